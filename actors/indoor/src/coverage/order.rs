//! The order of stops, and its division among drones.

use crate::frames::MapXy;
use crate::map::Cell;
use crate::path::{DIAGONAL, Floor, STRAIGHT};

/// Rounds of 2-opt at most. It ends by itself before, for each round shortens the tour.
const ROUNDS_MAX: usize = 200;
/// Shortening that is worth a round, in metres.
const WORTH_M: f64 = 1e-6;

/// Lengths of the paths between stops, and from each start to each stop, in metres.
pub(super) struct Distances {
    /// By drone, then stop.
    from_starts: Vec<Vec<f64>>,
    /// By stop, then stop.
    between: Vec<Vec<f64>>,
}

impl Distances {
    pub(super) fn new(floor: &Floor, starts: &[MapXy], stops: &[MapXy]) -> Self {
        let rows = |from: &[MapXy]| from.iter().map(|it| lengths_m(floor, *it, stops)).collect();
        Self {
            from_starts: rows(starts),
            between: rows(stops),
        }
    }

    /// Length of a drone's tour through these stops, in metres.
    pub(super) fn length_m(&self, drone: usize, stops: &[usize]) -> f64 {
        let first = stops
            .first()
            .map_or(0.0, |stop| self.from_starts[drone][*stop]);
        let legs = stops.windows(2).map(|pair| self.between[pair[0]][pair[1]]);
        first + legs.sum::<f64>()
    }

    /// A short order of `stops` stops for the first drone: each time the nearest, then improved by reversals of parts (2-opt).
    pub(super) fn shortest_order(&self, stops: usize) -> Vec<usize> {
        let mut left: Vec<usize> = (0..stops).collect();
        let mut order: Vec<usize> = Vec::new();
        while !left.is_empty() {
            let away = |stop: usize| match order.last() {
                Some(last) => self.between[*last][stop],
                None => self.from_starts[0][stop],
            };
            let nearest = (0..left.len()).min_by(|a, b| away(left[*a]).total_cmp(&away(left[*b])));
            order.push(left.remove(nearest.unwrap_or(0)));
        }
        for _ in 0..ROUNDS_MAX {
            if !self.improve(&mut order) {
                break;
            }
        }
        order
    }

    /// Reverses parts of the order as long as one is found that shortens it; whether any was.
    fn improve(&self, order: &mut [usize]) -> bool {
        let mut improved = false;
        for from in 0..order.len() {
            for to in from + 1..order.len() {
                let before = |first: usize| match from.checked_sub(1) {
                    Some(before) => self.between[order[before]][first],
                    None => self.from_starts[0][first],
                };
                let after =
                    |last: usize| order.get(to + 1).map_or(0.0, |it| self.between[last][*it]);
                let now = before(order[from]) + after(order[to]);
                let reversed = before(order[to]) + after(order[from]);
                if reversed < now - WORTH_M {
                    order[from..=to].reverse();
                    improved = true;
                }
            }
        }
        improved
    }

    /// Consecutive parts of an order, one for each drone, such that the longest is as short as possible. A stop counts as
    /// `turn_m` metres.
    pub(super) fn parts(&self, order: &[usize], drones: usize, turn_m: f64) -> Vec<Vec<usize>> {
        let cost = |drone: usize, from: usize, to: usize| {
            self.length_m(drone, &order[from..to]) + turn_m * (to - from) as f64
        };
        // Of the first n stops, shared among the first drones: the longest part, and where the last part begins.
        let mut best: Vec<Vec<(f64, usize)>> = Vec::new();
        for drone in 0..drones {
            let row = (0..=order.len()).map(|to| {
                let from = if drone == 0 { 0..=0 } else { 0..=to };
                let longest = from.map(|from| {
                    let before = if drone == 0 {
                        0.0
                    } else {
                        best[drone - 1][from].0
                    };
                    (cost(drone, from, to).max(before), from)
                });
                longest
                    .min_by(|a, b| a.0.total_cmp(&b.0))
                    .unwrap_or((0.0, 0))
            });
            let row = row.collect();
            best.push(row);
        }
        let mut parts = Vec::new();
        let mut to = order.len();
        for drone in (0..drones).rev() {
            let from = best[drone][to].1;
            parts.push(order[from..to].to_vec());
            to = from;
        }
        parts.reverse();
        parts
    }
}

/// Length of the shortest path from a point to each of others, in metres; infinite if there is none.
///
/// Dijkstra's algorithm with a bucket for each length (R. Dial, algorithm 360, 1969).
fn lengths_m(floor: &Floor, from: MapXy, to: &[MapXy]) -> Vec<f64> {
    let map = floor.map();
    let index = |point| map.cell(point).and_then(|cell| map.index(cell));
    let wanted: Vec<Option<usize>> = to.iter().map(|it| index(*it)).collect();
    let mut lengths = vec![u32::MAX; floor.costs().len()];
    let mut buckets: Vec<Vec<u32>> = vec![Vec::new(); DIAGONAL as usize + 1];
    if let Some(start) = index(from) {
        lengths[start] = 0;
        buckets[0].push(start as u32);
    }
    let mut length = 0;
    while buckets.iter().any(|bucket| !bucket.is_empty()) {
        let place = length as usize % buckets.len();
        for at in std::mem::take(&mut buckets[place]) {
            let at = at as usize;
            if lengths[at] != length {
                continue;
            }
            for (to, step) in beside(floor, at) {
                if length + step < lengths[to] {
                    lengths[to] = length + step;
                    let place = (length + step) as usize % buckets.len();
                    buckets[place].push(to as u32);
                }
            }
        }
        length += 1;
    }
    let metres = |length: u32| match length {
        u32::MAX => f64::INFINITY,
        length => f64::from(length) / f64::from(STRAIGHT) * map.resolution_m(),
    };
    let lengths = wanted
        .into_iter()
        .map(|it| it.map_or(u32::MAX, |it| lengths[it]));
    lengths.map(metres).collect()
}

/// The free cells beside one, with the lengths of the steps. None leads through the corner of a cell that is not free.
fn beside(floor: &Floor, at: usize) -> impl Iterator<Item = (usize, u32)> + '_ {
    let map = floor.map();
    let own = floor.cell(at);
    let free = move |column: usize, row: usize| {
        let index = map.index(Cell { column, row })?;
        (floor.costs()[index] > 0).then_some(index)
    };
    let steps = [
        (1, 0),
        (0, 1),
        (-1, 0),
        (0, -1),
        (1, 1),
        (-1, 1),
        (-1, -1),
        (1, -1),
    ];
    steps
        .into_iter()
        .filter_map(move |(dx, dy): (isize, isize)| {
            let column = own.column.checked_add_signed(dx)?;
            let row = own.row.checked_add_signed(dy)?;
            let to = free(column, row)?;
            if dx == 0 || dy == 0 {
                return Some((to, STRAIGHT));
            }
            free(column, own.row)?;
            free(own.column, row)?;
            Some((to, DIAGONAL))
        })
}
