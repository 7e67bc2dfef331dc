//! State that does not fit one datagram.

use super::*;

/// Every second of 10,000 drones.
fn every_other() -> NodeSet {
    (0..10_000).step_by(2).map(NodeId).collect()
}

#[test]
fn large_state_is_sent_in_several_datagrams() {
    let drones = 10_000;
    let config = |id| Config {
        drones,
        relays: 0,
        ..config(id)
    };
    let mut child = Node::new(1);
    child.routing = routing(config(1));
    child.receive(0, master_heartbeat(1));
    child.receive(0, order(0, every_other()));
    let mut subtree = done(1, 2, every_other());
    subtree.hops = Some(2);
    // The report exceeds a datagram, so it arrives in two.
    for span in [0..5_000, 5_000..drones] {
        child.receive(2, subtree.cut_to(span));
    }
    let mut parent = Node::new(0);
    parent.routing = routing(config(0));
    parent.input(Input::Lead(MASTER));
    parent.input(Input::Publish {
        ballot: MASTER,
        sequence: 1,
        order: Bytes::from_static(b"go"),
    });
    parent.stimulate(Stimulus::Timeout);
    let acknowledged = |parent: &Node| {
        parent
            .routing
            .policy
            .topology
            .links
            .subtree(1)
            .acknowledged
            .clone()
    };
    for frames in 1.. {
        assert!(frames < 20, "all acknowledgements arrive");
        let Dissemination { shared, policy, .. } = &mut child.routing;
        policy.send_state(shared, child.now, Reason::Change);
        for sent in child.stimulate(Stimulus::Timeout) {
            assert!(wire::encode_packet(&Packet::Tree(sent.clone())).len() <= wire::PAYLOAD_MAX);
            assert!(sent.span.is_some());
            parent.receive(1, sent);
        }
        if acknowledged(&parent) == every_other() {
            break;
        }
    }
    // Acknowledgements of this order do not count for the next one.
    let next = Tree {
        sequence: 2,
        ..done(0, 1, ids([7]))
    };
    parent.receive(1, next.cut_to(0..100));
    assert_eq!(acknowledged(&parent), NodeSet::default());
}

#[test]
fn partial_report_does_not_change_link_symmetry() {
    let mut node = Node::placed(1, 0, 1, &[]);
    for _ in 0..5 {
        node.receive(
            0,
            Tree {
                span: Some(2..4),
                hears: Some(ids([2])),
                ..master_heartbeat(1)
            },
        );
        node.now += Duration::from_secs(1);
    }
    assert!(
        node.routing
            .policy
            .topology
            .links
            .get(NodeId(0))
            .is_some_and(|link| link.hearing().is_symmetric())
    );
}
