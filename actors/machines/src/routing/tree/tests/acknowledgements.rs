//! Acknowledgements on their way to the master.

use super::*;

#[test]
fn acknowledgements_are_merged_towards_the_master() {
    let mut node = Node::placed(1, 0, 1, &[]);
    node.receive(
        2,
        Tree {
            alive: ids([2, 3]),
            ..child_heartbeat(2, 1, 2)
        },
    );
    let relayed = node.receive(0, order(0, ids([1, 2, 3])));
    assert_eq!(relayed.len(), 1);
    assert_eq!(
        relayed[0].to,
        Some(NodeId(2)),
        "only one child needs the order"
    );
    assert_eq!(
        relayed[0].pending,
        ids([1, 2, 3]),
        "pending members are forwarded"
    );
    node.report_delivery(&relayed[0], true);
    assert_eq!(
        node.input(ACKNOWLEDGE),
        [],
        "acknowledgements of 2 and 3 are missing"
    );
    let half = Tree {
        alive: ids([2, 3]),
        ..done(1, 2, ids([2]))
    };
    assert_eq!(node.receive(2, half), []);
    let merged = node.receive(2, done(1, 2, ids([2, 3])));
    assert_eq!(merged.len(), 1);
    assert_eq!(merged[0].to, Some(NodeId(0)));
    assert_eq!(merged[0].acknowledged, ids([1, 2, 3]));
    assert!(merged[0].order.is_none() || node.routing.policy.topology.route.routes().relay);
}

#[test]
fn missing_acknowledgement_holds_others_for_limited_time() {
    let mut node = Node::placed(1, 0, 1, &[2]);
    let relayed = node.receive(0, order(0, ids([1, 2, 3])));
    node.report_delivery(&relayed[0], true);
    assert_eq!(node.input(ACKNOWLEDGE), []);
    let alone = node.wait(200);
    assert_eq!(alone[0].acknowledged, ids([1]));
    assert_eq!(alone[0].to, Some(NodeId(0)));
}

#[test]
fn overheard_parent_confirms_an_acknowledgement() {
    for overheard in [true, false] {
        let mut node = Node::placed(2, 1, 2, &[]);
        node.receive(1, order(1, ids([1, 2])));
        let sent = node.input(ACKNOWLEDGE);
        assert_eq!(sent.len(), 1);
        if overheard {
            let merged = done(0, 1, ids([1, 2]));
            assert_eq!(node.receive(1, merged), []);
        }
        assert_eq!(node.wait(100).is_empty(), overheard);
    }
}

#[test]
fn delivered_state_is_not_sent_again() {
    let mut node = Node::placed(2, 1, 2, &[]);
    node.receive(1, order(1, ids([1, 2])));
    let sent = node.input(ACKNOWLEDGE);
    node.report_delivery(&sent[0], true);
    assert_eq!(node.wait(500), []);
    // A parent whose report lacks the delivered state has restarted.
    let sent = node.receive(
        1,
        Tree {
            order: None,
            ..order(1, ids([1, 2]))
        },
    );
    assert_eq!(sent[0].acknowledged, ids([2]));
}

#[test]
fn only_pending_members_acknowledge() {
    for (pending, answers) in [(ids([2, 3]), true), (ids([1, 3]), false)] {
        let mut node = Node::placed(2, 1, 2, &[]);
        node.receive(1, order(1, pending));
        assert_eq!(!node.input(ACKNOWLEDGE).is_empty(), answers);
        assert_eq!(!node.wait(100).is_empty(), answers);
    }
}

#[test]
fn master_names_members_with_missing_acknowledgements() {
    let mut node = Node::new(0);
    node.input(Input::Lead(MASTER));
    let first = node.input(Input::Publish {
        ballot: MASTER,
        sequence: 1,
        order: Bytes::from_static(b"go"),
    });
    assert_eq!(first[0].to, None, "the first order is a broadcast");
    assert!(first[0].pending.is_superset(&ids([1, 2, 3])));
    assert!(
        !first[0].pending.contains(NodeId(4)),
        "a relay is not awaited"
    );
    node.input(ACKNOWLEDGE);
    node.receive(1, child_heartbeat(1, 0, 1));
    node.receive(1, done(0, 1, ids([1, 2])));
    assert!(node.notices.contains(&Notice::Progress {
        sequence: 1,
        acknowledged: ids([1, 2]),
        landing: NodeSet::default()
    }));
    let heartbeat = node.next_heartbeat();
    assert_eq!(heartbeat.pending, ids([3]));
}
