use super::Separation;
use super::tube::Tube;
use crate::geometry::Ned;

/// A straight way, flown from one end to the other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Path {
    /// Where it begins.
    pub from: Ned,
    /// Where it ends.
    pub to: Ned,
}

impl Path {
    /// A way whose ends are the same place: where a drone stands still.
    #[must_use]
    pub const fn standing(at: Ned) -> Self {
        Self { from: at, to: at }
    }

    /// Whether a drone anywhere on this way and one anywhere on the other may be too near each other, over ground and in
    /// height at once.
    #[must_use]
    pub fn comes_near(self, other: Self, separation: Separation) -> bool {
        Tube::from(self).comes_near(other.into(), separation)
    }

    /// Likewise, where the other may come down from anywhere on its way, as far as the ground.
    #[must_use]
    pub fn comes_near_below(self, other: Self, separation: Separation) -> bool {
        let ends = [self.from, self.to, other.from, other.to];
        let lowest_m = ends
            .map(Ned::altitude_m)
            .into_iter()
            .fold(f64::INFINITY, f64::min);
        Tube::from(self).comes_near(Tube::from(other).stretched_to(lowest_m), separation)
    }

    /// Whether it leads straight up or down, or nowhere.
    #[must_use]
    pub fn is_upright(self) -> bool {
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
        // Whole metres, so that ways stand still, are level and are upright often.
        (-12..=12, -12..=12, 0..=12).prop_map(|(north, east, up)| {
            Ned::new(f64::from(north), f64::from(east), -f64::from(up))
        })
    }

    fn path() -> impl Strategy<Value = Path> {
        (place(), place()).prop_map(|(from, to)| Path { from, to })
    }

    /// How much room is left between the two at the least, sampled: more than 1 where they are far enough apart.
    fn sampled(a: Path, b: Path) -> f64 {
        let steps = || (0..=60).map(|step| f64::from(step) / 60.0);
        let on = |path: Path, share| Ned(path.from.0.lerp(&path.to.0, share));
        let room = |(s, t)| {
            let (here, there) = (on(a, s), on(b, t));
            let level = here.horizontal_distance_m(there) / SEPARATION.horizontal_m;
            level.max(here.vertical_distance_m(there) / SEPARATION.vertical_m)
        };
        steps()
            .flat_map(|s| steps().map(move |t| (s, t)))
            .map(room)
            .fold(f64::INFINITY, f64::min)
    }

    proptest! {
        #[test]
        fn two_ways_come_near_where_places_on_them_do(a in path(), b in path()) {
            let room = sampled(a, b);
            let comes_near = [a.comes_near(b, SEPARATION), b.comes_near(a, SEPARATION)];
            // At the limit rounding decides; samples are at most 0.6 m off.
            if room < 1.0 - 1e-9 {
                prop_assert_eq!(comes_near, [true; 2], "{} of 1", room);
            } else if room > 1.25 {
                prop_assert_eq!(comes_near, [false; 2], "{} of 1", room);
            }
        }
    }

    #[test]
    fn below_one_that_may_come_down_all_is_near() {
        let level = |altitude_m: f64| Path {
            from: Ned::new(-50.0, 0.0, -altitude_m),
            to: Ned::new(50.0, 0.0, -altitude_m),
        };
        let across = Path {
            from: Ned::new(0.0, -50.0, -20.0),
            to: Ned::new(0.0, 50.0, -30.0),
        };
        let is_near = |altitude_m: f64| level(altitude_m).comes_near_below(across, SEPARATION);
        // It is 25 m high where the two cross, and somewhat more 5 m farther on.
        assert!(is_near(1.0) && is_near(27.9) && !is_near(28.6));
        let unicasts = Path {
            from: Ned::new(0.0, 5.0, -20.0),
            to: Ned::new(0.0, 50.0, -20.0),
        };
        assert!(!level(1.0).comes_near_below(unicasts, SEPARATION));
    }

    #[test]
    fn one_that_passes_far_enough_above_is_not_near() {
        let level = |altitude_m: f64| Path {
            from: Ned::new(-50.0, 0.0, -altitude_m),
            to: Ned::new(50.0, 0.0, -altitude_m),
        };
        let upright = Path {
            from: Ned::HOME,
            to: Ned::new(0.0, 0.0, -20.0),
        };
        assert!(level(22.9).comes_near(upright, SEPARATION));
        assert!(!level(23.0).comes_near(upright, SEPARATION));
        assert!(!level(-3.0).comes_near(upright, SEPARATION));
        let slope = Path {
            from: Ned::new(-50.0, 0.0, -10.0),
            to: Ned::new(50.0, 0.0, -20.0),
        };
        assert!(
            slope.comes_near(level(12.0), SEPARATION),
            "it begins below it and ends above"
        );
    }
}
