use super::super::tests::neighbourhood::{Neighbourhood, with_route};
use super::*;
use crate::routing::{Reception, Tree};

/// A report of drone 2, which receives this share of drone 1's frames, in sixteenths.
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
fn neighbour_is_unreachable_at_failure_odds_of_one_in_a_thousand() {
    for (sixteenths, times) in [(16, 2), (15, 3), (12, 5), (8, 10), (1, 12)] {
        let mut near = Neighbourhood::of(1);
        near.receive_well(2, &hearing(sixteenths));
        let mut failed_deliveries = 0;
        while near.links.get(NodeId(2)).unwrap().is_reachable() {
            near.links
                .update_link(NodeId(2), |link| link.deliveries.record_failure());
            failed_deliveries += 1;
        }
        assert_eq!(failed_deliveries, times, "{sixteenths}/16 received");
        near.receive(2, hearing(sixteenths));
        assert!(near.links.get(NodeId(2)).unwrap().is_reachable());
    }
}

#[test]
fn lossless_neighbour_without_failures_or_requests_is_trusted() {
    let is_trusted = |sixteenths, change: fn(&mut Neighbourhood)| {
        let mut near = Neighbourhood::of(1);
        near.receive_well(2, &hearing(sixteenths));
        change(&mut near);
        near.links.get(NodeId(2)).unwrap().is_trusted()
    };
    assert!(is_trusted(16, |_| ()));
    assert!(!is_trusted(15, |_| ()));
    assert!(!is_trusted(16, |near| near.links.record_request(NodeId(2))));
    let give_up = |near: &mut Neighbourhood| {
        near.links
            .update_link(NodeId(2), |link| link.deliveries.record_failure());
    };
    assert!(!is_trusted(16, give_up));
}

#[test]
fn delivered_state_counts_until_a_report_contradicts_it() {
    let mut near = Neighbourhood::of(1);
    let knows_none = Tree {
        sequence: 0,
        parent: Some(NodeId(1)),
        ..with_route(2, 64, 1)
    };
    near.receive(2, knows_none.clone());
    assert!(!near.links.get(NodeId(2)).unwrap().has_order(1));
    let delivered = Tree {
        sequence: 1,
        ..Tree::default()
    };
    let delivered = crate::wire::encode_packet(&crate::routing::Packet::Tree(delivered));
    near.links
        .record_delivery(NodeId(2), &crate::wire::decode_tree(&delivered).unwrap());
    assert!(near.links.get(NodeId(2)).unwrap().has_order(1));
    near.receive(2, knows_none);
    assert!(
        !near.links.get(NodeId(2)).unwrap().has_order(1),
        "the report contradicts the delivery"
    );
}

#[test]
fn link_stays_symmetric_until_omitted_for_longer_than_stale_time() {
    let mut near = Neighbourhood::of(1);
    near.receive_well(2, &hearing(16));
    let omits_this_drone = Tree {
        hears: Some(NodeSet::from(NodeId(3))),
        ..with_route(1, 32, 1)
    };
    let forwarded = Tree {
        hears: None,
        ..with_route(1, 32, 1)
    };
    let stale = near.links.get(NodeId(2)).unwrap().quality.stale_heartbeats;
    for _ in 0..=stale {
        near.receive(2, omits_this_drone.clone());
        assert!(near.links.get(NodeId(2)).unwrap().hearing().is_symmetric());
        // A forwarded order does not report which drones are heard.
        near.receive_unmodified(2, forwarded.clone());
        near.now += Neighbourhood::HEARTBEAT_PERIOD * 9 / 10;
    }
    near.now += Neighbourhood::HEARTBEAT_PERIOD;
    near.receive(2, omits_this_drone);
    assert!(!near.links.get(NodeId(2)).unwrap().hearing().is_symmetric());
    near.receive(2, hearing(16));
    assert!(near.links.get(NodeId(2)).unwrap().hearing().is_symmetric());
}
