use super::Separation;
use super::tube::Tube;
use crate::geometry::Ned;

/// A straight piece of flight path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Path {
    /// Start.
    pub from: Ned,
    /// End.
    pub to: Ned,
}

impl Path {
    /// Path from one place to another.
    #[must_use]
    pub const fn new(from: Ned, to: Ned) -> Self {
        Self { from, to }
    }

    /// Path of a drone that hovers or stands at a place: start and end are equal.
    #[must_use]
    pub const fn stationary(at: Ned) -> Self {
        Self { from: at, to: at }
    }

    /// The place after a share of the path, from 0 at its start to 1 at its end.
    #[must_use]
    pub fn at(self, share: f64) -> Ned {
        Ned(self.from.0.lerp(&self.to.0, share))
    }

    /// The share of the path at which it is nearest to a place; 0 if the path is stationary.
    #[must_use]
    pub fn share_nearest(self, place: Ned) -> f64 {
        let along = (self.to - self.from).0;
        let length_squared = along.norm_squared();
        if length_squared <= 0.0 {
            return 0.0;
        }
        ((place - self.from).0.dot(&along) / length_squared).clamp(0.0, 1.0)
    }

    /// Distance of a place from the path, in metres.
    #[must_use]
    pub fn distance_m(self, place: Ned) -> f64 {
        self.at(self.share_nearest(place)).distance_m(place)
    }

    /// Whether two drones, each anywhere on its path, may violate the separation: over ground and in height at once.
    #[must_use]
    pub fn violates(self, other: Self, separation: Separation) -> bool {
        !self.is_far_from(other, separation) && Tube::from(self).violates(other.into(), separation)
    }

    /// Whether the bounding boxes of two paths are apart by the separation along an axis. This is cheap, and true of most paths.
    fn is_far_from(self, other: Self, separation: Separation) -> bool {
        let near_m = [
            separation.horizontal_m,
            separation.horizontal_m,
            separation.vertical_m,
        ];
        (0..3).any(|axis| {
            let (a, b) = (self.from.0[axis], self.to.0[axis]);
            let (c, d) = (other.from.0[axis], other.to.0[axis]);
            c.min(d) - a.max(b) >= near_m[axis] || a.min(b) - c.max(d) >= near_m[axis]
        })
    }

    /// As [`Self::violates`], where the other drone may also descend from anywhere on its path.
    #[must_use]
    pub fn violates_below(self, other: Self, separation: Separation) -> bool {
        let ends = [self.from, self.to, other.from, other.to];
        let lowest_m = ends
            .map(Ned::altitude_m)
            .into_iter()
            .fold(f64::INFINITY, f64::min);
        Tube::from(self).violates(Tube::from(other).extended_to(lowest_m), separation)
    }

    /// Whether the path is vertical or stationary.
    #[must_use]
    pub fn is_vertical(self) -> bool {
        self.from.0.xy() == self.to.0.xy()
    }

    pub(super) fn map(self, place: impl Fn(Ned) -> Ned) -> Self {
        Self {
            from: place(self.from),
            to: place(self.to),
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const SEPARATION: Separation = Separation {
        horizontal_m: 5.0,
        vertical_m: 3.0,
    };

    fn place() -> impl Strategy<Value = Ned> {
        // Whole metres, so that stationary, level and vertical paths are frequent.
        (-12..=12, -12..=12, 0..=12).prop_map(|(north, east, up)| {
            Ned::new(f64::from(north), f64::from(east), -f64::from(up))
        })
    }

    fn path() -> impl Strategy<Value = Path> {
        (place(), place()).prop_map(|(from, to)| Path { from, to })
    }

    /// Smallest sampled distance of the two, as a multiple of the separation: above 1 they are separated.
    fn sampled_ratio(a: Path, b: Path) -> f64 {
        let steps = || (0..=60).map(|step| f64::from(step) / 60.0);
        let ratio = |(s, t)| {
            let (here, there) = (a.at(s), b.at(t));
            let level = here.horizontal_distance_m(there) / SEPARATION.horizontal_m;
            level.max(here.vertical_distance_m(there) / SEPARATION.vertical_m)
        };
        steps()
            .flat_map(|s| steps().map(move |t| (s, t)))
            .map(ratio)
            .fold(f64::INFINITY, f64::min)
    }

    proptest! {
        #[test]
        fn paths_violate_separation_if_sampled_places_do(a in path(), b in path()) {
            let ratio = sampled_ratio(a, b);
            let violates = [a.violates(b, SEPARATION), b.violates(a, SEPARATION)];
            // Rounding decides at the limit; samples are at most 0.6 m off.
            if ratio < 1.0 - 1e-9 {
                prop_assert_eq!(violates, [true; 2], "{} of 1", ratio);
            } else if ratio > 1.25 {
                prop_assert_eq!(violates, [false; 2], "{} of 1", ratio);
            }
        }
    }

    #[test]
    fn descending_drone_violates_separation_with_all_below() {
        let level = |altitude_m: f64| Path {
            from: Ned::new(-50.0, 0.0, -altitude_m),
            to: Ned::new(50.0, 0.0, -altitude_m),
        };
        let across = Path {
            from: Ned::new(0.0, -50.0, -20.0),
            to: Ned::new(0.0, 50.0, -30.0),
        };
        let violates = |altitude_m: f64| level(altitude_m).violates_below(across, SEPARATION);
        // The crossing is at 25 m, and 5 m further on the path is slightly higher.
        assert!(violates(1.0) && violates(27.9) && !violates(28.6));
        let beside = Path {
            from: Ned::new(0.0, 5.0, -20.0),
            to: Ned::new(0.0, 50.0, -20.0),
        };
        assert!(!level(1.0).violates_below(beside, SEPARATION));
    }

    #[test]
    fn path_at_vertical_separation_is_no_violation() {
        let level = |altitude_m: f64| Path {
            from: Ned::new(-50.0, 0.0, -altitude_m),
            to: Ned::new(50.0, 0.0, -altitude_m),
        };
        let vertical = Path {
            from: Ned::HOME,
            to: Ned::new(0.0, 0.0, -20.0),
        };
        assert!(level(22.9).violates(vertical, SEPARATION));
        assert!(!level(23.0).violates(vertical, SEPARATION));
        assert!(!level(-3.0).violates(vertical, SEPARATION));
        let slope = Path {
            from: Ned::new(-50.0, 0.0, -10.0),
            to: Ned::new(50.0, 0.0, -20.0),
        };
        assert!(
            slope.violates(level(12.0), SEPARATION),
            "the slope starts below and ends above"
        );
    }
}
