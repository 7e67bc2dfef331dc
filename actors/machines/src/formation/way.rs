use nalgebra::{Vector2, Vector3};

use super::Separation;
use crate::geometry::Ned;

/// A straight way, flown from one end to the other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Way {
    /// Where it begins.
    pub from: Ned,
    /// Where it ends.
    pub to: Ned,
}

impl Way {
    /// Whether a drone anywhere on this way and one anywhere on the other may be too near each other, over ground and in
    /// height at once.
    #[must_use]
    pub fn comes_near(self, other: Self, separation: Separation) -> bool {
        let limits = [(1.0, separation.vertical_m), (-1.0, separation.vertical_m)];
        self.is_within(other, separation.horizontal_m, &limits)
    }

    /// Likewise, where the other may come down from anywhere on its way, as far as the ground.
    #[must_use]
    pub fn comes_near_below(self, other: Self, separation: Separation) -> bool {
        self.is_within(
            other,
            separation.horizontal_m,
            &[(-1.0, separation.vertical_m)],
        )
    }

    /// Whether the two may be nearer than that over ground while the one is below the other, in metres, by less than each
    /// limit allows, with its sign.
    fn is_within(self, other: Self, horizontal_m: f64, limits: &[(f64, f64)]) -> bool {
        if !self.boxes_are_within(other, horizontal_m, limits) {
            return false;
        }
        // Relative to each other they may be anywhere in the parallelogram that is spanned by the two ways: cut to the
        // slab in which the heights are too near, is it too near the vertical axis?
        let (u, v) = ((self.to - self.from).0, -(other.to - other.from).0);
        let corner = (self.from - other.from).0;
        let mut outline = vec![corner, corner + u, corner + u + v, corner + v];
        for (sign, limit) in limits {
            outline = cut(&outline, |at| limit - sign * at.z);
        }
        let seen_from_above: Vec<_> = outline.iter().map(Vector3::xy).collect();
        !seen_from_above.is_empty() && to_origin_m(&seen_from_above) < horizontal_m
    }

    /// Whether the boxes around the two are so near.
    fn boxes_are_within(self, other: Self, horizontal_m: f64, limits: &[(f64, f64)]) -> bool {
        // How far the one is from the other along an axis, at the least and at the most.
        let apart = |axis: usize| {
            let (a, b) = (self.from.0[axis], self.to.0[axis]);
            let (c, d) = (other.from.0[axis], other.to.0[axis]);
            (a.min(b) - c.max(d), a.max(b) - c.min(d))
        };
        let (least, most) = apart(2);
        (0..2)
            .map(apart)
            .all(|(least, most)| least < horizontal_m && -most < horizontal_m)
            && limits.iter().all(|(sign, limit)| {
                let nearest = (sign * least).min(sign * most);
                nearest < *limit
            })
    }
}

/// The part of a convex outline where `inside` is positive; it changes evenly along each side.
fn cut(outline: &[Vector3<f64>], inside: impl Fn(&Vector3<f64>) -> f64) -> Vec<Vector3<f64>> {
    let mut kept = Vec::with_capacity(outline.len() + 2);
    let next = outline.iter().cycle().skip(1);
    for (at, next) in outline.iter().zip(next) {
        let (here, there) = (inside(at), inside(next));
        if here > 0.0 {
            kept.push(*at);
        }
        if (here > 0.0) != (there > 0.0) {
            kept.push(at.lerp(next, here / (here - there)));
        }
    }
    kept
}

/// How far a convex outline is from the origin at the closest, in metres; 0 if that is within it.
fn to_origin_m(outline: &[Vector2<f64>]) -> f64 {
    let sides = || outline.iter().zip(outline.iter().cycle().skip(1));
    // Twice the area of the triangle that each side makes with the origin; of one sign where that is within.
    let areas = || sides().map(|(a, b)| a.perp(b));
    let is_within = areas().all(|area| area >= 0.0) || areas().all(|area| area <= 0.0);
    if is_within && areas().sum::<f64>() != 0.0 {
        return 0.0;
    }
    sides()
        .map(|(a, b)| super::crossings::to_point_m((*a, *b), Vector2::zeros()))
        .fold(f64::INFINITY, f64::min)
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

    fn way() -> impl Strategy<Value = Way> {
        (place(), place()).prop_map(|(from, to)| Way { from, to })
    }

    /// How much room is left between the two at the least, sampled: more than 1 where they are far enough apart.
    fn sampled(a: Way, b: Way) -> f64 {
        let steps = || (0..=60).map(|step| f64::from(step) / 60.0);
        let on = |way: Way, share| Ned(way.from.0.lerp(&way.to.0, share));
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
        fn two_ways_come_near_where_places_on_them_do(a in way(), b in way()) {
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
        let level = |altitude_m: f64| Way {
            from: Ned::new(-50.0, 0.0, -altitude_m),
            to: Ned::new(50.0, 0.0, -altitude_m),
        };
        let across = Way {
            from: Ned::new(0.0, -50.0, -20.0),
            to: Ned::new(0.0, 50.0, -30.0),
        };
        let is_near = |altitude_m: f64| level(altitude_m).comes_near_below(across, SEPARATION);
        // It is 25 m high where the two cross, and somewhat more 5 m farther on.
        assert!(is_near(1.0) && is_near(27.9) && !is_near(28.6));
        let aside = Way {
            from: Ned::new(0.0, 5.0, -20.0),
            to: Ned::new(0.0, 50.0, -20.0),
        };
        assert!(!level(1.0).comes_near_below(aside, SEPARATION));
    }

    #[test]
    fn one_that_passes_far_enough_above_is_not_near() {
        let level = |altitude_m: f64| Way {
            from: Ned::new(-50.0, 0.0, -altitude_m),
            to: Ned::new(50.0, 0.0, -altitude_m),
        };
        let upright = Way {
            from: Ned::HOME,
            to: Ned::new(0.0, 0.0, -20.0),
        };
        assert!(level(22.9).comes_near(upright, SEPARATION));
        assert!(!level(23.0).comes_near(upright, SEPARATION));
        assert!(!level(-3.0).comes_near(upright, SEPARATION));
        let slope = Way {
            from: Ned::new(-50.0, 0.0, -10.0),
            to: Ned::new(50.0, 0.0, -20.0),
        };
        assert!(
            slope.comes_near(level(12.0), SEPARATION),
            "it begins below it and ends above"
        );
    }
}
