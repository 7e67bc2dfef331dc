//! Seeing every zone of a map: what can be seen, from where, in which order, by one drone or by several.
//!
//! The floor is cut into targets, squares of [`TARGET_M`]. A target is seen if its centre is within the camera's range and
//! cone and no wall is between. What can be seen is what a full turn sees from any of the places, [`PLACE_M`] apart, that a
//! drone can get to.

mod order;
mod places;
mod targets;
#[cfg(test)]
mod tests;

use std::f64::consts::TAU;

pub use self::places::{Places, PlanError};
pub use self::targets::Targets;
pub use muster_machines::indoor::Seen;

use self::order::Distances;
use crate::frames::MapXy;
use crate::path::Floor;

/// Edge of a target, in metres.
pub const TARGET_M: f64 = 0.2;
/// Distance between places to look from, in metres.
pub const PLACE_M: f64 = 0.4;

/// Most targets, and squares without one, of a map: 40,000 m².
pub const TARGETS_MAX: usize = 1_000_000;
/// Most times that a target is in range of a place: half a minute of work.
pub const LOOKS_MAX: usize = 100_000_000;
/// Most stops of all tours.
pub const STOPS_MAX: usize = 1_000;

/// Distance by which a camera is taken to see less far than it does, for the pose is uncertain, in metres.
const MARGIN_M: f64 = 0.2;
/// Angle by which its cone is taken to be narrower on each side, in radians.
const MARGIN_RAD: f64 = 0.07;

/// What a camera sees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// Farthest target, in metres.
    pub range_m: f64,
    /// Opening angle, in radians.
    pub cone_rad: f64,
}

impl View {
    /// The part of the view that is seen also if the pose is a little wrong: 20 cm nearer, 4° narrower on each side.
    #[must_use]
    pub fn cautious(self) -> Self {
        Self {
            range_m: self.range_m - MARGIN_M,
            cone_rad: self.cone_rad - 2.0 * MARGIN_RAD,
        }
    }

    /// A camera that turned once round.
    #[must_use]
    pub const fn all_round(self) -> Self {
        Self {
            range_m: self.range_m,
            cone_rad: TAU,
        }
    }
}

/// What one drone flies: places to look round from, in this order.
#[derive(Debug, Clone, PartialEq)]
pub struct Tour {
    /// Where the drone starts.
    pub start: MapXy,
    /// Where it turns once round.
    pub stops: Vec<MapXy>,
    /// Length of the paths between them, in metres.
    pub length_m: f64,
}

/// Tours that together see all that the first drone's start lets see.
///
/// `turn_m` is the distance in metres that takes as long as to look round once. The stops are those of a greedy set cover, the
/// order is by nearest neighbour and 2-opt. Several drones get consecutive parts of it, cut so that the longest part is as
/// short as possible; `starts` has one place for each drone. The same input gives the same tours.
///
/// Cost: about a second for 1,000 m² with a range of 3 m.
///
/// # Errors
/// If a start isn't a place where a drone can be, or none can get from it to the others; if the map has more targets, looks or
/// stops than the limits.
pub fn plan(
    floor: &Floor,
    view: View,
    starts: &[MapXy],
    turn_m: f64,
) -> Result<(Vec<Tour>, Places), PlanError> {
    let places = Places::new(floor, view, starts)?;
    let stops = places.chosen();
    PlanError::limit("stops", stops.len(), STOPS_MAX)?;
    let distances = Distances::new(floor, starts, &stops);
    let order = distances.shortest_order(stops.len());
    let parts = distances.parts(&order, starts.len(), turn_m);
    let tours = parts.iter().zip(starts).zip(0..);
    let tours = tours.map(|((part, start), drone)| Tour {
        start: *start,
        stops: part.iter().map(|stop| stops[*stop]).collect(),
        length_m: distances.length_m(drone, part),
    });
    Ok((tours.collect(), places))
}
