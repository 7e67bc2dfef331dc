//! Geofences: areas to stay within, areas to stay out of, and a ceiling.

mod polygon;

pub use self::polygon::{Polygon, PolygonError};

use super::health::CHECK_INTERVAL;
use crate::formation::crossings::segment_to_point_m;
use crate::geometry::Ned;

/// A geofence: within every inclusion zone, out of every exclusion zone, and below a ceiling.
///
/// A drone stays in all of several inclusion zones, as with ArduPilot's default of `FENCE_OPTIONS`, whose bit 1 asks
/// for any. PX4 asks for any. A place in all is in any, too.
#[derive(Debug, Clone, PartialEq)]
pub struct Fence {
    zones: Vec<Zone>,
    altitude_max_m: f64,
}

/// A zone of a fence: a horizontal area, at all altitudes.
#[derive(Debug, Clone, PartialEq)]
pub struct Zone {
    /// Area.
    pub area: Area,
    /// Whether drones stay within it; otherwise they stay out of it.
    pub is_inclusion: bool,
}

/// A horizontal area.
#[derive(Debug, Clone, PartialEq)]
pub enum Area {
    /// A circle.
    Circle {
        /// Centre; its altitude is ignored.
        centre: Ned,
        /// Radius in metres, above 0.
        radius_m: f64,
    },
    /// A polygon.
    Polygon(Polygon),
}

impl Area {
    /// Distance of a place from the boundary, in metres; negative outside.
    fn depth_m(&self, place: Ned) -> f64 {
        match self {
            Self::Circle { centre, radius_m } => radius_m - centre.horizontal_distance_m(place),
            Self::Polygon(polygon) => polygon.depth_m(place.0.xy()),
        }
    }
}

impl Zone {
    /// Horizontal distance of a place from the boundary, in metres: exact; negative where a drone may not be.
    #[must_use]
    pub fn clearance_m(&self, place: Ned) -> f64 {
        let depth_m = self.area.depth_m(place);
        if self.is_inclusion { depth_m } else { -depth_m }
    }

    /// Horizontal distance of a straight path from the boundary, in metres: exact above 0; 0 or less if the path leads
    /// to where a drone may not be.
    #[must_use]
    pub fn clearance_along_m(&self, from: Ned, to: Ned) -> f64 {
        let ends_m = self.clearance_m(from).min(self.clearance_m(to));
        let path = (from.0.xy(), to.0.xy());
        match &self.area {
            // No straight path between two places in a circle leaves it.
            Area::Circle { .. } if self.is_inclusion => ends_m,
            Area::Circle { centre, radius_m } => segment_to_point_m(path, centre.0.xy()) - radius_m,
            Area::Polygon(polygon) if ends_m > 0.0 => polygon.to_path_m(path).min(ends_m),
            Area::Polygon(_) => ends_m,
        }
    }

    /// As [`Self::clearance_along_m`], for a drone at an allowed place `from` that would come to rest at `stop`.
    fn stopping_clearance_m(&self, from: Ned, stop: Ned) -> f64 {
        match &self.area {
            Area::Circle { .. } if self.is_inclusion => self.clearance_m(stop),
            _ => self.clearance_along_m(from, stop),
        }
    }
}

impl Fence {
    /// A fence of these zones with a ceiling in metres above home; infinite without a ceiling.
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

    /// Zones of the fence.
    #[must_use]
    pub fn zones(&self) -> &[Zone] {
        &self.zones
    }

    /// Ceiling, in metres above home; infinite without a ceiling.
    #[must_use]
    pub const fn altitude_max_m(&self) -> f64 {
        self.altitude_max_m
    }

    /// Distance of a place from the nearest boundary or the ceiling, in metres: exact. Outside it is negative: the
    /// largest distance beyond any of them.
    #[must_use]
    pub fn clearance_m(&self, place: Ned) -> f64 {
        let below_m = self.altitude_max_m - place.altitude_m();
        let clearances_m = self.zones.iter().map(|zone| zone.clearance_m(place));
        clearances_m.fold(below_m, f64::min)
    }

    /// Clearance of a drone at `from` that would come to rest at `stop`, in metres. The straight path between them must
    /// not cross an exclusion zone, or a corner outside a concave fence.
    #[must_use]
    pub fn stopping_clearance_m(&self, from: Ned, stop: Ned) -> f64 {
        let below_m = self.altitude_max_m - stop.altitude_m();
        let clearances_m = self
            .zones
            .iter()
            .map(|zone| zone.stopping_clearance_m(from, stop));
        clearances_m.fold(below_m, f64::min)
    }

    /// Distance from the fence at which a vehicle of this maximum speed is stopped, in metres. The stopping point,
    /// v²/2a ahead, moves at 2 v at most if it accelerates as hard as it brakes. The margin is the distance that it
    /// moves between two checks.
    #[must_use]
    pub fn margin_m(speed_mps: f64) -> f64 {
        2.0 * speed_mps * CHECK_INTERVAL.as_secs_f64()
    }
}

#[cfg(test)]
mod tests;
