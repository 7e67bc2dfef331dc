mod budgets;
mod freshness;
mod lists;

use std::time::Duration;

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

/// In its first life, and so without need to ask anybody.
fn radio(id: u32) -> Radio<IdealAuthenticator> {
    Radio::new(config(id), IdealAuthenticator, 1, Checkpoint::default(), 0)
}

fn at(now_ms: u64) -> Timestamp {
    Timestamp::from_nanos(now_ms * 1_000_000)
}

/// What comes of a step.
fn stepped<A: Authenticator>(
    radio: &mut Radio<A>,
    now_ms: u64,
    stimulus: Stimulus<Input>,
) -> (Vec<Transmit>, Vec<Event>) {
    let (mut transmits, mut events) = (Vec::new(), Vec::new());
    let Ok(_) = step(radio, at(now_ms), stimulus, |said| match said {
        Emitted::Transmit(transmit) => transmits.push(transmit),
        Emitted::Event(event) => events.push(event),
    });
    (transmits, events)
}

fn told<A: Authenticator>(
    radio: &mut Radio<A>,
    now_ms: u64,
    input: Input,
) -> (Vec<Transmit>, Vec<Event>) {
    stepped(radio, now_ms, Stimulus::Input(input))
}

/// The frames among what was transmitted.
fn frames(transmits: Vec<Transmit>) -> Vec<Bytes> {
    let frames = transmits.into_iter().filter_map(|it| match it {
        Transmit::Send { frame, .. } => Some(frame),
        _ => None,
    });
    frames.collect()
}

/// What a radio says by itself, woken now.
fn says<A: Authenticator>(radio: &mut Radio<A>, now_ms: u64) -> Vec<Bytes> {
    frames(stepped(radio, now_ms, Stimulus::Timeout).0)
}

/// What it answers to a frame, whether it lets that in or not.
fn answers<A: Authenticator>(radio: &mut Radio<A>, now_ms: u64, frame: &Bytes) -> Vec<Bytes> {
    frames(told(radio, now_ms, received(frame, None)).0)
}

fn packet(frame: &Bytes) -> Packet {
    let payload = wire::decode_frame(frame).unwrap().payload;
    wire::decode_radio_packet(payload).unwrap()
}

/// The same frame, signed by nobody.
fn unsigned(frame: &Bytes) -> Bytes {
    let mut bytes = frame.to_vec();
    *bytes.last_mut().unwrap() ^= 1;
    bytes.into()
}

fn sent_by<A: Authenticator>(radio: &mut Radio<A>, payload: &[u8]) -> Bytes {
    let payload = payload.to_vec();
    let (transmits, _) = told(
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

/// One of a host's ports.
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

/// What becomes of a frame: nothing if it was let in.
fn dropped<A: Authenticator>(
    radio: &mut Radio<A>,
    now_ms: u64,
    frame: &Bytes,
) -> Option<DropReason> {
    dropped_from(radio, now_ms, frame, None)
}

/// Likewise, of one from somewhere.
fn dropped_from<A: Authenticator>(
    radio: &mut Radio<A>,
    now_ms: u64,
    frame: &Bytes,
    source: Option<Source>,
) -> Option<DropReason> {
    let (transmits, events) = told(radio, now_ms, received(frame, source));
    let reason = events.into_iter().find_map(|event| match event {
        Event::Dropped(reason) => Some(reason),
        _ => None,
    });
    let is_heard = transmits.iter().any(is_passed_on);
    assert!(
        !is_heard || reason.is_none(),
        "what is dropped is not passed on"
    );
    reason
}

fn is_passed_on(transmit: &Transmit) -> bool {
    matches!(transmit, Transmit::Heard { .. } | Transmit::Locate { .. })
}

#[test]
fn a_frame_reaches_the_routing_of_another_drone() {
    let frame = sent_by(&mut radio(0), b"hello");
    let (transmits, events) = told(&mut radio(1), 0, received(&frame, None));
    let heard = Transmit::Heard {
        sender: NodeId(0),
        ballot: BALLOT,
        payload: Bytes::from_static(b"hello"),
    };
    assert_eq!((transmits, events), (vec![heard], vec![]));
}

#[test]
fn a_frame_is_let_in_once() {
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
fn a_frame_of_an_earlier_life_is_a_replay() {
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
fn a_sender_over_its_budget_is_dropped_until_it_has_earned_more() {
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
fn other_swarms_own_echoes_forgeries_and_strangers_are_told_apart() {
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

#[test]
fn over_a_connection_a_drone_speaks_for_itself_only_and_its_signature_is_not_looked_at() {
    let mut receiver = radio(1);
    let frame = unsigned(&sent_by(&mut radio(0), b"hello"));
    let over_that_with = |peer| Input::Received {
        datagram: frame.clone(),
        source: Some(source(1, 7)),
        peer: Some(NodeId(peer)),
    };
    let (transmits, events) = told(&mut receiver, 0, over_that_with(2));
    assert_eq!(transmits, [], "nor is drone 0 looked for there");
    assert_eq!(events, [Event::Dropped(DropReason::Relayed)]);
    let (transmits, events) = told(&mut receiver, 0, over_that_with(0));
    assert!(transmits.iter().any(is_passed_on) && events.is_empty());
    let (_, events) = told(&mut receiver, 0, over_that_with(0));
    assert_eq!(events, [Event::Dropped(DropReason::Replayed)]);
}

#[test]
fn a_forged_frame_does_not_use_up_the_counter_it_claims() {
    let mut receiver = radio(1);
    let genuine = sent_by(&mut radio(0), b"");
    let forged = unsigned(&genuine);
    assert_eq!(dropped(&mut receiver, 0, &forged), Some(DropReason::Forged));
    assert_eq!(dropped(&mut receiver, 1, &genuine), None);
}

#[test]
fn a_restarted_radio_uses_no_counter_twice() {
    let mut first = radio(0);
    let payload = Vec::new();
    let (_, events) = told(
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
        panic!("counters are reserved before they are used");
    };
    sent_by(&mut first, b"");
    let mut second = Radio::new(config(0), IdealAuthenticator, 1, *checkpoint, 7);
    let frame = sent_by(&mut second, b"");
    let counter = wire::decode_frame(&frame).unwrap().header.counter;
    assert!(
        counter > first.counter,
        "{counter} was used by the first incarnation already"
    );
}

#[test]
fn a_payload_that_outgrows_a_datagram_is_not_sent() {
    let payload = vec![0; PAYLOAD_MAX + 1];
    let (transmits, events) = told(
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
fn where_a_sender_is_to_be_found_is_told_by_frames_that_are_let_in_and_by_no_other() {
    let frame = sent_by(&mut radio(0), b"hello");
    let source = source(1, 7);
    let forged = unsigned(&frame);
    let mut receiver = radio(1);
    let located = |transmits: Vec<Transmit>| {
        let is_location = |it: &Transmit| matches!(it, Transmit::Locate { .. });
        transmits.into_iter().find(is_location)
    };
    let (transmits, _) = told(&mut receiver, 0, received(&forged, Some(source)));
    assert_eq!(located(transmits), None);
    let (transmits, _) = told(&mut receiver, 0, received(&frame, Some(source)));
    let sender = NodeId(0);
    let found = Transmit::Locate { sender, source };
    assert_eq!(located(transmits), Some(found));
}

/// Believes nobody but itself.
struct Suspicious;

impl Authenticator for Suspicious {
    fn is_trusted(&self, _: NodeId) -> bool {
        false
    }

    fn sign(&self, covered: &[u8]) -> [u8; AUTHENTICATOR_LEN] {
        IdealAuthenticator.sign(covered)
    }

    fn verify(&self, _: NodeId, _: &[u8], _: &[u8; AUTHENTICATOR_LEN]) -> bool {
        panic!("who is not trusted is not worth the cost of a signature")
    }
}

#[test]
fn frames_of_whoever_is_expelled_are_dropped_before_their_signature_is_looked_at() {
    let frame = sent_by(&mut radio(0), b"hello");
    let mut receiver = Radio::new(config(1), Suspicious, 1, Checkpoint::default(), 0);
    let (transmits, events) = told(&mut receiver, 0, received(&frame, None));
    assert_eq!(transmits, []);
    assert_eq!(events, [Event::Dropped(DropReason::Revoked)]);
}

#[test]
fn where_a_drone_is_and_goes_is_said_at_once_and_in_every_frame() {
    let intent = |north_dm: i32| Intent {
        from_dm: [0, 0, -300],
        to_dm: [north_dm, 0, -300],
        flown: 0,
        is_heedless: false,
    };
    let intend = |intent: Option<Intent>, at_once: bool| Input::Intend { intent, at_once };
    let (mut speaker, mut listener) = (radio(0), radio(1));
    let before = sent_by(&mut speaker, b"before");
    let at_once = frames(told(&mut speaker, 0, intend(Some(intent(600)), true)).0);
    assert_eq!(at_once.len(), 1);
    assert_eq!(packet(&at_once[0]), Packet::Intent);
    assert!(
        told(&mut speaker, 0, intend(Some(intent(600)), true))
            .0
            .is_empty()
    );
    let after = sent_by(&mut speaker, b"after");
    let too_long = sent_by(&mut speaker, &[9; PAYLOAD_MAX]);
    let farther = Intent {
        flown: 64,
        ..intent(600)
    };
    let silently = told(&mut speaker, 0, intend(Some(farther), false)).0;
    assert_eq!(silently, [], "the next frame says so");
    let later = sent_by(&mut speaker, b"later");
    let gone = frames(told(&mut speaker, 0, intend(None, true)).0);
    let mut hears = |now_ms: u64, frame: &Bytes| {
        let (transmits, _) = told(&mut listener, now_ms, received(frame, None));
        transmits.into_iter().find_map(|it| match it {
            Transmit::Traffic { sender, intent } => Some((sender, intent)),
            _ => None,
        })
    };
    assert_eq!(hears(0, &before), None);
    assert_eq!(
        hears(200, &at_once[0]),
        Some((NodeId(0), Some(intent(600))))
    );
    assert_eq!(hears(400, &after), None, "that is known");
    assert_eq!(hears(600, &too_long), None, "no room is no news");
    assert_eq!(hears(700, &later), Some((NodeId(0), Some(farther))));
    assert_eq!(hears(800, &gone[0]), Some((NodeId(0), None)));
}

#[test]
fn a_radio_that_restarts_asks_where_its_drone_is_and_goes() {
    let kept = Checkpoint { counter: 1_024 };
    let mut restarted = Radio::new(config(0), IdealAuthenticator, 1, kept, 7);
    let (asked, _) = told(&mut restarted, 0, received(&Bytes::new(), None));
    assert!(asked.contains(&Transmit::Resync), "{asked:?}");
    let (asked, _) = told(&mut radio(1), 0, received(&Bytes::new(), None));
    assert_eq!(asked, [], "nothing was said before");
}
