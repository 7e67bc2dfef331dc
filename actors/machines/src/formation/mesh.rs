use super::shape::Shape;

/// A point of a lattice of equilateral triangles: steps straight ahead, and steps a sixth of a turn right of that.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Hexagonal {
    ahead: i64,
    aslant: i64,
}

impl Hexagonal {
    /// The points of a ring, those nearest to the centre first, then from the left to the right.
    pub(super) fn ring(ring: i64) -> Vec<Self> {
        let mut points: Vec<Self> = (-ring..=ring)
            .flat_map(|ahead| (-ring..=ring).map(move |aslant| Self { ahead, aslant }))
            .filter(|point| point.rings_out() == ring)
            .collect();
        points.sort_by_key(|point| (point.distance_squared(), point.aslant, -point.ahead));
        points
    }

    fn rings_out(self) -> i64 {
        let third = self.ahead + self.aslant;
        self.ahead.abs().max(self.aslant.abs()).max(third.abs())
    }

    /// The squared distance from the centre, in steps.
    pub(super) const fn distance_squared(self) -> u64 {
        let Self { ahead, aslant } = self;
        (ahead * ahead + ahead * aslant + aslant * aslant).unsigned_abs()
    }

    /// Metres ahead and to the right.
    pub(super) fn place_m(self, spacing_m: f64) -> (f64, f64) {
        #[expect(
            clippy::cast_precision_loss,
            reason = "fewer steps than there are drones"
        )]
        let (ahead, aslant) = (self.ahead as f64, self.aslant as f64);
        let height = 3.0_f64.sqrt() / 2.0;
        (
            (ahead + aslant / 2.0) * spacing_m,
            aslant * height * spacing_m,
        )
    }
}

/// The centre first, hexagonal rings around it: every slot has up to six neighbours at the spacing.
pub(super) fn compact(drones: u32, spacing_m: f64) -> Shape {
    let points = (0..).flat_map(Hexagonal::ring).take(drones as usize);
    Shape::new(
        0,
        points.map(|point| (point.place_m(spacing_m), point.distance_squared())),
    )
}
