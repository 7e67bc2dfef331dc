use nalgebra::Vector2;
use thiserror::Error;

use crate::formation::crossings::to_point_m;
use crate::geometry::Ned;

/// An area whose sides don't meet but at the corners that they share; to the whole millimetre.
#[derive(Debug, Clone, PartialEq)]
pub struct Polygon {
    /// North and east of home, in metres; at least three.
    corners: Vec<Vector2<f64>>,
}

/// Corners that enclose no area, or not one. They are counted from 0; side `n` begins at corner `n`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum PolygonError {
    /// There are fewer than three different ones.
    #[error("{corners} different corners enclose nothing")]
    TooFewCorners {
        /// How many.
        corners: usize,
    },
    /// Two sides cross, touch, or lie on each other.
    #[error("the side from corner {first} meets the side from corner {second}")]
    SidesMeet {
        /// Where the one begins.
        first: usize,
        /// Where the other one begins.
        second: usize,
    },
}

type Millimetres = Vector2<i64>;

impl Polygon {
    /// The polygon of these corners, in order either way round; their heights don't matter. A corner that is where the one
    /// before it is, to the millimetre, counts as one with it; so does a last one that is where the first is.
    ///
    /// # Errors
    /// When they enclose nothing, or their sides meet. It takes time with the square of their number.
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

    /// Its corners, in metres north and east of home.
    pub fn corners(&self) -> impl ExactSizeIterator<Item = Ned> {
        let corners = self.corners.iter();
        corners.map(|corner| Ned::new(corner.x, corner.y, 0.0))
    }

    fn sides(&self) -> impl Iterator<Item = (Vector2<f64>, Vector2<f64>)> {
        let next = self.corners.iter().cycle().skip(1);
        self.corners.iter().copied().zip(next.copied())
    }

    /// How far a place is within it, in metres; negative outside.
    pub(super) fn depth_m(&self, place: Vector2<f64>) -> f64 {
        let mut is_within = false;
        let mut nearest_m = f64::INFINITY;
        for (from, to) in self.sides() {
            // A line north from the place crosses an odd number of sides if it is inside.
            if (from.y > place.y) != (to.y > place.y) {
                let share = (place.y - from.y) / (to.y - from.y);
                is_within ^= from.x + share * (to.x - from.x) > place.x;
            }
            nearest_m = nearest_m.min(to_point_m((from, to), place));
        }
        if is_within { nearest_m } else { -nearest_m }
    }

    /// How far a straight way is from the sides at the closest, in metres; 0 if it crosses one.
    pub(super) fn to_path_m(&self, path: (Vector2<f64>, Vector2<f64>)) -> f64 {
        let apart_m = self.sides().map(|side| apart_m(side, path));
        apart_m.fold(f64::INFINITY, f64::min)
    }
}

/// How far two straight ways are apart at the closest, in metres.
fn apart_m(one: (Vector2<f64>, Vector2<f64>), other: (Vector2<f64>, Vector2<f64>)) -> f64 {
    let are_parted = |(from, to): (Vector2<f64>, Vector2<f64>), (a, b)| {
        let along = to - from;
        along.perp(&(a - from)) * along.perp(&(b - from)) >= 0.0
    };
    if !are_parted(one, other) && !are_parted(other, one) {
        return 0.0;
    }
    let from_ends = [
        to_point_m(one, other.0),
        to_point_m(one, other.1),
        to_point_m(other, one.0),
        to_point_m(other, one.1),
    ];
    from_ends.into_iter().fold(f64::INFINITY, f64::min)
}

/// Whether no two sides meet but where they follow each other. The corners are different from their neighbours.
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

/// Whether who comes from `a` to `b` goes back the same way to `c`.
fn turns_back(a: Millimetres, b: Millimetres, c: Millimetres) -> bool {
    let (to, on) = (b - a, c - b);
    to.perp(&on) == 0 && to.dot(&on) < 0
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

/// Exact where products of differences fit 64 bits: 1,000 km from home.
#[expect(
    clippy::cast_possible_truncation,
    reason = "saturates, far beyond where missions are"
)]
fn to_millimetres(place: Ned) -> Millimetres {
    let within = |metres: f64| (metres.clamp(-1e6, 1e6) * 1_000.0).round() as i64;
    Vector2::new(within(place.north_m()), within(place.east_m()))
}
