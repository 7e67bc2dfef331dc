//! Which drones in slots are within radio range of each other, and in which order drones fly so that they stay so.

use std::collections::{BTreeSet, VecDeque};
use std::ops::Range;

use super::crossings::pairs_within;
use super::phases::SAME_M;
use super::{Formation, WaveLimits};
use crate::geometry::Ned;

impl Formation {
    /// Longest distance over ground between two slots that a swarm with links of up to `range_m` metres relies on: links
    /// of this length connect all slots that longer links connect. 0 without links.
    ///
    /// It is the longest edge in range of the minimum spanning tree of the slots (Prim, 1957), in time O(n²).
    #[must_use]
    pub fn longest_link_m(&self, range_m: f64) -> f64 {
        // Distance of each slot from the nearest slot of the tree.
        let mut open: Vec<_> = self.slots.iter().map(|it| (it, f64::INFINITY)).collect();
        let mut longest_m: f64 = 0.0;
        let mut last = open.pop();
        while let Some((slot, _)) = last {
            for (other, apart_m) in &mut open {
                *apart_m = apart_m.min(slot.horizontal_distance_m(**other));
            }
            let nearest = (0..open.len()).min_by(|a, b| open[*a].1.total_cmp(&open[*b].1));
            last = nearest.map(|it| open.swap_remove(it));
            longest_m = last
                .map(|(_, apart_m)| apart_m)
                .filter(|it| *it <= range_m)
                .map_or(longest_m, |it| longest_m.max(it));
        }
        longest_m
    }
}

/// The order in which drones fly in waves, and which links connect them with the centre after each wave.
///
/// Drones fly by rank, from the centre outwards, but none before there is a link to its slot. In a change of formation, or
/// from places far apart on the ground, those that have not flown stay connected, too.
#[derive(Debug)]
pub(super) struct Reach {
    /// Each drone once, the centre first.
    pub(super) order: Vec<usize>,
    /// Links of each drone's new place, then of each drone's old place, where old places matter.
    links: Vec<Vec<usize>>,
    /// Whether links connect each drone with the centre once all have flown.
    is_connected: Vec<bool>,
}

/// Lengths of links over ground, in metres.
#[derive(Debug, Clone, Copy)]
struct LinksM {
    among_new: f64,
    among_old: f64,
    between: f64,
}

/// Who is connected with the centre after a wave.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Reached {
    /// Number of drones that are not, though they will be once all have flown.
    pub(super) unreached: usize,
    /// Most drones of the wave over which links lead to one drone.
    pub(super) hops: u32,
}

/// Largest swarm for which orders are searched for that keep all drones connected, in time O(n³).
pub const SEARCHED_MAX: usize = 128;

/// Length of links between drones on the ground, as a multiple of the distance of their places.
const GROUND_LINK: f64 = 2.0;

impl Reach {
    /// Of a landing, or of a take-off from places close to each other: drones on the ground are taken to be connected.
    pub(super) fn to_slots(formation: &Formation, waves: WaveLimits) -> Self {
        let links = LinksM {
            among_new: waves.link_m,
            among_old: 0.0,
            between: 0.0,
        };
        Self::outwards(formation, &[], links)
    }

    /// Of a take-off from places on the ground, the nearest `gap_m` apart.
    pub(super) fn from_ground(
        places: &[Ned],
        gap_m: f64,
        formation: &Formation,
        waves: WaveLimits,
    ) -> Self {
        let links = LinksM {
            among_new: waves.link_m,
            among_old: GROUND_LINK * gap_m,
            between: waves.ground_link_m,
        };
        Self::outwards(formation, places, links).searched(places)
    }

    /// Of a change from slots to a formation.
    pub(super) fn from_slots(from: &[Ned], formation: &Formation, waves: WaveLimits) -> Self {
        let links = LinksM {
            among_new: waves.link_m,
            among_old: waves.link_m,
            between: waves.link_m,
        };
        Self::outwards(formation, from, links).searched(from)
    }

    /// From the centre outwards.
    fn outwards(formation: &Formation, old: &[Ned], lengths: LinksM) -> Self {
        let new = formation.slots();
        let all = [new, old].concat();
        let longest_m = lengths
            .among_new
            .max(lengths.among_old)
            .max(lengths.between);
        let mut links = vec![Vec::new(); all.len()];
        for [a, b] in pairs_within(&all, longest_m + SAME_M) {
            let link_m = match (a < new.len(), b < new.len()) {
                (true, true) => lengths.among_new,
                (false, false) => lengths.among_old,
                _ => lengths.between,
            };
            if all[a].horizontal_distance_m(all[b]) <= link_m + SAME_M {
                links[a].push(b);
                links[b].push(a);
            }
        }
        let by_rank = |drone: usize| (formation.ranks()[drone], drone);
        let mut open: BTreeSet<_> = (0..new.len()).map(by_rank).collect();
        let mut in_reach = BTreeSet::new();
        let mut order = Vec::with_capacity(new.len());
        while let Some(next) = in_reach.pop_first().or_else(|| open.first().copied()) {
            open.remove(&next);
            let (_, drone) = next;
            order.push(drone);
            let linked = links[drone].iter().filter(|it| **it < new.len());
            in_reach.extend(linked.map(|it| by_rank(*it)).filter(|it| open.contains(it)));
        }
        let mut reach = Self {
            is_connected: vec![true; order.len()],
            links,
            order,
        };
        let hops = reach.hops(&reach.order, 0..reach.order.len());
        reach.is_connected = hops.iter().map(Option::is_some).collect();
        reach
    }

    /// Searches for an order that keeps all connected: of drones from the centre outwards, or of those that come from
    /// farthest away.
    fn searched(mut self, old: &[Ned]) -> Self {
        if self.order.len() > SEARCHED_MAX {
            return self;
        }
        let links = LinkMasks::new(&self);
        let (gaps, mut order) = links.connected_order(&self.order);
        if gaps > 0 {
            let mut inwards = self.order.clone();
            inwards[1..].sort_by(|a, b| {
                let [a_m, b_m] = [a, b].map(|it| old[*it].horizontal_distance_m(Ned::HOME));
                b_m.total_cmp(&a_m).then(a.cmp(b))
            });
            let (fewer, other) = links.connected_order(&inwards);
            if fewer < gaps {
                order = other;
            }
        }
        self.order = order;
        self
    }

    /// The first drone in order with a link between its slot and that of `drone`. `None` if one of them `is_before` this one,
    /// or for the centre.
    pub(super) fn needed(&self, drone: usize, is_before: impl Fn(usize) -> bool) -> Option<usize> {
        let drones = self.order.len();
        let linked = self.links[drone].iter().filter(|it| **it < drones);
        if drone == self.order[0] || linked.clone().any(|it| is_before(*it)) {
            return None;
        }
        let mut order = self.order.iter().copied();
        order.find(|drone| linked.clone().any(|it| it == drone))
    }

    /// Who is connected with the centre after the drones in `wave`, a range of `order`, and all before them have flown.
    pub(super) fn reached(&self, order: &[usize], wave: Range<usize>) -> Reached {
        let has_old_places = self.links.len() > self.order.len();
        let placed = if has_old_places {
            &self.order[..]
        } else {
            &order[..wave.end]
        };
        let hops = self.hops(order, wave);
        let placed = placed.iter().filter(|it| self.is_connected[**it]);
        let placed = placed.map(|it| hops[*it]);
        Reached {
            unreached: placed.clone().filter(Option::is_none).count(),
            hops: placed.flatten().max().unwrap_or(0),
        }
    }

    /// For each drone, the fewest drones of `wave` over which links lead to it from the centre; `None` without such links.
    fn hops(&self, order: &[usize], wave: Range<usize>) -> Vec<Option<u32>> {
        let drones = self.is_connected.len();
        let (mut has_flown, mut is_in_wave) = (vec![false; drones], vec![false; drones]);
        for drone in &order[..wave.end] {
            has_flown[*drone] = true;
        }
        for drone in &order[wave] {
            is_in_wave[*drone] = true;
        }
        let is_occupied = |place: usize| (place < drones) == has_flown[place % drones];
        let mut hops = vec![None; drones];
        let centre = self.order[0];
        let mut places = [centre, centre + drones].into_iter();
        let begin = places.find(|it| *it < self.links.len() && is_occupied(*it));
        let mut next: VecDeque<(usize, u32)> = begin.map(|it| (it, 0)).into_iter().collect();
        while let Some((place, over)) = next.pop_front() {
            let drone = place % drones;
            if hops[drone].is_some_and(|it| it <= over) {
                continue;
            }
            hops[drone] = Some(over);
            for linked in self.links[place].iter().filter(|it| is_occupied(**it)) {
                if is_in_wave[linked % drones] {
                    next.push_back((*linked, over + 1));
                } else {
                    next.push_front((*linked, over));
                }
            }
        }
        hops
    }
}

/// The links of a [`Reach`] as sets of drones, a bit each, for a search that looks at thousands of orders.
struct LinkMasks {
    centre: usize,
    is_connected: u128,
    /// For the new and the old place of each drone, the drones with linked new places and those with linked old places.
    linked: [Vec<[u128; 2]>; 2],
}

impl LinkMasks {
    fn new(reach: &Reach) -> Self {
        let drones = reach.order.len();
        let masks = |linked: &Vec<usize>| {
            let mut masks = [0; 2];
            for place in linked {
                masks[place / drones] |= 1 << (place % drones);
            }
            masks
        };
        let [new, old] = [&reach.links[..drones], &reach.links[drones..]];
        let is_connected = reach.is_connected.iter().enumerate();
        Self {
            centre: reach.order[0],
            is_connected: is_connected.fold(0, |all, (drone, it)| all | u128::from(*it) << drone),
            linked: [new, old].map(|places| places.iter().map(masks).collect()),
        }
    }

    /// An order in which each drone is the first of those left of `preferred` that keeps all connected, or the first of all
    /// if none does; and how often none does.
    fn connected_order(&self, preferred: &[usize]) -> (usize, Vec<usize>) {
        let (mut order, mut left) = (Vec::with_capacity(preferred.len()), preferred.to_vec());
        let (mut gaps, mut flown) = (0, 0_u128);
        while !left.is_empty() {
            let keeps_connected = |next: &usize| self.are_connected(flown | 1 << *next);
            let next = left.iter().position(keeps_connected);
            gaps += usize::from(next.is_none());
            let next = left.remove(next.unwrap_or(0));
            flown |= 1 << next;
            order.push(next);
        }
        (gaps, order)
    }

    /// Whether links connect all drones with the centre, with those that have `flown` in their new places.
    fn are_connected(&self, flown: u128) -> bool {
        let mut reached: u128 = 1 << self.centre;
        let mut next = reached;
        while next != 0 {
            let drone = next.trailing_zeros() as usize;
            next &= next - 1;
            let [new, old] = self.linked[usize::from(flown >> drone & 1 == 0)][drone];
            let more = (new & flown | old & !flown) & !reached;
            reached |= more;
            next |= more;
        }
        self.is_connected & !reached == 0
    }
}

#[cfg(test)]
mod tests;
