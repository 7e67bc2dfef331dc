//! Maps of buildings: grids of cells that are free, occupied or unknown.
//!
//! A map is made of a text ([`Header`]) and an image, as ROS's map_server has them, or of a plan drawn as text. It holds at
//! most [`CELLS_MAX`] cells. Distances to the nearest occupied cell are computed once.

mod cast;
mod distance;
mod header;
mod image;
mod place;
mod plan;
mod split;
#[cfg(test)]
mod tests;
mod yaml;
mod zone;

use crate::digest;
use crate::frames::{MapPose, MapXy};
use crate::refusal::Refusal;
use header::Source;
pub use header::{CORNERS_MAX, Header, Mode, TEXT_SIZE_MAX, ZONES_MAX, Zone};
pub use image::{IMAGE_SIZE_MAX, ImageError};
use place::Place;

/// Most cells of a map: 100 m × 100 m at 5 cm.
pub const CELLS_MAX: usize = 4_000_000;

/// Length by which a distance may be too short by rounding, in cells.
const ROUNDING_CELLS: f64 = 1e-9;

/// What is known of a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// A drone can be there.
    Free,
    /// A wall or a thing.
    Occupied,
    /// Nothing is known, as behind walls.
    Unknown,
}

/// A cell of a map. Columns grow along the map's x axis and rows along its y axis, both from 0; row 0 is the image's last.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Cell {
    /// From the left.
    pub column: usize,
    /// From the bottom.
    pub row: usize,
}

/// A grid of cells and where it lies in the map's frame.
#[derive(Debug, Clone)]
pub struct Map {
    columns: usize,
    rows: usize,
    resolution_m: f64,
    origin: MapPose,
    /// Sine and cosine of the origin's heading.
    turn: (f64, f64),
    states: Vec<State>,
    kept_out: Vec<bool>,
    /// Metres from each cell's centre to the centre of the nearest occupied one.
    distances_m: Vec<f32>,
}

/// Why a map can't be made of its text and image.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MapError {
    /// The text is at fault.
    #[error(transparent)]
    Text(#[from] Refusal),
    /// The image is at fault.
    #[error(transparent)]
    Image(#[from] ImageError),
}

impl Map {
    /// The map that a text draws, or that it describes together with an image. `image` is the content of the file that
    /// [`Header::image`] names, and is not looked at if the text draws the map.
    ///
    /// # Errors
    /// If the plan or the image can't be used, or a zone that is not to be entered lies outside of the map.
    pub fn parse(header: &Header, image: &[u8]) -> Result<Self, MapError> {
        let grid = match &header.source {
            Source::Image(_) => plan::of_image(header, &image::decode(image)?),
            Source::Plan { text, cells, place } => plan::of_text(text, *cells, place)?,
        };
        Ok(Self::new(header, grid)?)
    }

    /// A plan drawn as text, one cell of `resolution_m` for a character: `#` occupied, `.` free, `x` free but not to be
    /// entered, a space or `?` unknown. The lower left corner is the frame's origin. Lines may differ in length.
    ///
    /// # Errors
    /// If the plan has another character, no cell, or too many.
    ///
    /// # Examples
    /// ```
    /// use muster_indoor::frames::MapXy;
    /// use muster_indoor::map::Map;
    /// let map = Map::from_text("#####\n#...#\n#####", 0.5).unwrap();
    /// assert_eq!(map.cast(MapXy::new(0.75, 0.75), 0.0, 4.0), Some(1.25));
    /// ```
    pub fn from_text(plan: &str, resolution_m: f64) -> Result<Self, Refusal> {
        let grid = plan::of_text(plan, 1, &Place::of_all(plan))?;
        Self::new(&Header::of_plan(resolution_m), grid)
    }

    fn new(header: &Header, grid: plan::Grid) -> Result<Self, Refusal> {
        let plan::Grid {
            columns,
            rows,
            states,
            kept_out,
        } = grid;
        let yaw_rad = header.origin.heading_rad;
        let mut map = Self {
            columns,
            rows,
            resolution_m: header.resolution_m,
            origin: header.origin,
            turn: (libm::sin(yaw_rad), libm::cos(yaw_rad)),
            distances_m: distance::metres(columns, rows, &states, header.resolution_m),
            states,
            kept_out,
        };
        for zone in &header.keep_out {
            map.keep_out(zone)?;
        }
        Ok(map)
    }

    /// Cells along the x axis.
    #[must_use]
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Cells along the y axis.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Metres along a cell's edge.
    #[must_use]
    pub fn resolution_m(&self) -> f64 {
        self.resolution_m
    }

    /// The lower left corner of the cell (0, 0), and the direction of rows.
    #[must_use]
    pub fn origin(&self) -> MapPose {
        self.origin
    }

    /// The cell at a point; `None` outside of the map.
    #[must_use]
    pub fn cell(&self, point: MapXy) -> Option<Cell> {
        let (column, row) = self.in_cells(point);
        let is_inside = |at: f64, cells: usize| at >= 0.0 && at < cells as f64;
        let is_inside = is_inside(column, self.columns) && is_inside(row, self.rows);
        is_inside.then_some(Cell {
            column: column as usize,
            row: row as usize,
        })
    }

    /// The point at a cell's centre.
    #[must_use]
    pub fn centre(&self, cell: Cell) -> MapXy {
        let (sin, cos) = self.turn;
        let along = (cell.column as f64 + 0.5) * self.resolution_m;
        let across = (cell.row as f64 + 0.5) * self.resolution_m;
        MapXy::new(
            self.origin.at.x_m + cos * along - sin * across,
            self.origin.at.y_m + sin * along + cos * across,
        )
    }

    /// All cells, row by row from the bottom.
    pub fn cells(&self) -> impl Iterator<Item = Cell> + use<> {
        let columns = self.columns;
        (0..columns * self.rows).map(move |index| Cell {
            column: index % columns,
            row: index / columns,
        })
    }

    /// What is known of a cell; [`State::Unknown`] outside of the map.
    #[must_use]
    pub fn state(&self, cell: Cell) -> State {
        self.index(cell)
            .map_or(State::Unknown, |index| self.states[index])
    }

    /// Whether a cell lies in a zone that is not to be entered.
    #[must_use]
    pub fn is_kept_out(&self, cell: Cell) -> bool {
        self.index(cell).is_some_and(|index| self.kept_out[index])
    }

    /// The same map without zones that are not to be entered.
    #[must_use]
    pub fn without_zones(&self) -> Self {
        Self {
            kept_out: vec![false; self.kept_out.len()],
            ..self.clone()
        }
    }

    /// A digest of the cells, the zones, and where they lie. Costs one pass over the map.
    #[must_use]
    pub fn digest(&self) -> u64 {
        let place = [
            self.resolution_m,
            self.origin.at.x_m,
            self.origin.at.y_m,
            self.origin.heading_rad,
        ];
        let size = [self.columns as u64, self.rows as u64];
        let words = place.into_iter().map(f64::to_bits).chain(size);
        let cells = self.states.iter().zip(&self.kept_out);
        let cells = cells.map(|(state, kept_out)| *state as u64 * 2 + u64::from(*kept_out));
        words.chain(cells).fold(digest::EMPTY, digest::with_word)
    }

    /// Metres to the centre of the nearest occupied cell, from the centre of the point's cell. Infinite outside of the map and
    /// without any occupied cell.
    #[must_use]
    pub fn distance_m(&self, point: MapXy) -> f64 {
        let index = self.cell(point).and_then(|cell| self.index(cell));
        index.map_or(f64::INFINITY, |index| f64::from(self.distances_m[index]))
    }

    /// Which cells the centre of a drone of this radius can't be in, row by row from the bottom: those with a point less than
    /// `radius_m` from a cell that is occupied, unknown, kept out or outside of the map, and such cells themselves. Costs two passes
    /// over the map.
    #[must_use]
    pub fn inflated(&self, radius_m: f64) -> Vec<bool> {
        let is_blocked = |cell: usize| self.states[cell] != State::Free || self.kept_out[cell];
        let radius_cells = radius_m / self.resolution_m - ROUNDING_CELLS;
        // The gap between two cells is the distance of one from the nearest of the nine cells about the other.
        let is_beside = |index: usize| {
            let (column, row) = (index % self.columns, index / self.columns);
            let rows = row.saturating_sub(1)..(row + 2).min(self.rows);
            rows.into_iter().any(|row| {
                let columns = column.saturating_sub(1)..(column + 2).min(self.columns);
                columns
                    .into_iter()
                    .any(|column| is_blocked(row * self.columns + column))
            })
        };
        let squared = distance::squared_cells(self.columns, self.rows, is_beside);
        let near = squared.into_iter().zip(self.cells()).enumerate();
        let is_near = |(index, (squared, cell)): (usize, (u32, Cell))| {
            let sides = [
                cell.column,
                cell.row,
                self.columns - 1 - cell.column,
                self.rows - 1 - cell.row,
            ];
            let edge = sides.into_iter().min().unwrap_or(0) as f64;
            let gap = f64::from(squared).sqrt().min(edge);
            is_blocked(index) || gap < radius_cells
        };
        near.map(is_near).collect()
    }

    /// A cell's place in row-by-row order from the bottom; `None` outside of the map.
    #[must_use]
    pub fn index(&self, cell: Cell) -> Option<usize> {
        let is_inside = cell.column < self.columns && cell.row < self.rows;
        is_inside.then(|| cell.row * self.columns + cell.column)
    }

    /// A point in cells from the lower left corner.
    fn in_cells(&self, point: MapXy) -> (f64, f64) {
        let (sin, cos) = self.turn;
        let (dx, dy) = (
            point.x_m - self.origin.at.x_m,
            point.y_m - self.origin.at.y_m,
        );
        let along = cos * dx + sin * dy;
        let across = cos * dy - sin * dx;
        (along / self.resolution_m, across / self.resolution_m)
    }
}
