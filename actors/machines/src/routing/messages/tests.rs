mod faults;
mod limits;
mod net;
mod properties;

use std::time::Duration;

use bytes::Bytes;

use self::net::{Faults, Net, flood_config, leader, tree_config};
use super::*;
use crate::routing::{Config, Input, tree};
use crate::wire::{self, MESSAGE_FRAME_MAX, MESSAGE_MAX, MessageBody};

const SECOND: Duration = Duration::from_secs(1);
/// The end of the line.
const FARTHEST: usize = 7;

/// Eight drones that hear the next ones only, led by the first.
fn line(seed: u64) -> Net {
    Net::line(FARTHEST as u32 + 1, 1, tree_config, seed)
}

fn is_outcome(net: &Net, at: usize, expected: &[(u32, Outcome)]) -> bool {
    net.nodes[at].outcomes == expected
}

#[test]
fn message_reaches_the_leader_over_seven_hops_and_is_acknowledged() {
    for config in [tree_config, flood_config] {
        let mut net = Net::line(FARTHEST as u32 + 1, 1, config, 1);
        let sent_at = net.now;
        net.send(FARTHEST, 7, Destination::Leader, b"found");
        net.run(SECOND);
        let (from, payload, at) = net.nodes[0].got[0].clone();
        assert_eq!(
            (from, &payload[..]),
            (NodeId(FARTHEST as u32), &b"found"[..])
        );
        assert!(
            at.since(sent_at) < Duration::from_millis(20),
            "{:?}",
            at.since(sent_at)
        );
        assert_eq!(net.nodes[0].got.len(), 1);
        assert!(is_outcome(&net, FARTHEST, &[(7, Outcome::Delivered)]));
    }
}

#[test]
fn message_reaches_one_drone_on_another_branch() {
    for config in [tree_config, flood_config] {
        let mut net = Net::line(FARTHEST as u32 + 1, 1, config, 2);
        net.send(2, 1, Destination::Drone(NodeId(6)), b"out");
        net.send(6, 2, Destination::Drone(NodeId(1)), b"in");
        net.run(2 * SECOND);
        assert_eq!(net.payloads(6), [&b"out"[..]]);
        assert_eq!(net.payloads(1), [&b"in"[..]]);
        assert!(is_outcome(&net, 2, &[(1, Outcome::Delivered)]));
        assert!(is_outcome(&net, 6, &[(2, Outcome::Delivered)]));
    }
}

#[test]
fn message_to_neighbours_goes_one_hop_and_to_all_everywhere_once() {
    for config in [tree_config, flood_config] {
        let mut net = Net::line(FARTHEST as u32 + 1, 2, config, 3);
        net.send(3, 1, Destination::Neighbours, b"near");
        net.submit(4, 2, Destination::All, Reliability::BestEffort, b"all");
        net.run(2 * SECOND);
        for at in 0..=FARTHEST {
            let mut expected: Vec<&[u8]> = Vec::new();
            if (1..=5).contains(&at) && at != 3 {
                expected.push(b"near");
            }
            if at != 4 {
                expected.push(b"all");
            }
            let mut got = net.payloads(at);
            got.sort_unstable_by(|a, b| b.cmp(a));
            assert_eq!(got, expected, "drone {at}");
        }
        assert!(is_outcome(&net, 3, &[(1, Outcome::Delivered)]));
        assert!(is_outcome(&net, 4, &[]));
    }
}

#[test]
fn messages_that_can_not_be_sent_are_refused_with_the_reason() {
    let mut net = line(4);
    let long = vec![0; MESSAGE_MAX + 1];
    net.send(1, 1, Destination::Leader, &long);
    net.send(
        1,
        2,
        Destination::Neighbours,
        &long[..MESSAGE_FRAME_MAX + 1],
    );
    net.send(1, 3, Destination::Drone(NodeId(8)), b"");
    net.send(1, 4, Destination::All, b"");
    net.input(1, Input::Stop);
    net.send(1, 5, Destination::Leader, b"");
    let reasons = [
        DropReason::TooLong,
        DropReason::TooLong,
        DropReason::UnknownDrone,
        DropReason::NotAcknowledgeable,
        DropReason::Stopped,
    ];
    let expected: Vec<_> = (1..).zip(reasons.map(Outcome::Dropped)).collect();
    assert!(is_outcome(&net, 1, &expected));
}

#[test]
fn message_to_oneself_is_delivered_at_once() {
    let mut net = line(4);
    net.send(0, 1, Destination::Leader, b"self");
    net.send(3, 2, Destination::Drone(NodeId(3)), b"self");
    for at in [0, 3] {
        assert_eq!(net.payloads(at), [&b"self"[..]]);
        assert_eq!(net.nodes[at].sent, 0);
    }
    assert!(is_outcome(&net, 3, &[(2, Outcome::Delivered)]));
}

#[test]
fn pure_relay_passes_messages_on_and_gets_none() {
    // Drones 0 to 2 and relay 3, over which drone 2 is reached.
    let config = |id, nodes| match tree_config(id, nodes - 1) {
        Config::Tree(config) => Config::Tree(tree::Config {
            relays: 1,
            ..config
        }),
        other => other,
    };
    let mut net = Net::line(4, 1, config, 17);
    net.connect(1, 2, false);
    net.connect(1, 3, true);
    net.run(20 * SECOND);
    net.send(2, 1, Destination::Leader, b"in");
    net.submit(0, 2, Destination::All, Reliability::BestEffort, b"all");
    net.send(0, 3, Destination::Drone(NodeId(3)), b"to the relay");
    net.run(SECOND);
    assert_eq!(net.payloads(0), [&b"in"[..]]);
    assert_eq!(net.payloads(2), [&b"all"[..]]);
    assert!(net.payloads(3).is_empty() && net.nodes[3].sent > 0);
    let refused = Outcome::Dropped(DropReason::UnknownDrone);
    assert!(is_outcome(&net, 0, &[(3, refused)]));
}
