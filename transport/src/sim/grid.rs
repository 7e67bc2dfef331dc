use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;

use crate::SendError;

/// Who is near whom, by squares as wide as the range.
///
/// Radios lie in memory in the order of their squares, row by row, so that those that a frame looks at are three stretches:
/// of the row above its sender's square, of its own, and of the row below.
#[derive(Debug)]
pub(super) struct Grid {
    range_m: f64,
    /// By rising square, then id; some may be out of order as long as `is_in_order` says so.
    radios: Vec<Radio>,
    /// Where each drone's radio is among those.
    at: Vec<usize>,
    /// Of each square in which there is anybody, in the order of squares, where the three stretches begin and end.
    around: Vec<[(usize, usize); 3]>,
    is_in_order: bool,
}

/// A square, by its row and its column.
type Square = (i64, i64);

#[derive(Debug, Clone, Copy)]
struct Radio {
    square: Square,
    id: NodeId,
    place: Ned,
    /// Which of the squares in which there is anybody that is.
    nth: usize,
}

impl Grid {
    pub(super) fn new(range_m: f64, places: &[Ned]) -> Self {
        let radios = (0..).map(NodeId).zip(places).map(|(id, place)| Radio {
            square: square(*place, range_m),
            id,
            place: *place,
            nth: 0,
        });
        let mut grid = Self {
            range_m,
            radios: radios.collect(),
            at: vec![0; places.len()],
            around: Vec::new(),
            is_in_order: false,
        };
        grid.put_in_order();
        grid
    }

    /// Puts a radio elsewhere; whether it was not there already.
    pub(super) fn place(&mut self, id: NodeId, place: Ned) -> bool {
        let radio = &mut self.radios[self.at[id.0 as usize]];
        if radio.place == place {
            return false;
        }
        radio.place = place;
        let square = square(place, self.range_m);
        if radio.square != square {
            radio.square = square;
            self.is_in_order = false;
        }
        true
    }

    /// To be called after radios were put elsewhere, and before anybody is looked for.
    pub(super) fn put_in_order(&mut self) {
        if self.is_in_order {
            return;
        }
        self.is_in_order = true;
        self.radios.sort_by_key(|radio| (radio.square, radio.id));
        self.around.clear();
        // Where the stretches around the square before began: those of the next one begin there or further on.
        let mut begins = [0; 3];
        let radios = &self.radios;
        for own in radios.chunk_by(|a, b| a.square == b.square) {
            let (row, column) = own[0].square;
            let stretch = |begin: &mut usize, row: i64| {
                *begin += stretch_len(&radios[*begin..], |it| it < (row, column - 1));
                let len = stretch_len(&radios[*begin..], |it| it <= (row, column + 1));
                (*begin, *begin + len)
            };
            let [above, beside, below] = &mut begins;
            self.around.push([
                stretch(above, row - 1),
                stretch(beside, row),
                stretch(below, row + 1),
            ]);
        }
        let squares = self.radios.chunk_by_mut(|a, b| a.square == b.square);
        let radios = squares
            .enumerate()
            .flat_map(|(nth, own)| own.iter_mut().map(move |it| (nth, it)));
        for (at, (nth, radio)) in radios.enumerate() {
            radio.nth = nth;
            self.at[radio.id.0 as usize] = at;
        }
    }

    pub(super) fn place_of(&self, id: NodeId) -> Option<Ned> {
        let at = self.at.get(id.0 as usize)?;
        Some(self.radios[*at].place)
    }

    /// Overwrites `found` with the radios in range of `from`, lowest first.
    pub(super) fn in_range(&self, from: NodeId, found: &mut Vec<NodeId>) -> Result<(), SendError> {
        debug_assert!(self.is_in_order);
        found.clear();
        let Some(&at) = self.at.get(from.0 as usize) else {
            return Err(SendError::UnknownSender(from));
        };
        let Radio { place, nth, .. } = self.radios[at];
        for (begin, end) in self.around[nth] {
            for other in &self.radios[begin..end] {
                if other.place.distance_m(place) <= self.range_m && other.id != from {
                    found.push(other.id);
                }
            }
        }
        found.sort_unstable();
        Ok(())
    }

    /// Visits every two radios in range of each other once, with their distance in metres, in an order that depends on
    /// nothing but where they are.
    pub(super) fn each_pair_in_range(&self, mut visit: impl FnMut(NodeId, NodeId, f64)) {
        debug_assert!(self.is_in_order);
        for (at, a) in self.radios.iter().enumerate() {
            // Of those around, the ones that do not come to this one.
            let [_, (_, end), (below, below_end)] = self.around[a.nth];
            for b in self.radios[at + 1..end]
                .iter()
                .chain(&self.radios[below..below_end])
            {
                let distance_m = a.place.distance_m(b.place);
                if distance_m <= self.range_m {
                    visit(a.id, b.id, distance_m);
                }
            }
        }
    }
}

/// How many of the first radios are in squares of which this is so.
fn stretch_len(radios: &[Radio], is_so: impl Fn(Square) -> bool) -> usize {
    radios.iter().take_while(|it| is_so(it.square)).count()
}

/// The square in which a place lies, where they are that wide.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    reason = "a place beyond 2^53 squares is beyond any mission that loads"
)]
fn square(place: Ned, width_m: f64) -> Square {
    // As `floor`, which is a call where a processor is not known to have it.
    let index = |metres: f64| {
        let towards_zero = (metres / width_m) as i64;
        towards_zero - i64::from(towards_zero as f64 > metres / width_m)
    };
    (index(place.north_m()), index(place.east_m()))
}
