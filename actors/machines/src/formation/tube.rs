//! Regions in which a drone may be, and how near two of them come.

use nalgebra::{Vector2, Vector3, Vector4};
use smallvec::{SmallVec, smallvec};

use super::{Path, Separation};
use crate::geometry::Ned;

/// How often the range in which a clearance lies is halved: it is known to a part in 10^13 then.
const HALVINGS: usize = 44;

/// A region that is upright: all that is straight above one straight way and below another, of which one is above the
/// other. A way is a tube whose bounds are the same.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tube {
    upper: Path,
    lower: Path,
}

/// How near the two drones come that are the nearest: each distance is the smallest while the other is too small.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clearance {
    /// Metres over ground.
    pub horizontal_m: f64,
    /// Metres in height.
    pub vertical_m: f64,
    /// The larger of the two as shares of the separation: below 1 they are too near.
    pub room: f64,
}

impl From<Path> for Tube {
    fn from(path: Path) -> Self {
        Self {
            upper: path,
            lower: path,
        }
    }
}

impl Tube {
    /// The same and all that is between it and a height, in metres above home.
    #[must_use]
    pub fn stretched_to(self, altitude_m: f64) -> Self {
        let reach = |end: Ned, limit: fn(f64, f64) -> f64| {
            end.at_altitude(limit(end.altitude_m(), altitude_m))
        };
        Self {
            upper: self.upper.map(|end| reach(end, f64::max)),
            lower: self.lower.map(|end| reach(end, f64::min)),
        }
    }

    /// Whether a drone anywhere in this one and one anywhere in the other may be too near each other, over ground and in
    /// height at once.
    #[must_use]
    pub fn comes_near(self, other: Self, separation: Separation) -> bool {
        self.comes_within(1.0, other, separation)
    }

    /// Whether they may be nearer than this share of the separation.
    pub(super) fn comes_within(self, room: f64, other: Self, separation: Separation) -> bool {
        let horizontal_m = room * separation.horizontal_m;
        let vertical_m = room * separation.vertical_m;
        self.bounds()
            .is_within(&other.bounds(), horizontal_m, vertical_m)
            && self
                .over_ground_m(other, vertical_m)
                .is_some_and(|nearest_m| nearest_m < horizontal_m)
    }

    /// How near a drone anywhere in this one and one anywhere in the other come at the closest. `room` is never more than
    /// the truth.
    #[must_use]
    pub fn clearance(self, other: Self, separation: Separation) -> Clearance {
        let room = self.room(other, separation);
        // A little more, so that there are places as near.
        let near = room * (1.0 + 1e-9) + 1e-12;
        let near_m = near * separation.horizontal_m;
        let height_m = near * separation.vertical_m;
        let is_near = |height_m: f64| {
            self.over_ground_m(other, height_m)
                .is_some_and(|nearest_m| nearest_m <= near_m)
        };
        let (mut low_m, mut high_m) = (0.0, height_m);
        for _ in 0..HALVINGS {
            let middle_m = f64::midpoint(low_m, high_m);
            if is_near(middle_m) {
                high_m = middle_m;
            } else {
                low_m = middle_m;
            }
        }
        Clearance {
            horizontal_m: self.over_ground_m(other, height_m).unwrap_or(near_m),
            vertical_m: low_m,
            room,
        }
    }

    fn room(self, other: Self, separation: Separation) -> f64 {
        let corner_room = |corner: &Vector4<f64>| {
            let level = corner.xy().norm() / separation.horizontal_m;
            level.max(corner.z.max(corner.w).max(0.0) / separation.vertical_m)
        };
        let corners = self.relative_to(other);
        let mut far = corners
            .iter()
            .map(corner_room)
            .fold(f64::INFINITY, f64::min);
        let mut near = 0.0;
        for _ in 0..HALVINGS {
            let middle = f64::midpoint(near, far);
            let level_m = self.over_ground_m(other, middle * separation.vertical_m);
            if level_m.is_some_and(|nearest_m| nearest_m < middle * separation.horizontal_m) {
                far = middle;
            } else {
                near = middle;
            }
        }
        near
    }

    /// The least distance over ground between two places in them whose heights differ by less than this, if there are any.
    fn over_ground_m(self, other: Self, height_m: f64) -> Option<f64> {
        let mut outline = self.relative_to(other);
        for gap in [2, 3] {
            outline = cut(&outline, |corner| height_m - corner[gap]);
        }
        let seen_from_above: SmallVec<[Vector2<f64>; 6]> =
            outline.iter().map(|corner| corner.xy()).collect();
        (!seen_from_above.is_empty()).then(|| to_origin_m(&seen_from_above))
    }

    /// Where this drone may be relative to the other, as seen from above: within a parallelogram that is spanned by the
    /// two ways. Beside that by how much it is above the other at least, and below it.
    fn relative_to(self, other: Self) -> Outline {
        let corners = |path: Path, other: Path| {
            let (u, v) = ((path.to - path.from).0, -(other.to - other.from).0);
            let corner = (path.from - other.from).0;
            [corner, corner + u, corner + u + v, corner + v]
        };
        let below = corners(self.upper, other.lower);
        let above = corners(self.lower, other.upper);
        let both = below.iter().zip(&above);
        both.map(|(below, above)| Vector4::new(below.x, below.y, below.z, -above.z))
            .collect()
    }

    pub(super) fn bounds(self) -> Bounds {
        let ends = [
            self.upper.from,
            self.upper.to,
            self.lower.from,
            self.lower.to,
        ];
        let [first, rest @ ..] = ends.map(|end| end.0);
        Bounds {
            low: rest.iter().fold(first, |low, end| low.inf(end)),
            high: rest.iter().fold(first, |high, end| high.sup(end)),
        }
    }
}

/// A box around a tube: metres north, east and down of home.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bounds {
    pub(super) low: Vector3<f64>,
    pub(super) high: Vector3<f64>,
}

impl Bounds {
    /// Whether two are too near along each axis.
    pub(super) fn is_within(&self, other: &Self, horizontal_m: f64, vertical_m: f64) -> bool {
        let near_m = [horizontal_m, horizontal_m, vertical_m];
        near_m.into_iter().enumerate().all(|(axis, near_m)| {
            self.low[axis] - other.high[axis] < near_m && other.low[axis] - self.high[axis] < near_m
        })
    }
}

/// Corners of a convex outline.
type Outline = SmallVec<[Vector4<f64>; 6]>;

/// The part of a convex outline where `inside` is positive; it changes evenly along each side.
fn cut(outline: &[Vector4<f64>], inside: impl Fn(&Vector4<f64>) -> f64) -> Outline {
    let mut kept: Outline = smallvec![];
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

/// How far a convex outline is from the origin at the closest, in metres; 0 if that is within it. Corners that rounding puts a
/// little beside a straight side, or that are there twice, do not matter.
fn to_origin_m(outline: &[Vector2<f64>]) -> f64 {
    let sides = || outline.iter().zip(outline.iter().cycle().skip(1));
    // How often the axis to the right of the origin is crossed.
    let crosses = |(a, b): &(&Vector2<f64>, &Vector2<f64>)| {
        (a.y > 0.0) != (b.y > 0.0) && a.x + (b.x - a.x) * a.y / (a.y - b.y) > 0.0
    };
    if sides().filter(crosses).count() % 2 == 1 {
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
        (-12..=12, -12..=12, 0..=12).prop_map(|(north, east, up)| {
            Ned::new(f64::from(north), f64::from(east), -f64::from(up))
        })
    }

    fn tube() -> impl Strategy<Value = Tube> {
        (
            place(),
            place(),
            prop_oneof![Just(None), (0..20).prop_map(Some)],
        )
            .prop_map(|(from, to, stretched)| {
                let tube = Tube::from(Path { from, to });
                stretched.map_or(tube, |to_m| tube.stretched_to(f64::from(to_m)))
            })
    }

    /// Where in it a drone is at these shares of the way and of the height.
    fn at(tube: Tube, share: f64, height: f64) -> Ned {
        let on = |path: Path| path.from.0.lerp(&path.to.0, share);
        Ned(on(tube.lower).lerp(&on(tube.upper), height))
    }

    fn room(a: Ned, b: Ned) -> f64 {
        let level = a.horizontal_distance_m(b) / SEPARATION.horizontal_m;
        level.max(a.vertical_distance_m(b) / SEPARATION.vertical_m)
    }

    proptest! {
        #[test]
        fn no_two_places_are_nearer_than_the_clearance_and_some_are_as_near(a in tube(), b in tube()) {
            let clearance = a.clearance(b, SEPARATION);
            let steps = || (0..=24).map(|step| f64::from(step) / 24.0);
            let heights = || (0..=6).map(|step| f64::from(step) / 6.0);
            let places = |tube: Tube| -> Vec<Ned> {
                steps().flat_map(|s| heights().map(move |h| at(tube, s, h))).collect()
            };
            let (here, there) = (places(a), places(b));
            let sampled = here.iter().flat_map(|a| there.iter().map(|b| room(*a, *b)));
            let sampled = sampled.fold(f64::INFINITY, f64::min);
            prop_assert!(sampled >= clearance.room - 1e-9, "{sampled} < {clearance:?}");
            // Samples are half a metre off along each way, and one and a half in height.
            prop_assert!(sampled <= clearance.room + 1.0, "{sampled} > {clearance:?}");
        }

        #[test]
        fn a_clearance_of_less_than_one_is_too_near(a in tube(), b in tube()) {
            let clearance = a.clearance(b, SEPARATION);
            prop_assume!((clearance.room - 1.0).abs() > 1e-9);
            prop_assert_eq!(a.comes_near(b, SEPARATION), clearance.room < 1.0);
            prop_assert!((clearance.room - b.clearance(a, SEPARATION).room).abs() < 1e-9);
            let largest = (clearance.horizontal_m / SEPARATION.horizontal_m)
                .max(clearance.vertical_m / SEPARATION.vertical_m);
            prop_assert!((largest - clearance.room).abs() < 1e-6, "{:?}", clearance);
        }
    }

    #[test]
    fn of_two_that_cross_above_each_other_the_height_between_them_is_told() {
        let level = |east_m: f64, altitude_m: f64| Path {
            from: Ned::new(-50.0, -east_m, -altitude_m),
            to: Ned::new(50.0, east_m, -altitude_m),
        };
        let over = Tube::from(level(20.0, 30.0)).clearance(level(-20.0, 36.0).into(), SEPARATION);
        assert!(
            over.horizontal_m < 1e-6 && (over.vertical_m - 6.0).abs() < 1e-6,
            "{over:?}"
        );
        assert!((over.room - 2.0).abs() < 1e-9);
        let beside = Path::standing(Ned::new(0.0, 40.0, -30.0));
        let beside = Tube::from(level(0.0, 30.0)).clearance(beside.into(), SEPARATION);
        assert!((beside.horizontal_m - 40.0).abs() < 1e-6 && beside.vertical_m < 1e-6);
    }

    #[test]
    fn one_that_comes_down_is_near_whatever_is_below_its_way() {
        let level = |altitude_m: f64| Path {
            from: Ned::new(-50.0, 0.0, -altitude_m),
            to: Ned::new(50.0, 0.0, -altitude_m),
        };
        let comes_down = Tube::from(level(40.0)).stretched_to(0.0);
        assert!(comes_down.comes_near(level(10.0).into(), SEPARATION));
        assert!(comes_down.comes_near(level(42.9).into(), SEPARATION));
        assert!(!comes_down.comes_near(level(43.0).into(), SEPARATION));
    }
}
