//! Which paths may come near each other, so that not every pair of drones needs a check.

use std::collections::BTreeMap;

use muster_machines::time::Timestamp;
use nalgebra::{Vector2, Vector3};

use muster_machines::motion::Motion;

/// Width of a cell in metres: a few times the distance between drones of a swarm.
const CELL_M: f64 = 256.0;
/// A path through more cells than this counts as near every drone.
const CELLS_MAX: i64 = 64;

/// A horizontal bounding box of each drone's path, and an index of them.
///
/// Invariant: each box that was placed is in all cells that it touches, or in `everywhere` if they are too many.
#[derive(Debug)]
pub(super) struct Nearby {
    boxes: Vec<Extent>,
    cells: BTreeMap<(i64, i64), Vec<u32>>,
    /// Drones that may come near every other.
    everywhere: Vec<u32>,
}

/// A horizontal box, from its lowest to its highest corner, in metres.
#[derive(Debug, Clone, Copy)]
struct Extent {
    low: Vector2<f64>,
    high: Vector2<f64>,
}

impl Extent {
    /// The bounding box of a path from `from` on, however late it is flown.
    fn of(motion: &Motion, from: Timestamp) -> Self {
        let at = |place: Vector3<f64>| Self {
            low: place.xy(),
            high: place.xy(),
        };
        let mut extent = at(motion.position(from).0);
        for piece in motion.pieces().iter().rev() {
            if piece.end < from {
                break;
            }
            for corner in piece.corners() {
                extent = extent.with(at(corner));
            }
        }
        extent
    }

    fn with(self, other: Self) -> Self {
        Self {
            low: self.low.inf(&other.low),
            high: self.high.sup(&other.high),
        }
    }

    fn grown(self, by_m: f64) -> Self {
        let by = Vector2::repeat(by_m);
        Self {
            low: self.low - by,
            high: self.high + by,
        }
    }

    fn touches(&self, other: &Self) -> bool {
        self.low.x <= other.high.x
            && other.low.x <= self.high.x
            && self.low.y <= other.high.y
            && other.low.y <= self.high.y
    }

    /// The first and the last cell along each axis; `None` if it touches more than [`CELLS_MAX`].
    #[expect(
        clippy::cast_possible_truncation,
        reason = "coordinates beyond 2^63 cells saturate"
    )]
    fn cells(&self) -> Option<[(i64, i64); 2]> {
        let index = |metres: f64| (metres / CELL_M).floor() as i64;
        let (x, y) = (
            (index(self.low.x), index(self.high.x)),
            (index(self.low.y), index(self.high.y)),
        );
        let wide = |(low, high): (i64, i64)| high.saturating_sub(low).saturating_add(1);
        (wide(x).saturating_mul(wide(y)) <= CELLS_MAX).then_some([x, y])
    }
}

impl Nearby {
    /// For this many drones, without paths.
    pub(super) fn new(drones: usize) -> Self {
        let nowhere = Extent {
            low: Vector2::repeat(f64::INFINITY),
            high: Vector2::repeat(f64::NEG_INFINITY),
        };
        Self {
            boxes: vec![nowhere; drones],
            cells: BTreeMap::new(),
            everywhere: Vec::new(),
        }
    }

    /// Sets a drone's path from `from` on.
    pub(super) fn place(&mut self, drone: usize, motion: &Motion, from: Timestamp) {
        let (before, after) = (self.boxes[drone], Extent::of(motion, from));
        self.boxes[drone] = after;
        let id = u32::try_from(drone).expect("drones are numbered by 32 bits");
        if before.low.x <= before.high.x {
            self.each_cell(before, |cell| cell.retain(|it| *it != id));
        }
        self.each_cell(after, |cell| cell.push(id));
    }

    fn each_cell(&mut self, extent: Extent, mut change: impl FnMut(&mut Vec<u32>)) {
        let Some([x, y]) = extent.cells() else {
            return change(&mut self.everywhere);
        };
        for row in x.0..=x.1 {
            for column in y.0..=y.1 {
                change(self.cells.entry((row, column)).or_default());
            }
        }
    }

    /// Overwrites `found` with the drones, lowest first, whose paths may come within `near_m` metres of this one's.
    pub(super) fn of(&self, drone: usize, near_m: f64, found: &mut Vec<u32>) {
        found.clear();
        let around = self.boxes[drone].grown(near_m);
        let Some([x, y]) = around.cells() else {
            found.extend((0..).take(self.boxes.len()));
            found.retain(|it| *it as usize != drone && self.boxes[*it as usize].touches(&around));
            return;
        };
        found.extend_from_slice(&self.everywhere);
        for row in x.0..=x.1 {
            for (_, cell) in self.cells.range((row, y.0)..=(row, y.1)) {
                found.extend_from_slice(cell);
            }
        }
        found.retain(|it| *it as usize != drone && self.boxes[*it as usize].touches(&around));
        found.sort_unstable();
        found.dedup();
    }
}
