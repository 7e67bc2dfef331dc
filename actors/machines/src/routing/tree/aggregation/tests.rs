use std::collections::BTreeMap;

use proptest::prelude::*;

use super::super::tests::neighbourhood::{Neighbourhood, carry_out, member, order_of, with_route};
use super::*;
use crate::identity::NodeId;
use crate::routing::Tree;

const REPAIR: Duration = Duration::from_millis(8);

/// Drone 1 with parent 0 and children.
struct Relay {
    near: Neighbourhood,
    shared: SharedState,
    aggregation: Aggregation,
}

fn ids(ids: impl IntoIterator<Item = u32>) -> NodeSet {
    ids.into_iter().map(NodeId).collect()
}

/// A report of a child of drone 1 with its subtree.
fn child(sequence: u32, alive: &[u32], acknowledged: &[u32]) -> Tree {
    Tree {
        parent: Some(NodeId(1)),
        sequence,
        alive: ids(alive.iter().copied()),
        acknowledged: ids(acknowledged.iter().copied()),
        ..with_route(2, 64, 1)
    }
}

impl Relay {
    /// With order 1, which its parent knows.
    fn new() -> Self {
        let mut relay = Self {
            near: Neighbourhood::of(1),
            shared: member(1),
            aggregation: Aggregation::default(),
        };
        relay.near.follow(0);
        relay.order(1);
        relay
    }

    fn order(&mut self, sequence: u32) {
        self.near.links.start_order();
        order_of(&mut self.shared, sequence);
        self.receive_from_parent(sequence, &[]);
    }

    fn receive_from_parent(&mut self, sequence: u32, acknowledged: &[u32]) {
        self.near.receive(
            0,
            Tree {
                sequence,
                acknowledged: ids(acknowledged.iter().copied()),
                pending: ids((1..16).filter(|id| !acknowledged.contains(id))),
                ..with_route(0, 0, 1)
            },
        );
    }

    fn forward(&mut self) -> Forward {
        let parent = self.near.links.get(NodeId(0));
        let times = (self.near.now, REPAIR);
        self.aggregation
            .forward(&self.shared, &self.near.links, parent, times)
    }
}

#[test]
fn acknowledgements_are_forwarded_once_the_subtree_is_complete() {
    let done = |relay: &mut Relay, who: u32| match who {
        1 => carry_out(&mut relay.shared, 1),
        2 => relay.near.receive(2, child(1, &[2, 4], &[2, 4])),
        _ => relay.near.receive(3, child(1, &[3], &[3])),
    };
    for order in [
        [1, 2, 3],
        [1, 3, 2],
        [2, 1, 3],
        [2, 3, 1],
        [3, 1, 2],
        [3, 2, 1],
    ] {
        let mut relay = Relay::new();
        relay.near.receive(2, child(0, &[2, 4], &[]));
        relay.near.receive(3, child(1, &[3], &[]));
        assert_eq!(relay.forward(), Forward::No);
        for who in &order[..2] {
            done(&mut relay, *who);
            assert_eq!(relay.forward(), Forward::No, "{order:?}");
        }
        done(&mut relay, order[2]);
        assert_eq!(relay.forward(), Forward::Now, "{order:?}");
        assert_eq!(relay.near.links.subtree(1).acknowledged, ids([2, 3, 4]));
        relay.receive_from_parent(1, &[1, 2, 3, 4]);
        assert_eq!(
            relay.forward(),
            Forward::No,
            "the parent has the acknowledgements"
        );
    }
}

#[test]
fn landing_and_unreachable_children_are_not_awaited() {
    for lands in [true, false] {
        let mut relay = Relay::new();
        carry_out(&mut relay.shared, 1);
        relay.near.receive(2, child(1, &[2], &[]));
        assert_eq!(relay.forward(), Forward::No);
        if lands {
            let landing = Tree {
                landing: ids([2]),
                ..child(1, &[2], &[])
            };
            relay.near.receive(2, landing);
        } else {
            relay
                .near
                .links
                .update_link(NodeId(2), |link| link.deliveries.mark_unreachable());
        }
        assert_eq!(relay.forward(), Forward::Now);
    }
}

#[test]
fn hold_is_limited_and_starts_once_per_order() {
    let mut relay = Relay::new();
    carry_out(&mut relay.shared, 1);
    relay.near.receive(2, child(1, &[2], &[]));
    assert_eq!(relay.forward(), Forward::No);
    let hold = relay.aggregation.deadline().unwrap();
    assert_eq!(hold, relay.near.now + REPAIR * HOLD_REPAIRS);
    relay.near.now = Timestamp::from_nanos(hold.as_nanos() - 1);
    assert!(!relay.aggregation.ends_hold(relay.near.now));
    assert_eq!(relay.forward(), Forward::No);
    relay.near.now = hold;
    assert!(relay.aggregation.ends_hold(hold) && !relay.aggregation.ends_hold(hold));
    assert_eq!(relay.aggregation.deadline(), None);
    assert_eq!(relay.forward(), Forward::Now);
    // The next order starts its own hold.
    relay.order(2);
    carry_out(&mut relay.shared, 2);
    relay.near.receive(2, child(2, &[2], &[]));
    relay.near.now += Duration::from_secs(1);
    assert_eq!(relay.forward(), Forward::No);
    assert_eq!(
        relay.aggregation.deadline(),
        Some(relay.near.now + REPAIR * HOLD_REPAIRS)
    );
}

#[test]
fn acknowledgements_after_a_hold_are_merged() {
    let mut relay = Relay::new();
    carry_out(&mut relay.shared, 1);
    relay.near.receive(2, child(1, &[2, 3], &[]));
    assert_eq!(relay.forward(), Forward::No);
    relay.near.now = relay.aggregation.deadline().unwrap();
    assert!(relay.aggregation.ends_hold(relay.near.now));
    assert_eq!(relay.forward(), Forward::Now);
    let next = relay.near.now + REPAIR * MERGE_REPAIRS;
    for acknowledged in [&[2][..], &[2, 3]] {
        relay.near.now += Duration::from_millis(1);
        relay.near.receive(2, child(1, &[2, 3], acknowledged));
        assert_eq!(relay.forward(), Forward::At(next));
    }
    relay.near.now = next;
    assert_eq!(relay.forward(), Forward::Now);
}

#[test]
fn only_pending_acknowledgements_are_forwarded() {
    let mut relay = Relay::new();
    relay.receive_from_parent(1, &[1]);
    carry_out(&mut relay.shared, 1);
    assert_eq!(
        relay.forward(),
        Forward::No,
        "the master has this acknowledgement"
    );
    relay.near.receive(2, child(1, &[2], &[2]));
    assert_eq!(
        relay.forward(),
        Forward::Now,
        "the child's acknowledgement is pending"
    );
}

/// An input of drone 1.
#[derive(Debug, Clone)]
enum Action {
    /// A child reports acknowledgements, limited to `span` if there is one.
    Child {
        from: u32,
        sequence: u32,
        acknowledged: Vec<u32>,
        span: Option<(u32, u32)>,
        is_child: bool,
    },
    Order,
    CarryOut,
    Lost(u32),
}

fn action() -> impl Strategy<Value = Action> {
    let span = prop::option::of((0..8_u32, 8..16_u32));
    let set = prop::collection::vec(2..16_u32, 0..6);
    prop_oneof![
        6 => (2..6_u32, 0..4_u32, set, span, any::<bool>()).prop_map(
            |(from, sequence, acknowledged, span, is_child)| Action::Child {
                from, sequence, acknowledged, span, is_child,
            }
        ),
        1 => Just(Action::Order),
        1 => Just(Action::CarryOut),
        1 => (2..6_u32).prop_map(Action::Lost),
    ]
}

proptest! {
    /// An acknowledgement is merged only if a member reported it for that order, though drones change parents, reports
    /// are cut to fit a datagram, and senders know other orders.
    #[test]
    fn acknowledgement_needs_the_members_own_report(actions in prop::collection::vec(action(), 1..60)) {
        let mut relay = Relay::new();
        let mut truth: BTreeMap<u32, NodeSet> = BTreeMap::new();
        for it in actions {
            match it {
                Action::Child { from, sequence, acknowledged, span, is_child } => {
                    // A drone never reports less for the same order, nor an older order than before.
                    let before = relay.near.links.get(NodeId(from)).map_or(0, |it| it.report.sequence);
                    let report = Tree {
                        parent: Some(NodeId(if is_child { 1 } else { 7 })),
                        ..child(sequence.max(before), &acknowledged, &acknowledged)
                    };
                    let report = match span {
                        Some((begin, end)) => report.cut_to(begin..end),
                        None => report,
                    };
                    truth.entry(report.sequence).or_default().extend_from(&report.acknowledged);
                    relay.near.receive(from, report);
                }
                Action::Order => {
                    let next = relay.shared.sequence() + 1;
                    relay.order(next);
                }
                Action::CarryOut => {
                    let sequence = relay.shared.sequence();
                    relay.shared.durable.epoch.acknowledge(relay.shared.durable.epoch.ballot().unwrap(), sequence);
                }
                Action::Lost(id) => relay.near.links.forget(NodeId(id)),
            }
            let sequence = relay.shared.sequence();
            let subtree = &relay.near.links.subtree(sequence).acknowledged;
            let report = truth.get(&sequence).cloned().unwrap_or_default();
            prop_assert!(report.is_superset(subtree), "{:?} of {:?}", subtree, report);
        }
    }
}
