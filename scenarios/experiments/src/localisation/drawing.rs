//! A map, a track and particles as SVG.

use std::fmt::Write;

use maud::{Markup, html};
use muster_indoor::frames::{MapPose, MapXy};
use muster_indoor::map::{Cell, Map, State};

/// Most blocks of cells along a side of a drawing.
const BLOCKS_MAX: usize = 800;
/// Longest bar of a scale, as a share of the map's width.
const SCALE_MAX: f64 = 0.3;
/// Margin about what is free, blocks.
const MARGIN: usize = 8;

/// A map reduced to blocks of cells, and the part of it that is drawn.
pub(super) struct Drawing<'a> {
    map: &'a Map,
    /// Cells along a block's edge.
    block: usize,
    columns: usize,
    rows: usize,
    free: String,
    occupied: String,
    /// Left, top, width and height in blocks.
    view: [usize; 4],
}

impl<'a> Drawing<'a> {
    pub(super) fn new(map: &'a Map) -> Self {
        let block = map.columns().max(map.rows()).div_ceil(BLOCKS_MAX).max(1);
        let (columns, rows) = (map.columns().div_ceil(block), map.rows().div_ceil(block));
        let mut drawing = Self {
            map,
            block,
            columns,
            rows,
            free: String::new(),
            occupied: String::new(),
            view: [0; 4],
        };
        drawing.free = drawing.runs(State::Free);
        drawing.occupied = drawing.runs(State::Occupied);
        drawing.view = drawing.view();
        drawing
    }

    /// Drawings share one copy of the map, which this is.
    pub(super) fn definition(&self) -> Markup {
        html! {
            svg width="0" height="0" aria-hidden="true" {
                defs {
                    g #map {
                        path.free d=(self.free) {}
                        path.occupied d=(self.occupied) {}
                    }
                }
            }
        }
    }

    /// The map with something on it.
    pub(super) fn with(&self, name: &str, content: &Markup) -> Markup {
        let [left, top, width, height] = self.view;
        html! {
            svg.floor role="img" aria-label=(name) viewBox={ (left) " " (top) " " (width) " " (height) } {
                use href="#map" {}
                (content)
            }
            (self.scale_bar())
        }
    }

    /// A bar of a round length below the map. It is no part of the picture, so that its text keeps its size.
    fn scale_bar(&self) -> Markup {
        let width_m = self.view[2] as f64 * self.map.resolution_m() * self.block as f64;
        let longest_m = width_m * SCALE_MAX;
        let power = 10_f64.powf(longest_m.log10().floor());
        let fits = |factor: &f64| factor * power <= longest_m;
        let length_m = [5.0, 2.0].into_iter().find(fits).unwrap_or(1.0) * power;
        let percent = 100.0 * length_m / width_m;
        html! {
            p.scale {
                span style={ "width: " (format!("{percent:.2}")) "%" } {}
                (length_m) " m"
            }
        }
    }

    /// A line through points; empty parts are left out.
    pub(super) fn line(&self, points: impl Iterator<Item = MapXy>) -> String {
        let mut path = String::new();
        for point in points {
            let (x, y) = self.place(point);
            let command = if path.is_empty() { 'M' } else { 'L' };
            write!(path, "{command}{x:.1} {y:.1}").expect("strings take all");
        }
        path
    }

    /// Dots at poses.
    pub(super) fn dots(&self, poses: &[MapPose]) -> String {
        let mut path = String::new();
        for pose in poses {
            let (x, y) = self.place(pose.at);
            write!(path, "M{x:.1} {y:.1}h0").expect("strings take all");
        }
        path
    }

    /// A point in blocks from the upper left corner, in the grid's own directions.
    fn place(&self, point: MapXy) -> (f64, f64) {
        let at = self.map.origin().sight(point);
        let scale = self.map.resolution_m() * self.block as f64;
        (at.x_m / scale, self.rows as f64 - at.y_m / scale)
    }

    fn state(&self, column: usize, row: usize) -> State {
        let cells = (0..self.block * self.block).map(|at| Cell {
            column: column * self.block + at % self.block,
            row: row * self.block + at / self.block,
        });
        let mut state = State::Unknown;
        for cell in cells {
            match self.map.state(cell) {
                State::Occupied => return State::Occupied,
                State::Free => state = State::Free,
                State::Unknown => {}
            }
        }
        state
    }

    /// Rows of equal blocks as rectangles.
    fn runs(&self, state: State) -> String {
        let mut path = String::new();
        for row in 0..self.rows {
            let y = self.rows - 1 - row;
            let mut column = 0;
            while column < self.columns {
                let is_of = |at: usize| at < self.columns && self.state(at, row) == state;
                let length = (column..).take_while(|at| is_of(*at)).count();
                if length > 0 {
                    write!(path, "M{column} {y}h{length}v1h-{length}z").expect("strings take all");
                }
                column += length + 1;
            }
        }
        path
    }

    /// What is free, with a margin.
    fn view(&self) -> [usize; 4] {
        let (mut left, mut right, mut low, mut high) = (self.columns, 0, self.rows, 0);
        for (row, column) in
            (0..self.rows).flat_map(|row| (0..self.columns).map(move |it| (row, it)))
        {
            if self.state(column, row) == State::Free {
                (left, right) = (left.min(column), right.max(column + 1));
                (low, high) = (low.min(row), high.max(row + 1));
            }
        }
        let left = left.saturating_sub(MARGIN);
        let top = (self.rows - high.min(self.rows)).saturating_sub(MARGIN);
        let right = (right + MARGIN).min(self.columns);
        let bottom = (self.rows - low.min(self.rows) + MARGIN).min(self.rows);
        [
            left,
            top,
            right.saturating_sub(left).max(1),
            bottom.saturating_sub(top).max(1),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn map_has_a_bar_of_a_round_length() {
        let room = |metres: usize| format!("{}\n", ".".repeat(metres)).repeat(4);
        for (metres, length, percent) in [
            (4, "1 m", "25.00"),
            (20, "5 m", "25.00"),
            (250, "50 m", "20.00"),
        ] {
            let map = Map::from_text(&room(metres), 1.0).unwrap();
            let picture = Drawing::new(&map).with("map", &html! {}).into_string();
            let (_, bar) = picture.split_once("class=\"scale\"").unwrap();
            assert!(bar.contains(&format!("width: {percent}%")), "{bar}");
            assert!(bar.contains(length), "{bar}");
        }
    }
}
