use super::shape::Shape;

/// A point of a lattice of equilateral triangles: steps ahead, and steps 60° to the right of that.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Hexagonal {
    ahead: i64,
    diagonal: i64,
}

impl Hexagonal {
    /// Points of a ring, nearest to the centre first, then from left to right.
    pub(super) fn ring(ring: i64) -> Vec<Self> {
        let mut points: Vec<Self> = (-ring..=ring)
            .flat_map(|ahead| (-ring..=ring).map(move |diagonal| Self { ahead, diagonal }))
            .filter(|point| point.ring_number() == ring)
            .collect();
        points.sort_by_key(|point| (point.distance_squared(), point.diagonal, -point.ahead));
        points
    }

    fn ring_number(self) -> i64 {
        let third = self.ahead + self.diagonal;
        self.ahead.abs().max(self.diagonal.abs()).max(third.abs())
    }

    /// Squared distance from the centre, in steps.
    pub(super) const fn distance_squared(self) -> u64 {
        let Self { ahead, diagonal } = self;
        (ahead * ahead + ahead * diagonal + diagonal * diagonal).unsigned_abs()
    }

    /// Metres ahead and to the right.
    pub(super) fn place_m(self, spacing_m: f64) -> (f64, f64) {
        #[expect(
            clippy::cast_precision_loss,
            reason = "fewer steps than there are drones"
        )]
        let (ahead, diagonal) = (self.ahead as f64, self.diagonal as f64);
        let height = 3.0_f64.sqrt() / 2.0;
        (
            (ahead + diagonal / 2.0) * spacing_m,
            diagonal * height * spacing_m,
        )
    }
}

/// Compact mesh: the centre first, then hexagonal rings. Each slot has up to six neighbours at the spacing.
pub(super) fn compact(drones: u32, spacing_m: f64) -> Shape {
    let points = (0..).flat_map(Hexagonal::ring).take(drones as usize);
    Shape::new(
        0,
        points.map(|point| (point.place_m(spacing_m), point.distance_squared())),
    )
}
