//! The same map in smaller cells.

use super::{CELLS_MAX, Map, distance};

/// Size by which a cell may be too large by rounding, as a share.
const ROUNDING: f64 = 1e-9;

impl Map {
    /// The same map with each cell split into equal ones of at most `cell_m` metres, as far as [`CELLS_MAX`] allows. Costs a pass
    /// over the new map.
    #[must_use]
    pub fn split(&self, cell_m: f64) -> Self {
        let wanted = (self.resolution_m / cell_m - ROUNDING).ceil() as usize;
        let fits = |times: usize| self.states.len().saturating_mul(times * times) <= CELLS_MAX;
        // The largest map is 10 m a cell: few steps.
        let times = (1..=wanted).take_while(|times| fits(*times)).last();
        let times = times.unwrap_or(1);
        let (columns, rows) = (self.columns * times, self.rows * times);
        let resolution_m = self.resolution_m / times as f64;
        let from = |index: usize| {
            let (column, row) = (index % columns, index / columns);
            row / times * self.columns + column / times
        };
        let states: Vec<_> = (0..columns * rows)
            .map(|it| self.states[from(it)])
            .collect();
        let kept_out = (0..columns * rows).map(|it| self.kept_out[from(it)]);
        Self {
            columns,
            rows,
            resolution_m,
            kept_out: kept_out.collect(),
            distances_m: distance::metres(columns, rows, &states, resolution_m),
            states,
            ..self.clone()
        }
    }
}
