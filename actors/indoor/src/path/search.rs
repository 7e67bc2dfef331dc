//! A* that can be paused: a step of a drone's machine may not take as long as a search over a large floor.
//!
//! Source: P. Hart, N. Nilsson, B. Raphael, "A formal basis for the heuristic determination of minimum cost paths", 1968.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::floor::Floor;
use super::{DIAGONAL, STRAIGHT};
use crate::frames::MapXy;
use crate::map::Cell;

/// The neighbours of a cell: columns, rows, cost.
const NEIGHBOURS: [(i64, i64, u32); 8] = [
    (1, 0, STRAIGHT),
    (0, 1, STRAIGHT),
    (-1, 0, STRAIGHT),
    (0, -1, STRAIGHT),
    (1, 1, DIAGONAL),
    (-1, 1, DIAGONAL),
    (-1, -1, DIAGONAL),
    (1, -1, DIAGONAL),
];

/// A search for the cheapest path between two cells of a floor. Memory: 5 bytes a cell of the map.
#[derive(Debug, Clone)]
pub struct Search {
    start: Cell,
    goal: Cell,
    /// Where the path begins and ends, in these cells.
    ends: (MapXy, MapXy),
    columns: i64,
    rows: i64,
    /// Cells to expand, by the least cost of a path through them; index of the cell in the low half.
    open: BinaryHeap<Reverse<u64>>,
    /// Least cost found of a path to each cell, plus 1; 0 if there is none yet.
    reached: Vec<u32>,
    /// The neighbour that each cell was reached by: its place in [`NEIGHBOURS`].
    by: Vec<u8>,
}

/// The state of a search.
#[derive(Debug, Clone, PartialEq)]
pub enum Found {
    /// The search needs more work.
    NotYet,
    /// There is no path.
    Nothing,
    /// The path, as corners of straight legs: the first is the start, the last the goal.
    Path(Vec<MapXy>),
}

impl Search {
    /// A search from the centre of one cell to that of another of a floor. Either may be a cell where the drone can't be; then
    /// there is no path.
    #[must_use]
    pub fn new(floor: &Floor, start: Cell, goal: Cell) -> Self {
        let map = floor.map();
        let mut search = Self {
            start,
            goal,
            ends: (map.centre(start), map.centre(goal)),
            columns: map.columns() as i64,
            rows: map.rows() as i64,
            open: BinaryHeap::new(),
            reached: vec![0; floor.costs().len()],
            by: vec![0; floor.costs().len()],
        };
        let ends = map.index(start).zip(map.index(goal));
        if let Some((at, to)) = ends
            && floor.costs()[at] > 0
            && floor.costs()[to] > 0
        {
            search.reached[at] = 1;
            search.open.push(Reverse(at as u64));
        }
        search
    }

    /// Expands at most `cells_max` cells.
    ///
    /// `floor` is the one that the search was made for.
    pub fn advance(&mut self, floor: &Floor, cells_max: usize) -> Found {
        let costs = floor.costs();
        let goal = self.index(self.goal);
        for _ in 0..cells_max {
            let Some(Reverse(entry)) = self.open.pop() else {
                return Found::Nothing;
            };
            let at = (entry & u64::from(u32::MAX)) as usize;
            if at == goal {
                return Found::Path(super::straight::legs(floor, &self.path(floor)));
            }
            let cell = floor.cell(at);
            let (column, row) = (cell.column as i64, cell.row as i64);
            let spent = self.reached[at] - 1;
            if u64::from(spent + self.left(column, row)) < entry >> 32 {
                continue;
            }
            for (place, (dx, dy, length)) in NEIGHBOURS.iter().enumerate() {
                let (x, y) = (column + dx, row + dy);
                if x < 0 || y < 0 || x >= self.columns || y >= self.rows {
                    continue;
                }
                // Between two cells that touch at a corner there is no gap.
                let beside = [row * self.columns + x, y * self.columns + column];
                if beside.iter().any(|it| costs[*it as usize] == 0) {
                    continue;
                }
                let to = (y * self.columns + x) as usize;
                let cost = u32::from(costs[to]);
                let spent = spent + length * cost;
                let reached = self.reached[to];
                if cost == 0 || (reached != 0 && reached <= spent + 1) {
                    continue;
                }
                self.reached[to] = spent + 1;
                self.by[to] = place as u8;
                let whole = u64::from(spent + self.left(x, y));
                self.open.push(Reverse(whole << 32 | to as u64));
            }
        }
        Found::NotYet
    }

    fn index(&self, cell: Cell) -> usize {
        cell.row * self.columns as usize + cell.column
    }

    /// Least cost from a cell to the goal, as if all were open.
    fn left(&self, column: i64, row: i64) -> u32 {
        let columns = column.abs_diff(self.goal.column as i64) as u32;
        let rows = row.abs_diff(self.goal.row as i64) as u32;
        let (more, less) = (columns.max(rows), columns.min(rows));
        STRAIGHT * (more - less) + DIAGONAL * less
    }

    /// The path that was found: its ends, and the centres of the cells between.
    fn path(&self, floor: &Floor) -> Vec<MapXy> {
        let (from, to) = self.ends;
        let mut points = vec![to];
        let mut at = self.index(self.goal);
        while at != self.index(self.start) {
            let (dx, dy, _) = NEIGHBOURS[usize::from(self.by[at])];
            at = (at as i64 - dy * self.columns - dx) as usize;
            points.push(floor.map().centre(floor.cell(at)));
        }
        match points.len() {
            1 if from != to => points.push(from),
            last => points[last - 1] = from,
        }
        points.reverse();
        points
    }
}

impl Floor {
    /// The cheapest path between two points, as corners of straight legs; `None` if there is none. For work outside of a
    /// drone's steps: over a large floor it takes milliseconds.
    #[must_use]
    pub fn path(&self, from: MapXy, to: MapXy) -> Option<Vec<MapXy>> {
        let (start, goal) = (self.map().cell(from)?, self.map().cell(to)?);
        let mut search = Search::new(self, start, goal);
        search.ends = (from, to);
        match search.advance(self, usize::MAX) {
            Found::Path(corners) => Some(corners),
            Found::NotYet | Found::Nothing => None,
        }
    }
}
