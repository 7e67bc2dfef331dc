//! Straight legs instead of cells: corners of a path are left out as long as that costs hardly more (string pulling).

use super::STRAIGHT;
use super::floor::Floor;
use crate::frames::MapXy;

/// Share by which a straight leg may cost more than the cells that it replaces: these can turn by 45° only.
const DEARER: f64 = 1.05;

/// The corners of the legs that replace a path from cell to cell, with the same ends.
///
/// Corners are left out from the front, each time the most by doubling and halving: a path of n cells takes about n · log n.
pub(super) fn legs(floor: &Floor, points: &[MapXy]) -> Vec<MapXy> {
    let mut spent = vec![0.0];
    for pair in points.windows(2) {
        let so_far = spent[spent.len() - 1];
        let cost = leg_cost(floor, pair[0], pair[1]).unwrap_or(f64::INFINITY);
        spent.push(so_far + cost);
    }
    let mut corners = vec![points[0]];
    let mut at = 0;
    while at + 1 < points.len() {
        let is_fit = |to: usize| {
            let allowed = (spent[to] - spent[at]) * DEARER + 1e-9;
            leg_cost(floor, points[at], points[to]).is_some_and(|cost| cost <= allowed)
        };
        let last = points.len() - 1;
        let mut step = 1;
        let mut to = at + 1;
        while to + step <= last && is_fit(to + step) {
            to += step;
            step *= 2;
        }
        while step > 0 {
            if to + step <= last && is_fit(to + step) {
                to += step;
            }
            step /= 2;
        }
        at = to;
        corners.push(points[at]);
    }
    corners
}

impl Floor {
    /// Whether a straight leg touches no cell where the drone can't be.
    #[must_use]
    pub fn is_clear(&self, from: MapXy, to: MapXy) -> bool {
        leg_cost(self, from, to).is_some()
    }
}

/// The cost of a straight leg; `None` if it touches a cell where the drone can't be.
fn leg_cost(floor: &Floor, from: MapXy, to: MapXy) -> Option<f64> {
    let map = floor.map();
    let mut sum = 0.0;
    for (cell, length) in map.cells_between(from, to) {
        match floor.costs()[map.index(cell?)?] {
            0 => return None,
            cost => sum += f64::from(cost) * length,
        }
    }
    Some(sum * f64::from(STRAIGHT))
}
