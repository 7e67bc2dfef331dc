use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError};

use super::crossings::{Crossing, Over};
use crate::geometry::Ned;

/// Which layer each drone has, counted from the lowest, 0 being the height of the slots themselves, and in which wave it
/// flies: the next wave flies once all of the one before have arrived.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Stack {
    pub(super) layers: Vec<u32>,
    pub(super) waves: Vec<u16>,
    /// How many ends of ways are flown over below the drone that climbs and descends there: such pairs keep apart
    /// only as long as they start together.
    pub(super) exposed: usize,
}

/// Where a drone rests while other waves fly.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Rest {
    /// On the ground before its own wave, in its slot after it; the reverse for a landing, whose waves are reversed.
    GroundAndSlot,
    /// In its layer, over either end of its way.
    InLayer,
}

impl Stack {
    /// The layers of drones whose ways cross, all in one wave: different ones for the two of a crossing and, where one's
    /// way leads over an end of the other's, the higher one for it, so that the other may be late. The lowest that is
    /// free, and `lowest` at least for a drone that is in a crossing.
    ///
    /// Where two lead over each other's ends, the one that leads over a slot has the higher; slots are entered one
    /// after the other, places on the ground are left at one time.
    pub(super) fn of(drones: usize, crossings: &[Crossing], lowest: u32) -> Self {
        let all: Vec<&Crossing> = crossings.iter().collect();
        let mut stack = Self::on_ground(drones);
        let members: Vec<usize> = (0..drones).collect();
        stack.add(&members, &all, lowest, |_, _| false);
        stack
    }

    /// The same with layers up to `layers_max` and nobody exposed, in as few waves as that takes. Each wave is a run of `order`, which names
    /// each drone once; a later wave flies over drones that rest as `rest` says. The first of `order` flies in the first
    /// wave. A wave that can't do with so many layers has more.
    pub(super) fn in_waves(
        order: &[usize],
        crossings: &[Crossing],
        layers_max: u32,
        rest: Rest,
    ) -> Self {
        let drones = order.len();
        let mut stack = Self::on_ground(drones);
        let first = order.first().copied();
        let mut of_drone: Vec<Vec<&Crossing>> = vec![Vec::new(); drones];
        for crossing in crossings {
            crossing
                .drones
                .iter()
                .for_each(|it| of_drone[*it].push(crossing));
        }
        let order = with_those_below_first(order, &of_drone, rest);
        let mut position = vec![0; drones];
        order
            .iter()
            .enumerate()
            .for_each(|(at, drone)| position[*drone] = at);
        let (mut begin, mut wave) = (0, 0);
        while begin < drones {
            let flown = stack.clone();
            let with_wave = |end: usize| {
                let members = &order[begin..end];
                let among: Vec<&Crossing> = members
                    .iter()
                    .flat_map(|drone| of_drone[*drone].iter().map(move |it| (*drone, *it)))
                    .filter(|(drone, it)| {
                        let [a, b] = it.drones.map(|it| position[it]);
                        // Each once.
                        it.drones[0] == *drone
                            && (begin..end).contains(&a.max(b))
                            && a.min(b) >= begin
                    })
                    .map(|(_, it)| it)
                    .collect();
                let is_taken = |drone: usize, layer: u32| {
                    of_drone[drone].iter().any(|it| {
                        position[it.other(drone)] < begin
                            && flown.is_in_the_way(it, drone, layer, rest)
                    })
                };
                let mut next = flown.clone();
                next.add(members, &among, 0, is_taken);
                members.iter().for_each(|it| next.waves[*it] = wave);
                next
            };
            let fits = |end: usize| {
                let next = with_wave(end);
                let mut members = order[begin..end].iter();
                next.exposed == flown.exposed && members.all(|it| next.layers[*it] <= layers_max)
            };
            let awaited = first.map_or(begin, |it| position[it]);
            let end = largest(begin.max(awaited) + 1, drones, fits);
            stack = with_wave(end);
            begin = end;
            wave = wave.saturating_add(1);
        }
        stack
    }

    fn on_ground(drones: usize) -> Self {
        Self {
            layers: vec![0; drones],
            waves: vec![0; drones],
            exposed: 0,
        }
    }

    /// Gives layers to `members`, whose crossings with each other are `among`; none that `is_taken` for a drone.
    fn add(
        &mut self,
        members: &[usize],
        among: &[&Crossing],
        lowest: u32,
        is_taken: impl Fn(usize, u32) -> bool,
    ) {
        let mut graph = Graph::new(self.layers.len(), members, among);
        let mut layers: Vec<Option<u32>> = vec![None; self.layers.len()];
        while let Some(drone) = graph.next() {
            let below = graph.below[drone].iter().filter_map(|below| layers[*below]);
            let floor = below.map(|layer| layer + 1).max().unwrap_or(lowest);
            let taken: BTreeSet<u32> = graph.apart[drone]
                .iter()
                .filter_map(|other| layers[*other])
                .collect();
            let floor = if graph.apart[drone].is_empty() {
                0
            } else {
                floor
            };
            layers[drone] = (floor..).find(|it| !taken.contains(it) && !is_taken(drone, *it));
        }
        for member in members {
            self.layers[*member] = layers[*member].unwrap_or_default();
        }
        self.exposed += graph.exposed;
    }

    /// Whether the other drone of a crossing, which flew in an earlier wave, rests where `drone` would fly in `layer`.
    fn is_in_the_way(&self, crossing: &Crossing, drone: usize, layer: u32, rest: Rest) -> bool {
        match rest {
            Rest::GroundAndSlot => layer == 0 && crossing.over_of(drone) == Over::Slot,
            // The one that is to fly over an end where the other rests, whichever it is.
            Rest::InLayer => {
                crossing.over != [Over::Neither; 2] && layer == self.layers[crossing.other(drone)]
            }
        }
    }

    pub(super) fn highest(&self) -> u32 {
        self.layers.iter().copied().max().unwrap_or(0)
    }

    /// How many waves there are, one at least.
    pub(super) fn wave_count(&self) -> u16 {
        self.waves.iter().copied().max().unwrap_or(0) + 1
    }
}

/// The largest `end` up to `most` with which it `fits`, or `least`; it is taken to fit below where it does. Looked for
/// upwards in growing steps, for most that fit are small.
fn largest(least: usize, most: usize, fits: impl Fn(usize) -> bool) -> usize {
    let (mut low, mut step) = (least, 1);
    while low + step <= most && fits(low + step) {
        low += step;
        step *= 2;
    }
    while step > 0 {
        if low + step <= most && fits(low + step) {
            low += step;
        }
        step /= 2;
    }
    low
}

/// The order with each drone that stands below another's slot before that one: it climbs through that slot.
fn with_those_below_first(order: &[usize], of_drone: &[Vec<&Crossing>], rest: Rest) -> Vec<usize> {
    if rest == Rest::InLayer {
        return order.to_vec();
    }
    let mut sorted = Vec::with_capacity(order.len());
    let mut is_seen = vec![false; order.len()];
    for drone in order {
        let mut path: Vec<usize> = (!is_seen[*drone]).then_some(*drone).into_iter().collect();
        while let Some(last) = path.last().copied() {
            is_seen[last] = true;
            let below = of_drone[last].iter().map(|it| (it, it.other(last)));
            let mut unseen = below.filter(|(it, other)| it.is_below(*other) && !is_seen[*other]);
            if let Some((_, next)) = unseen.next() {
                path.push(next);
            } else {
                path.pop();
                sorted.push(last);
            }
        }
    }
    sorted
}

/// Who must be above whom; taken apart from below.
struct Graph {
    /// Whose layers must differ from each drone's.
    apart: Vec<Vec<usize>>,
    /// Who must be below each.
    below: Vec<Vec<usize>>,
    /// Who must be above each.
    above: Vec<Vec<usize>>,
    /// How many of those below each have no layer yet.
    awaited: Vec<usize>,
    left: BTreeSet<usize>,
    ready: BTreeSet<usize>,
    exposed: usize,
}

impl Graph {
    /// Of so many drones `members` only, whose crossings are `crossings`.
    fn new(drones: usize, members: &[usize], crossings: &[&Crossing]) -> Self {
        let mut graph = Self {
            apart: vec![Vec::new(); drones],
            below: vec![Vec::new(); drones],
            above: vec![Vec::new(); drones],
            awaited: vec![0; drones],
            left: members.iter().copied().collect(),
            ready: BTreeSet::new(),
            exposed: 0,
        };
        for crossing in crossings {
            let Crossing {
                drones: [a, b],
                over,
                ..
            } = **crossing;
            graph.apart[a].push(b);
            graph.apart[b].push(a);
            graph.exposed += usize::from(over[0].min(over[1]) != Over::Neither);
            if over[0] > over[1] {
                graph.puts_below(b, a);
            } else if over[1] > over[0] {
                graph.puts_below(a, b);
            }
        }
        let members = members.iter().copied();
        graph.ready = members.filter(|it| graph.awaited[*it] == 0).collect();
        graph
    }

    fn puts_below(&mut self, lower: usize, upper: usize) {
        self.below[upper].push(lower);
        self.above[lower].push(upper);
        self.awaited[upper] += 1;
    }

    /// The next drone to be given a layer: one with nobody below it left or, in a ring of drones that should each be
    /// above the next, the one that waits for the fewest.
    fn next(&mut self) -> Option<usize> {
        let next = match self.ready.pop_first() {
            Some(ready) => ready,
            None => {
                let fewest = |drone: &usize| (self.awaited[*drone], *drone);
                let next = self.left.iter().copied().min_by_key(fewest)?;
                self.exposed += self.awaited[next];
                next
            }
        };
        self.left.remove(&next);
        for upper in &self.above[next] {
            self.awaited[*upper] -= 1;
            if self.awaited[*upper] == 0 && self.left.contains(upper) {
                self.ready.insert(*upper);
            }
        }
        Some(next)
    }
}

/// The layers for the last mission that was asked for, kept, for every drone of a simulation asks for the same.
#[derive(Debug, Default)]
pub struct Layers {
    last: Mutex<Option<Answer>>,
}

#[derive(Debug)]
struct Answer {
    waypoints: Vec<Ned>,
    layers_m: Arc<[f64]>,
}

impl Layers {
    /// What `work_out` says of these waypoints, or said last time.
    pub(super) fn of(
        &self,
        waypoints: &[Ned],
        work_out: impl FnOnce() -> Arc<[f64]>,
    ) -> Arc<[f64]> {
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(answer) = &*last
            && answer.waypoints == waypoints
        {
            return Arc::clone(&answer.layers_m);
        }
        let layers_m = work_out();
        *last = Some(Answer {
            waypoints: waypoints.to_vec(),
            layers_m: Arc::clone(&layers_m),
        });
        layers_m
    }
}
