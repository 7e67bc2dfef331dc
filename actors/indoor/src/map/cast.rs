//! Rays through a map.

use super::{Cell, Map, State};
use crate::frames::MapXy;

impl Map {
    /// Metres from `point` in the direction `angle_rad` to the edge of the first cell that is not free; `None` if there is none
    /// within `max_m`. 0 if the point's own cell is not free. Outside of the map, nothing is free.
    ///
    /// Visits each cell on the way once. Source: J. Amanatides, A. Woo, "A fast voxel traversal algorithm for ray tracing",
    /// 1987.
    #[must_use]
    pub fn cast(&self, point: MapXy, angle_rad: f64, max_m: f64) -> Option<f64> {
        let angle_rad = angle_rad - self.origin().heading_rad;
        let (x, y) = self.in_cells(point);
        let mut along = Axis::new(x, libm::cos(angle_rad));
        let mut across = Axis::new(y, libm::sin(angle_rad));
        let max_cells = max_m / self.resolution_m();
        let mut travelled = 0.0;
        while self.is_free(along.cell, across.cell) {
            let nearer = if along.next <= across.next {
                &mut along
            } else {
                &mut across
            };
            travelled = nearer.step();
            if travelled > max_cells {
                return None;
            }
        }
        Some(travelled * self.resolution_m())
    }

    /// The cells that a straight leg passes through, with the length in each, in cells; `None` for a cell below the map's first
    /// row or column. A leg through a corner of four cells passes one of those beside it, for the length 0.
    pub(crate) fn cells_between(
        &self,
        from: MapXy,
        to: MapXy,
    ) -> impl Iterator<Item = (Option<Cell>, f64)> {
        let ((x1, y1), (x2, y2)) = (self.in_cells(from), self.in_cells(to));
        let length = libm::hypot(x2 - x1, y2 - y1);
        let share = |off: f64| if length > 0.0 { off / length } else { 0.0 };
        let mut along = Axis::new(x1, share(x2 - x1));
        let mut across = Axis::new(y1, share(y2 - y1));
        let mut travelled = Some(0.0);
        std::iter::from_fn(move || {
            let before = travelled?;
            let cell = cell(along.cell, across.cell);
            let nearer = if along.next <= across.next {
                &mut along
            } else {
                &mut across
            };
            let next = nearer.step();
            travelled = (next <= length).then_some(next);
            Some((cell, next.min(length) - before))
        })
    }

    fn is_free(&self, column: i64, row: i64) -> bool {
        cell(column, row).is_some_and(|cell| self.state(cell) == State::Free)
    }
}

/// The cell in a column and row; `None` below 0.
fn cell(column: i64, row: i64) -> Option<Cell> {
    Some(Cell {
        column: usize::try_from(column).ok()?,
        row: usize::try_from(row).ok()?,
    })
}

/// One coordinate of a point that moves along a ray, in cells.
struct Axis {
    cell: i64,
    step: i64,
    /// Travelled when the next cell is entered.
    next: f64,
    /// Travelled from cell to cell.
    pitch: f64,
}

impl Axis {
    fn new(at: f64, direction: f64) -> Self {
        let cell = libm::floor(at);
        let pitch = 1.0 / direction.abs();
        let to_edge = if direction > 0.0 {
            cell + 1.0 - at
        } else {
            at - cell
        };
        Self {
            cell: cell as i64,
            step: if direction > 0.0 { 1 } else { -1 },
            // A ray along the other axis never leaves its cell.
            next: if pitch.is_finite() {
                to_edge * pitch
            } else {
                f64::INFINITY
            },
            pitch,
        }
    }

    fn step(&mut self) -> f64 {
        let travelled = self.next;
        self.cell += self.step;
        self.next += self.pitch;
        travelled
    }
}
