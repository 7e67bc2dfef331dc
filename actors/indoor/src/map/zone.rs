//! Zones that are not to be entered.

use std::ops::Range;

use super::{Map, Zone};
use crate::refusal::Refusal;

/// Length by which a side may reach into a cell by rounding, in cells.
const ROUNDING_CELLS: f64 = 1e-6;

/// A side of a polygon: its ends, in cells.
type Side = ((f64, f64), (f64, f64));

impl Map {
    /// Marks the cells that a polygon touches: those with their centre inside of it, and those that a side passes through.
    ///
    /// # Errors
    /// If there is none.
    pub(super) fn keep_out(&mut self, zone: &Zone) -> Result<(), Refusal> {
        let corners = zone.corners.iter().map(|it| self.in_cells(*it));
        let corners: Vec<(f64, f64)> = corners.collect();
        let ends = corners.iter().copied().cycle().skip(1);
        let sides: Vec<_> = corners.iter().copied().zip(ends).collect();
        let mut has_marked = false;
        for row in 0..self.rows {
            for columns in inside(&sides, row as f64 + 0.5) {
                has_marked |= self.mark(row, columns);
            }
            for side in &sides {
                if let Some(columns) = passed(*side, row as f64) {
                    has_marked |= self.mark(row, columns);
                }
            }
        }
        if has_marked {
            return Ok(());
        }
        let message = "this zone marks no cell: it lies outside of the map";
        let accepted = "corners in metres of the map's frame, about a part of the map";
        Err(Refusal::new(zone.span.clone(), message, accepted))
    }

    /// Marks cells of a row; whether there is any.
    fn mark(&mut self, row: usize, columns: Range<usize>) -> bool {
        let (from, to) = (
            columns.start.min(self.columns),
            columns.end.min(self.columns),
        );
        let is_any = from < to;
        if is_any {
            self.kept_out[row * self.columns + from..row * self.columns + to].fill(true);
        }
        is_any
    }
}

/// The columns with their centre inside of a polygon, at a height `y`.
fn inside(sides: &[Side], y: f64) -> Vec<Range<usize>> {
    let mut crossings: Vec<f64> = Vec::new();
    for ((x1, y1), (x2, y2)) in sides {
        if (*y1 <= y) != (*y2 <= y) {
            crossings.push(x1 + (y - y1) / (y2 - y1) * (x2 - x1));
        }
    }
    crossings.sort_by(f64::total_cmp);
    let pairs = crossings.chunks_exact(2);
    // Casts of negative numbers give 0.
    let columns = pairs.map(|pair| {
        let from = libm::ceil(pair[0] - 0.5) as usize;
        from..(libm::floor(pair[1] - 0.5) + 1.0) as usize
    });
    columns.collect()
}

/// The columns that a side passes through in the row above the height `y`; `None` if it doesn't pass the row.
fn passed(((x1, y1), (x2, y2)): Side, y: f64) -> Option<Range<usize>> {
    let (low, high) = (y + ROUNDING_CELLS, y + 1.0 - ROUNDING_CELLS);
    if y1.max(y2) <= low || y1.min(y2) >= high {
        return None;
    }
    let at = |y: f64| x1 + ((y - y1) / (y2 - y1)).clamp(0.0, 1.0) * (x2 - x1);
    let is_level = (y2 - y1).abs() < ROUNDING_CELLS;
    let (from, to) = if is_level {
        (x1, x2)
    } else {
        (at(low), at(high))
    };
    // Casts of negative numbers give 0.
    let first = libm::floor(from.min(to) + ROUNDING_CELLS) as usize;
    let end = libm::ceil(from.max(to) - ROUNDING_CELLS) as usize;
    Some(first..end)
}
