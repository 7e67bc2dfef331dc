mod net;

use std::time::Duration;

use bytes::Bytes;
use proptest::prelude::*;

use self::net::{Faults, Net, flood_config, leader, tree_config};
use super::limits::{QUEUE_MAX, SEND_BUDGET};
use super::*;
use crate::routing::Input;
use crate::wire::{self, MessageBody};

const SECOND: Duration = Duration::from_secs(1);
const FARTHEST: usize = 7;

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
fn message_expires_in_a_partition() {
    let mut net = line(5);
    net.connect(3, 4, false);
    net.send(FARTHEST, 1, Destination::Leader, b"cut off");
    net.submit(
        6,
        2,
        Destination::Leader,
        Reliability::BestEffort,
        b"cut off",
    );
    net.run(31 * SECOND);
    assert!(net.nodes[0].got.is_empty());
    assert!(is_outcome(&net, FARTHEST, &[(1, Outcome::Expired)]));
}

#[test]
fn message_survives_a_short_partition() {
    let mut net = line(6);
    net.connect(3, 4, false);
    net.send(FARTHEST, 1, Destination::Leader, b"late");
    net.run(8 * SECOND);
    net.connect(3, 4, true);
    net.run(20 * SECOND);
    assert_eq!(net.payloads(0), [&b"late"[..]]);
    assert!(is_outcome(&net, FARTHEST, &[(1, Outcome::Delivered)]));
}

#[test]
fn message_goes_around_a_relay_that_fails() {
    for reports in [false, true] {
        let mut net = Net::line(8, 2, tree_config, 7);
        net.faults.reports = reports;
        for id in 0..20 {
            if id == 3 {
                net.kill(4);
            }
            net.send(FARTHEST, id, Destination::Leader, &[id as u8]);
            net.run(SECOND / 4);
        }
        net.run(20 * SECOND);
        assert_eq!(net.payloads(0).len(), 20);
        assert!(
            net.nodes[FARTHEST]
                .outcomes
                .iter()
                .all(|(_, it)| *it == Outcome::Delivered)
        );
    }
}

#[test]
fn messages_to_the_leader_go_to_the_new_one() {
    let mut net = Net::line(8, 2, tree_config, 8);
    net.kill(0);
    net.send(FARTHEST, 1, Destination::Leader, b"to whom?");
    net.run(SECOND);
    net.input(1, Input::Lead(leader(2, 1)));
    net.run(10 * SECOND);
    assert_eq!(net.payloads(1), [&b"to whom?"[..]]);
    assert!(is_outcome(&net, FARTHEST, &[(1, Outcome::Delivered)]));
}

#[test]
fn restarted_relay_and_receiver_lose_no_acknowledged_message() {
    let mut net = line(9);
    for id in 0..12 {
        net.send(FARTHEST, id, Destination::Leader, &[id as u8]);
        if id % 4 == 0 {
            net.restart(3);
        }
        net.run(SECOND / 100);
    }
    net.run(29 * SECOND);
    let mut got = net.payloads(0);
    got.sort_unstable();
    assert_eq!(got.len(), 12);
    assert_eq!(net.nodes[FARTHEST].outcomes.len(), 12);
}

#[test]
fn large_message_arrives_whole_in_spite_of_losses() {
    let mut net = Net::line(4, 1, tree_config, 10);
    net.faults = Faults::loss(0.2);
    let large: Vec<u8> = (0..100_000_u32).map(|it| (it % 251) as u8).collect();
    net.send(3, 1, Destination::Leader, &large);
    net.send(3, 2, Destination::Leader, b"small");
    net.run(30 * SECOND);
    let got = net.payloads(0);
    assert_eq!(got.len(), 2);
    assert_eq!(
        got[0],
        &b"small"[..],
        "a small message overtakes the pieces"
    );
    assert!(got[1] == large);
    assert!(is_outcome(
        &net,
        3,
        &[(2, Outcome::Delivered), (1, Outcome::Delivered)]
    ));
}

#[test]
fn large_message_starts_over_at_a_new_leader_and_a_restarted_receiver() {
    let mut net = Net::line(5, 2, tree_config, 11);
    let large = vec![3; 60_000];
    net.send(4, 1, Destination::Leader, &large);
    net.run(SECOND / 2);
    net.kill(0);
    net.input(1, Input::Lead(leader(2, 1)));
    net.run(10 * SECOND);
    assert!(net.payloads(1) == [large.clone()]);
    net.send(1, 2, Destination::Drone(NodeId(4)), &large);
    net.run(SECOND / 2);
    net.restart(4);
    net.run(15 * SECOND);
    assert!(net.payloads(4).ends_with(&[large.into()]));
    assert!(is_outcome(&net, 1, &[(2, Outcome::Delivered)]));
}

#[test]
fn full_queue_drops_the_oldest_best_effort_message_first() {
    let mut net = line(12);
    // Without a leader's route nothing leaves.
    (0..FARTHEST).for_each(|at| net.kill(at));
    net.run(20 * SECOND);
    for id in 0..200 {
        let reliability = if id % 2 == 0 {
            Reliability::BestEffort
        } else {
            Reliability::Acknowledged
        };
        net.submit(FARTHEST, id, Destination::Leader, reliability, b"");
    }
    let dropped: Vec<_> = (net.nodes[FARTHEST].outcomes.iter())
        .map(|(id, outcome)| {
            assert_eq!(*outcome, Outcome::Dropped(DropReason::QueueFull));
            *id
        })
        .collect();
    assert!(dropped.len() >= 200 - QUEUE_MAX - 20);
    let first_refused = dropped.iter().position(|id| id % 2 == 1).unwrap();
    assert!(dropped[..first_refused].is_sorted() && first_refused > QUEUE_MAX / 4);
}

#[test]
fn sender_at_ten_times_its_budget_costs_no_one_else_a_message() {
    let mut net = line(13);
    let period = SECOND / 400;
    for nth in 0..4_000_u32 {
        net.submit(
            4,
            nth,
            Destination::Leader,
            Reliability::BestEffort,
            &[0; 64],
        );
        let other = [1, 2, 3, 5, 6, 7][(nth / 40) as usize % 6];
        if nth % 40 == 0 {
            net.submit(
                other,
                nth,
                Destination::Leader,
                Reliability::BestEffort,
                &[other as u8],
            );
        }
        net.run(period);
    }
    net.run(5 * SECOND);
    let others = net.payloads(0).into_iter().filter(|it| it.len() == 1);
    assert_eq!(others.count(), 100);
    let greedy = net
        .payloads(0)
        .into_iter()
        .filter(|it| it.len() == 64)
        .count();
    assert!(
        (300..=500).contains(&greedy),
        "{greedy} in 10 s at 40 a second"
    );
}

#[test]
fn drone_stays_within_what_radios_admit() {
    let mut net = line(14);
    for nth in 0..400 {
        let large = vec![0; 50_000];
        net.submit(
            5,
            nth,
            Destination::Leader,
            Reliability::BestEffort,
            b"flood",
        );
        if nth % 50 == 0 {
            net.submit(
                6,
                nth,
                Destination::Leader,
                Reliability::Acknowledged,
                &large,
            );
        }
        let before: Vec<_> = net.nodes.iter().map(|it| it.sent).collect();
        net.run(SECOND / 20);
        for (node, before) in net.nodes.iter().zip(before) {
            let sent = node.sent - before;
            assert!(sent <= (SEND_BUDGET.burst + 50 / 6 + 1) as usize, "{sent}");
        }
    }
}

#[test]
fn malformed_and_implausible_frames_are_ignored() {
    let mut net = line(15);
    let frame = |change: &dyn Fn(&mut MessageFrame)| {
        let mut frame = MessageFrame {
            number: 1,
            flood: None,
            hops: 0,
            left_ms: 1_000,
            awaited: NodeId(3).into(),
            origin: NodeId(2),
            origin_session: 1,
            message: 1,
            to: Destination::Drone(NodeId(3)),
            body: MessageBody::Whole {
                acknowledge: true,
                payload: Bytes::new(),
            },
        };
        change(&mut frame);
        wire::encode_message(&wire::Message {
            session: 1,
            accepted: Vec::new(),
            frame: Some(frame),
        })
    };
    let good = frame(&|_| {});
    let bad = [
        vec![good[0]],
        good[..good.len() - 1].to_vec(),
        frame(&|it| it.origin = NodeId(8)),
        frame(&|it| it.to = Destination::Drone(NodeId(8))),
        frame(&|it| it.to = Destination::Neighbours),
        frame(&|it| it.flood = Some((NodeId(8), 1))),
        frame(&|it| it.number = 0),
        frame(&|it| it.message = 0),
    ];
    let expected = bad.len();
    for payload in bad {
        receive(&mut net, 3, payload);
    }
    assert_eq!(
        (net.nodes[3].ignored, net.nodes[3].got.len()),
        (expected, 0)
    );
    receive(&mut net, 3, good);
    assert_eq!(
        (net.nodes[3].ignored, net.nodes[3].got.len()),
        (expected, 1)
    );
}

fn receive(net: &mut Net, at: usize, payload: Vec<u8>) {
    let input = Input::Received {
        sender: NodeId(2),
        ballot: leader(1, 0),
        payload: payload.into(),
    };
    net.input(at, input);
}

#[test]
fn tables_stay_within_their_limits_whatever_is_received() {
    let mut net = line(16);
    for nth in 1..3_000_u32 {
        let frame = MessageFrame {
            number: nth,
            flood: (nth % 3 == 0).then_some((NodeId(nth % 8), nth / 100)),
            hops: 0,
            left_ms: u32::MAX,
            awaited: NodeId(3).into(),
            origin: NodeId(nth % 8),
            origin_session: nth / 50,
            message: nth,
            to: if nth % 2 == 0 {
                Destination::Drone(NodeId(3))
            } else {
                Destination::Leader
            },
            body: MessageBody::Piece {
                index: 0,
                length: MESSAGE_MAX as u32,
                payload: vec![0; MESSAGE_FRAME_MAX].into(),
            },
        };
        let message = wire::Message {
            session: nth / 100,
            accepted: Vec::new(),
            frame: Some(frame),
        };
        receive(&mut net, 3, wire::encode_message(&message));
        net.run(SECOND / 100);
        let (len, max) = net.occupancy(3);
        assert!(len <= max, "{len} of {max}");
    }
}

fn any_destination() -> impl Strategy<Value = Destination> {
    prop_oneof![
        Just(Destination::Leader),
        Just(Destination::All),
        Just(Destination::Neighbours),
        (0_u32..6).prop_map(|id| Destination::Drone(NodeId(id))),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn each_message_arrives_at_most_once_and_if_acknowledged_once_or_is_reported(
        seed: u64,
        loss in 0.0..0.5_f64,
        duplicate in 0.0..0.3_f64,
        delay_ms in 1_u64..60,
        (reach, is_flood, reports) in (1_usize..4, any::<bool>(), any::<bool>()),
        messages in prop::collection::vec((0_usize..6, any_destination(), any::<bool>(), 0_u64..400, 0_usize..3_000), 1..30),
    ) {
        let config = if is_flood { flood_config } else { tree_config };
        let mut net = Net::line(6, reach, config, seed);
        net.faults = Faults { loss, duplicate, delay: Duration::from_millis(delay_ms), reports };
        let mut sent = Vec::new();
        for (id, (at, to, is_acknowledged, pause_ms, length)) in (0_u32..).zip(messages) {
            let is_for_many = matches!(to, Destination::All | Destination::Neighbours);
            let length = if is_for_many { length % 1_000 } else { length };
            let mut payload = id.to_le_bytes().to_vec();
            payload.resize(4 + length, 0);
            let is_acknowledged = is_acknowledged && to != Destination::All;
            let reliability = if is_acknowledged { Reliability::Acknowledged } else { Reliability::BestEffort };
            net.submit(at, id, to, reliability, &payload);
            sent.push((id, at, to, is_acknowledged, Bytes::from(payload)));
            net.run(Duration::from_millis(pause_ms));
        }
        net.run(40 * SECOND);
        for (id, at, to, is_acknowledged, payload) in sent {
            let copies: Vec<_> = (0..6).map(|at| net.payloads(at).iter().filter(|it| **it == payload).count()).collect();
            prop_assert!(copies.iter().all(|copies| *copies <= 1), "message {} to {:?}: {:?}", id, to, copies);
            let outcomes: Vec<_> = net.nodes[at].outcomes.iter().filter(|it| it.0 == id).collect();
            prop_assert!(outcomes.len() <= 1);
            if is_acknowledged {
                prop_assert_eq!(outcomes.len(), 1, "message {} has an outcome", id);
                let receiver = match to {
                    Destination::Leader => Some(0),
                    Destination::Drone(id) => Some(id.0 as usize),
                    _ => None,
                };
                if let (Some(receiver), Outcome::Delivered) = (receiver, outcomes[0].1) {
                    prop_assert_eq!(copies[receiver], 1, "message {} was acknowledged", id);
                }
            }
        }
    }
}
