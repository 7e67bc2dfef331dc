use std::f64::consts::PI;
use std::num::NonZeroU32;

use super::assignment::Assignment;
use super::crossings::{Crossing, crossings, paths};
use super::layers::{Rest, Stack};
use super::{Formation, Kind};
use crate::geometry::Ned;

/// How drones stand on the ground before they take off.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ground {
    /// As they will land: the formation drawn together, each drone at its own slot's place.
    Gathered,
    /// In a line, each drone at the place that it is assigned.
    Line(Assignment),
    /// In rows, as many columns as rows or one more, each drone at the place that it is assigned.
    Grid(Assignment),
}

/// By how much an arrangement on the ground may be turned against the formation's heading, the best first where they
/// come to the same.
///
/// A right angle keeps drones of a line out of each other's way, none at all those of a ring; half of it helps
/// formations that have both, for no drone then passes over where another one climbs.
const TURNS_RAD: [f64; 5] = [PI / 2.0, 0.0, PI / 4.0, -PI / 4.0, PI / 8.0];

/// Places on the ground for all drones of a formation, as displacements from its centre, and what their ways to the
/// slots and back ask for.
#[derive(Debug)]
pub(super) struct Places {
    pub(super) places: Vec<Ned>,
    pub(super) crossings: Vec<Crossing>,
    pub(super) stack: Stack,
}

impl Places {
    /// An arrangement whose places are `gap_m` apart, turned as fewest ends of ways are exposed and fewest waves and layers
    /// needed, where ways nearer than `near_m` cross. In one wave, or with layers up to `layers_max` in waves from the
    /// centre outwards, so that each wave is within reach of the ones before.
    pub(super) fn new(
        ground: Ground,
        formation: &Formation,
        gap_m: f64,
        near_m: f64,
        layers_max: Option<u32>,
    ) -> Self {
        let mut best: Option<Self> = None;
        // Drones that stand as far apart as they fly climb straight up.
        let is_drawn_together = ground != Ground::Gathered || gap_m < formation.nearest_m();
        let turns_rad = if is_drawn_together {
            &TURNS_RAD[..]
        } else {
            &[0.0]
        };
        for turn_rad in turns_rad.iter().copied() {
            let places = ground.places(formation, gap_m, turn_rad);
            let crossings = crossings(&paths(&places, formation.slots()), near_m);
            let stack = match layers_max {
                None => Stack::of(places.len(), &crossings, 0),
                Some(most) => {
                    let order = formation.by_rank();
                    Stack::in_waves(&order, &crossings, most, Rest::GroundAndSlot)
                }
            };
            let cost = |stack: &Stack| (stack.exposed, stack.wave_count(), stack.highest());
            if best
                .as_ref()
                .is_none_or(|best| cost(&stack) < cost(&best.stack))
            {
                best = Some(Self {
                    places,
                    crossings,
                    stack,
                });
            }
            if best.as_ref().is_some_and(|it| cost(&it.stack) == (0, 1, 0)) {
                break;
            }
        }
        best.expect("there is a turn to be tried")
    }
}

impl Ground {
    fn places(self, formation: &Formation, gap_m: f64, turn_rad: f64) -> Vec<Ned> {
        let drones = NonZeroU32::new(formation.drones()).expect("a formation has drones");
        let (kind, assignment) = match self {
            Self::Gathered => return formation.drawn_together(gap_m, turn_rad),
            Self::Line(assignment) => (Kind::Linear, assignment),
            Self::Grid(assignment) => (Kind::RegularMatrix, assignment),
        };
        let turned_rad = formation.heading_rad + turn_rad;
        let arrangement = Formation::new(kind, drones, gap_m, turned_rad);
        assignment.assign(arrangement.slots(), formation.slots())
    }
}
