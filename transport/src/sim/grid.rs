use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;

use crate::SendError;

/// Spatial index of the radios: a grid of squares as wide as the range.
///
/// Radios are sorted by square, row by row. The neighbourhood of a square is three contiguous slices: of the row above, of
/// its own row, and of the row below.
#[derive(Debug)]
pub(super) struct Grid {
    range_m: f64,
    /// Sorted by square, then id, if `is_sorted`.
    radios: Vec<Radio>,
    /// Index in `radios` by drone.
    index: Vec<usize>,
    /// For each occupied square, the start and end of the three slices of its neighbourhood.
    neighbourhoods: Vec<[(usize, usize); 3]>,
    is_sorted: bool,
}

/// A square by row and column.
type Square = (i64, i64);

#[derive(Debug, Clone, Copy)]
struct Radio {
    square: Square,
    id: NodeId,
    position: Ned,
    /// Index of its square in `neighbourhoods`.
    neighbourhood: usize,
}

impl Grid {
    pub(super) fn new(range_m: f64, positions: &[Ned]) -> Self {
        let radios = (0..).map(NodeId).zip(positions);
        let radios = radios.map(|(id, position)| Radio {
            square: square(*position, range_m),
            id,
            position: *position,
            neighbourhood: 0,
        });
        let mut grid = Self {
            range_m,
            radios: radios.collect(),
            index: vec![0; positions.len()],
            neighbourhoods: Vec::new(),
            is_sorted: false,
        };
        grid.sort();
        grid
    }

    /// Moves a radio. Returns whether its position changed.
    pub(super) fn set_position(&mut self, id: NodeId, position: Ned) -> bool {
        let radio = &mut self.radios[self.index[id.0 as usize]];
        if radio.position == position {
            return false;
        }
        radio.position = position;
        let square = square(position, self.range_m);
        if radio.square != square {
            radio.square = square;
            self.is_sorted = false;
        }
        true
    }

    /// Restores the order after moves. Must be called before a search.
    pub(super) fn sort(&mut self) {
        if self.is_sorted {
            return;
        }
        self.is_sorted = true;
        self.radios.sort_by_key(|radio| (radio.square, radio.id));
        self.neighbourhoods.clear();
        // The slices of a square start at or after those of the square before.
        let mut starts = [0; 3];
        let radios = &self.radios;
        for own in radios.chunk_by(|a, b| a.square == b.square) {
            let (row, column) = own[0].square;
            let slice = |start: &mut usize, row: i64| {
                *start += prefix_len(&radios[*start..], |it| it < (row, column - 1));
                let len = prefix_len(&radios[*start..], |it| it <= (row, column + 1));
                (*start, *start + len)
            };
            let [above, beside, below] = &mut starts;
            self.neighbourhoods.push([
                slice(above, row - 1),
                slice(beside, row),
                slice(below, row + 1),
            ]);
        }
        let squares = self.radios.chunk_by_mut(|a, b| a.square == b.square);
        let radios = squares
            .enumerate()
            .flat_map(|(nth, own)| own.iter_mut().map(move |it| (nth, it)));
        for (index, (neighbourhood, radio)) in radios.enumerate() {
            radio.neighbourhood = neighbourhood;
            self.index[radio.id.0 as usize] = index;
        }
    }

    /// The position of a radio; `None` if it is unknown.
    pub(super) fn position(&self, id: NodeId) -> Option<Ned> {
        let index = self.index.get(id.0 as usize)?;
        Some(self.radios[*index].position)
    }

    /// Overwrites `found` with the radios in range of `from`, lowest first.
    pub(super) fn in_range(&self, from: NodeId, found: &mut Vec<NodeId>) -> Result<(), SendError> {
        debug_assert!(self.is_sorted);
        found.clear();
        let Some(&index) = self.index.get(from.0 as usize) else {
            return Err(SendError::UnknownSender(from));
        };
        let Radio {
            position,
            neighbourhood,
            ..
        } = self.radios[index];
        for (start, end) in self.neighbourhoods[neighbourhood] {
            for other in &self.radios[start..end] {
                if other.position.distance_m(position) <= self.range_m && other.id != from {
                    found.push(other.id);
                }
            }
        }
        found.sort_unstable();
        Ok(())
    }

    /// Visits each pair of radios in range once, with their distance in metres. The order depends only on the positions.
    pub(super) fn each_pair_in_range(&self, mut visit: impl FnMut(NodeId, NodeId, f64)) {
        debug_assert!(self.is_sorted);
        for (index, a) in self.radios.iter().enumerate() {
            // Only the later half of the neighbourhood: the earlier radios visit this one.
            let [_, (_, end), (below, below_end)] = self.neighbourhoods[a.neighbourhood];
            for b in self.radios[index + 1..end]
                .iter()
                .chain(&self.radios[below..below_end])
            {
                let distance_m = a.position.distance_m(b.position);
                if distance_m <= self.range_m {
                    visit(a.id, b.id, distance_m);
                }
            }
        }
    }
}

/// Length of the longest prefix whose squares satisfy `condition`.
fn prefix_len(radios: &[Radio], condition: impl Fn(Square) -> bool) -> usize {
    radios.iter().take_while(|it| condition(it.square)).count()
}

/// The square of a position, for squares of this width.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    reason = "no accepted mission reaches 2^53 squares"
)]
fn square(position: Ned, width_m: f64) -> Square {
    // Faster than `floor`, which is a library call on the baseline processor.
    let index = |metres: f64| {
        let towards_zero = (metres / width_m) as i64;
        towards_zero - i64::from(towards_zero as f64 > metres / width_m)
    };
    (index(position.north_m()), index(position.east_m()))
}
