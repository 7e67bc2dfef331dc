use std::collections::BTreeMap;

use proptest::prelude::*;

use super::super::tests::neighbourhood::{Neighbourhood, carry_out, member, order_of, with_route};
use super::*;
use crate::identity::NodeId;
use crate::routing::Tree;

const REPAIR: Duration = Duration::from_millis(8);

/// Drone 1, whose parent is drone 0, with children.
struct Relay {
    near: Neighbourhood,
    core: Core,
    aggregation: Aggregation,
}

fn ids(ids: impl IntoIterator<Item = u32>) -> NodeSet {
    ids.into_iter().map(NodeId).collect()
}

/// What drone `child` says, whose parent drone 1 is, with `below` below it and itself.
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
            core: member(1),
            aggregation: Aggregation::default(),
        };
        relay.near.follow(0);
        relay.order(1);
        relay
    }

    fn order(&mut self, sequence: u32) {
        self.near.links.begin_order();
        order_of(&mut self.core, sequence);
        self.parent_says(sequence, &[]);
    }

    fn parent_says(&mut self, sequence: u32, acknowledged: &[u32]) {
        self.near.hear(
            0,
            Tree {
                sequence,
                acknowledged: ids(acknowledged.iter().copied()),
                pending: ids((1..16).filter(|id| !acknowledged.contains(id))),
                ..with_route(0, 0, 1)
            },
        );
    }

    fn pass(&mut self) -> Pass {
        let parent = self.near.links.get(NodeId(0));
        let times = (self.near.now, REPAIR);
        self.aggregation
            .pass(&self.core, &self.near.links, parent, times)
    }
}

#[test]
fn acknowledgements_are_passed_on_once_all_below_have_given_theirs_in_whichever_order() {
    let done = |relay: &mut Relay, who: u32| match who {
        1 => carry_out(&mut relay.core, 1),
        2 => relay.near.hear(2, child(1, &[2, 4], &[2, 4])),
        _ => relay.near.hear(3, child(1, &[3], &[3])),
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
        relay.near.hear(2, child(0, &[2, 4], &[]));
        relay.near.hear(3, child(1, &[3], &[]));
        assert_eq!(relay.pass(), Pass::No);
        for who in &order[..2] {
            done(&mut relay, *who);
            assert_eq!(relay.pass(), Pass::No, "{order:?}");
        }
        done(&mut relay, order[2]);
        assert_eq!(relay.pass(), Pass::Now, "{order:?}");
        assert_eq!(relay.near.links.below(1).acknowledged, ids([2, 3, 4]));
        relay.parent_says(1, &[1, 2, 3, 4]);
        assert_eq!(relay.pass(), Pass::No, "the parent has them");
    }
}

#[test]
fn who_is_going_to_land_or_out_of_reach_is_not_waited_for() {
    for lands in [true, false] {
        let mut relay = Relay::new();
        carry_out(&mut relay.core, 1);
        relay.near.hear(2, child(1, &[2], &[]));
        assert_eq!(relay.pass(), Pass::No);
        if lands {
            let landing = Tree {
                landing: ids([2]),
                ..child(1, &[2], &[])
            };
            relay.near.hear(2, landing);
        } else {
            relay.near.links.change_reach(NodeId(2), Link::suspect);
        }
        assert_eq!(relay.pass(), Pass::Now);
    }
}

#[test]
fn what_is_missing_is_waited_for_once_an_order_and_for_so_many_repairs() {
    let mut relay = Relay::new();
    carry_out(&mut relay.core, 1);
    relay.near.hear(2, child(1, &[2], &[]));
    assert_eq!(relay.pass(), Pass::No);
    let hold = relay.aggregation.deadline().unwrap();
    assert_eq!(hold, relay.near.now + REPAIR * HOLD_REPAIRS);
    relay.near.now = Timestamp::from_nanos(hold.as_nanos() - 1);
    assert!(!relay.aggregation.ends_hold(relay.near.now));
    assert_eq!(relay.pass(), Pass::No);
    relay.near.now = hold;
    assert!(relay.aggregation.ends_hold(hold) && !relay.aggregation.ends_hold(hold));
    assert_eq!(relay.aggregation.deadline(), None);
    assert_eq!(relay.pass(), Pass::Now);
    // The next order begins anew.
    relay.order(2);
    carry_out(&mut relay.core, 2);
    relay.near.hear(2, child(2, &[2], &[]));
    relay.near.now += Duration::from_secs(1);
    assert_eq!(relay.pass(), Pass::No);
    assert_eq!(
        relay.aggregation.deadline(),
        Some(relay.near.now + REPAIR * HOLD_REPAIRS)
    );
}

#[test]
fn what_comes_in_after_a_hold_is_said_in_one_frame_a_while_later() {
    let mut relay = Relay::new();
    carry_out(&mut relay.core, 1);
    relay.near.hear(2, child(1, &[2, 3], &[]));
    assert_eq!(relay.pass(), Pass::No);
    relay.near.now = relay.aggregation.deadline().unwrap();
    assert!(relay.aggregation.ends_hold(relay.near.now));
    assert_eq!(relay.pass(), Pass::Now);
    let next = relay.near.now + REPAIR * MERGED_REPAIRS;
    for acknowledged in [&[2][..], &[2, 3]] {
        relay.near.now += Duration::from_millis(1);
        relay.near.hear(2, child(1, &[2, 3], acknowledged));
        assert_eq!(relay.pass(), Pass::At(next));
    }
    relay.near.now = next;
    assert_eq!(relay.pass(), Pass::Now);
}

#[test]
fn only_who_is_pending_is_passed_on() {
    let mut relay = Relay::new();
    relay.parent_says(1, &[1]);
    carry_out(&mut relay.core, 1);
    assert_eq!(relay.pass(), Pass::No, "the master has heard of it");
    relay.near.hear(2, child(1, &[2], &[2]));
    assert_eq!(relay.pass(), Pass::Now, "and not of the child");
}

/// Something that drone 1 is told, or does.
#[derive(Debug, Clone)]
enum Told {
    /// A child says who below it has carried an order out, of some ids only if `span` says so.
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

fn told() -> impl Strategy<Value = Told> {
    let span = prop::option::of((0..8_u32, 8..16_u32));
    let set = prop::collection::vec(2..16_u32, 0..6);
    prop_oneof![
        6 => (2..6_u32, 0..4_u32, set, span, any::<bool>()).prop_map(
            |(from, sequence, acknowledged, span, is_child)| Told::Child {
                from, sequence, acknowledged, span, is_child,
            }
        ),
        1 => Just(Told::Order),
        1 => Just(Told::CarryOut),
        1 => (2..6_u32).prop_map(Told::Lost),
    ]
}

proptest! {
    /// Nobody is ever said to have carried an order out who did not say so of that very order, though drones change parents,
    /// words are cut to fit a datagram, and senders know of other orders.
    #[test]
    fn nobody_is_acknowledged_for_who_has_not_said_so(told in prop::collection::vec(told(), 1..60)) {
        let mut relay = Relay::new();
        let mut truth: BTreeMap<u32, NodeSet> = BTreeMap::new();
        for it in told {
            match it {
                Told::Child { from, sequence, acknowledged, span, is_child } => {
                    // No drone says less than before of the same order, or of an older one than it said before.
                    let before = relay.near.links.get(NodeId(from)).map_or(0, |it| it.said.sequence);
                    let said = Tree {
                        parent: Some(NodeId(if is_child { 1 } else { 7 })),
                        ..child(sequence.max(before), &acknowledged, &acknowledged)
                    };
                    let said = match span {
                        Some((begin, end)) => said.cut_to(begin..end),
                        None => said,
                    };
                    truth.entry(said.sequence).or_default().extend_from(&said.acknowledged);
                    relay.near.hear(from, said);
                }
                Told::Order => {
                    let next = relay.core.sequence() + 1;
                    relay.order(next);
                }
                Told::CarryOut => {
                    let sequence = relay.core.sequence();
                    relay.core.durable.epoch.acknowledge(relay.core.durable.epoch.ballot().unwrap(), sequence);
                }
                Told::Lost(id) => relay.near.links.forget(NodeId(id)),
            }
            let sequence = relay.core.sequence();
            let below = &relay.near.links.below(sequence).acknowledged;
            let said = truth.get(&sequence).cloned().unwrap_or_default();
            prop_assert!(said.is_superset(below), "{:?} of {:?}", below, said);
        }
    }
}
