use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError};

use super::crossings::{Crossing, Over};
use crate::geometry::Ned;

/// Which layer each drone has, counted from the lowest, 0 being the height of the slots themselves.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Stack {
    pub(super) layers: Vec<u32>,
    /// How many ends of ways are flown over below the drone that climbs and descends there: such pairs keep apart
    /// only as long as they start together.
    pub(super) exposed: usize,
}

impl Stack {
    /// The layers of drones whose ways cross: different ones for the two of a crossing and, where one's way leads over
    /// an end of the other's, the higher one for it, so that the other may be late. The lowest that is free, and
    /// `lowest` at least for whoever is in a crossing.
    ///
    /// Where two lead over each other's ends, the one that leads over a slot has the higher; slots are entered one
    /// after the other, places on the ground are left at one time.
    pub(super) fn of(drones: usize, crossings: &[Crossing], lowest: u32) -> Self {
        let mut graph = Graph::new(drones, crossings);
        let mut layers: Vec<Option<u32>> = vec![None; drones];
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
            layers[drone] = (floor..).find(|layer| !taken.contains(layer));
        }
        Self {
            layers: layers.into_iter().map(Option::unwrap_or_default).collect(),
            exposed: graph.exposed,
        }
    }

    pub(super) fn highest(&self) -> u32 {
        self.layers.iter().copied().max().unwrap_or(0)
    }
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
    fn new(drones: usize, crossings: &[Crossing]) -> Self {
        let mut graph = Self {
            apart: vec![Vec::new(); drones],
            below: vec![Vec::new(); drones],
            above: vec![Vec::new(); drones],
            awaited: vec![0; drones],
            left: (0..drones).collect(),
            ready: BTreeSet::new(),
            exposed: 0,
        };
        for Crossing {
            drones: [a, b],
            over,
        } in crossings
        {
            graph.apart[*a].push(*b);
            graph.apart[*b].push(*a);
            graph.exposed += usize::from(over[0].min(over[1]) != Over::Neither);
            if over[0] > over[1] {
                graph.puts_below(*b, *a);
            } else if over[1] > over[0] {
                graph.puts_below(*a, *b);
            }
        }
        graph.ready = (0..drones)
            .filter(|drone| graph.awaited[*drone] == 0)
            .collect();
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
