use std::collections::BTreeMap;

use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;

use crate::SendError;

/// Who is near whom, by square cells as wide as the range.
#[derive(Debug)]
pub(super) struct Grid {
    range_m: f64,
    radios: Vec<Radio>,
    /// As they were first entered; none is taken out again.
    cells: Vec<Cell>,
    /// Which of them lies where.
    places: BTreeMap<Square, usize>,
}

/// Where a cell lies, by its row and its column.
type Square = (i64, i64);

#[derive(Debug, Clone, Copy)]
struct Radio {
    place: Ned,
    square: Square,
    /// The number of the cell that lies there.
    cell: usize,
}

#[derive(Debug)]
struct Cell {
    /// Who is in it, and where: a frame looks at all of them.
    radios: Vec<(NodeId, Ned)>,
    /// The numbers of the cells that touch it, its own included.
    around: Vec<usize>,
}

impl Grid {
    pub(super) fn new(range_m: f64, places: &[Ned]) -> Self {
        let mut grid = Self {
            range_m,
            radios: Vec::with_capacity(places.len()),
            cells: Vec::new(),
            places: BTreeMap::new(),
        };
        for (id, place) in (0..).map(NodeId).zip(places) {
            let square = square(*place, range_m);
            let cell = grid.enter(id, *place, square);
            grid.radios.push(Radio {
                place: *place,
                square,
                cell,
            });
        }
        grid
    }

    /// Puts a radio elsewhere; whether it was not there already.
    pub(super) fn place(&mut self, id: NodeId, place: Ned) -> bool {
        let radio = &mut self.radios[id.0 as usize];
        if radio.place == place {
            return false;
        }
        radio.place = place;
        let to = square(place, self.range_m);
        let radios = &mut self.cells[radio.cell].radios;
        if radio.square != to {
            radio.square = to;
            radios.retain(|(other, _)| *other != id);
            self.radios[id.0 as usize].cell = self.enter(id, place, to);
        } else if let Some((_, known)) = radios.iter_mut().find(|(other, _)| *other == id) {
            *known = place;
        }
        true
    }

    /// Adds a radio to the cell that lies in a square; its number.
    fn enter(&mut self, id: NodeId, place: Ned, square: Square) -> usize {
        let number = match self.places.get(&square) {
            Some(number) => *number,
            None => self.begin_cell(square),
        };
        self.cells[number].radios.push((id, place));
        number
    }

    fn begin_cell(&mut self, square: Square) -> usize {
        let number = self.cells.len();
        self.places.insert(square, number);
        let (row, column) = square;
        let rows = row - 1..=row + 1;
        let around: Vec<_> = rows
            .flat_map(|row| self.places.range((row, column - 1)..=(row, column + 1)))
            .map(|(_, number)| *number)
            .collect();
        for other in around.iter().filter(|other| **other != number) {
            self.cells[*other].around.push(number);
        }
        self.cells.push(Cell {
            radios: Vec::new(),
            around,
        });
        number
    }

    pub(super) fn place_of(&self, id: NodeId) -> Option<Ned> {
        self.radios.get(id.0 as usize).map(|radio| radio.place)
    }

    /// Overwrites `found` with the radios in range of `from`, lowest first.
    pub(super) fn in_range(&self, from: NodeId, found: &mut Vec<NodeId>) -> Result<(), SendError> {
        found.clear();
        let Some(&Radio { place, cell, .. }) = self.radios.get(from.0 as usize) else {
            return Err(SendError::UnknownSender(from));
        };
        for number in &self.cells[cell].around {
            for (id, other) in &self.cells[*number].radios {
                if other.distance_m(place) <= self.range_m && *id != from {
                    found.push(*id);
                }
            }
        }
        found.sort_unstable();
        Ok(())
    }

    /// Visits every two radios in range of each other once, with their distance in metres, in an order that depends on
    /// nothing but where they have been.
    pub(super) fn each_pair_in_range(&self, mut visit: impl FnMut(NodeId, NodeId, f64)) {
        let mut look_at = |(a, place): (NodeId, Ned), others: &[(NodeId, Ned)]| {
            for (b, other) in others {
                let distance_m = other.distance_m(place);
                if distance_m <= self.range_m {
                    visit(a, *b, distance_m);
                }
            }
        };
        let radios = |number: &usize| self.cells[*number].radios.as_slice();
        for ((row, column), number) in &self.places {
            let cell = radios(number);
            for (at, a) in cell.iter().enumerate() {
                look_at(*a, &cell[at + 1..]);
            }
            // Of the cells around, those that have not come to this one.
            let beside = (*row, column + 1)..=(*row, column + 1);
            let below = (row + 1, column - 1)..=(row + 1, column + 1);
            for (_, others) in self.places.range(beside).chain(self.places.range(below)) {
                for a in cell {
                    look_at(*a, radios(others));
                }
            }
        }
    }
}

/// The square in which a place lies, where they are that wide.
#[expect(
    clippy::cast_possible_truncation,
    reason = "a place beyond 2^63 cells is beyond any mission that loads"
)]
fn square(place: Ned, width_m: f64) -> Square {
    let index = |metres: f64| (metres / width_m).floor() as i64;
    (index(place.north_m()), index(place.east_m()))
}
