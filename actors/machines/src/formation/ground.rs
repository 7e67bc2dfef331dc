use std::f64::consts::PI;
use std::num::NonZeroU32;

use super::assignment::Assignment;
use super::crossings::{Crossing, crossings, ground_tracks};
use super::layers::{LayerPlan, WaitingPosition};
use super::{Formation, Kind};
use crate::geometry::Ned;

/// Arrangement of drones on the ground before take-off.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ground {
    /// As they land: the formation scaled down, each drone at the place of its own slot.
    Gathered,
    /// A line; each drone at its assigned place.
    Line(Assignment),
    /// A grid with as many columns as rows or one more; each drone at its assigned place.
    Grid(Assignment),
}

/// Candidate rotations of a ground arrangement against the formation's heading; the first wins a tie.
///
/// A right angle keeps the drones of a line clear of each other, and no rotation those of a ring. Half a right angle
/// helps formations with both: no drone then passes over a place where another climbs.
const TURNS_RAD: [f64; 5] = [PI / 2.0, 0.0, PI / 4.0, -PI / 4.0, PI / 8.0];

/// GroundPlaces on the ground for all drones of a formation, as displacements from its centre, with the crossings and layers
/// of the paths to the slots.
#[derive(Debug)]
pub(super) struct GroundPlaces {
    pub(super) positions: Vec<Ned>,
    pub(super) crossings: Vec<Crossing>,
    pub(super) layer_plan: LayerPlan,
}

impl GroundPlaces {
    /// An arrangement with places `gap_m` apart. Its rotation minimises exposed ends, then waves, then layers. Tracks
    /// closer than `min_m` cross. All drones fly in one wave; with `layers_max`, in waves from the centre outwards, so
    /// that each wave is within radio range of the ones before.
    pub(super) fn new(
        ground: Ground,
        formation: &Formation,
        gap_m: f64,
        min_m: f64,
        layers_max: Option<u32>,
    ) -> Self {
        let mut best: Option<Self> = None;
        // Drones with places as far apart as their slots climb vertically.
        let is_scaled = ground != Ground::Gathered || gap_m < formation.slot_distance_min_m();
        let turns_rad = if is_scaled { &TURNS_RAD[..] } else { &[0.0] };
        for turn_rad in turns_rad.iter().copied() {
            let places = ground.places(formation, gap_m, turn_rad);
            let crossings = crossings(&ground_tracks(&places, formation.slots()), min_m);
            let layer_plan = match layers_max {
                None => LayerPlan::of(places.len(), &crossings, 0),
                Some(max) => {
                    let order = formation.by_rank();
                    LayerPlan::in_waves(&order, &crossings, max, WaitingPosition::GroundAndSlot)
                }
            };
            let cost = |plan: &LayerPlan| (plan.exposed, plan.wave_count(), plan.highest());
            if best
                .as_ref()
                .is_none_or(|best| cost(&layer_plan) < cost(&best.layer_plan))
            {
                best = Some(Self {
                    positions: places,
                    crossings,
                    layer_plan,
                });
            }
            if best
                .as_ref()
                .is_some_and(|it| cost(&it.layer_plan) == (0, 1, 0))
            {
                break;
            }
        }
        best.expect("at least one rotation is tried")
    }
}

impl Ground {
    fn places(self, formation: &Formation, gap_m: f64, turn_rad: f64) -> Vec<Ned> {
        let drones = NonZeroU32::new(formation.drones()).expect("a formation has drones");
        let (kind, assignment) = match self {
            Self::Gathered => return formation.scaled_to_gap(gap_m, turn_rad),
            Self::Line(assignment) => (Kind::Linear, assignment),
            Self::Grid(assignment) => (Kind::RegularMatrix, assignment),
        };
        let turned_rad = formation.heading_rad + turn_rad;
        let arrangement = Formation::new(kind, drones, gap_m, turned_rad);
        assignment.assign(arrangement.slots(), formation.slots())
    }
}
