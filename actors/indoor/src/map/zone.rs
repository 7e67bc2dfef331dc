//! Zones that are not to be entered.

use super::Map;
use crate::frames::MapXy;

impl Map {
    /// Marks the cells with their centre inside of a polygon. Its sides may cross: what an odd number of them separates from
    /// outside is inside.
    pub(super) fn keep_out(&mut self, corners: &[MapXy]) {
        let corners: Vec<(f64, f64)> = corners.iter().map(|it| self.in_cells(*it)).collect();
        for row in 0..self.rows {
            let y = row as f64 + 0.5;
            let mut crossings: Vec<f64> = Vec::new();
            for (index, (x1, y1)) in corners.iter().enumerate() {
                let (x2, y2) = corners[(index + 1) % corners.len()];
                if (*y1 <= y) != (y2 <= y) {
                    crossings.push(x1 + (y - y1) / (y2 - y1) * (x2 - x1));
                }
            }
            crossings.sort_by(f64::total_cmp);
            for pair in crossings.chunks_exact(2) {
                // Casts of negative numbers give 0.
                let from = libm::ceil(pair[0] - 0.5) as usize;
                let to = (libm::floor(pair[1] - 0.5) + 1.0) as usize;
                let (from, to) = (from.min(self.columns), to.min(self.columns));
                if from < to {
                    self.kept_out[row * self.columns + from..row * self.columns + to].fill(true);
                }
            }
        }
    }
}
