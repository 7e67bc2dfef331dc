use super::*;

/// A radio with an earlier incarnation.
fn restarted(id: u32, nonce: u64) -> Radio<IdealAuthenticator> {
    let used = Checkpoint {
        counter: COUNTER_BLOCK,
    };
    Radio::new(config(id), IdealAuthenticator, 2, used, nonce)
}

/// A radio with a drawn incarnation.
fn drawn(id: u32, incarnation: u32, nonce: u64) -> Radio<IdealAuthenticator> {
    let config = Config {
        incarnations: Incarnations::Drawn(incarnation),
        ..config(id)
    };
    Radio::new(config, IdealAuthenticator, 1, Checkpoint::default(), nonce)
}

/// First challenge of a radio.
fn challenge_of(radio: &mut Radio<IdealAuthenticator>) -> Bytes {
    challenge_at(radio, 0)
}

fn challenge_at(radio: &mut Radio<IdealAuthenticator>, now_ms: u64) -> Bytes {
    let sent = timeout_frames(radio, now_ms).pop();
    sent.expect("it challenges as soon as allowed")
}

/// `receiver` challenges, `sender` responds.
fn prove(
    now_ms: u64,
    receiver: &mut Radio<IdealAuthenticator>,
    sender: &mut Radio<IdealAuthenticator>,
) {
    let challenge = challenge_at(receiver, now_ms);
    let response_frames = response_frames(sender, now_ms, &challenge);
    let is_response = |frame: &&Bytes| matches!(packet(frame), RadioPacket::Response(_));
    let response = response_frames.iter().find(is_response).unwrap();
    assert_eq!(dropped(receiver, now_ms, response), None);
}

#[test]
fn restarted_radio_accepts_a_sender_that_has_signed_its_nonce() {
    let (mut sender, mut receiver) = (radio(0), restarted(1, 99));
    let before = sent_by(&mut sender, b"before");
    assert_eq!(
        dropped(&mut receiver, 0, &before),
        Some(DropReason::Unproven)
    );
    // It has challenged on that frame.
    prove(100, &mut receiver, &mut sender);
    let after = sent_by(&mut sender, b"after");
    assert_eq!(dropped(&mut receiver, 100, &after), None);
}

#[test]
fn frames_from_before_the_proof_are_replays() {
    let mut sender = radio(0);
    let recorded: Vec<_> = (0..100).map(|_| sent_by(&mut sender, b"old")).collect();
    let mut receiver = restarted(1, 99);
    prove(0, &mut receiver, &mut sender);
    for frame in &recorded {
        let replayed = dropped(&mut receiver, 10_000, frame);
        assert_eq!(replayed, Some(DropReason::Replayed));
    }
}

#[test]
fn recorded_response_proves_nothing_to_the_next_incarnation() {
    let (mut sender, mut first) = (radio(0), restarted(1, 99));
    let challenge = challenge_of(&mut first);
    let response = response_frames(&mut sender, 0, &challenge).pop().unwrap();
    let mut second = restarted(1, 100);
    assert_eq!(
        dropped(&mut second, 0, &response),
        Some(DropReason::Unproven)
    );
    // Nor to another drone with the same nonce.
    let mut other = restarted(2, 99);
    assert_eq!(
        dropped(&mut other, 0, &response),
        Some(DropReason::Unproven)
    );
}

#[test]
fn unsigned_response_proves_nothing() {
    let (mut sender, mut receiver) = (radio(0), restarted(1, 99));
    let challenge = challenge_of(&mut receiver);
    let response = response_frames(&mut sender, 0, &challenge).pop().unwrap();
    let forged = unsigned(&response);
    assert_eq!(dropped(&mut receiver, 0, &forged), Some(DropReason::Forged));
    let frame = sent_by(&mut sender, b"still unproven");
    assert_eq!(
        dropped(&mut receiver, 0, &frame),
        Some(DropReason::Unproven)
    );
}

#[test]
fn radio_in_its_first_incarnation_challenges_only_if_drawn() {
    let mut trusting = radio(1);
    assert_eq!(timeout_frames(&mut trusting, 0), Vec::<Bytes>::new());
    let frame = sent_by(&mut radio(0), b"first");
    assert_eq!(dropped(&mut trusting, 0, &frame), None);

    let mut asking = drawn(1, 1, 5);
    let challenge = packet(&challenge_of(&mut asking));
    let of = [NodeId(0), NodeId(2)].into_iter().collect();
    assert_eq!(challenge, RadioPacket::Challenge { nonce: 5, of });
    assert_eq!(dropped(&mut asking, 0, &frame), Some(DropReason::Unproven));
}

#[test]
fn radio_restarted_before_its_first_frame_requires_proofs() {
    let mut first = radio(1);
    let (_, events) = step_at(&mut first, 0, Stimulus::Timeout);
    let [Event::Checkpoint(checkpoint)] = events.as_slice() else {
        panic!("the first step leaves a checkpoint, not {events:?}");
    };
    let mut second = Radio::new(config(1), IdealAuthenticator, 1, *checkpoint, 3);
    let frame = sent_by(&mut radio(0), b"");
    assert_eq!(dropped(&mut second, 0, &frame), Some(DropReason::Unproven));
}

#[test]
fn two_restarted_radios_prove_themselves_to_each_other() {
    let (mut one, mut other) = (restarted(0, 7), restarted(1, 8));
    prove(0, &mut one, &mut other);
    prove(100, &mut other, &mut one);
    let frame = sent_by(&mut one, b"hello");
    assert_eq!(dropped(&mut other, 100, &frame), None);
    let frame = sent_by(&mut other, b"hello");
    assert_eq!(dropped(&mut one, 100, &frame), None);
}

#[test]
fn unproven_sender_is_challenged_again_when_heard_at_a_limited_rate() {
    let mut receiver = restarted(1, 99);
    let mut challenges = 0;
    // Without peers it challenges a few times, then stops.
    for now in 0..5_000 {
        challenges += timeout_frames(&mut receiver, now).len();
    }
    assert_eq!(challenges, 3);
    // A thousand junk frames in a second cause ten challenges and no verification.
    let mut sender = radio(0);
    let frame = unsigned(&sent_by(&mut sender, b"junk"));
    let mut asked = Vec::new();
    for now in 5_000..6_000 {
        let (transmits, events) = handle(&mut receiver, now, received(&frame, None));
        assert_eq!(events, [Event::Dropped(DropReason::Unproven)]);
        asked.extend(frames(transmits));
        asked.extend(timeout_frames(&mut receiver, now));
    }
    assert_eq!(asked.len(), 10);
    let response = response_frames(&mut sender, 6_000, asked.last().unwrap());
    assert_eq!(dropped(&mut receiver, 6_000, &response[0]), None);
}

#[test]
fn proven_sender_is_not_challenged_again() {
    let (mut sender, mut receiver) = (radio(0), restarted(1, 99));
    prove(0, &mut receiver, &mut sender);
    let next = timeout_frames(&mut receiver, 200).pop().unwrap();
    let of = NodeId(2).into();
    assert_eq!(packet(&next), RadioPacket::Challenge { nonce: 99, of });
    assert_eq!(
        response_frames(&mut sender, 200, &next),
        Vec::<Bytes>::new()
    );
}

#[test]
fn challenges_within_the_response_interval_are_answered_together() {
    let mut sender = radio(0);
    let [first, second, third] = [(1, 5), (2, 6), (1, 7)].map(|(id, nonce)| {
        let mut challenger = restarted(id, nonce);
        challenger.incarnation += u32::try_from(nonce).unwrap();
        challenge_of(&mut challenger)
    });
    let answered = |frames: Vec<Bytes>| frames.iter().map(packet).collect::<Vec<_>>();
    let immediately = answered(response_frames(&mut sender, 0, &first));
    assert_eq!(immediately, [RadioPacket::Response(vec![(NodeId(1), 5)])]);
    assert_eq!(
        response_frames(&mut sender, 1, &second),
        Vec::<Bytes>::new()
    );
    assert_eq!(response_frames(&mut sender, 2, &third), Vec::<Bytes>::new());
    assert_eq!(sender.deadline(), Some(at(20)));
    let together = answered(timeout_frames(&mut sender, 20));
    let both = vec![(NodeId(1), 7), (NodeId(2), 6)];
    assert_eq!(together, [RadioPacket::Response(both)]);
}

/// Whether a frame answers this challenge.
fn has_answered(frame: &Bytes, id: u32, nonce: u64) -> bool {
    match packet(frame) {
        RadioPacket::Response(answered) => answered.contains(&(NodeId(id), nonce)),
        _ => false,
    }
}

/// Recorded challenges of drone `id` from several incarnations.
fn recorded_challenges(id: u32, incarnations: u32) -> Vec<Bytes> {
    let asked = (1..=incarnations)
        .map(|incarnation| challenge_of(&mut drawn(id, incarnation, incarnation.into())));
    asked.collect()
}

#[test]
fn replayed_challenge_does_not_displace_a_new_one() {
    let mut sender = drawn(0, 100, 100);
    timeout_frames(&mut sender, 0);
    let old = recorded_challenges(1, 2);
    let new = challenge_of(&mut drawn(1, 3, 33));
    // It has just sent a response, so it answers these together.
    response_frames(&mut sender, 0, &challenge_of(&mut drawn(2, 4, 44)));
    for challenge in [&old[0], &new, &old[1]] {
        response_frames(&mut sender, 1, challenge);
    }
    let responses = timeout_frames(&mut sender, 20);
    assert!(responses.iter().any(|it| has_answered(it, 1, 33)));
}

#[test]
fn replayed_challenges_cause_few_responses_and_little_memory() {
    let mut sender = drawn(0, 100, 100);
    let old = recorded_challenges(1, 40);
    let mut responses = 0;
    for now in 0..10_000 {
        let challenge = &old[usize::try_from(now).unwrap() % old.len()];
        let mut sent = response_frames(&mut sender, now, challenge);
        sent.extend(timeout_frames(&mut sender, now));
        for frame in sent {
            if let RadioPacket::Response(answered) = packet(&frame) {
                responses += 1;
                assert!(answered.len() <= 4, "{answered:?}");
            }
        }
    }
    // Ten at once, then five a second.
    assert_eq!(responses, 59);
    // It still answers a new challenge.
    let mut challenger = drawn(2, 1, 22);
    let mut answered = response_frames(&mut sender, 10_000, &challenge_of(&mut challenger));
    answered.extend((10_001..10_300).flat_map(|now| timeout_frames(&mut sender, now)));
    assert!(answered.iter().any(|it| has_answered(it, 2, 22)));
}

/// Two incarnations of drone 0, and a radio for which it is proven in the first.
fn after_a_restart() -> [Radio<IdealAuthenticator>; 3] {
    let (mut first, mut receiver) = (drawn(0, 7, 70), drawn(1, 1, 99));
    prove(0, &mut receiver, &mut first);
    [first, drawn(0, 3, 30), receiver]
}

/// `sender` is heard in a new incarnation, `receiver` challenges, `sender` responds.
fn prove_again(
    now_ms: u64,
    receiver: &mut Radio<IdealAuthenticator>,
    sender: &mut Radio<IdealAuthenticator>,
) {
    let frame = sent_by(sender, b"restarted");
    let (transmits, events) = handle(receiver, now_ms, received(&frame, None));
    assert_eq!(events, [Event::Dropped(DropReason::Unproven)]);
    let challenge = frames(transmits).pop().expect("it challenges immediately");
    let sent = response_frames(sender, now_ms, &challenge);
    let is_response = |frame: &&Bytes| matches!(packet(frame), RadioPacket::Response(_));
    let response = sent.iter().find(is_response).unwrap();
    assert_eq!(dropped(receiver, now_ms, response), None);
}

#[test]
fn recordings_of_another_incarnation_are_dropped_whatever_their_number() {
    for recorded_incarnation in [3, 5, u32::MAX] {
        let mut earlier = drawn(0, recorded_incarnation, 1);
        let recorded: Vec<_> = (0..100).map(|_| sent_by(&mut earlier, b"land")).collect();
        let (mut sender, mut receiver) = (drawn(0, 4, 40), drawn(1, 1, 99));
        prove(0, &mut receiver, &mut sender);
        for frame in &recorded {
            let unproven = dropped(&mut receiver, 10, frame);
            assert_eq!(unproven, Some(DropReason::Unproven));
        }
        // Its sender is still accepted.
        let frame = sent_by(&mut sender, b"fly on");
        assert_eq!(dropped(&mut receiver, 20, &frame), None);
    }
}

#[test]
fn restarted_sender_is_accepted_after_its_proof_and_its_last_incarnation_is_not() {
    let [mut first, mut second, mut receiver] = after_a_restart();
    let late = sent_by(&mut first, b"not heard yet");
    prove_again(200, &mut receiver, &mut second);
    let frame = sent_by(&mut second, b"believe me");
    assert_eq!(dropped(&mut receiver, 300, &frame), None);
    assert_eq!(
        dropped(&mut receiver, 300, &late),
        Some(DropReason::Unproven)
    );
}

#[test]
fn late_proof_of_the_last_incarnation_does_not_bring_it_back() {
    let [mut first, mut second, mut receiver] = after_a_restart();
    // It has sent several responses, one of which arrives late.
    let challenge = challenge_at(&mut receiver, 100);
    let withheld = wire::encode_radio_packet(&RadioPacket::Response(vec![(
        NodeId(1),
        match packet(&challenge) {
            RadioPacket::Challenge { nonce, .. } => nonce,
            other => panic!("{other:?}"),
        },
    )]));
    let withheld = sent_by(&mut first, &withheld);
    prove_again(200, &mut receiver, &mut second);
    assert_eq!(
        dropped(&mut receiver, 500, &withheld),
        Some(DropReason::Unproven)
    );
    let frame = sent_by(&mut second, b"still believed");
    assert_eq!(dropped(&mut receiver, 500, &frame), None);
}

#[test]
fn recordings_of_another_incarnation_cause_few_challenges() {
    let [mut first, _, mut receiver] = after_a_restart();
    prove(100, &mut receiver, &mut drawn(2, 1, 2));
    timeout_frames(&mut receiver, 200);
    let recorded = sent_by(&mut drawn(0, 3, 30), b"land");
    let mut asked = Vec::new();
    for now in 1_000..11_000 {
        asked.extend(response_frames(&mut receiver, now, &recorded));
        asked.extend(timeout_frames(&mut receiver, now));
        if now % 1_000 == 0 {
            let frame = sent_by(&mut first, b"");
            assert_eq!(dropped(&mut receiver, now, &frame), None);
        }
    }
    // Three at once, then one a second.
    assert_eq!(asked.len(), 12);
}

#[test]
fn unsigned_challenge_is_not_answered() {
    let (mut sender, mut receiver) = (radio(0), restarted(1, 99));
    let challenge = unsigned(&challenge_of(&mut receiver));
    assert_eq!(
        dropped(&mut sender, 0, &challenge),
        Some(DropReason::Forged)
    );
    assert_eq!(timeout_frames(&mut sender, 100), Vec::<Bytes>::new());
}

#[test]
fn challenge_fits_a_datagram_with_any_number_of_members() {
    let large = Config {
        members: 10_000,
        ..config(1)
    };
    let mut receiver = Radio::new(
        large.clone(),
        IdealAuthenticator,
        2,
        Checkpoint::default(),
        1,
    );
    challenge_of(&mut receiver);
    // Every other sender is proven.
    for id in (0..large.members).step_by(2) {
        let config = Config {
            id: NodeId(id),
            ..large.clone()
        };
        let mut sender = Radio::new(config, IdealAuthenticator, 1, Checkpoint::default(), 0);
        let response = wire::encode_radio_packet(&RadioPacket::Response(vec![(NodeId(1), 1)]));
        let frame = sent_by(&mut sender, &response);
        assert_eq!(dropped(&mut receiver, 0, &frame), None);
    }
    let challenge = timeout_frames(&mut receiver, 100).pop().unwrap();
    assert!(challenge.len() < 200);
    let of = NodeSet::from(0..large.members);
    assert_eq!(packet(&challenge), RadioPacket::Challenge { nonce: 1, of });
}
