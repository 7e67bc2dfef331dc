use std::collections::BTreeMap;

use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;

use crate::SendError;

/// Who is near whom, by square cells as wide as the range.
#[derive(Debug)]
pub(super) struct Grid {
    range_m: f64,
    places: Vec<Ned>,
    cells: BTreeMap<(i64, i64), Vec<NodeId>>,
}

impl Grid {
    pub(super) fn new(range_m: f64, places: &[Ned]) -> Self {
        let mut grid = Self {
            range_m,
            places: places.to_vec(),
            cells: BTreeMap::new(),
        };
        for (id, place) in (0..).map(NodeId).zip(places) {
            let cell = grid.cell(*place);
            grid.cells.entry(cell).or_default().push(id);
        }
        grid
    }

    /// Puts a radio elsewhere; whether it was not there already.
    pub(super) fn place(&mut self, id: NodeId, place: Ned) -> bool {
        let known = &mut self.places[id.0 as usize];
        let before = std::mem::replace(known, place);
        if before == place {
            return false;
        }
        let (from, to) = (self.cell(before), self.cell(place));
        if from != to {
            if let Some(cell) = self.cells.get_mut(&from) {
                cell.retain(|other| *other != id);
            }
            self.cells.entry(to).or_default().push(id);
        }
        true
    }

    pub(super) fn place_of(&self, id: NodeId) -> Option<Ned> {
        self.places.get(id.0 as usize).copied()
    }

    /// Overwrites `found` with the radios in range of `from`, lowest first.
    pub(super) fn in_range(&self, from: NodeId, found: &mut Vec<NodeId>) -> Result<(), SendError> {
        found.clear();
        let Some(centre) = self.places.get(from.0 as usize) else {
            return Err(SendError::UnknownSender(from));
        };
        let (row, column) = self.cell(*centre);
        for row in row - 1..=row + 1 {
            for (_, cell) in self.cells.range((row, column - 1)..=(row, column + 1)) {
                found.extend(cell.iter().filter(|id| {
                    **id != from && self.places[id.0 as usize].distance_m(*centre) <= self.range_m
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
            let place = self.places[a.0 as usize];
            for b in others {
                let distance_m = self.places[b.0 as usize].distance_m(place);
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

    #[expect(
        clippy::cast_possible_truncation,
        reason = "a place beyond 2^63 cells is beyond any mission that loads"
    )]
    fn cell(&self, place: Ned) -> (i64, i64) {
        let index = |metres: f64| (metres / self.range_m).floor() as i64;
        (index(place.north_m()), index(place.east_m()))
    }
}
