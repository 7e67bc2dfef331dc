use std::f64::consts::PI;
use std::num::NonZeroU32;

use super::assignment::Assignment;
use super::crossings::{Crossing, crossings, ground_tracks};
use super::layers::{LayerPlan, WaitingPosition};
use super::reach::Reach;
use super::{Formation, Kind, WaveLimits};
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

/// Parts of a full turn that are tried, too, if asked for and drones are out of reach of the centre with each of
/// [`TURNS_RAD`].
const FINE_TURNS: i32 = 12;

/// GroundPlaces on the ground for all drones of a formation, as displacements from its centre, with the crossings and layers
/// of the paths to the slots.
#[derive(Debug)]
pub(super) struct GroundPlaces {
    pub(super) positions: Vec<Ned>,
    pub(super) crossings: Vec<Crossing>,
    pub(super) layer_plan: LayerPlan,
}

impl GroundPlaces {
    /// An arrangement with places `gap_m` apart. Its rotation minimises exposed ends, then drones out of reach of the
    /// centre, then waves, then layers. Tracks closer than `min_m` cross. All drones fly in one wave; with `waves`, in
    /// waves from the centre outwards, so that each wave is within radio range of the ones before.
    pub(super) fn new(
        ground: Ground,
        formation: &Formation,
        gap_m: f64,
        min_m: f64,
        waves: Option<WaveLimits>,
    ) -> Self {
        let mut best: Option<Self> = None;
        // Drones with places as far apart as their slots climb vertically.
        let is_scaled = ground != Ground::Gathered || gap_m < formation.slot_distance_min_m();
        let waves = waves.map(|it| (it, Reach::to_slots(formation, it)));
        let turns_rad = if is_scaled { &TURNS_RAD[..] } else { &[0.0] };
        let turns = turns_rad.iter().map(|turn_rad| (*turn_rad, None));
        // Only a drone that stands below its own slot keeps no other from flying first.
        let from_below = (ground != Ground::Gathered).then_some(Some(min_m));
        let fine_m = [Some(None), from_below];
        let finely = fine_m.into_iter().flatten().flat_map(|from_below_m| {
            let turns = 0..FINE_TURNS;
            let part = move |turn| 2.0 * PI * f64::from(turn) / f64::from(FINE_TURNS);
            turns.map(move |turn| (part(turn), from_below_m))
        });
        let searches_on = is_scaled && waves.as_ref().is_some_and(|(it, _)| it.searches_on);
        let finely = finely.filter(|_| searches_on);
        for (at, (turn_rad, from_below_m)) in turns.chain(finely).enumerate() {
            let is_reached = |it: &Self| it.layer_plan.unreached == 0;
            if at >= turns_rad.len() && best.as_ref().is_some_and(is_reached) {
                break;
            }
            let places = ground.places(formation, gap_m, turn_rad, from_below_m);
            let crossings = crossings(&ground_tracks(&places, formation.slots()), min_m);
            let layer_plan = match &waves {
                None => LayerPlan::of(places.len(), &crossings, 0),
                Some((limits, close)) => {
                    let spread = (ground != Ground::Gathered)
                        .then(|| Reach::from_ground(&places, gap_m, formation, *limits));
                    let reach = spread.as_ref().unwrap_or(close);
                    LayerPlan::in_waves(reach, &crossings, *limits, WaitingPosition::GroundAndSlot)
                }
            };
            let cost = |plan: &LayerPlan| {
                let (waves, highest) = (plan.wave_count, plan.highest());
                (plan.exposed, plan.unreached, waves, highest)
            };
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
                .is_some_and(|it| cost(&it.layer_plan) == (0, 0, 1, 0))
            {
                break;
            }
        }
        best.expect("at least one rotation is tried")
    }
}

impl Ground {
    /// The place of each drone; with `from_below_m`, slots with a place so close below them take that.
    fn places(
        self,
        formation: &Formation,
        gap_m: f64,
        turn_rad: f64,
        from_below_m: Option<f64>,
    ) -> Vec<Ned> {
        let drones = NonZeroU32::new(formation.drones()).expect("a formation has drones");
        let (kind, assignment) = match self {
            Self::Gathered => return formation.scaled_to_gap(gap_m, turn_rad),
            Self::Line(assignment) => (Kind::Linear, assignment),
            Self::Grid(assignment) => (Kind::RegularMatrix, assignment),
        };
        let turned_rad = formation.heading_rad + turn_rad;
        let arrangement = Formation::new(kind, drones, gap_m, turned_rad);
        let (places, slots) = (arrangement.slots(), formation.slots());
        match from_below_m {
            Some(within_m) => assignment.assign_from_below(places, slots, within_m),
            None => assignment.assign(places, slots),
        }
    }
}
