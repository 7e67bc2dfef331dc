mod faults;
mod leaving;
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

#[test]
fn large_message_arrives_however_many_small_ones_are_sent_meanwhile() {
    let mut net = Net::line(2, 1, tree_config, 77);
    let large: Vec<u8> = (0..500_000_u32).map(|it| it as u8).collect();
    net.send(1, 0, Destination::Leader, &large);
    for id in 1..=3_200 {
        net.submit(
            1,
            id,
            Destination::Leader,
            Reliability::BestEffort,
            b"position",
        );
        net.run(SECOND / 35);
    }
    net.run(60 * SECOND);
    let is_large = |payload: &[u8]| payload == large;
    let got = net.nodes[0].got.iter().filter(|(_, it, _)| is_large(it));
    assert_eq!(got.count(), 1);
    assert!(net.nodes[1].outcomes.contains(&(0, Outcome::Delivered)));
}

#[test]
fn acknowledged_message_arrives_once_its_receiver_is_back_however_many_are_sent_meanwhile() {
    // Drone 2 is cut off while 1 tells its neighbours something all the time.
    let mut net = Net::line(3, 2, tree_config, 78);
    let mut id = 0;
    let mut tell_neighbours = |net: &mut Net, times: u32| {
        for _ in 0..times {
            id += 1;
            net.submit(
                1,
                id,
                Destination::Neighbours,
                Reliability::BestEffort,
                b"here",
            );
            net.run(SECOND / 45);
        }
    };
    tell_neighbours(&mut net, 4);
    let connect = |net: &mut Net, is_connected| {
        net.connect(2, 0, is_connected);
        net.connect(2, 1, is_connected);
    };
    connect(&mut net, false);
    net.send(1, 1_000_000, Destination::Drone(NodeId(2)), b"come down");
    tell_neighbours(&mut net, 1_152);
    connect(&mut net, true);
    tell_neighbours(&mut net, 450);
    net.run(10 * SECOND);
    let come_down = |payload: &[u8]| payload == b"come down";
    let got = net.nodes[2].got.iter().filter(|(_, it, _)| come_down(it));
    assert_eq!(got.count(), 1);
    let outcomes = &net.nodes[1].outcomes;
    assert!(outcomes.contains(&(1_000_000, Outcome::Delivered)));
}

#[test]
fn message_that_is_refused_displaces_none() {
    let mut own = own::Own::new();
    let mut submit = |id, reliability, len: usize| {
        let outgoing = Outgoing {
            id,
            to: Destination::Leader,
            reliability,
            payload: vec![0; len].into(),
        };
        own.submit(Timestamp::ZERO, outgoing)
    };
    let (acknowledged, best_effort) = (Reliability::Acknowledged, Reliability::BestEffort);
    assert!(submit(1, acknowledged, MESSAGE_MAX).is_empty());
    assert!(submit(2, acknowledged, MESSAGE_MAX - 50_000).is_empty());
    for id in 10..40 {
        assert!(submit(id, best_effort, 1_000).is_empty());
    }
    assert_eq!(submit(98, acknowledged, MESSAGE_MAX), [98]);
    assert_eq!(submit(99, acknowledged, 49_000), Vec::from_iter(10..39));
}
