use super::super::tests::neighbourhood::{Neighbourhood, with_route};
use super::*;
use crate::routing::{Reception, Tree};

/// What drone 2 says, which hears that share of drone 1's frames, in sixteenths.
fn hearing(sixteenths: u8) -> Tree {
    let reception = Reception {
        id: NodeId(1),
        sixteenths,
    };
    Tree {
        weak: Some(reception)
            .filter(|it| it.sixteenths < 16)
            .into_iter()
            .collect(),
        ..with_route(1, 32, 1)
    }
}

#[test]
fn a_neighbour_is_out_of_reach_once_its_link_explains_it_once_in_a_thousand_times() {
    for (sixteenths, times) in [(16, 2), (15, 3), (12, 5), (8, 10), (1, 12)] {
        let mut near = Neighbourhood::of(1);
        near.hear_well(2, &hearing(sixteenths));
        let mut given_up = 0;
        while near.links.get(NodeId(2)).unwrap().is_reachable() {
            near.links.change_reach(NodeId(2), Link::give_up_once);
            given_up += 1;
        }
        assert_eq!(given_up, times, "{sixteenths} of sixteen are heard");
        near.hear(2, hearing(sixteenths));
        assert!(near.links.get(NodeId(2)).unwrap().is_reachable());
    }
}

#[test]
fn trusted_is_who_hears_well_has_missed_nothing_since_and_does_not_ask() {
    let is_trusted = |sixteenths, change: fn(&mut Neighbourhood)| {
        let mut near = Neighbourhood::of(1);
        near.hear_well(2, &hearing(sixteenths));
        change(&mut near);
        near.links.get(NodeId(2)).unwrap().is_trusted()
    };
    assert!(is_trusted(16, |_| ()));
    assert!(!is_trusted(15, |_| ()));
    assert!(!is_trusted(16, |near| near.links.asks(NodeId(2))));
    let give_up = |near: &mut Neighbourhood| {
        near.links.change_reach(NodeId(2), Link::give_up_once);
    };
    assert!(!is_trusted(16, give_up));
}

#[test]
fn what_arrived_is_known_there_until_the_neighbour_shows_that_it_is_not() {
    let mut near = Neighbourhood::of(1);
    let knows_none = Tree {
        sequence: 0,
        parent: Some(NodeId(1)),
        ..with_route(2, 64, 1)
    };
    near.hear(2, knows_none.clone());
    assert!(!near.links.get(NodeId(2)).unwrap().knows(1));
    let told = Tree {
        sequence: 1,
        ..Tree::default()
    };
    let told = crate::wire::encode_packet(&crate::routing::Packet::Tree(told));
    near.links
        .told(NodeId(2), &crate::wire::decode_tree(&told).unwrap());
    assert!(near.links.get(NodeId(2)).unwrap().knows(1));
    near.hear(2, knows_none);
    assert!(!near.links.get(NodeId(2)).unwrap().knows(1), "it restarted");
}

#[test]
fn a_link_counts_both_ways_until_it_is_left_out_for_longer_than_by_chance() {
    let mut near = Neighbourhood::of(1);
    near.hear_well(2, &hearing(16));
    let leaves_out = Tree {
        hears: Some(NodeSet::from(NodeId(3))),
        ..with_route(1, 32, 1)
    };
    let passes_on = Tree {
        hears: None,
        ..with_route(1, 32, 1)
    };
    let stale = near.links.get(NodeId(2)).unwrap().quality.stale_beacons;
    for _ in 0..=stale {
        near.hear(2, leaves_out.clone());
        assert!(near.links.get(NodeId(2)).unwrap().symmetric);
        // An order that it passes on does not say which drones it hears.
        near.hear_as_it_is(2, passes_on.clone());
        near.now += Neighbourhood::BEACON * 9 / 10;
    }
    near.now += Neighbourhood::BEACON;
    near.hear(2, leaves_out);
    assert!(!near.links.get(NodeId(2)).unwrap().symmetric);
    near.hear(2, hearing(16));
    assert!(near.links.get(NodeId(2)).unwrap().symmetric);
}
