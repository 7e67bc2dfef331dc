use super::super::limits::{QUEUE_MAX, SEND_BUDGET};
use super::*;

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

#[test]
fn relay_accepts_twice_an_origins_budget_and_no_more() {
    let mut net = line(18);
    for number in 1..=400 {
        let frame = MessageFrame {
            number,
            flood: None,
            hops: 0,
            left_ms: 1_000,
            awaited: NodeId(3).into(),
            origin: NodeId(5),
            origin_session: 1,
            message: number,
            to: Destination::Leader,
            body: MessageBody::Whole {
                acknowledge: false,
                payload: Bytes::new(),
            },
        };
        let message = wire::Message {
            session: 1,
            accepted: Vec::new(),
            frame: Some(frame),
        };
        receive(&mut net, 3, wire::encode_message(&message));
        net.run(SECOND / 400);
    }
    net.run(3 * SECOND);
    let arrived = net.nodes[0].got.len();
    assert!((100..=120).contains(&arrived), "{arrived} in a second");
    assert!(net.nodes[3].ignored > 0, "those beyond are counted");
}
