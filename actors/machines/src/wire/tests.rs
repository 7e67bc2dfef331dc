mod message;
mod order;

use std::time::Duration;

use proptest::prelude::*;

use super::*;
use crate::geometry::{Ned, Velocity};
use crate::identity::{Ballot, NodeId, NodeSet, SwarmId};

const HEADER: Header = Header {
    swarm: SwarmId(7),
    sender: NodeId(300),
    incarnation: 2,
    counter: 1_000_000,
    ballot: Ballot {
        term: 3,
        rank: 1,
        master: NodeId(4),
    },
    intent: None,
};

fn frame(payload: &[u8]) -> Vec<u8> {
    let mut frame = encode_covered(&HEADER, payload);
    frame.extend_from_slice(&[0xab; AUTHENTICATOR_LEN]);
    frame
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[test]
fn frame_matches_golden_bytes() {
    let golden = format!("0107ac0202c0843d030104{}{}", "c0ffee", "ab".repeat(64));
    assert_eq!(hex(&frame(&[0xc0, 0xff, 0xee])), golden);
}

#[test]
fn packets_match_golden_bytes() {
    let hello = Packet::Hello {
        remaining: Duration::from_millis(7_500),
    };
    assert_eq!(hex(&encode_packet(&hello)), "00cc3a");
    let hop_update = Packet::HopUpdate {
        hops: 1,
        routing_list: vec![NodeId(2), NodeId(4), NodeId(1)],
    };
    assert_eq!(hex(&encode_packet(&hop_update)), "010103020401");
    let flood = Packet::Flood(Flood {
        hops: Some(2),
        parent: Some(NodeId(6)),
        heartbeat: 900,
        sequence: 5,
        hears: [NodeId(1), NodeId(6)].into_iter().collect(),
        members: vec![Member {
            id: NodeId(1),
            number: 300,
            acknowledged: 4,
            out_of_range: true,
            landing: true,
        }],
        order: Some(bytes::Bytes::from_static(&[1])),
    });
    assert_eq!(
        hex(&encode_packet(&flood)),
        "020102010684070504010104010101ac020403010101"
    );
}

#[test]
fn tree_packet_matches_golden_bytes() {
    let tree = Packet::Tree(Tree {
        number: 300,
        hops: Some(1),
        cost: 64,
        parent: Some(NodeId(7)),
        heartbeat: 2,
        lag: 1,
        sequence: 3,
        span: None,
        acknowledged: [NodeId(0), NodeId(9)].into_iter().collect(),
        alive: [NodeId(1)].into_iter().collect(),
        landing: NodeSet::default(),
        hears: Some([NodeId(2)].into_iter().collect()),
        weak: vec![Reception {
            id: NodeId(2),
            sixteenths: 12,
        }],
        requests: NodeId(9).into(),
        to: Some(NodeId(5)),
        unicasts: 2,
        pending: NodeSet::default(),
        order: Some(bytes::Bytes::from_static(&[1])),
    });
    assert_eq!(
        hex(&encode_packet(&tree)),
        "03ac02010140010702010300000201010400010801000102020102020c02090101050200010101"
    );
}

#[test]
fn radio_packets_match_golden_bytes() {
    let challenge = RadioPacket::Challenge {
        nonce: 300,
        of: [NodeId(1), NodeId(2)].into_iter().collect(),
    };
    assert_eq!(hex(&encode_radio_packet(&challenge)), "04ac02020102");
    let response = RadioPacket::Response(vec![(NodeId(3), 300), (NodeId(200), 1)]);
    assert_eq!(hex(&encode_radio_packet(&response)), "050203ac02c80101");
    let number = RadioPacket::ListNumber(300);
    assert_eq!(hex(&encode_radio_packet(&number)), "06ac02");
    let list = RadioPacket::List(bytes::Bytes::from_static(&[0xc0, 0xff]));
    assert_eq!(hex(&encode_radio_packet(&list)), "07c0ff");
}

#[test]
fn sets_are_encoded_relative_to_alive_if_shorter() {
    let alive: NodeSet = (0..1_000).step_by(3).map(NodeId).collect();
    let tree = |acknowledged: NodeSet| {
        Packet::Tree(Tree {
            alive: alive.clone(),
            acknowledged,
            ..Tree::default()
        })
    };
    let empty = encode_packet(&tree(NodeSet::default()));
    let all_but_one = tree(alive.difference(&NodeId(30).into()));
    let bytes = encode_packet(&all_but_one);
    assert!(bytes.len() <= empty.len() + 2, "{}", bytes.len());
    assert_eq!(decode_packet(&bytes.into()), Ok(all_but_one));
}

#[test]
fn set_bounds_must_rise_and_come_in_pairs() {
    let tree = Packet::Tree(Tree {
        pending: [NodeId(5)].into_iter().collect(),
        ..Tree::default()
    });
    let bytes = encode_packet(&tree);
    let (pending, rest) = (bytes.len() - 3, [2, 5, 1, 0]);
    assert_eq!(bytes[pending - 1..], rest);
    for malformed in [[2, 5, 0, 0], [2, 0x85, 1, 0], [2, 0xff, 0xff, 0]] {
        let mut bytes = bytes.clone();
        bytes.splice(pending - 1.., malformed);
        assert_eq!(
            decode_packet(&bytes.into()),
            Err(PayloadError),
            "{malformed:?}"
        );
    }
    assert!(postcard::from_bytes::<NodeSet>(&[2, 0, 1]).is_ok());
    for bytes in [&[2, 5, 0][..], &[1, 5], &[3, 5, 1, 1]] {
        assert!(postcard::from_bytes::<NodeSet>(bytes).is_err(), "{bytes:?}");
    }
}

#[test]
fn frame_decodes_without_a_copy() {
    let bytes = frame(b"payload");
    let read = decode_frame(&bytes).unwrap();
    assert_eq!(read.header, HEADER);
    assert_eq!(sender(&bytes), Some(HEADER.sender));
    assert_eq!(read.payload, b"payload");
    assert_eq!(read.authenticator, &[0xab; AUTHENTICATOR_LEN]);
    assert_eq!(read.covered, &bytes[..bytes.len() - AUTHENTICATOR_LEN]);
}

#[test]
fn version_2_frame_carries_the_intent() {
    let intent = Intent {
        from_dm: [-1, 64, -300],
        to_dm: [i32::MAX, 0, i32::MIN],
        flown: 127,
        has_priority: true,
    };
    let header = Header {
        intent: Some(intent),
        ..HEADER
    };
    let encode = |header: &Header| {
        let mut frame = encode_covered(header, b"payload");
        frame.extend_from_slice(&[9; AUTHENTICATOR_LEN]);
        frame
    };
    let (with, without) = (encode(&header), encode(&HEADER));
    let read = decode_frame(&with).unwrap();
    assert_eq!((read.header, read.payload), (header, &b"payload"[..]));
    assert_eq!(sender(&with), Some(header.sender));
    // As postcard writes them.
    let numbers = postcard::to_allocvec(&(intent.from_dm, intent.to_dm, 255_u8)).unwrap();
    assert_eq!(with.len(), without.len() + numbers.len());
    let begin = with.len() - AUTHENTICATOR_LEN - b"payload".len() - numbers.len();
    assert_eq!(with[begin..][..numbers.len()], numbers);
    let cut = [&with[..begin + 3], &[9; AUTHENTICATOR_LEN]].concat();
    assert_eq!(decode_frame(&cut), Err(FrameError::TooShort));
}

#[test]
fn malformed_frames_get_distinct_errors() {
    let mut other_version = frame(b"");
    other_version[0] = VERSION_WITH_INTENT + 1;
    assert_eq!(decode_frame(&other_version), Err(FrameError::Version));
    assert_eq!(decode_frame(&[VERSION; 64]), Err(FrameError::TooShort));
    assert_eq!(decode_frame(&[VERSION; 66]), Err(FrameError::TooShort));
    assert_eq!(decode_frame(&[]), Err(FrameError::TooShort));
    let too_long = vec![VERSION; DATAGRAM_MAX + 1];
    assert_eq!(decode_frame(&too_long), Err(FrameError::TooLong));
}

#[test]
fn largest_header_and_payload_fit_a_datagram() {
    let header = Header {
        swarm: SwarmId(u32::MAX),
        sender: NodeId(u32::MAX),
        incarnation: u32::MAX,
        counter: u64::MAX,
        ballot: Ballot {
            term: u32::MAX,
            rank: u32::MAX,
            master: NodeId(u32::MAX),
        },
        intent: None,
    };
    let covered = encode_covered(&header, &[0; PAYLOAD_MAX]);
    assert_eq!(covered.len() + AUTHENTICATOR_LEN, DATAGRAM_MAX);
}

#[test]
fn payload_with_trailing_bytes_is_rejected() {
    let mut packet = encode_packet(&Packet::Hello {
        remaining: Duration::ZERO,
    });
    packet.push(0);
    assert_eq!(decode_packet(&packet.into()), Err(PayloadError));
    assert_eq!(decode_order(&[1, 0]), Err(PayloadError));
    assert_eq!(decode_order(&[]), Err(PayloadError));
    assert_eq!(decode_order(&[99]), Err(PayloadError));
    let holds_for = |hold: Duration| Order::Plan {
        index: 0,
        count: 1,
        waypoints: vec![Ned::HOME],
        holds: vec![hold],
    };
    let most = holds_for(HOLD_MAX);
    assert_eq!(decode_order(&encode_order(&most)), Ok(most));
    let longer = holds_for(HOLD_MAX + Duration::from_millis(1));
    assert_eq!(decode_order(&encode_order(&longer)), Err(PayloadError));
}

fn ids_below_200() -> impl Strategy<Value = Vec<NodeId>> {
    prop::collection::vec((0_u32..200).prop_map(NodeId), 0..20)
}

fn any_packet() -> impl Strategy<Value = Packet> {
    let hello = any::<u32>().prop_map(|ms| Packet::Hello {
        remaining: Duration::from_millis(ms.into()),
    });
    let ids = || prop::collection::vec(any::<u32>().prop_map(NodeId), 0..20);
    let hop_update = (any::<u16>(), ids())
        .prop_map(|(hops, routing_list)| Packet::HopUpdate { hops, routing_list });
    let member = (any::<[u32; 3]>(), any::<[bool; 2]>()).prop_map(|(numbers, flags)| Member {
        id: NodeId(numbers[0]),
        number: numbers[1],
        acknowledged: numbers[2],
        out_of_range: flags[0],
        landing: flags[1],
    });
    let flood = (
        any::<Option<u16>>(),
        any::<Option<u32>>(),
        any::<[u32; 2]>(),
        ids_below_200(),
        prop::collection::vec(member, 0..20),
        any::<Option<Vec<u8>>>(),
    )
        .prop_map(
            |(hops, parent, [heartbeat, sequence], hears, members, order)| {
                Packet::Flood(Flood {
                    hops,
                    parent: parent.map(NodeId),
                    heartbeat,
                    sequence,
                    hears: hears.into_iter().collect(),
                    members,
                    order: order.map(Into::into),
                })
            },
        );
    let set = || ids_below_200().prop_map(NodeSet::from_iter);
    let tree = (
        any::<([u32; 4], u16, u8)>(),
        any::<(Option<u16>, [Option<u32>; 2], Option<Vec<u8>>)>(),
        (set(), set(), set(), prop::option::of(set()), set()),
        any::<Option<[u32; 2]>>(),
    )
        .prop_map(|(numbers, (hops, [parent, to], order), sets, span)| {
            let ([number, heartbeat, lag, sequence], cost, heard) = numbers;
            let (acknowledged, alive, landing, hears, pending) = sets;
            let heard_at = |id| Reception {
                id,
                sixteenths: heard % 15 + 1,
            };
            let weak = hears.iter().flat_map(NodeSet::iter).map(heard_at);
            Packet::Tree(Tree {
                number,
                hops,
                cost,
                parent: parent.map(NodeId),
                heartbeat,
                lag,
                sequence,
                weak: weak.collect(),
                requests: pending.clone(),
                span: span.map(|[start, end]| start..end),
                acknowledged,
                alive,
                landing,
                hears,
                to: to.map(NodeId),
                unicasts: to.map_or(0, |to| to ^ sequence),
                pending,
                order: order.map(Into::into),
            })
        });
    prop_oneof![hello, hop_update, flood, tree, message::any_message()]
}

fn any_radio_packet() -> impl Strategy<Value = RadioPacket> {
    let challenge = (any::<u64>(), ids_below_200()).prop_map(|(nonce, of)| {
        let of = of.into_iter().collect();
        RadioPacket::Challenge { nonce, of }
    });
    let answered = (any::<u32>().prop_map(NodeId), any::<u64>());
    let response = prop::collection::vec(answered, 0..70).prop_map(RadioPacket::Response);
    let number = any::<u64>().prop_map(RadioPacket::ListNumber);
    let list = any::<Vec<u8>>().prop_map(|list| RadioPacket::List(list.into()));
    prop_oneof![challenge, response, number, list]
}

proptest! {
    #[test]
    fn node_set_behaves_like_btree_set(
        a in ids_below_200(),
        b in ids_below_200(),
        end in 0_u32..250,
    ) {
        use std::collections::BTreeSet;
        let (set_a, set_b): (BTreeSet<_>, BTreeSet<_>) =
            (a.iter().copied().collect(), b.iter().copied().collect());
        let mut set: NodeSet = a.into_iter().collect();
        let others: NodeSet = b.into_iter().collect();
        prop_assert_eq!(set.len(), set_a.len());
        prop_assert_eq!(set.is_superset(&others), set_a.is_superset(&set_b));
        let difference: BTreeSet<_> = set.difference(&others).iter().collect();
        prop_assert_eq!(difference, &set_a - &set_b);
        let both: BTreeSet<_> = set.intersection(&others).iter().collect();
        prop_assert_eq!(both, &set_a & &set_b);
        let either: BTreeSet<_> = set.symmetric_difference(&others).iter().collect();
        prop_assert_eq!(either, &set_a ^ &set_b);
        let below = NodeSet::from(0..end);
        let is_there = NodeSet::any_where([&set, &others, &below], |[own, others, below]| {
            own && !others && below
        });
        prop_assert_eq!(is_there, (&set_a - &set_b).iter().any(|id| id.0 < end));
        set.extend_from(&others);
        prop_assert_eq!(set.iter().collect::<BTreeSet<_>>(), &set_a | &set_b);
        let bytes = postcard::to_stdvec(&set).unwrap();
        prop_assert_eq!(&postcard::from_bytes::<NodeSet>(&bytes).unwrap(), &set);
        set.truncate(end);
        let below: BTreeSet<_> = (&set_a | &set_b).into_iter().filter(|id| id.0 < end).collect();
        prop_assert_eq!(&set.iter().collect::<BTreeSet<_>>(), &below);
        prop_assert_eq!(set, below.into_iter().collect::<NodeSet>(), "equal sets are encoded equally");
    }

    #[test]
    fn packets_survive_a_round_trip(packet in any_packet(), before in any_packet()) {
        let payload = encode_packet(&packet).into();
        prop_assert_eq!(decode_packet(&payload), Ok(packet.clone()));
        let members = match before {
            Packet::Flood(flood) => flood.members,
            _ => Vec::new(),
        };
        prop_assert_eq!(decode_packet_reusing(&payload, members), Ok(packet));
    }

    #[test]
    fn radio_packets_survive_a_round_trip(packet in any_radio_packet()) {
        let bytes = encode_radio_packet(&packet);
        prop_assert_eq!(decode_packet(&bytes.clone().into()), Err(PayloadError), "no routing packet");
        prop_assert_eq!(decode_radio_packet(&bytes), Some(packet));
    }

    #[test]
    fn routing_packet_is_no_radio_packet(packet in any_packet()) {
        prop_assert_eq!(decode_radio_packet(&encode_packet(&packet)), None);
    }

    #[test]
    fn decoders_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..1_600)) {
        let _ = decode_frame(&bytes);
        let _ = decode_packet(&bytes.clone().into());
        let _ = decode_order(&bytes);
        let _ = decode_radio_packet(&bytes);
    }

    #[test]
    fn positions_are_exact_to_a_millimetre(place in prop::array::uniform3(-2e6..2e6_f64)) {
        let at = Ned::new(place[0], place[1], place[2]);
        let land = Order::Land { at, changes: 0, apart: false, wave: 0 };
        let Ok(Order::Land { at: read, .. }) = decode_order(&encode_order(&land)) else {
            panic!("a landing decodes as a landing");
        };
        prop_assert!((read.0 - at.0).amax() <= 0.000_501);
    }
}
