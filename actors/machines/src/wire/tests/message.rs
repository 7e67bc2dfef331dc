use proptest::prelude::*;

use super::*;

#[test]
fn message_packets_match_golden_bytes() {
    let frame = |to, body| MessageFrame {
        number: 300,
        flood: None,
        hops: 2,
        left_ms: 3_000,
        awaited: NodeId(1).into(),
        origin: NodeId(5),
        origin_session: 9,
        message: 4,
        to,
        body,
    };
    let whole = MessageBody::Whole {
        acknowledge: true,
        payload: bytes::Bytes::from_static(&[0xc0, 0xff]),
    };
    let message = |frame| Message {
        session: 7,
        accepted: vec![Accepted {
            by: NodeId(3),
            session: 8,
            number: 300,
            before: 0b101,
        }],
        frame,
    };
    let head = "0907010308ac020501ac02";
    let flooded = MessageFrame {
        flood: Some((NodeId(5), 9)),
        ..frame(
            Destination::All,
            MessageBody::Whole {
                acknowledge: false,
                payload: bytes::Bytes::new(),
            },
        )
    };
    let piece = MessageBody::Piece {
        index: 1,
        length: 1_201,
        payload: bytes::Bytes::from_static(&[0xee]),
    };
    let receipt = MessageBody::Receipt {
        session: 1,
        message: 300,
        before: 3,
    };
    let progress = MessageBody::Progress {
        session: 1,
        message: 300,
        below: 2,
        beyond: 1 << 7,
    };
    for (frame, bytes) in [
        (
            frame(Destination::Leader, whole),
            "0002b8170201010509040001".to_owned() + "02c0ff",
        ),
        (flooded, "01050902b817020101050904010000".to_owned()),
        (
            frame(Destination::Neighbours, piece),
            "0002b817020101050904020201b10901ee".to_owned(),
        ),
        (
            frame(Destination::Drone(NodeId(6)), receipt),
            "0002b817020101050904030603 01ac0203".replace(' ', ""),
        ),
        (
            frame(Destination::Drone(NodeId(6)), progress),
            "0002b817020101050904030604 01ac02028001".replace(' ', ""),
        ),
    ] {
        let packet = Packet::Message(message(Some(frame)));
        let encoded = encode_packet(&packet);
        assert_eq!(hex(&encoded), format!("{head}{bytes}"));
        assert_eq!(decode_packet(&encoded.clone().into()), Ok(packet));
        assert!(is_message(&encoded));
    }
    let only_accepted = Packet::Message(message(None));
    assert_eq!(hex(&encode_packet(&only_accepted)), "0907010308ac020500");
}

#[test]
fn message_packets_beyond_a_limit_are_rejected() {
    let encode = |hops, body| {
        encode_message(&Message {
            session: 1,
            accepted: Vec::new(),
            frame: Some(MessageFrame {
                number: 1,
                flood: None,
                hops,
                left_ms: 1,
                awaited: NodeSet::new(),
                origin: NodeId(1),
                origin_session: 1,
                message: 1,
                to: Destination::Leader,
                body,
            }),
        })
    };
    let whole = |length: usize| MessageBody::Whole {
        acknowledge: false,
        payload: vec![0; length].into(),
    };
    let piece = |index, length, bytes: usize| MessageBody::Piece {
        index,
        length,
        payload: vec![0; bytes].into(),
    };
    let (full, most) = (MESSAGE_FRAME_MAX, MESSAGE_MAX as u32);
    for (hops, body) in [
        (MESSAGE_HOPS_MAX, whole(full)),
        (0, piece(0, 1_201, full)),
        (0, piece(873, most, MESSAGE_MAX - 873 * full)),
    ] {
        assert!(decode_message(&encode(hops, body)).is_ok());
    }
    for (hops, body) in [
        (MESSAGE_HOPS_MAX + 1, whole(0)),
        (0, whole(full + 1)),
        (0, piece(0, 0, 0)),
        (0, piece(1, 1_201, 2)),
        (0, piece(2, 1_201, 0)),
        (0, piece(0, most + 1, full)),
    ] {
        assert_eq!(decode_message(&encode(hops, body)), Err(PayloadError));
    }
}

#[test]
fn longest_message_frame_fits_a_datagram() {
    let accepted = |count| {
        let group = Accepted {
            by: NodeId(u32::MAX),
            session: u32::MAX,
            number: u32::MAX,
            before: u32::MAX,
        };
        vec![group; count]
    };
    let frame = |awaited: u32, flood| MessageFrame {
        number: u32::MAX,
        flood,
        hops: MESSAGE_HOPS_MAX,
        left_ms: 30_000,
        awaited: (0..awaited)
            .map(|id| NodeId(1_000_000 * (2 + id)))
            .collect(),
        origin: NodeId(u32::MAX),
        origin_session: u32::MAX,
        message: u32::MAX,
        to: Destination::Drone(NodeId(u32::MAX)),
        body: MessageBody::Piece {
            index: 0,
            length: MESSAGE_MAX as u32,
            payload: vec![0; MESSAGE_FRAME_MAX].into(),
        },
    };
    // As many groups, and as many awaited neighbours, as `routing::messages` puts into a frame.
    for (groups, frame) in [
        (4, frame(1, None)),
        (0, frame(16, Some((NodeId(u32::MAX), u32::MAX)))),
    ] {
        let message = Message {
            session: u32::MAX,
            accepted: accepted(groups),
            frame: Some(frame),
        };
        let bytes = encode_message(&message);
        assert!(bytes.len() <= PAYLOAD_MAX, "{}", bytes.len());
    }
}

#[test]
fn seeds_of_the_fuzz_targets_are_packets() {
    let seeds: [&[u8]; 4] = [
        include_bytes!("../../../../../fuzz/corpus/frames/message-0"),
        include_bytes!("../../../../../fuzz/corpus/frames/message-1"),
        include_bytes!("../../../../../fuzz/corpus/frames/message-2"),
        include_bytes!("../../../../../fuzz/corpus/frames/message-3"),
    ];
    for seed in seeds {
        let message = decode_message(seed).expect("a packet of each body");
        assert_eq!(encode_message(&message), seed);
    }
}

/// Any packet of the messages.
pub(super) fn any_message() -> impl Strategy<Value = Packet> {
    let accepted = any::<[u32; 4]>().prop_map(|[by, session, number, before]| Accepted {
        by: NodeId(by),
        session,
        number,
        before,
    });
    let to = prop_oneof![
        Just(Destination::Leader),
        Just(Destination::All),
        Just(Destination::Neighbours),
        any::<u32>().prop_map(|id| Destination::Drone(NodeId(id))),
    ];
    let payload = prop::collection::vec(any::<u8>(), 0..40);
    let body = prop_oneof![
        (any::<bool>(), payload).prop_map(|(acknowledge, payload)| MessageBody::Whole {
            acknowledge,
            payload: payload.into(),
        }),
        (0_u32..5, 1_usize..1_200).prop_map(|(index, last)| MessageBody::Piece {
            index,
            length: index * MESSAGE_FRAME_MAX as u32 + last as u32,
            payload: vec![7; last].into(),
        }),
        any::<[u32; 3]>().prop_map(|[session, message, before]| MessageBody::Receipt {
            session,
            message,
            before,
        }),
        any::<([u32; 3], u64)>().prop_map(|([session, message, below], beyond)| {
            MessageBody::Progress {
                session,
                message,
                below,
                beyond,
            }
        }),
    ];
    let frame = (
        any::<[u32; 5]>(),
        any::<Option<(u32, u32)>>(),
        0..=MESSAGE_HOPS_MAX,
        ids_below_200(),
        (to, body),
    )
        .prop_map(|(numbers, flood, hops, awaited, (to, body))| {
            let [number, left_ms, origin, origin_session, message] = numbers;
            MessageFrame {
                number,
                flood: flood.map(|(by, session)| (NodeId(by), session)),
                hops,
                left_ms,
                awaited: awaited.into_iter().collect(),
                origin: NodeId(origin),
                origin_session,
                message,
                to,
                body,
            }
        });
    let parts = (
        any::<u32>(),
        prop::collection::vec(accepted, 0..5),
        prop::option::of(frame),
    );
    parts.prop_map(|(session, accepted, frame)| {
        Packet::Message(Message {
            session,
            accepted,
            frame,
        })
    })
}
