use super::super::tests::neighbourhood::{Neighbourhood, member, order_of, with_route};
use super::*;
use crate::wire::Tree;

fn ids<const N: usize>(ids: [u32; N]) -> NodeSet {
    ids.into_iter().map(NodeId).collect()
}

/// A report of a neighbour with this parent and newest order.
fn following(parent: u32, sequence: u32) -> Tree {
    Tree {
        parent: Some(NodeId(parent)),
        sequence,
        ..with_route(2, 64, 1)
    }
}

#[test]
fn recipients_are_parent_children_and_requesters() {
    let mut shared = member(1);
    order_of(&mut shared, 1);
    let mut near = Neighbourhood::of(1);
    near.receive_well(0, &with_route(0, 0, 1));
    // A neighbour with another parent, a child without the order, a lossy child without it, and a child with it.
    near.receive_well(2, &following(7, 0));
    near.receive_well(3, &following(1, 0));
    near.receive_well(4, &following(1, 0));
    near.miss(4);
    near.miss(4);
    near.receive(4, following(1, 0));
    near.receive_well(5, &following(1, 1));
    let recipients = |near: &Neighbourhood, parent| {
        let times = (near.now, Neighbourhood::HEARTBEAT_PERIOD);
        Recipients::of(&shared, &near.links, parent, times)
    };
    let now = recipients(&near, None);
    assert_eq!((now.trusted, now.unaware), (ids([3]), ids([4])));
    assert_eq!(now.requesting, ids([]));
    assert_eq!(recipients(&near, Some(NodeId(0))).unaware, ids([0, 4]));
    // Requests of all neighbours are answered.
    near.links.record_request(NodeId(2));
    assert_eq!(recipients(&near, None).requesting, ids([2]));
    // Stale children may have changed parents.
    near.links.record_answer(None);
    near.now += Neighbourhood::HEARTBEAT_PERIOD * 6;
    assert!(!recipients(&near, None).needs_retransmission());
    assert!(recipients(&near, None).trusted.is_empty());
}
