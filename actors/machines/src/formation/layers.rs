use std::collections::BTreeSet;
use std::ops::Range;

use super::WaveLimits;
use super::crossings::{Crossing, Overflight};
use super::reach::Reach;

/// Altitude layer and wave of each drone. Layer 0 is the height of the slots. A wave starts once all drones of the wave
/// before have arrived.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct LayerPlan {
    pub(super) layers: Vec<u32>,
    pub(super) waves: Vec<u16>,
    /// Number of waves, at least one.
    pub(super) wave_count: u16,
    /// Number of path ends with another path below the drone that climbs and descends there. Such pairs are separated
    /// only as long as they start together.
    pub(super) exposed: usize,
    /// Number of drones that reach their slots in an earlier wave than all drones over which they are connected with
    /// the centre.
    pub(super) unreached: usize,
}

/// Where a drone waits while other waves fly.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum WaitingPosition {
    /// On the ground before its own wave, in its slot after it. For a landing, the reverse in reverse order of waves.
    GroundAndSlot,
    /// In its layer, above the start or the end of its path.
    Layer,
}

impl LayerPlan {
    /// Layers in one wave. The two drones of a crossing get different layers. If one path leads over an end of the
    /// other, it gets the higher layer, so the other drone may be late. Each drone gets the lowest free layer, `lowest`
    /// at least if it is in a crossing.
    ///
    /// If two paths lead over each other's ends, the one over a slot gets the higher layer: slots are entered one after
    /// the other, places on the ground are unassigned at the same time.
    pub(super) fn of(drones: usize, crossings: &[Crossing], lowest: u32) -> Self {
        let all: Vec<&Crossing> = crossings.iter().collect();
        let mut plan = Self::on_ground(drones);
        let members: Vec<usize> = (0..drones).collect();
        plan.add(&members, &all, lowest, |_, _| false);
        plan
    }

    /// No exposed ends, in as few waves as the limits allow. Each wave is a run of drones in the order of `reach`, and ends
    /// with all that flew connected with the centre if it can. Later waves fly over drones that wait as `waiting` says. The
    /// centre flies in the first wave. A wave that needs more layers gets them.
    pub(super) fn in_waves(
        reach: &Reach,
        crossings: &[Crossing],
        limits: WaveLimits,
        waiting: WaitingPosition,
    ) -> Self {
        let schedule = Schedule::new(reach, crossings, waiting, BelowFirst::Advance);
        let plan = Self::of_schedule(reach, &schedule, limits);
        if !limits.searches_on || plan.unreached == 0 {
            return plan;
        }
        let schedule = Schedule::new(reach, crossings, waiting, BelowFirst::Wait);
        let other = Self::of_schedule(reach, &schedule, limits);
        let cost = |it: &Self| (it.exposed, it.unreached, it.wave_count);
        if cost(&other) < cost(&plan) {
            other
        } else {
            plan
        }
    }

    fn of_schedule(reach: &Reach, schedule: &Schedule<'_>, limits: WaveLimits) -> Self {
        let drones = reach.order.len();
        let first = reach.order.first().copied();
        let mut plan = Self::on_ground(drones);
        let (mut begin, mut wave) = (0, 0);
        while begin < drones {
            let fits = |end: usize| {
                let next = schedule.with_wave(&plan, begin..end, wave);
                let mut members = schedule.order[begin..end].iter();
                next.exposed == plan.exposed
                    && members.all(|it| next.layers[*it] <= limits.layers_max)
            };
            let first_at = first.map_or(begin, |it| schedule.position[it]);
            let least = begin.max(first_at) + 1;
            let most = largest(least, drones, fits);
            let reached = |end: usize| reach.reached(&schedule.order, begin..end);
            let is_connected = |end: &usize| reached(*end).unreached == 0;
            let is_within = |end: &usize| {
                let reached = reached(*end);
                reached.unreached == 0 && reached.hops <= limits.hops_max
            };
            let end = (least..=most).rev().find(is_within);
            let end = end.or_else(|| (least..=most).find(is_connected));
            let end = end.unwrap_or(most);
            plan = schedule.with_wave(&plan, begin..end, wave);
            plan.unreached += reached(end).unreached;
            begin = end;
            wave = wave.saturating_add(1);
        }
        plan
    }

    fn on_ground(drones: usize) -> Self {
        Self {
            layers: vec![0; drones],
            waves: vec![0; drones],
            wave_count: 1,
            exposed: 0,
            unreached: 0,
        }
    }

    /// Assigns layers to `members`, with `among` as their mutual crossings, except layers that `is_taken`.
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

    /// Whether the other drone of a crossing flew in an earlier wave and waits where `drone` would fly in `layer`.
    fn is_blocked(
        &self,
        crossing: &Crossing,
        drone: usize,
        layer: u32,
        waiting: WaitingPosition,
    ) -> bool {
        match waiting {
            WaitingPosition::GroundAndSlot => {
                layer == 0 && crossing.overflight_of(drone) == Overflight::Slot
            }
            // Either may lead over the end where the other waits.
            WaitingPosition::Layer => {
                crossing.overflights != [Overflight::None; 2]
                    && layer == self.layers[crossing.other(drone)]
            }
        }
    }

    pub(super) fn highest(&self) -> u32 {
        self.layers.iter().copied().max().unwrap_or(0)
    }
}

/// How a drone that stands below another's slot comes to fly before that one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum BelowFirst {
    /// It flies early.
    Advance,
    /// The other flies late.
    Wait,
}

/// The order in which drones are divided into waves, with their crossings.
struct Schedule<'a> {
    order: Vec<usize>,
    /// Index of each drone in `order`.
    position: Vec<usize>,
    /// Crossings of each drone.
    of_drone: Vec<Vec<&'a Crossing>>,
    waiting: WaitingPosition,
}

impl<'a> Schedule<'a> {
    fn new(
        reach: &Reach,
        crossings: &'a [Crossing],
        waiting: WaitingPosition,
        below_first: BelowFirst,
    ) -> Self {
        let drones = reach.order.len();
        let mut of_drone: Vec<Vec<&Crossing>> = vec![Vec::new(); drones];
        for crossing in crossings {
            for drone in crossing.drones {
                of_drone[drone].push(crossing);
            }
        }
        let order = match (waiting, below_first) {
            (WaitingPosition::GroundAndSlot, BelowFirst::Advance) => {
                with_those_below_first(reach, &of_drone)
            }
            (WaitingPosition::GroundAndSlot, BelowFirst::Wait) => {
                waiting_for_those_below(reach, &of_drone)
            }
            (WaitingPosition::Layer, _) => reach.order.clone(),
        };
        let mut position = vec![0; drones];
        for (at, drone) in order.iter().enumerate() {
            position[*drone] = at;
        }
        Self {
            order,
            position,
            of_drone,
            waiting,
        }
    }

    /// The plan with the drones at these positions as the next wave.
    fn with_wave(&self, plan: &LayerPlan, range: Range<usize>, wave: u16) -> LayerPlan {
        let members = &self.order[range.clone()];
        let among: Vec<&Crossing> = members
            .iter()
            .flat_map(|drone| self.of_drone[*drone].iter().map(move |it| (*drone, *it)))
            .filter(|(drone, it)| {
                let [a, b] = it.drones.map(|it| self.position[it]);
                // Each crossing once.
                it.drones[0] == *drone && range.contains(&a.max(b)) && a.min(b) >= range.start
            })
            .map(|(_, it)| it)
            .collect();
        let is_taken = |drone: usize, layer: u32| {
            self.of_drone[drone].iter().any(|it| {
                self.position[it.other(drone)] < range.start
                    && plan.is_blocked(it, drone, layer, self.waiting)
            })
        };
        let mut next = plan.clone();
        next.add(members, &among, 0, is_taken);
        for member in members {
            next.waves[*member] = wave;
        }
        next.wave_count = wave + 1;
        next
    }
}

/// The largest `end` from `least` to `most` that `fits`, assuming that all smaller ends fit. Searches in growing steps,
/// because most results are small.
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

/// Reorders: a drone that stands below another's slot comes before that one, because it climbs through the slot. So does
/// one over which that drone is connected with the centre.
fn with_those_below_first(reach: &Reach, of_drone: &[Vec<&Crossing>]) -> Vec<usize> {
    let mut sorted = Vec::with_capacity(of_drone.len());
    let mut is_seen = vec![false; of_drone.len()];
    for drone in &reach.order {
        let mut path: Vec<usize> = (!is_seen[*drone]).then_some(*drone).into_iter().collect();
        while let Some(last) = path.last().copied() {
            is_seen[last] = true;
            let needed = reach.needed(last, |other| is_seen[other]);
            let below = of_drone[last].iter().map(|it| (it, it.other(last)));
            let below = below.filter(|(it, other)| it.is_below(*other));
            let before = needed.into_iter().chain(below.map(|(_, other)| other));
            if let Some(next) = before.into_iter().find(|other| !is_seen[*other]) {
                path.push(next);
            } else {
                path.pop();
                sorted.push(last);
            }
        }
    }
    sorted
}

/// Reorders: each drone is the first below whose slot no other is left, and whose connection with the centre depends on none
/// that is left. If there is none, the first below whose slot no other is left.
fn waiting_for_those_below(reach: &Reach, of_drone: &[Vec<&Crossing>]) -> Vec<usize> {
    let (mut sorted, mut left) = (Vec::with_capacity(of_drone.len()), reach.order.clone());
    let mut has_flown = vec![false; of_drone.len()];
    while !left.is_empty() {
        let is_connected = |drone: &usize| reach.needed(*drone, |other| has_flown[other]).is_none();
        let is_free = |drone: &usize| {
            let mut others = of_drone[*drone].iter().map(|it| (it, it.other(*drone)));
            !others.any(|(it, other)| it.is_below(other) && !has_flown[other])
        };
        let connected = left.iter().position(|it| is_free(it) && is_connected(it));
        let next = connected.or_else(|| left.iter().position(is_free));
        let next = left.remove(next.unwrap_or(0));
        has_flown[next] = true;
        sorted.push(next);
    }
    sorted
}

/// Which drones must be above which, consumed from below.
struct Graph {
    /// Drones in other layers than each drone.
    apart: Vec<Vec<usize>>,
    /// Drones that must be below each drone.
    below: Vec<Vec<usize>>,
    /// Drones that must be above each drone.
    above: Vec<Vec<usize>>,
    /// Number of drones below each that have no layer yet.
    unassigned_below: Vec<usize>,
    unassigned: BTreeSet<usize>,
    ready: BTreeSet<usize>,
    exposed: usize,
}

impl Graph {
    /// Graph of `members` of a swarm of `drones`, with these crossings.
    fn new(drones: usize, members: &[usize], crossings: &[&Crossing]) -> Self {
        let mut graph = Self {
            apart: vec![Vec::new(); drones],
            below: vec![Vec::new(); drones],
            above: vec![Vec::new(); drones],
            unassigned_below: vec![0; drones],
            unassigned: members.iter().copied().collect(),
            ready: BTreeSet::new(),
            exposed: 0,
        };
        for crossing in crossings {
            let Crossing {
                drones: [a, b],
                overflights,
                ..
            } = **crossing;
            graph.apart[a].push(b);
            graph.apart[b].push(a);
            graph.exposed += usize::from(overflights[0].min(overflights[1]) != Overflight::None);
            if overflights[0] > overflights[1] {
                graph.add_below(b, a);
            } else if overflights[1] > overflights[0] {
                graph.add_below(a, b);
            }
        }
        let members = members.iter().copied();
        graph.ready = members
            .filter(|it| graph.unassigned_below[*it] == 0)
            .collect();
        graph
    }

    fn add_below(&mut self, lower: usize, upper: usize) {
        self.below[upper].push(lower);
        self.above[lower].push(upper);
        self.unassigned_below[upper] += 1;
    }

    /// Next drone to get a layer: one with no unassigned drone below it. In a cycle, the one with the fewest unassigned
    /// below.
    fn next(&mut self) -> Option<usize> {
        let next = match self.ready.pop_first() {
            Some(ready) => ready,
            None => {
                let fewest = |drone: &usize| (self.unassigned_below[*drone], *drone);
                let next = self.unassigned.iter().copied().min_by_key(fewest)?;
                self.exposed += self.unassigned_below[next];
                next
            }
        };
        self.unassigned.remove(&next);
        for upper in &self.above[next] {
            self.unassigned_below[*upper] -= 1;
            if self.unassigned_below[*upper] == 0 && self.unassigned.contains(upper) {
                self.ready.insert(*upper);
            }
        }
        Some(next)
    }
}
