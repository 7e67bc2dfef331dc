//! Volumes in which a drone may be, and the closest approach of two of them.

use nalgebra::{Vector2, Vector3, Vector4};
use smallvec::{SmallVec, smallvec};

use super::{Path, Separation};
use crate::geometry::Ned;

/// Number of bisection steps for a clearance: exact to one part in 10^13.
const HALVINGS: usize = 44;

/// A vertical strip: everything between an upper path and a lower path straight below it. A path is a tube with equal
/// bounds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tube {
    upper: Path,
    lower: Path,
}

/// Smallest distances of two drones: each is the smallest while the other violates its minimum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clearance {
    /// Horizontal distance, in metres.
    pub horizontal_m: f64,
    /// Vertical distance, in metres.
    pub vertical_m: f64,
    /// The larger of the two as a multiple of its minimum; below 1 the separation is violated.
    pub ratio: f64,
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
    /// Column from a place down to the ground.
    #[must_use]
    pub fn down_from(place: Ned) -> Self {
        Self::from(Path::stationary(place)).extended_to(0.0)
    }

    /// Level path from above a place to above another, at an altitude in metres above home, and the descent there.
    #[must_use]
    pub fn level_then_down(from: Ned, to: Ned, altitude_m: f64) -> [Self; 2] {
        let [above, over] = [from, to].map(|it| it.at_altitude(altitude_m));
        [Path::new(above, over).into(), Self::down_from(over)]
    }

    /// The tube extended to an altitude, in metres above home.
    #[must_use]
    pub fn extended_to(self, altitude_m: f64) -> Self {
        let reach = |end: Ned, limit: fn(f64, f64) -> f64| {
            end.at_altitude(limit(end.altitude_m(), altitude_m))
        };
        Self {
            upper: self.upper.map(|end| reach(end, f64::max)),
            lower: self.lower.map(|end| reach(end, f64::min)),
        }
    }

    /// Whether two drones, each anywhere in its tube, may violate the separation: over ground and in height at once.
    #[must_use]
    pub fn violates(self, other: Self, separation: Separation) -> bool {
        self.comes_within(1.0, other, separation)
    }

    /// Whether the drones may be closer than `ratio` times the separation.
    pub(super) fn comes_within(self, ratio: f64, other: Self, separation: Separation) -> bool {
        let horizontal_m = ratio * separation.horizontal_m;
        let vertical_m = ratio * separation.vertical_m;
        self.bounds()
            .is_within(&other.bounds(), horizontal_m, vertical_m)
            && self
                .horizontal_m_within(other, vertical_m)
                .is_some_and(|nearest_m| nearest_m < horizontal_m)
    }

    /// Closest approach of two drones, each anywhere in its tube. `ratio` is never above the true value.
    #[must_use]
    pub fn clearance(self, other: Self, separation: Separation) -> Clearance {
        let ratio = self.ratio(other, separation);
        // Slightly more, so that places at this distance exist.
        let near = ratio * (1.0 + 1e-9) + 1e-12;
        let near_m = near * separation.horizontal_m;
        let height_m = near * separation.vertical_m;
        let is_within = |height_m: f64| {
            self.horizontal_m_within(other, height_m)
                .is_some_and(|nearest_m| nearest_m <= near_m)
        };
        let (mut low_m, mut high_m) = (0.0, height_m);
        for _ in 0..HALVINGS {
            let middle_m = f64::midpoint(low_m, high_m);
            if is_within(middle_m) {
                high_m = middle_m;
            } else {
                low_m = middle_m;
            }
        }
        Clearance {
            horizontal_m: self.horizontal_m_within(other, height_m).unwrap_or(near_m),
            vertical_m: low_m,
            ratio,
        }
    }

    fn ratio(self, other: Self, separation: Separation) -> f64 {
        let corner_ratio = |corner: &Vector4<f64>| {
            let level = corner.xy().norm() / separation.horizontal_m;
            level.max(corner.z.max(corner.w).max(0.0) / separation.vertical_m)
        };
        let corners = self.relative_to(other);
        let mut far = corners
            .iter()
            .map(corner_ratio)
            .fold(f64::INFINITY, f64::min);
        let mut near = 0.0;
        for _ in 0..HALVINGS {
            let middle = f64::midpoint(near, far);
            let level_m = self.horizontal_m_within(other, middle * separation.vertical_m);
            if level_m.is_some_and(|nearest_m| nearest_m < middle * separation.horizontal_m) {
                far = middle;
            } else {
                near = middle;
            }
        }
        near
    }

    /// Smallest horizontal distance of two places with heights that differ by less than `height_m`; `None` if there are
    /// none.
    fn horizontal_m_within(self, other: Self, height_m: f64) -> Option<f64> {
        let mut outline = self.relative_to(other);
        for gap in [2, 3] {
            outline = cut(&outline, |corner| height_m - corner[gap]);
        }
        let projected: SmallVec<[Vector2<f64>; 6]> =
            outline.iter().map(|corner| corner.xy()).collect();
        (!projected.is_empty()).then(|| distance_to_origin_m(&projected))
    }

    /// Positions of this drone relative to the other: a parallelogram spanned by the two paths, as seen from above.
    /// Each corner also has the height by which this drone is at least above the other, and at least below it.
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

/// Bounding box of a tube: metres north, east and down of home.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bounds {
    pub(super) low: Vector3<f64>,
    pub(super) high: Vector3<f64>,
}

impl Bounds {
    /// Whether two boxes are closer than these limits along each axis.
    pub(super) fn is_within(&self, other: &Self, horizontal_m: f64, vertical_m: f64) -> bool {
        let near_m = [horizontal_m, horizontal_m, vertical_m];
        near_m.into_iter().enumerate().all(|(axis, near_m)| {
            self.low[axis] - other.high[axis] < near_m && other.low[axis] - self.high[axis] < near_m
        })
    }
}

/// Corners of a convex outline.
type Outline = SmallVec<[Vector4<f64>; 6]>;

/// The part of a convex outline where `inside`, which is linear along each side, is positive.
fn cut(outline: &[Vector4<f64>], inside: impl Fn(&Vector4<f64>) -> f64) -> Outline {
    let mut kept: Outline = smallvec![];
    let next = outline.iter().cycle().skip(1);
    for (at, next) in outline.iter().zip(next) {
        let (value, next_value) = (inside(at), inside(next));
        if value > 0.0 {
            kept.push(*at);
        }
        if (value > 0.0) != (next_value > 0.0) {
            kept.push(at.lerp(next, value / (value - next_value)));
        }
    }
    kept
}

/// Distance of a convex outline from the origin, in metres; 0 if the origin is inside. Tolerates duplicate corners and
/// corners that rounding puts beside a straight side.
fn distance_to_origin_m(outline: &[Vector2<f64>]) -> f64 {
    let sides = || outline.iter().zip(outline.iter().cycle().skip(1));
    // Number of crossings of the axis to the right of the origin.
    let crosses = |(a, b): &(&Vector2<f64>, &Vector2<f64>)| {
        (a.y > 0.0) != (b.y > 0.0) && a.x + (b.x - a.x) * a.y / (a.y - b.y) > 0.0
    };
    if sides().filter(crosses).count() % 2 == 1 {
        return 0.0;
    }
    sides()
        .map(|(a, b)| super::crossings::segment_to_point_m((*a, *b), Vector2::zeros()))
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
                stretched.map_or(tube, |to_m| tube.extended_to(f64::from(to_m)))
            })
    }

    /// Position in the tube at these fractions of the path and of the height.
    fn at(tube: Tube, share: f64, height: f64) -> Ned {
        let on = |path: Path| path.from.0.lerp(&path.to.0, share);
        Ned(on(tube.lower).lerp(&on(tube.upper), height))
    }

    fn ratio(a: Ned, b: Ned) -> f64 {
        let level = a.horizontal_distance_m(b) / SEPARATION.horizontal_m;
        level.max(a.vertical_distance_m(b) / SEPARATION.vertical_m)
    }

    proptest! {
        #[test]
        fn clearance_is_the_closest_approach_of_sampled_places(a in tube(), b in tube()) {
            let clearance = a.clearance(b, SEPARATION);
            let steps = || (0..=24).map(|step| f64::from(step) / 24.0);
            let heights = || (0..=6).map(|step| f64::from(step) / 6.0);
            let places = |tube: Tube| -> Vec<Ned> {
                steps().flat_map(|s| heights().map(move |h| at(tube, s, h))).collect()
            };
            let (here, there) = (places(a), places(b));
            let sampled = here.iter().flat_map(|a| there.iter().map(|b| ratio(*a, *b)));
            let sampled = sampled.fold(f64::INFINITY, f64::min);
            prop_assert!(sampled >= clearance.ratio - 1e-9, "{sampled} < {clearance:?}");
            // Samples are 0.5 m apart along each path and 1.5 m apart in height.
            prop_assert!(sampled <= clearance.ratio + 1.0, "{sampled} > {clearance:?}");
        }

        #[test]
        fn clearance_ratio_below_one_violates_separation(a in tube(), b in tube()) {
            let clearance = a.clearance(b, SEPARATION);
            prop_assume!((clearance.ratio - 1.0).abs() > 1e-9);
            prop_assert_eq!(a.violates(b, SEPARATION), clearance.ratio < 1.0);
            prop_assert!((clearance.ratio - b.clearance(a, SEPARATION).ratio).abs() < 1e-9);
            let largest = (clearance.horizontal_m / SEPARATION.horizontal_m)
                .max(clearance.vertical_m / SEPARATION.vertical_m);
            prop_assert!((largest - clearance.ratio).abs() < 1e-6, "{:?}", clearance);
        }
    }

    #[test]
    fn crossing_paths_have_their_height_difference_as_clearance() {
        let level = |east_m: f64, altitude_m: f64| Path {
            from: Ned::new(-50.0, -east_m, -altitude_m),
            to: Ned::new(50.0, east_m, -altitude_m),
        };
        let over = Tube::from(level(20.0, 30.0)).clearance(level(-20.0, 36.0).into(), SEPARATION);
        assert!(
            over.horizontal_m < 1e-6 && (over.vertical_m - 6.0).abs() < 1e-6,
            "{over:?}"
        );
        assert!((over.ratio - 2.0).abs() < 1e-9);
        let beside = Path::stationary(Ned::new(0.0, 40.0, -30.0));
        let beside = Tube::from(level(0.0, 30.0)).clearance(beside.into(), SEPARATION);
        assert!((beside.horizontal_m - 40.0).abs() < 1e-6 && beside.vertical_m < 1e-6);
    }

    #[test]
    fn extended_tube_violates_separation_with_all_below() {
        let level = |altitude_m: f64| Path {
            from: Ned::new(-50.0, 0.0, -altitude_m),
            to: Ned::new(50.0, 0.0, -altitude_m),
        };
        let descending = Tube::from(level(40.0)).extended_to(0.0);
        assert!(descending.violates(level(10.0).into(), SEPARATION));
        assert!(descending.violates(level(42.9).into(), SEPARATION));
        assert!(!descending.violates(level(43.0).into(), SEPARATION));
    }
}
