//! Orders on their way outwards, and their repair.

use super::*;

#[test]
fn only_parents_forward_orders() {
    let mut leaf = Node::placed(2, 1, 2, &[]);
    assert_eq!(leaf.receive(1, order(1, ids([2]))), []);
    assert_eq!(leaf.wait(200), []);
    let mut relay = Node::placed(1, 0, 1, &[2, 3]);
    let forwarded = relay.receive(0, order(0, ids([1, 2, 3])));
    assert_eq!(forwarded[0].order, Some(Bytes::from_static(b"go")));
    assert_eq!(forwarded[0].to, None, "two children need the order");
}

#[test]
fn unacknowledged_order_is_repeated_with_back_off() {
    let mut node = Node::placed(1, 0, 1, &[2]);
    // A leaf over a lossy link is not trusted to have received the order.
    node.numbers.insert(2, 40);
    node.receive(2, child_heartbeat(2, 1, 2));
    node.receive(0, order(0, ids([1, 2])));
    let (early, late) = (node.wait(100).len(), node.wait(100).len());
    assert!(early > late && late > 0, "{early}, then {late}");
    node.receive(
        2,
        Tree {
            sequence: 1,
            ..child_heartbeat(2, 1, 2)
        },
    );
    assert_eq!(node.wait(500), [], "the child has confirmed the order");
}

#[test]
fn repair_is_sent_to_the_neighbour_that_lacks_the_order() {
    let mut node = Node::placed(1, 0, 1, &[2, 3]);
    node.numbers.extend([(2, 40), (3, 40)]);
    for child in [2, 3] {
        node.receive(child, child_heartbeat(child, 1, 2));
    }
    node.receive(0, order(0, ids([1, 2, 3])));
    node.receive(
        2,
        Tree {
            sequence: 1,
            ..child_heartbeat(2, 1, 2)
        },
    );
    let repair = node.wait(20);
    assert_eq!(repair[0].to, Some(NodeId(3)));
    assert!(repair[0].order.is_some());
}

#[test]
fn undelivered_frame_is_repaired_sooner() {
    let is_repeated_within = |delivered: Option<bool>, millis: u64| {
        let mut node = Node::placed(2, 1, 2, &[]);
        node.receive(1, order(1, ids([1, 2])));
        let sent = node.input(ACKNOWLEDGE);
        if let Some(delivered) = delivered {
            node.report_delivery(&sent[0], delivered);
        }
        !node.wait(millis).is_empty()
    };
    assert!(!is_repeated_within(None, 3) && is_repeated_within(None, 12));
    assert!(is_repeated_within(Some(false), 3));
    assert!(!is_repeated_within(Some(true), 500));
}

#[test]
fn parent_with_two_failed_deliveries_is_replaced() {
    let mut node = Node::placed(3, 1, 2, &[]);
    let sibling = |heartbeat| Tree {
        parent: Some(NodeId(1)),
        hears: Some(ids([3])),
        heartbeat,
        ..order(2, ids([1, 2, 3]))
    };
    node.receive(2, sibling(1));
    node.receive(1, order(1, ids([1, 2, 3])));
    let sent = node.input(ACKNOWLEDGE);
    node.report_delivery(&sent[0], false);
    assert_eq!(node.parent(), Some(NodeId(1)), "one failure proves nothing");
    node.report_delivery(&sent[0], false);
    assert_eq!(
        node.parent(),
        Some(NodeId(1)),
        "the other route is not feasible yet"
    );
    let mut sent = node.receive(2, sibling(9));
    assert_eq!(node.parent(), Some(NodeId(2)));
    sent.extend(node.wait(200));
    assert!(sent.iter().any(|it| it.to == Some(NodeId(2))), "{sent:?}");
}

#[test]
fn unreachable_child_does_not_hold_acknowledgements() {
    let mut node = Node::placed(1, 0, 1, &[2]);
    let relayed = node.receive(0, order(0, ids([1, 2])));
    node.input(ACKNOWLEDGE);
    node.report_delivery(&relayed[0], false);
    let alone = node.report_delivery(&relayed[0], false);
    assert_eq!(alone[0].acknowledged, ids([1]));
    assert_eq!(alone[0].to, Some(NodeId(0)));
}

#[test]
fn only_requested_neighbours_answer() {
    for (probes, is_answered) in [(3, false), (1, true)] {
        let mut node = Node::placed(1, 0, 1, &[2]);
        node.receive(0, order(0, ids([1, 2, 3])));
        let repeated = Tree {
            alive: ids([2, 3]),
            ..done(1, 2, ids([2]))
        };
        node.receive(2, repeated.clone());
        assert_eq!(node.wait(20), []);
        node.receive(
            2,
            Tree {
                requests: ids([probes]),
                to: None,
                ..repeated
            },
        );
        let answers = node.wait(20);
        assert_eq!(!answers.is_empty(), is_answered);
        assert!(answers.iter().all(|answer| answer.to == Some(NodeId(2))));
    }
}

#[test]
fn drones_without_routes_exchange_only_orders() {
    for (hops, sequence, is_answered) in [(None, 0, false), (Some(1), 0, true), (None, 1, true)] {
        let mut node = Node::new(1);
        node.receive(2, Tree::default());
        node.wait(2_000);
        assert_eq!(node.parent(), None);
        let requests = Tree {
            hops,
            sequence,
            requests: ids([1]),
            ..Tree::default()
        };
        node.receive(2, requests);
        let answers = node.wait(20).iter().any(|sent| sent.requests.is_empty());
        assert_eq!(answers, is_answered, "{hops:?}, {sequence}");
    }
}

#[test]
fn pure_relay_forwards_and_is_not_awaited() {
    let mut relay = Node::placed(4, 0, 1, &[2]);
    let forwarded = relay.receive(0, order(0, ids([2])));
    assert_eq!(forwarded[0].to, Some(NodeId(2)));
    assert!(forwarded[0].order.is_some());
    relay.report_delivery(&forwarded[0], true);
    let merged = relay.receive(2, done(4, 2, ids([2])));
    assert_eq!(merged[0].to, Some(NodeId(0)));
    assert_eq!(merged[0].acknowledged, ids([2]));
    assert_eq!(merged[0].alive, ids([2]), "a relay is no member");
    relay.wait(60_000);
    assert_eq!(relay.notices, [], "a relay has no protocol");
}
