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

    fn is_free(&self, column: i64, row: i64) -> bool {
        match (usize::try_from(column), usize::try_from(row)) {
            (Ok(column), Ok(row)) => self.state(Cell { column, row }) == State::Free,
            _ => false,
        }
    }
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
