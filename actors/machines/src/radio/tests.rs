mod budgets;
mod freshness;
mod lists;

use std::num::NonZeroU16;
use std::time::Duration;

use super::counters::COUNTER_BLOCK;
use super::*;
use crate::identity::SwarmId;
use crate::machine::{Emitted, Stimulus, step};
use crate::wire::AUTHENTICATOR_LEN;

const BALLOT: Ballot = Ballot {
    term: 1,
    rank: 0,
    master: NodeId(0),
};

const MEMBERS: u32 = 3;

fn config(id: u32) -> Config {
    Config {
        id: NodeId(id),
        swarm: SwarmId(1),
        budget: Budget {
            interval: Duration::from_millis(100),
            burst: 3,
        },
        members: MEMBERS,
        incarnations: Incarnations::Counted,
    }
}

/// In its first incarnation, so it needs no freshness proofs.
fn radio(id: u32) -> Radio<IdealAuthenticator> {
    Radio::new(config(id), IdealAuthenticator, 1, Checkpoint::default(), 0)
}

fn at(now_ms: u64) -> Timestamp {
    Timestamp::from_nanos(now_ms * 1_000_000)
}

/// Output of a step.
fn step_at<A: Authenticator>(
    radio: &mut Radio<A>,
    now_ms: u64,
    stimulus: Stimulus<Input>,
) -> (Vec<Transmit>, Vec<Event>) {
    let (mut transmits, mut events) = (Vec::new(), Vec::new());
    step(radio, at(now_ms), stimulus, |output| match output {
        Emitted::Transmit(transmit) => transmits.push(transmit),
        Emitted::Event(event) => events.push(event),
    });
    (transmits, events)
}

fn handle<A: Authenticator>(
    radio: &mut Radio<A>,
    now_ms: u64,
    input: Input,
) -> (Vec<Transmit>, Vec<Event>) {
    step_at(radio, now_ms, Stimulus::Input(input))
}

/// Sent frames in this output.
fn frames(transmits: Vec<Transmit>) -> Vec<Bytes> {
    let frames = transmits.into_iter().filter_map(|it| match it {
        Transmit::Send { frame, .. } => Some(frame),
        _ => None,
    });
    frames.collect()
}

/// Frames that a radio sends on a timeout.
fn timeout_frames<A: Authenticator>(radio: &mut Radio<A>, now_ms: u64) -> Vec<Bytes> {
    frames(step_at(radio, now_ms, Stimulus::Timeout).0)
}

/// Frames that it sends in response to a frame, admitted or not.
fn response_frames<A: Authenticator>(
    radio: &mut Radio<A>,
    now_ms: u64,
    frame: &Bytes,
) -> Vec<Bytes> {
    frames(handle(radio, now_ms, received(frame, None)).0)
}

fn packet(frame: &Bytes) -> RadioPacket {
    let payload = wire::decode_frame(frame).unwrap().payload;
    wire::decode_radio_packet(payload).unwrap()
}

/// The same frame with a wrong signature.
fn unsigned(frame: &Bytes) -> Bytes {
    let mut bytes = frame.to_vec();
    *bytes.last_mut().unwrap() ^= 1;
    bytes.into()
}

fn sent_by<A: Authenticator>(radio: &mut Radio<A>, payload: &[u8]) -> Bytes {
    let payload = payload.to_vec();
    let (transmits, _) = handle(
        radio,
        0,
        Input::Send {
            to: None,
            ballot: BALLOT,
            payload,
            keep_alive: false,
        },
    );
    let frame = transmits.into_iter().find_map(|it| match it {
        Transmit::Send { frame, .. } => Some(frame),
        _ => None,
    });
    frame.expect("a frame should have been sent")
}

/// A port of a host.
fn source(host: u16, port: u16) -> Source {
    let host = NonZeroU16::new(host).unwrap();
    Source { host, port }
}

fn received(frame: &Bytes, source: Option<Source>) -> Input {
    let datagram = frame.clone();
    Input::Received {
        datagram,
        source,
        peer: None,
    }
}

/// Why a frame is dropped; `None` if it is admitted.
fn dropped<A: Authenticator>(
    radio: &mut Radio<A>,
    now_ms: u64,
    frame: &Bytes,
) -> Option<DropReason> {
    dropped_from(radio, now_ms, frame, None)
}

/// As [`dropped`], for a frame from this source.
fn dropped_from<A: Authenticator>(
    radio: &mut Radio<A>,
    now_ms: u64,
    frame: &Bytes,
    source: Option<Source>,
) -> Option<DropReason> {
    let (transmits, events) = handle(radio, now_ms, received(frame, source));
    let reason = events.into_iter().find_map(|event| match event {
        Event::Dropped(reason) => Some(reason),
        _ => None,
    });
    let is_heard = transmits.iter().any(is_passed_on);
    assert!(
        !is_heard || reason.is_none(),
        "a dropped frame is not passed on"
    );
    reason
}

fn is_passed_on(transmit: &Transmit) -> bool {
    matches!(
        transmit,
        Transmit::Received { .. } | Transmit::Locate { .. }
    )
}

#[test]
fn frame_reaches_the_routing_of_another_drone() {
    let frame = sent_by(&mut radio(0), b"hello");
    let (transmits, events) = handle(&mut radio(1), 0, received(&frame, None));
    let heard = Transmit::Received {
        sender: NodeId(0),
        ballot: BALLOT,
        payload: Bytes::from_static(b"hello"),
    };
    assert_eq!((transmits, events), (vec![heard], vec![]));
}

#[test]
fn frame_is_admitted_once() {
    let (mut sender, mut receiver) = (radio(0), radio(1));
    let frames = [b"a", b"b", b"c"].map(|payload| sent_by(&mut sender, payload));
    for frame in [&frames[1], &frames[0], &frames[2]] {
        assert_eq!(dropped(&mut receiver, 0, frame), None);
    }
    for frame in &frames {
        assert_eq!(
            dropped(&mut receiver, 9_000, frame),
            Some(DropReason::Replayed)
        );
    }
}

#[test]
fn frame_of_an_earlier_incarnation_is_a_replay() {
    let mut earlier = radio(0);
    let mut later = radio(0);
    later.incarnation = 2;
    let mut receiver = radio(1);
    let old = sent_by(&mut earlier, b"old");
    let new = sent_by(&mut later, b"new");
    assert_eq!(dropped(&mut receiver, 0, &new), None);
    assert_eq!(dropped(&mut receiver, 1, &old), Some(DropReason::Replayed));
}

#[test]
fn sender_over_its_budget_is_dropped_until_tokens_are_refilled() {
    let (mut sender, mut receiver) = (radio(0), radio(1));
    let outcome: Vec<_> = [0, 1, 2, 3, 150]
        .map(|now| {
            let frame = sent_by(&mut sender, b"again");
            dropped(&mut receiver, now, &frame)
        })
        .into();
    let over = Some(DropReason::OverBudget);
    assert_eq!(outcome, [None, None, None, over, None]);
}

#[test]
fn drop_reasons_of_other_swarm_own_echo_forgery_and_stranger_differ() {
    let mut receiver = radio(1);
    let mut elsewhere = radio(0);
    elsewhere.config.swarm = SwarmId(2);
    let frame = sent_by(&mut elsewhere, b"");
    assert_eq!(
        dropped(&mut receiver, 0, &frame),
        Some(DropReason::OtherSwarm)
    );
    let frame = sent_by(&mut radio(1), b"");
    assert_eq!(dropped(&mut receiver, 0, &frame), Some(DropReason::OwnEcho));
    let forged = unsigned(&sent_by(&mut radio(0), b""));
    assert_eq!(dropped(&mut receiver, 0, &forged), Some(DropReason::Forged));
    assert_eq!(
        dropped(&mut receiver, 0, &sent_by(&mut radio(2), b"")),
        None
    );
    let third = sent_by(&mut radio(3), b"");
    assert_eq!(
        dropped(&mut receiver, 0, &third),
        Some(DropReason::Stranger)
    );
}

/// A defect of the indoor thesis's code: who reached its TCP port flew the drone.
#[test]
fn frames_without_a_signature_command_nothing() {
    let mut receiver = radio(1);
    let forged = unsigned(&sent_by(&mut radio(0), b"land"));
    let (transmits, events) = handle(&mut receiver, 0, received(&forged, Some(source(1, 7))));
    assert_eq!(transmits, []);
    assert_eq!(events, [Event::Dropped(DropReason::Forged)]);
}

#[test]
fn connection_admits_frames_of_its_peer_only_and_without_signature_check() {
    let mut receiver = radio(1);
    let frame = unsigned(&sent_by(&mut radio(0), b"hello"));
    let from_peer = |peer| Input::Received {
        datagram: frame.clone(),
        source: Some(source(1, 7)),
        peer: Some(NodeId(peer)),
    };
    let (transmits, events) = handle(&mut receiver, 0, from_peer(2));
    assert_eq!(transmits, [], "drone 0 is not located there");
    assert_eq!(events, [Event::Dropped(DropReason::Relayed)]);
    let (transmits, events) = handle(&mut receiver, 0, from_peer(0));
    assert!(transmits.iter().any(is_passed_on) && events.is_empty());
    let (_, events) = handle(&mut receiver, 0, from_peer(0));
    assert_eq!(events, [Event::Dropped(DropReason::Replayed)]);
}

#[test]
fn forged_frame_does_not_use_up_its_counter() {
    let mut receiver = radio(1);
    let genuine = sent_by(&mut radio(0), b"");
    let forged = unsigned(&genuine);
    assert_eq!(dropped(&mut receiver, 0, &forged), Some(DropReason::Forged));
    assert_eq!(dropped(&mut receiver, 1, &genuine), None);
}

#[test]
fn restarted_radio_reuses_no_counter() {
    let mut first = radio(0);
    let payload = Vec::new();
    let (_, events) = handle(
        &mut first,
        0,
        Input::Send {
            to: None,
            ballot: BALLOT,
            payload,
            keep_alive: false,
        },
    );
    let [Event::Checkpoint(checkpoint)] = events.as_slice() else {
        panic!("counters are reserved before use");
    };
    sent_by(&mut first, b"");
    let mut second = Radio::new(config(0), IdealAuthenticator, 1, *checkpoint, 7);
    let frame = sent_by(&mut second, b"");
    let counter = wire::decode_frame(&frame).unwrap().header.counter;
    assert!(
        counter >= first.counters.next(),
        "{counter} was used by the first incarnation already"
    );
}

#[test]
fn payload_too_long_for_a_datagram_is_not_sent() {
    let payload = vec![0; PAYLOAD_MAX + 1];
    let (transmits, events) = handle(
        &mut radio(0),
        0,
        Input::Send {
            to: None,
            ballot: BALLOT,
            payload,
            keep_alive: false,
        },
    );
    assert!(transmits.is_empty());
    assert_eq!(
        events,
        [Event::Oversized {
            len: PAYLOAD_MAX + 1
        }]
    );
}

#[test]
fn only_admitted_frames_locate_their_sender() {
    let frame = sent_by(&mut radio(0), b"hello");
    let source = source(1, 7);
    let forged = unsigned(&frame);
    let mut receiver = radio(1);
    let located = |transmits: Vec<Transmit>| {
        let is_location = |it: &Transmit| matches!(it, Transmit::Locate { .. });
        transmits.into_iter().find(is_location)
    };
    let (transmits, _) = handle(&mut receiver, 0, received(&forged, Some(source)));
    assert_eq!(located(transmits), None);
    let (transmits, _) = handle(&mut receiver, 0, received(&frame, Some(source)));
    let sender = NodeId(0);
    let found = Transmit::Locate { sender, source };
    assert_eq!(located(transmits), Some(found));
}

/// Verifies no frame.
struct VerifiesNone;

impl Authenticator for VerifiesNone {
    fn sign(&self, covered: &[u8]) -> [u8; AUTHENTICATOR_LEN] {
        IdealAuthenticator.sign(covered)
    }

    fn verify(&self, _: NodeId, _: &[u8], _: &[u8; AUTHENTICATOR_LEN]) -> bool {
        panic!("the signature of a revoked sender is not checked")
    }
}

#[test]
fn frames_of_revoked_senders_are_dropped_before_the_signature_check() {
    let frame = sent_by(&mut radio(0), b"hello");
    let list = Revoked {
        number: 1,
        drones: NodeId(0).into(),
        signed: None,
    };
    let receiver = Radio::new(config(1), VerifiesNone, 1, Checkpoint::default(), 0);
    let mut receiver = receiver.with_list(list);
    timeout_frames(&mut receiver, 0);
    let (transmits, events) = handle(&mut receiver, 0, received(&frame, None));
    assert_eq!(transmits, []);
    assert_eq!(events, [Event::Dropped(DropReason::Revoked)]);
}

#[test]
fn intent_is_sent_immediately_and_in_every_frame() {
    let intent = |north_dm: i32| Intent {
        from_dm: [0, 0, -300],
        to_dm: [north_dm, 0, -300],
        flown: 0,
        has_priority: false,
    };
    let intend = |intent: Option<Intent>, immediately: bool| Input::AnnounceIntent {
        intent,
        immediately,
    };
    let (mut sender, mut receiver) = (radio(0), radio(1));
    let before = sent_by(&mut sender, b"before");
    let immediately = frames(handle(&mut sender, 0, intend(Some(intent(600)), true)).0);
    assert_eq!(immediately.len(), 1);
    assert_eq!(packet(&immediately[0]), RadioPacket::Intent);
    assert!(
        handle(&mut sender, 0, intend(Some(intent(600)), true))
            .0
            .is_empty()
    );
    let after = sent_by(&mut sender, b"after");
    let too_long = sent_by(&mut sender, &[9; PAYLOAD_MAX]);
    let farther = Intent {
        flown: 64,
        ..intent(600)
    };
    let silently = handle(&mut sender, 0, intend(Some(farther), false)).0;
    assert_eq!(silently, [], "the next frame holds it");
    let later = sent_by(&mut sender, b"later");
    let gone = frames(handle(&mut sender, 0, intend(None, true)).0);
    let traffic = |receiver: &mut _, now_ms: u64, frame: &Bytes| {
        let (transmits, _) = handle(receiver, now_ms, received(frame, None));
        transmits.into_iter().find_map(|it| match it {
            Transmit::Traffic { sender, intent, .. } => Some((sender, intent)),
            _ => None,
        })
    };
    assert_eq!(traffic(&mut receiver, 0, &before), None);
    assert_eq!(
        traffic(&mut receiver, 200, &immediately[0]),
        Some((NodeId(0), Some(intent(600))))
    );
    assert_eq!(traffic(&mut receiver, 400, &after), None, "unchanged");
    assert_eq!(
        traffic(&mut receiver, 600, &too_long),
        None,
        "a frame without room changes no intent"
    );
    assert_eq!(
        traffic(&mut receiver, 700, &later),
        Some((NodeId(0), Some(farther)))
    );
    let again = Transmit::Traffic {
        sender: NodeId(0),
        intent: Some(farther),
        heard_at: Timestamp::from_nanos(700_000_000),
    };
    let asked = handle(&mut receiver, 750, Input::ResendTraffic).0;
    assert_eq!(asked, [again], "for a restarted navigation");
    assert_eq!(
        traffic(&mut receiver, 800, &gone[0]),
        Some((NodeId(0), None))
    );
    assert_eq!(handle(&mut receiver, 850, Input::ResendTraffic).0, []);
}

#[test]
fn late_frame_brings_no_old_intent_back() {
    let intent = |north_dm| Intent {
        from_dm: [0, 0, -300],
        to_dm: [north_dm, 0, -300],
        flown: 0,
        has_priority: false,
    };
    let (mut sender, mut receiver) = (radio(0), radio(1));
    let [old, new] = [intent(0), intent(600)].map(|intent| {
        let announced = Input::AnnounceIntent {
            intent: Some(intent),
            immediately: true,
        };
        frames(handle(&mut sender, 0, announced).0).remove(0)
    });
    let is_traffic = |it: &Transmit| matches!(it, Transmit::Traffic { .. });
    let [first, late] = [new, old].map(|frame| handle(&mut receiver, 0, received(&frame, None)).0);
    assert!(first.iter().any(is_traffic));
    assert!(!late.iter().any(is_traffic));
}

#[test]
fn restarted_radio_requests_the_own_intent() {
    let kept = Checkpoint { counter: 1_024 };
    let mut restarted = Radio::new(config(0), IdealAuthenticator, 1, kept, 7);
    let (asked, _) = handle(&mut restarted, 0, received(&Bytes::new(), None));
    assert!(asked.contains(&Transmit::Resync), "{asked:?}");
    let (asked, _) = handle(&mut radio(1), 0, received(&Bytes::new(), None));
    assert_eq!(asked, [], "no frame was sent before");
}
