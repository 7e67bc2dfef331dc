use std::collections::BTreeMap;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::shape::Shape;

/// Limit of draws in a row without a free place; the drone then gets a place ahead of all.
const DRAWS_MAX: u32 = 10_000;

/// Random: the centre first, the others drawn with `seed`. Each is at least the spacing from all others and at most 1.5
/// times the spacing from one of them, so the swarm stays connected.
///
/// Places are whole millimetres. Each drone costs a few draws and a look-up in the neighbouring grid squares.
pub(super) fn random(drones: u32, spacing_m: f64, seed: u64) -> Shape {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a swarm is not wider than i64 has millimetres"
    )]
    let spacing_mm = (spacing_m * 1_000.0).ceil() as i64;
    let mut occupied = OccupiedPlaces::new(spacing_mm);
    occupied.insert((0, 0));
    while occupied.places.len() < drones as usize {
        let place = (0..DRAWS_MAX)
            .map(|_| occupied.draw(&mut rng))
            .find(|place| occupied.has_room(*place))
            .unwrap_or_else(|| occupied.ahead_of_all());
        occupied.insert(place);
    }
    #[expect(
        clippy::cast_precision_loss,
        reason = "millimetres of a swarm are far below 2⁵³"
    )]
    let slots = occupied.places.into_iter().map(|(ahead, right)| {
        let place_m = (ahead as f64 / 1_000.0, right as f64 / 1_000.0);
        (place_m, (ahead * ahead + right * right).unsigned_abs())
    });
    Shape::new(0, slots)
}

/// Occupied places in millimetres, indexed by grid squares as wide as the spacing.
struct OccupiedPlaces {
    spacing_mm: i64,
    places: Vec<(i64, i64)>,
    squares: BTreeMap<(i64, i64), Vec<(i64, i64)>>,
}

impl OccupiedPlaces {
    const fn new(spacing_mm: i64) -> Self {
        Self {
            spacing_mm,
            places: Vec::new(),
            squares: BTreeMap::new(),
        }
    }

    const fn square(&self, (ahead, right): (i64, i64)) -> (i64, i64) {
        (
            ahead.div_euclid(self.spacing_mm),
            right.div_euclid(self.spacing_mm),
        )
    }

    fn insert(&mut self, place: (i64, i64)) {
        self.places.push(place);
        let square = self.square(place);
        self.squares.entry(square).or_default().push(place);
    }

    /// A random place near an occupied one.
    fn draw(&self, rng: &mut ChaCha8Rng) -> (i64, i64) {
        let beside = self.places[rng.random_range(0..self.places.len())];
        let farthest = self.spacing_mm * 3 / 2;
        loop {
            let ahead = rng.random_range(-farthest..=farthest);
            let right = rng.random_range(-farthest..=farthest);
            if ahead * ahead + right * right <= farthest * farthest {
                return (beside.0 + ahead, beside.1 + right);
            }
        }
    }

    fn has_room(&self, place: (i64, i64)) -> bool {
        let (row, column) = self.square(place);
        (row - 1..=row + 1)
            .flat_map(|row| (column - 1..=column + 1).map(move |column| (row, column)))
            .filter_map(|square| self.squares.get(&square))
            .flatten()
            .all(|(ahead, right)| {
                let (ahead, right) = (ahead - place.0, right - place.1);
                ahead * ahead + right * right >= self.spacing_mm * self.spacing_mm
            })
    }

    fn ahead_of_all(&self) -> (i64, i64) {
        let foremost = self.places.iter().max().copied().unwrap_or_default();
        (foremost.0 + self.spacing_mm, foremost.1)
    }
}
