//! Exact Euclidean distances to the nearest marked cell, in time linear in the cells.
//!
//! Source: A. Meijster, J. Roerdink, W. Hesselink, "A general algorithm for computing distance transforms in linear time",
//! 2000: distances along columns first, then the lower envelope of parabolas along rows. Whole numbers only, so it is exact.

use super::State;

/// Metres from each cell's centre to the centre of the nearest occupied one; infinite if none is occupied.
pub(super) fn metres(columns: usize, rows: usize, states: &[State], resolution_m: f64) -> Vec<f32> {
    let squared = squared_cells(columns, rows, |cell| states[cell] == State::Occupied);
    let metres = |squared: u32| match squared {
        u32::MAX => f32::INFINITY,
        squared => (f64::from(squared).sqrt() * resolution_m) as f32,
    };
    squared.into_iter().map(metres).collect()
}

/// Squared distances in cells from each cell's centre to the centre of the nearest marked cell; `u32::MAX` if none is marked.
/// Distances of 65,536 cells and more are one less than `u32::MAX`.
pub(super) fn squared_cells(
    columns: usize,
    rows: usize,
    is_marked: impl Fn(usize) -> bool,
) -> Vec<u32> {
    let far = (columns + rows) as i64;
    let mut down = vec![far; columns * rows];
    for row in 0..rows {
        for column in 0..columns {
            let at = row * columns + column;
            down[at] = match row {
                _ if is_marked(at) => 0,
                0 => far,
                _ => (down[at - columns] + 1).min(far),
            };
        }
    }
    for row in (0..rows.saturating_sub(1)).rev() {
        for column in 0..columns {
            let at = row * columns + column;
            down[at] = down[at].min(down[at + columns] + 1);
        }
    }
    let mut squared = Vec::with_capacity(columns * rows);
    let mut envelope = Envelope::default();
    for row in down.chunks_exact(columns.max(1)) {
        envelope.along(row, far, &mut squared);
    }
    squared
}

/// The parabolas that are lowest somewhere along a row: the column of each vertex, and the column from which it is lowest.
#[derive(Default)]
struct Envelope {
    parabolas: Vec<(i64, i64)>,
}

impl Envelope {
    fn along(&mut self, row: &[i64], far: i64, squared: &mut Vec<u32>) {
        let columns = row.len() as i64;
        let height = |x: i64, vertex: i64| {
            let down = row[vertex as usize];
            (x - vertex) * (x - vertex) + down * down
        };
        self.parabolas.clear();
        for vertex in 0..columns {
            while let Some(&(other, from)) = self.parabolas.last()
                && height(from, other) > height(from, vertex)
            {
                self.parabolas.pop();
            }
            let from = match self.parabolas.last() {
                None => 0,
                Some(&(other, _)) => 1 + crossing(row, other, vertex),
            };
            if from < columns {
                self.parabolas.push((vertex, from));
            }
        }
        let mut lowest = self.parabolas.iter().rev().peekable();
        let start = squared.len();
        for x in (0..columns).rev() {
            while lowest.next_if(|(_, from)| *from > x).is_some() {}
            let cell = lowest
                .peek()
                .map_or(i64::MAX, |(vertex, _)| height(x, *vertex));
            let is_near = cell < far * far;
            squared.push(match is_near {
                true => u32::try_from(cell).unwrap_or(u32::MAX).min(u32::MAX - 1),
                false => u32::MAX,
            });
        }
        squared[start..].reverse();
    }
}

/// The last column at which the parabola of the left vertex is not above the right one's.
fn crossing(row: &[i64], left: i64, right: i64) -> i64 {
    let (of_left, of_right) = (row[left as usize], row[right as usize]);
    let numerator = right * right - left * left + of_right * of_right - of_left * of_left;
    numerator.div_euclid(2 * (right - left))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn by_search(columns: usize, rows: usize, marked: &[bool]) -> Vec<u32> {
        let cells = || (0..rows).flat_map(|y| (0..columns).map(move |x| (x, y)));
        let squared = |(x, y): (usize, usize)| {
            let others = cells().filter(|(u, v)| marked[v * columns + u]);
            let squares = others.map(|(u, v)| u.abs_diff(x).pow(2) + v.abs_diff(y).pow(2));
            squares.min().map_or(u32::MAX, |it| it as u32)
        };
        cells().map(squared).collect()
    }

    #[test]
    fn distances_of_more_than_65535_cells_do_not_wrap() {
        let squared = squared_cells(70_000, 1, |cell| cell == 0);
        assert_eq!(squared[65_535], 65_535 * 65_535);
        assert!(squared[65_536..].iter().all(|it| *it == u32::MAX - 1));
    }

    proptest! {
        #[test]
        fn distances_equal_those_of_a_search(
            (columns, rows, marked) in (1_usize..24, 1_usize..24).prop_flat_map(|(columns, rows)| {
                let cell = prop::bool::weighted(0.08);
                (Just(columns), Just(rows), prop::collection::vec(cell, columns * rows))
            })
        ) {
            let squared = squared_cells(columns, rows, |cell| marked[cell]);
            prop_assert_eq!(squared, by_search(columns, rows, &marked));
        }
    }
}
