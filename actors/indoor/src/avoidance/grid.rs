//! The certainty grid: how sure it is that something is near, in cells that move with the drone.

use std::ops::Range;

/// Edge of a cell, in metres (indoor thesis, Cartesian Histogram Grid).
pub const CELL_M: f64 = 0.05;
/// Cells a side: the 80 of the indoor thesis, and the drone's own in the middle.
pub const SIDE: usize = 81;
/// Cells from the drone to the edge.
pub(super) const REACH: i64 = SIDE as i64 / 2;
/// Index of the drone's own cell.
const OWN: usize = SIDE * SIDE / 2;
/// Highest certainty of a cell (Borenstein and Koren, histogramic in-motion mapping, 1991).
pub const CERTAINTY_MAX: u8 = 15;
/// What an echo adds to a cell (same source).
const RAISE: u8 = 3;
/// What an echo from farther away takes from a cell. The same source takes 1 from the cells on the axis only: then who walks on
/// blocks the way for up to 7 s.
const LOWER: u8 = 3;
/// What time takes from a cell.
const FADE: u8 = 1;

/// Certainties of obstacles around the drone, in a frame whose axes don't turn with the drone.
///
/// The drone is in the middle cell. Cells that enter as it moves are empty; cells that leave are forgotten. 6.6 kB.
#[derive(Debug, Clone)]
pub struct CertaintyGrid {
    /// The drone's cell, counted from the frame's origin.
    centre: (i64, i64),
    /// Row by row from the lowest y, each from the lowest x.
    cells: Vec<u8>,
}

impl CertaintyGrid {
    /// An empty grid around a position, in metres.
    #[must_use]
    pub fn new((x_m, y_m): (f64, f64)) -> Self {
        Self {
            centre: cell_of(x_m, y_m),
            cells: vec![0; SIDE * SIDE],
        }
    }

    /// Moves the window to the drone's position, in metres. Cells keep their places in the frame.
    pub fn move_to(&mut self, (x_m, y_m): (f64, f64)) {
        let centre = cell_of(x_m, y_m);
        let (dx, dy) = (centre.0 - self.centre.0, centre.1 - self.centre.1);
        if (dx, dy) == (0, 0) {
            return;
        }
        let old = std::mem::replace(&mut self.cells, vec![0; SIDE * SIDE]);
        for row in -REACH..=REACH {
            for column in -REACH..=REACH {
                if let Some(index) = index_of(column + dx, row + dy)
                    && let Some(to) = index_of(column, row)
                {
                    self.cells[to] = old[index];
                }
            }
        }
        self.centre = centre;
    }

    /// Raises the cell at a position in metres: an echo came from there. Positions outside are ignored.
    pub fn raise(&mut self, (x_m, y_m): (f64, f64)) {
        if let Some(index) = self.index_at(x_m, y_m) {
            self.cells[index] = (self.cells[index] + RAISE).min(CERTAINTY_MAX);
        }
    }

    /// Marks the cell at a position in metres as certain: the map has a wall there. Positions outside are ignored.
    pub fn mark(&mut self, (x_m, y_m): (f64, f64)) {
        if let Some(index) = self.index_at(x_m, y_m) {
            self.cells[index] = CERTAINTY_MAX;
        }
    }

    /// Lowers the cells in a cone around a bearing that are nearer than `to_m`: an echo came from behind them. A sonar hears what
    /// is nearest in its cone, so nothing is left there. Cells at the echo's own distance stay.
    pub fn lower_cone(&mut self, (bearing_rad, aperture_rad): (f64, f64), to_m: f64) {
        let (cos, sin) = (libm::cos(bearing_rad), libm::sin(bearing_rad));
        let cos_edge = libm::cos(aperture_rad / 2.0);
        for index in rows_near(to_m).flatten() {
            // As in `occupied`, the drone's own cell is left out.
            if self.cells[index] == 0 || index == OWN {
                continue;
            }
            let (x_m, y_m) = offset_m(index);
            let distance_m = libm::hypot(x_m, y_m);
            let is_inside = x_m * cos + y_m * sin >= cos_edge * distance_m;
            if is_inside && distance_m < to_m - CELL_M {
                self.cells[index] = self.cells[index].saturating_sub(LOWER);
            }
        }
    }

    /// Lowers all cells by one: what was not heard again may have gone.
    pub fn fade(&mut self) {
        for cell in &mut self.cells {
            *cell = cell.saturating_sub(FADE);
        }
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.cells.fill(0);
    }

    /// The certainty at a position in metres; 0 outside.
    #[must_use]
    pub fn certainty(&self, (x_m, y_m): (f64, f64)) -> u8 {
        self.index_at(x_m, y_m).map_or(0, |index| self.cells[index])
    }

    /// The cells with any certainty: index and certainty. The drone's own has no direction, and is left out.
    pub(super) fn occupied(&self) -> impl Iterator<Item = (usize, u8)> + '_ {
        with_certainty(&self.cells, 0)
    }

    /// Calls `visit` with each cell of [`Self::occupied`] in the square that reaches `reach_m` from the drone.
    pub(super) fn visit_near(&self, reach_m: f64, mut visit: impl FnMut(usize, u8)) {
        let mut visit_all = |cells: Range<usize>| {
            let first = cells.start;
            with_certainty(&self.cells[cells], first)
                .for_each(|(index, certainty)| visit(index, certainty));
        };
        if reach_cells(reach_m) == REACH {
            return visit_all(0..SIDE * SIDE);
        }
        rows_near(reach_m).for_each(visit_all);
    }

    fn index_at(&self, x_m: f64, y_m: f64) -> Option<usize> {
        let (x, y) = cell_of(x_m, y_m);
        index_of(x - self.centre.0, y - self.centre.1)
    }
}

/// Cells from the drone to the edge of a square that reaches `reach_m` from it.
fn reach_cells(reach_m: f64) -> i64 {
    ((reach_m / CELL_M).ceil() as i64).clamp(0, REACH)
}

/// The indices of the cells of that square, row by row.
fn rows_near(reach_m: f64) -> impl Iterator<Item = Range<usize>> {
    let reach = reach_cells(reach_m);
    let (from, end) = ((REACH - reach) as usize, (REACH + reach + 1) as usize);
    (from..end).map(move |row| row * SIDE + from..row * SIDE + end)
}

/// The cells that are not 0, from index `first` on, without the drone's own; eight empty ones cost one comparison.
fn with_certainty(cells: &[u8], first: usize) -> impl Iterator<Item = (usize, u8)> + '_ {
    let (chunks, rest) = cells.as_chunks::<8>();
    let at_end = (first + chunks.len() * 8..).zip(rest.iter().copied());
    let in_chunks = chunks
        .iter()
        .zip((first..).step_by(8))
        .filter(|(chunk, _)| u64::from_ne_bytes(**chunk) != 0)
        .flat_map(|(chunk, at)| (at..).zip(chunk.iter().copied()));
    in_chunks
        .chain(at_end)
        .filter(|(index, certainty)| *certainty > 0 && *index != OWN)
}

fn cell_of(x_m: f64, y_m: f64) -> (i64, i64) {
    ((x_m / CELL_M).floor() as i64, (y_m / CELL_M).floor() as i64)
}

/// The index of a cell by its offset from the drone's, in cells.
fn index_of(column: i64, row: i64) -> Option<usize> {
    let inside = column.abs() <= REACH && row.abs() <= REACH;
    inside.then(|| ((row + REACH) as usize) * SIDE + (column + REACH) as usize)
}

/// Offset of a cell from the drone's cell, in metres.
pub(super) fn offset_m(index: usize) -> (f64, f64) {
    let (row, column) = ((index / SIDE) as i64, (index % SIDE) as i64);
    (
        (column - REACH) as f64 * CELL_M,
        (row - REACH) as f64 * CELL_M,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_keep_their_place_while_the_window_moves() {
        let mut grid = CertaintyGrid::new((0.01, 0.01));
        grid.raise((1.02, 0.52));
        for _ in 0..2 {
            grid.move_to((0.73, -0.4));
            assert_eq!(grid.certainty((1.02, 0.52)), RAISE);
            assert_eq!(grid.occupied().count(), 1);
            grid.move_to((0.01, 0.01));
        }
        grid.move_to((-1.2, 0.01));
        grid.move_to((0.01, 0.01));
        assert_eq!(grid.certainty((1.02, 0.52)), 0);
    }

    #[test]
    fn an_echo_raises_one_cell_and_lowers_those_before_it_in_its_cone() {
        let mut grid = CertaintyGrid::new((0.025, 0.025));
        for _ in 0..10 {
            grid.raise((1.025, 0.025));
        }
        assert_eq!(grid.certainty((1.025, 0.025)), CERTAINTY_MAX);
        let lowered = |grid: &CertaintyGrid| CERTAINTY_MAX - grid.certainty((1.025, 0.025));
        for (bearing_rad, aperture_rad, to_m, after) in [
            (0.0, 0.5, 1.0, 0),
            (0.0, 0.5, 1.5, 1),
            (0.6, 0.5, 1.5, 1),
            (0.2, 0.5, 1.5, 2),
        ] {
            grid.lower_cone((bearing_rad, aperture_rad), to_m);
            assert_eq!(lowered(&grid), after * LOWER, "{bearing_rad}, {to_m}");
        }
    }
}
