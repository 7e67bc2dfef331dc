//! Where a drone may fly: areas that it stays within, areas that it stays out of, and a ceiling.

mod polygon;

pub use self::polygon::{Polygon, PolygonError};

use super::watch::LOOK_EVERY;
use crate::formation::crossings::to_point_m;
use crate::geometry::Ned;

/// Where a drone may fly: within every area to stay within, out of every area to stay out of, and below a ceiling.
///
/// Of several areas to stay within it stays in all, as with ArduPilot's default of `FENCE_OPTIONS`, whose bit 1 asks for
/// any of them; PX4 asks for any. What is in all is in any, too.
#[derive(Debug, Clone, PartialEq)]
pub struct Fence {
    zones: Vec<Zone>,
    altitude_max_m: f64,
}

/// A part of a fence: an area over ground, at all heights.
#[derive(Debug, Clone, PartialEq)]
pub struct Zone {
    /// Where it is.
    pub area: Area,
    /// Whether drones stay within it; otherwise they stay out of it.
    pub is_inclusion: bool,
}

/// An area over ground.
#[derive(Debug, Clone, PartialEq)]
pub enum Area {
    /// All that is near enough to a place.
    Circle {
        /// The place; its height does not matter.
        centre: Ned,
        /// How near, in metres, above 0.
        radius_m: f64,
    },
    /// All that some sides enclose.
    Polygon(Polygon),
}

impl Area {
    /// How far a place is within it over ground, in metres; negative outside.
    fn depth_m(&self, place: Ned) -> f64 {
        match self {
            Self::Circle { centre, radius_m } => radius_m - centre.horizontal_distance_m(place),
            Self::Polygon(polygon) => polygon.depth_m(place.0.xy()),
        }
    }
}

impl Zone {
    /// How far a place is from the boundary of the area over ground, in metres: exact; negative where a drone may not be.
    #[must_use]
    pub fn room_m(&self, place: Ned) -> f64 {
        let depth_m = self.area.depth_m(place);
        if self.is_inclusion { depth_m } else { -depth_m }
    }

    /// How far a straight way stays from the boundary over ground, in metres: exact where it is above 0; 0 or less where
    /// the way leads to where a drone may not be.
    #[must_use]
    pub fn room_along_m(&self, from: Ned, to: Ned) -> f64 {
        let ends_m = self.room_m(from).min(self.room_m(to));
        let path = (from.0.xy(), to.0.xy());
        match &self.area {
            // No way between two places in a circle leaves it.
            Area::Circle { .. } if self.is_inclusion => ends_m,
            Area::Circle { centre, radius_m } => to_point_m(path, centre.0.xy()) - radius_m,
            Area::Polygon(polygon) if ends_m > 0.0 => polygon.to_path_m(path).min(ends_m),
            Area::Polygon(_) => ends_m,
        }
    }

    /// Likewise, for a drone that is at `from`, where it may be, and would come to rest at `stop`.
    fn stopping_room_m(&self, from: Ned, stop: Ned) -> f64 {
        match &self.area {
            Area::Circle { .. } if self.is_inclusion => self.room_m(stop),
            _ => self.room_along_m(from, stop),
        }
    }
}

impl Fence {
    /// A fence of these zones, below so many metres above home; infinite if there is no ceiling.
    #[must_use]
    pub const fn new(zones: Vec<Zone>, altitude_max_m: f64) -> Self {
        Self {
            zones,
            altitude_max_m,
        }
    }

    /// A cylinder around home.
    #[must_use]
    pub fn cylinder(radius_m: f64, altitude_max_m: f64) -> Self {
        let area = Area::Circle {
            centre: Ned::HOME,
            radius_m,
        };
        let zone = Zone {
            area,
            is_inclusion: true,
        };
        Self::new(vec![zone], altitude_max_m)
    }

    /// Its areas.
    #[must_use]
    pub fn zones(&self) -> &[Zone] {
        &self.zones
    }

    /// The ceiling, in metres above home; infinite if there is none.
    #[must_use]
    pub const fn altitude_max_m(&self) -> f64 {
        self.altitude_max_m
    }

    /// How far a place is within the fence, in metres: from the nearest boundary or the ceiling, exactly. Beyond them it is
    /// negative: how far it is beyond that which it is the farthest beyond.
    #[must_use]
    pub fn room_m(&self, place: Ned) -> f64 {
        let below_m = self.altitude_max_m - place.altitude_m();
        let rooms_m = self.zones.iter().map(|zone| zone.room_m(place));
        rooms_m.fold(below_m, f64::min)
    }

    /// How far a drone stays within the fence that would come to rest at `stop`, in metres. On its way there, which is
    /// straight, it is not to cross an area to stay out of, or a corner beyond a fence that is bent inwards.
    #[must_use]
    pub fn stopping_room_m(&self, from: Ned, stop: Ned) -> f64 {
        let below_m = self.altitude_max_m - stop.altitude_m();
        let rooms_m = self
            .zones
            .iter()
            .map(|zone| zone.stopping_room_m(from, stop));
        rooms_m.fold(below_m, f64::min)
    }

    /// How far within the fence a vehicle is stopped that flies at up to this speed, in metres. Where it would come to
    /// rest, v²/2a ahead, moves at 2 v at most, when it accelerates as hard as it brakes; this is how far that gets
    /// between two looks.
    #[must_use]
    pub fn margin_m(speed_mps: f64) -> f64 {
        2.0 * speed_mps * LOOK_EVERY.as_secs_f64()
    }
}

#[cfg(test)]
mod tests;
