use pathfinding::matrix::Matrix;
use pathfinding::prelude::kuhn_munkres_min;

use crate::flaw::{self, Flaw};
use crate::geometry::Ned;

/// How drones are assigned to places.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Assignment {
    /// Minimises the sum of squared distances between places and slots; prefers short paths among equal sums. Hungarian
    /// method, O(n³), for up to [`OPTIMAL_MAX`] drones.
    Optimal,
    /// The drone with the outermost slot takes the nearest free place first; O(n²).
    Greedy,
}

/// Largest swarm that is assigned optimally, and the default limit for it.
pub const OPTIMAL_MAX: u32 = 300;

impl Assignment {
    /// Default assignment for a number of drones.
    #[must_use]
    pub const fn for_drones(drones: u32) -> Self {
        if drones <= OPTIMAL_MAX {
            Self::Optimal
        } else {
            Self::Greedy
        }
    }

    /// The places, in the order of the slots that they are assigned to.
    pub(super) fn assign(self, places: &[Ned], slots: &[Ned]) -> Vec<Ned> {
        let chosen = match self {
            _ if flaw::has(Flaw::AssignsSlotsById) => (0..slots.len()).collect(),
            Self::Optimal => optimal(places, slots),
            Self::Greedy => greedy(places, slots),
        };
        chosen.into_iter().map(|place| places[place]).collect()
    }
}

impl Assignment {
    /// As [`Self::assign`], but slots with a place less than `within_m` over ground from below them take that, so that no
    /// other drone stands there.
    pub(super) fn assign_from_below(
        self,
        places: &[Ned],
        slots: &[Ned],
        within_m: f64,
    ) -> Vec<Ned> {
        let (mut free, mut chosen) = (places.to_vec(), vec![None; slots.len()]);
        for (slot, chosen) in slots.iter().zip(&mut chosen) {
            let distance_m = |at: &usize| slot.horizontal_distance_m(free[*at]);
            let by_distance = |a: &usize, b: &usize| distance_m(a).total_cmp(&distance_m(b));
            let nearest = (0..free.len()).min_by(by_distance);
            let below = nearest.filter(|at| distance_m(at) < within_m);
            *chosen = below.map(|at| free.remove(at));
        }
        let others = slots.iter().zip(&chosen).filter(|(_, it)| it.is_none());
        let others: Vec<Ned> = others.map(|(slot, _)| *slot).collect();
        let mut rest = self.assign(&free, &others).into_iter();
        let all = chosen.into_iter().map(|it| it.or_else(|| rest.next()));
        all.flatten().collect()
    }
}

fn optimal(places: &[Ned], slots: &[Ned]) -> Vec<usize> {
    let costs = slots
        .iter()
        .map(|slot| places.iter().map(|place| cost(*place, *slot)));
    match Matrix::from_rows(costs) {
        Ok(costs) => kuhn_munkres_min(&costs).1,
        // No slots.
        Err(_) => Vec::new(),
    }
}

/// Cost in square millimetres, plus the distance in millimetres: short paths win if squares are about equal.
#[expect(
    clippy::cast_possible_truncation,
    reason = "places are at most some thousand kilometres apart"
)]
fn cost(place: Ned, slot: Ned) -> i128 {
    let distance_mm = place.horizontal_distance_m(slot) * 1_000.0;
    (distance_mm * distance_mm + distance_mm).round() as i128
}

fn greedy(places: &[Ned], slots: &[Ned]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..slots.len()).collect();
    let reach_m = |slot: usize| slots[slot].horizontal_distance_m(Ned::HOME);
    order.sort_by(|a, b| reach_m(*b).total_cmp(&reach_m(*a)).then(a.cmp(b)));
    let mut free: Vec<usize> = (0..places.len()).collect();
    let mut chosen = vec![0; slots.len()];
    for slot in order {
        let distance_m = |place: &usize| places[*place].horizontal_distance_m(slots[slot]);
        let nearest = free
            .iter()
            .enumerate()
            .min_by(|(_, a), (_, b)| distance_m(a).total_cmp(&distance_m(b)));
        if let Some((index, _)) = nearest {
            // `remove` keeps the order: of two places at equal distance the first is taken.
            chosen[slot] = free.remove(index);
        }
    }
    chosen
}
