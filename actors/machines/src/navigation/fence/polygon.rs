use nalgebra::Vector2;
use thiserror::Error;

use crate::formation::crossings::segment_to_point_m;
use crate::geometry::Ned;

/// A simple polygon, exact to the millimetre: sides meet only at shared corners.
#[derive(Debug, Clone, PartialEq)]
pub struct Polygon {
    /// Metres north and east of home; at least three corners.
    corners: Vec<Vector2<f64>>,
}

/// Corners that enclose no area or several. Corners count from 0; side `n` starts at corner `n`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum PolygonError {
    /// Fewer than three different corners.
    #[error("a polygon needs at least 3 different corners, found {corners}")]
    TooFewCorners {
        /// Number of different corners.
        corners: usize,
    },
    /// Two sides cross, touch or overlap.
    #[error("the side from corner {first} meets the side from corner {second}")]
    SidesMeet {
        /// First side.
        first: usize,
        /// Second side.
        second: usize,
    },
}

type Millimetres = Vector2<i64>;

impl Polygon {
    /// Polygon of these corners, in either order; altitudes are ignored. Equal consecutive corners, to the millimetre,
    /// count once, and so does a last corner equal to the first.
    ///
    /// # Errors
    /// If the corners enclose no area, or sides meet. Takes time quadratic in the number of corners.
    pub fn new(corners: impl IntoIterator<Item = Ned>) -> Result<Self, PolygonError> {
        let corners = corners.into_iter().map(to_millimetres).enumerate();
        let mut corners: Vec<(usize, Millimetres)> = corners.collect();
        corners.dedup_by_key(|(_, corner)| *corner);
        while corners.len() > 1 && corners.last().map(|it| it.1) == corners.first().map(|it| it.1) {
            corners.pop();
        }
        if corners.len() < 3 {
            let corners = corners.len();
            return Err(PolygonError::TooFewCorners { corners });
        }
        check_sides(&corners)?;
        #[expect(
            clippy::cast_precision_loss,
            reason = "far below 2^53 mm, and near what it was made from"
        )]
        let to_metres = |corner: Millimetres| corner.map(|it| it as f64 / 1_000.0);
        Ok(Self {
            corners: corners.into_iter().map(|(_, it)| to_metres(it)).collect(),
        })
    }

    /// Corners, in metres north and east of home.
    pub fn corners(&self) -> impl ExactSizeIterator<Item = Ned> {
        let corners = self.corners.iter();
        corners.map(|corner| Ned::new(corner.x, corner.y, 0.0))
    }

    fn sides(&self) -> impl Iterator<Item = (Vector2<f64>, Vector2<f64>)> {
        let next = self.corners.iter().cycle().skip(1);
        self.corners.iter().copied().zip(next.copied())
    }

    /// Distance of a place from the nearest side, in metres; negative outside.
    pub(super) fn depth_m(&self, place: Vector2<f64>) -> f64 {
        let mut is_within = false;
        let mut nearest_m = f64::INFINITY;
        for (from, to) in self.sides() {
            // A ray north crosses an odd number of sides from inside.
            if (from.y > place.y) != (to.y > place.y) {
                let share = (place.y - from.y) / (to.y - from.y);
                is_within ^= from.x + share * (to.x - from.x) > place.x;
            }
            nearest_m = nearest_m.min(segment_to_point_m((from, to), place));
        }
        if is_within { nearest_m } else { -nearest_m }
    }

    /// Smallest distance of a straight path from the sides, in metres; 0 if it crosses one.
    pub(super) fn to_path_m(&self, path: (Vector2<f64>, Vector2<f64>)) -> f64 {
        let apart_m = self.sides().map(|side| apart_m(side, path));
        apart_m.fold(f64::INFINITY, f64::min)
    }
}

/// Smallest distance of two segments, in metres.
fn apart_m(one: (Vector2<f64>, Vector2<f64>), other: (Vector2<f64>, Vector2<f64>)) -> f64 {
    let are_on_one_side = |(from, to): (Vector2<f64>, Vector2<f64>), (a, b)| {
        let along = to - from;
        along.perp(&(a - from)) * along.perp(&(b - from)) >= 0.0
    };
    if !are_on_one_side(one, other) && !are_on_one_side(other, one) {
        return 0.0;
    }
    let from_ends = [
        segment_to_point_m(one, other.0),
        segment_to_point_m(one, other.1),
        segment_to_point_m(other, one.0),
        segment_to_point_m(other, one.1),
    ];
    from_ends.into_iter().fold(f64::INFINITY, f64::min)
}

/// Checks that sides meet only at shared corners. Neighbouring corners must differ.
fn check_sides(corners: &[(usize, Millimetres)]) -> Result<(), PolygonError> {
    let corner = |at: usize| corners[at % corners.len()].1;
    for first in 0..corners.len() {
        for second in first + 1..corners.len() {
            let one = (corner(first), corner(first + 1));
            let other = (corner(second), corner(second + 1));
            let meet = if second == first + 1 {
                turns_back(one.0, one.1, other.1)
            } else if (second + 1) % corners.len() == first {
                turns_back(other.0, other.1, one.1)
            } else {
                sides_meet(one, other)
            };
            if meet {
                return Err(PolygonError::SidesMeet {
                    first: corners[first].0,
                    second: corners[second].0,
                });
            }
        }
    }
    Ok(())
}

/// Whether the path from `a` over `b` to `c` turns back on itself.
fn turns_back(a: Millimetres, b: Millimetres, c: Millimetres) -> bool {
    let (first, second) = (b - a, c - b);
    first.perp(&second) == 0 && first.dot(&second) < 0
}

/// Whether two sides have a point in common.
fn sides_meet(one: (Millimetres, Millimetres), other: (Millimetres, Millimetres)) -> bool {
    let side_of =
        |(a, b): (Millimetres, Millimetres), c: Millimetres| (b - a).perp(&(c - a)).signum();
    let is_on = |(a, b): (Millimetres, Millimetres), c: Millimetres| {
        side_of((a, b), c) == 0 && (a - c).dot(&(b - c)) <= 0
    };
    let crosses = side_of(one, other.0) * side_of(one, other.1) < 0
        && side_of(other, one.0) * side_of(other, one.1) < 0;
    crosses
        || is_on(one, other.0)
        || is_on(one, other.1)
        || is_on(other, one.0)
        || is_on(other, one.1)
}

/// Exact up to 1,000 km from home, where products of differences fit 64 bits.
#[expect(
    clippy::cast_possible_truncation,
    reason = "saturates, far beyond where missions are"
)]
fn to_millimetres(place: Ned) -> Millimetres {
    let within = |metres: f64| (metres.clamp(-1e6, 1e6) * 1_000.0).round() as i64;
    Vector2::new(within(place.north_m()), within(place.east_m()))
}
