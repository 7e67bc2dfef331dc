use std::num::NonZeroU32;

use proptest::prelude::*;

use super::*;
use crate::formation::Kind;

const SPACING_M: f64 = 50.0;

fn formation(kind: Kind, drones: u32) -> Formation {
    Formation::new(kind, NonZeroU32::new(drones).unwrap(), SPACING_M, 0.4)
}

fn kinds() -> impl Strategy<Value = Kind> {
    let clusters = NonZeroU32::new(3).unwrap();
    prop_oneof![
        Just(Kind::Linear),
        Just(Kind::Circular),
        Just(Kind::CompactMesh),
        Just(Kind::RegularMatrix),
        (0_u64..1000).prop_map(|seed| Kind::Random { seed }),
        (60.0..400.0_f64).prop_map(move |distance_m| Kind::SplitUp {
            clusters,
            distance_m
        }),
    ]
}

fn limits(link_m: f64) -> WaveLimits {
    WaveLimits {
        layers_max: 1,
        link_m,
        ground_link_m: link_m,
        hops_max: u32::MAX,
        searches_on: false,
    }
}

/// The members that links of up to `link_m` among them connect with the first.
fn connected(places: &[(usize, Ned)], link_m: f64) -> BTreeSet<usize> {
    let mut found: Vec<(usize, Ned)> = places.first().copied().into_iter().collect();
    let mut left = places.get(1..).unwrap_or_default().to_vec();
    loop {
        let is_near = |(_, place): &(usize, Ned)| {
            let near =
                |(_, other): &(usize, Ned)| place.horizontal_distance_m(*other) <= link_m + SAME_M;
            found.iter().any(near)
        };
        let (more, rest): (Vec<_>, Vec<_>) = left.into_iter().partition(is_near);
        left = rest;
        if more.is_empty() {
            return found.into_iter().map(|(drone, _)| drone).collect();
        }
        found.extend(more);
    }
}

/// All drones, the centre first, then by rank, each in its slot.
fn in_slots(formation: &Formation) -> Vec<(usize, Ned)> {
    let mut all: Vec<(usize, Ned)> = formation.slots.iter().copied().enumerate().collect();
    all.sort_by_key(|(drone, _)| formation.ranks[*drone]);
    all
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn links_of_the_longest_length_connect_what_the_range_connects_and_shorter_ones_do_not(
        kind in kinds(), drones in 2_u32..60, range_m in 30.0..400.0_f64,
    ) {
        let formation = formation(kind, drones);
        let all = in_slots(&formation);
        let link_m = formation.longest_link_m(range_m);
        prop_assert!(link_m <= range_m);
        let parts = |link_m: f64| {
            let (mut left, mut parts) = (all.clone(), Vec::new());
            while !left.is_empty() {
                let part = connected(&left, link_m);
                left.retain(|(drone, _)| !part.contains(drone));
                parts.push(part);
            }
            parts
        };
        prop_assert_eq!(parts(link_m), parts(range_m));
        if link_m > 0.0 {
            prop_assert_ne!(parts(link_m - 2.0 * SAME_M), parts(range_m));
        }
    }

    #[test]
    fn drone_flies_by_rank_once_its_slot_is_in_reach_of_one_that_has_flown(
        kind in kinds(), drones in 2_u32..60, range_m in 30.0..400.0_f64,
    ) {
        let formation = formation(kind, drones);
        let link_m = formation.longest_link_m(range_m);
        let by_rank = in_slots(&formation);
        let of_all = connected(&by_rank, link_m);
        let reach = Reach::to_slots(&formation, limits(link_m));
        let mut before: Vec<(usize, Ned)> = Vec::new();
        for drone in &reach.order {
            let mut left = by_rank.iter().filter(|it| !before.contains(it));
            let is_in_reach = |next: &&(usize, Ned)| {
                let apart_m = |other: &(usize, Ned)| next.1.horizontal_distance_m(other.1);
                before.iter().any(|it| apart_m(it) <= link_m + SAME_M)
            };
            let first = left.clone().find(is_in_reach).or_else(|| left.next());
            prop_assert_eq!(first.map(|(drone, _)| drone), Some(drone));
            before.push((*drone, formation.slots[*drone]));
        }
        for count in 1..=drones as usize {
            let flown: Vec<usize> = by_rank[..count].iter().map(|(drone, _)| *drone).collect();
            let in_reach = connected(&by_rank[..count], link_m);
            let apart = flown.iter().filter(|it| of_all.contains(it) && !in_reach.contains(it));
            let reached = reach.reached(&flown, 0..count);
            prop_assert_eq!(apart.count(), reached.unreached);
        }
    }

    #[test]
    fn change_keeps_all_connected_after_each_drone_or_says_who_is_not(
        from in kinds(), to in kinds(), drones in 2_u32..40,
    ) {
        let [from, to] = [from, to].map(|kind| formation(kind, drones));
        let link_m = [&from, &to].map(|it| it.longest_link_m(1_000.0));
        let link_m = link_m[0].max(link_m[1]);
        let to = to.reassigned_from(&from);
        let reach = Reach::from_slots(&from.slots, &to, limits(link_m));
        prop_assert_eq!(reach.order[0], from.centre().0 as usize);
        for count in 0..=drones as usize {
            let flown = &reach.order[..count];
            let places: Vec<(usize, Ned)> = reach.order.iter().map(|drone| {
                let slots = if flown.contains(drone) { &to.slots } else { &from.slots };
                (*drone, slots[*drone])
            }).collect();
            let apart = places.len() - connected(&places, link_m).len();
            let reached = reach.reached(&reach.order, count.saturating_sub(1)..count);
            prop_assert_eq!(apart, reached.unreached);
        }
    }
}

/// A line of five whose drones fly two at a time.
#[test]
fn hops_count_the_drones_of_the_wave_that_a_link_leads_over() {
    let line = formation(Kind::Linear, 5);
    let reach = Reach::to_slots(&line, limits(SPACING_M));
    assert_eq!(reach.order, [2, 1, 3, 0, 4]);
    let hops = |wave: Range<usize>| reach.reached(&reach.order, wave).hops;
    assert_eq!(
        [hops(0..3), hops(1..3), hops(1..5), hops(3..5)],
        [1, 1, 2, 1]
    );
}

/// By rank, the inner drones would leave a gap between those that wait at the ends of the line and the others.
#[test]
fn outer_drones_of_a_line_are_not_left_behind() {
    let line = formation(Kind::Linear, 9);
    let matrix = formation(Kind::CompactMatrix, 9).reassigned_from(&line);
    let reach = Reach::from_slots(&line.slots, &matrix, limits(1.5 * SPACING_M));
    let gaps = |order: &[usize]| {
        let after = (1..=order.len()).map(|end| reach.reached(order, end - 1..end).unreached);
        after.filter(|it| *it > 0).count()
    };
    let mut by_rank: Vec<usize> = (0..9).collect();
    by_rank.sort_by_key(|drone| matrix.ranks[*drone]);
    assert!(gaps(&by_rank) > 0, "by rank some are left behind");
    assert_eq!(gaps(&reach.order), 0, "{:?}", reach.order);
}
