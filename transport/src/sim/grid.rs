use std::collections::BTreeMap;

use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;

use crate::SendError;

/// Who is near whom, by square cells as wide as the range.
#[derive(Debug)]
pub(super) struct Grid {
    range_m: f64,
    radios: Vec<Radio>,
    cells: BTreeMap<Cell, Vec<NodeId>>,
}

/// A square, by its row and its column.
type Cell = (i64, i64);

#[derive(Debug, Clone, Copy)]
struct Radio {
    place: Ned,
    cell: Cell,
}

impl Grid {
    pub(super) fn new(range_m: f64, places: &[Ned]) -> Self {
        let radio = |place: &Ned| Radio {
            place: *place,
            cell: cell(*place, range_m),
        };
        let radios: Vec<_> = places.iter().map(radio).collect();
        let mut cells: BTreeMap<_, Vec<_>> = BTreeMap::new();
        for (id, radio) in (0..).map(NodeId).zip(&radios) {
            cells.entry(radio.cell).or_default().push(id);
        }
        Self {
            range_m,
            radios,
            cells,
        }
    }

    /// Puts a radio elsewhere; whether it was not there already.
    pub(super) fn place(&mut self, id: NodeId, place: Ned) -> bool {
        let radio = &mut self.radios[id.0 as usize];
        if radio.place == place {
            return false;
        }
        let (from, to) = (radio.cell, cell(place, self.range_m));
        *radio = Radio { place, cell: to };
        if from != to {
            if let Some(cell) = self.cells.get_mut(&from) {
                cell.retain(|other| *other != id);
            }
            self.cells.entry(to).or_default().push(id);
        }
        true
    }

    pub(super) fn place_of(&self, id: NodeId) -> Option<Ned> {
        self.radios.get(id.0 as usize).map(|radio| radio.place)
    }

    /// Overwrites `found` with the radios in range of `from`, lowest first.
    pub(super) fn in_range(&self, from: NodeId, found: &mut Vec<NodeId>) -> Result<(), SendError> {
        found.clear();
        let Some(&Radio {
            place: centre,
            cell,
        }) = self.radios.get(from.0 as usize)
        else {
            return Err(SendError::UnknownSender(from));
        };
        let (row, column) = cell;
        for row in row - 1..=row + 1 {
            for (_, cell) in self.cells.range((row, column - 1)..=(row, column + 1)) {
                found.extend(cell.iter().filter(|id| {
                    **id != from
                        && self.radios[id.0 as usize].place.distance_m(centre) <= self.range_m
                }));
            }
        }
        found.sort_unstable();
        Ok(())
    }

    /// Visits every two radios in range of each other once, with their distance in metres, in an order that depends on
    /// nothing but where they have been.
    pub(super) fn each_pair_in_range(&self, mut visit: impl FnMut(NodeId, NodeId, f64)) {
        let mut look_at = |a: NodeId, others: &[NodeId]| {
            let place = self.radios[a.0 as usize].place;
            for b in others {
                let distance_m = self.radios[b.0 as usize].place.distance_m(place);
                if distance_m <= self.range_m {
                    visit(a, *b, distance_m);
                }
            }
        };
        for ((row, column), cell) in &self.cells {
            for (at, a) in cell.iter().enumerate() {
                look_at(*a, &cell[at + 1..]);
            }
            // Of the cells around, those that have not come to this one.
            let beside = (*row, column + 1)..=(*row, column + 1);
            let below = (row + 1, column - 1)..=(row + 1, column + 1);
            for (_, others) in self.cells.range(beside).chain(self.cells.range(below)) {
                for a in cell {
                    look_at(*a, others);
                }
            }
        }
    }
}

/// The cell of a place where they are that wide.
#[expect(
    clippy::cast_possible_truncation,
    reason = "a place beyond 2^63 cells is beyond any mission that loads"
)]
fn cell(place: Ned, width_m: f64) -> Cell {
    let index = |metres: f64| (metres / width_m).floor() as i64;
    (index(place.north_m()), index(place.east_m()))
}
