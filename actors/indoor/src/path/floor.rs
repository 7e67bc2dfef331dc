//! What a drone of some size can fly over.

use std::sync::Arc;

use crate::frames::MapXy;
use crate::map::{Cell, Map};

/// Times that a cell beside a wall costs more than one in the open.
const NEAR_WALLS: f64 = 4.0;
/// Metres beyond a drone's radius from which a wall raises no cost: the middle of a door is then cheaper than its edge.
const COMFORT_M: f64 = 0.3;

/// A map as a drone of some radius sees it: what it can't be in, and what being there costs.
#[derive(Debug, Clone)]
pub struct Floor {
    map: Arc<Map>,
    /// Cost of each cell, 1 in the open; 0 if the drone can't be there.
    costs: Vec<u8>,
}

/// Places that were found blocked, as discs of one radius. At most [`Obstacles::MAX`]; the oldest goes first.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Obstacles(Vec<(MapXy, f64)>);

impl Obstacles {
    /// Most obstacles kept.
    pub const MAX: usize = 32;

    /// Adds a disc, by its centre and radius in metres.
    pub fn add(&mut self, centre: MapXy, radius_m: f64) {
        if self.0.len() == Self::MAX {
            self.0.remove(0);
        }
        self.0.push((centre, radius_m));
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.0.clear();
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Whether a point lies in one.
    #[must_use]
    pub fn cover(&self, point: MapXy) -> bool {
        self.0
            .iter()
            .any(|(centre, radius_m)| centre.distance_m(point) < *radius_m)
    }
}

impl Floor {
    /// The floor for a drone that keeps `radius_m` metres from walls, from what is unknown and from keep-out zones. Costs three
    /// passes over the map.
    #[must_use]
    pub fn new(map: Arc<Map>, radius_m: f64) -> Self {
        let blocked = map.inflated(radius_m);
        let cost = |(cell, blocked): (Cell, bool)| {
            if blocked {
                return 0;
            }
            let beyond_m = map.distance_m(map.centre(cell)) - radius_m;
            let near = (1.0 - beyond_m / COMFORT_M).clamp(0.0, 1.0);
            (1.0 + NEAR_WALLS * near).round() as u8
        };
        let costs = map.cells().zip(blocked).map(cost).collect();
        Self { map, costs }
    }

    /// The map.
    #[must_use]
    pub const fn map(&self) -> &Arc<Map> {
        &self.map
    }

    /// The same floor with discs of which no cell can be entered.
    #[must_use]
    pub fn without(&self, obstacles: &Obstacles) -> Self {
        let mut floor = self.clone();
        for (centre, radius_m) in &obstacles.0 {
            for cell in cells_within(&self.map, *centre, *radius_m) {
                if let Some(index) = self.map.index(cell) {
                    floor.costs[index] = 0;
                }
            }
        }
        floor
    }

    /// Whether a drone can be at a point.
    #[must_use]
    pub fn is_free(&self, point: MapXy) -> bool {
        self.map.cell(point).is_some_and(|cell| {
            self.map
                .index(cell)
                .is_some_and(|index| self.costs[index] > 0)
        })
    }

    /// The free cell nearest to a point, within `within_m` metres. A drone that was blown too close to a wall starts from there.
    #[must_use]
    pub fn nearest_free(&self, point: MapXy, within_m: f64) -> Option<Cell> {
        let near = cells_within(&self.map, point, within_m);
        let free = near.filter(|cell| self.index(*cell).is_some_and(|it| self.costs[it] > 0));
        let away = |cell: &Cell| self.map.centre(*cell).distance_m(point);
        free.min_by(|a, b| away(a).total_cmp(&away(b)).then(a.cmp(b)))
    }

    fn index(&self, cell: Cell) -> Option<usize> {
        self.map.index(cell)
    }

    /// The cost of each cell, row by row from the bottom: 1 in the open, 0 where the drone can't be.
    #[must_use]
    pub fn costs(&self) -> &[u8] {
        &self.costs
    }

    /// The cell of an index.
    pub(crate) fn cell(&self, index: usize) -> Cell {
        Cell {
            column: index % self.map.columns(),
            row: index / self.map.columns(),
        }
    }
}

/// The cells of which the centre is within a distance of a point, row by row.
fn cells_within(map: &Map, point: MapXy, within_m: f64) -> impl Iterator<Item = Cell> + '_ {
    let seen = map.origin().sight(point);
    let reach = (within_m / map.resolution_m()).ceil() + 1.0;
    // Casts of numbers below 0 give 0.
    let near = |at_m: f64, cells: usize| {
        let own = (at_m / map.resolution_m()).floor();
        (own - reach) as usize..((own + reach + 1.0) as usize).min(cells)
    };
    let columns = near(seen.x_m, map.columns());
    near(seen.y_m, map.rows()).flat_map(move |row| {
        let cells = columns.clone().map(move |column| Cell { column, row });
        cells.filter(move |cell| map.centre(*cell).distance_m(point) <= within_m)
    })
}
