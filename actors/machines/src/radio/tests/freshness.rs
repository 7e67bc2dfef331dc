use super::*;

/// A radio that was there before and can't know what it heard then.
fn reborn(id: u32, nonce: u64) -> Radio<IdealAuthenticator> {
    let used = Checkpoint {
        counter: COUNTER_BLOCK,
    };
    Radio::new(config(id), IdealAuthenticator, 2, used, nonce)
}

/// One of a drone whose lives are drawn.
fn drawn(id: u32, incarnation: u32, nonce: u64) -> Radio<IdealAuthenticator> {
    let config = Config {
        incarnations: Incarnations::Drawn(incarnation),
        ..config(id)
    };
    Radio::new(config, IdealAuthenticator, 1, Checkpoint::default(), nonce)
}

/// What a radio asks first.
fn challenge_of(radio: &mut Radio<IdealAuthenticator>) -> Bytes {
    challenge_at(radio, 0)
}

fn challenge_at(radio: &mut Radio<IdealAuthenticator>, now_ms: u64) -> Bytes {
    let said = says(radio, now_ms).pop();
    said.expect("it asks as soon as it may")
}

/// Lets `receiver` ask and `sender` answer.
fn prove(
    now_ms: u64,
    receiver: &mut Radio<IdealAuthenticator>,
    sender: &mut Radio<IdealAuthenticator>,
) {
    let challenge = challenge_at(receiver, now_ms);
    let answers = answers(sender, now_ms, &challenge);
    let is_response = |frame: &&Bytes| matches!(packet(frame), Packet::Response(_));
    let response = answers.iter().find(is_response).unwrap();
    assert_eq!(dropped(receiver, now_ms, response), None);
}

#[test]
fn a_radio_that_lived_before_believes_a_sender_once_that_has_signed_its_nonce() {
    let (mut sender, mut receiver) = (radio(0), reborn(1, 99));
    let before = sent_by(&mut sender, b"before");
    assert_eq!(
        dropped(&mut receiver, 0, &before),
        Some(DropReason::Unproven)
    );
    // It has asked when it heard that.
    prove(100, &mut receiver, &mut sender);
    let after = sent_by(&mut sender, b"after");
    assert_eq!(dropped(&mut receiver, 100, &after), None);
}

#[test]
fn what_a_sender_said_before_it_signed_the_nonce_is_a_replay() {
    let mut sender = radio(0);
    let recorded: Vec<_> = (0..100).map(|_| sent_by(&mut sender, b"old")).collect();
    let mut receiver = reborn(1, 99);
    prove(0, &mut receiver, &mut sender);
    for frame in &recorded {
        let replayed = dropped(&mut receiver, 10_000, frame);
        assert_eq!(replayed, Some(DropReason::Replayed));
    }
}

#[test]
fn recorded_responses_prove_nothing_to_the_next_life() {
    let (mut sender, mut first) = (radio(0), reborn(1, 99));
    let challenge = challenge_of(&mut first);
    let response = answers(&mut sender, 0, &challenge).pop().unwrap();
    let mut second = reborn(1, 100);
    assert_eq!(
        dropped(&mut second, 0, &response),
        Some(DropReason::Unproven)
    );
    // Nor to another drone whose number is the same by chance.
    let mut other = reborn(2, 99);
    assert_eq!(
        dropped(&mut other, 0, &response),
        Some(DropReason::Unproven)
    );
}

#[test]
fn a_response_that_its_sender_has_not_signed_proves_nothing() {
    let (mut sender, mut receiver) = (radio(0), reborn(1, 99));
    let challenge = challenge_of(&mut receiver);
    let response = answers(&mut sender, 0, &challenge).pop().unwrap();
    let forged = unsigned(&response);
    assert_eq!(dropped(&mut receiver, 0, &forged), Some(DropReason::Forged));
    let frame = sent_by(&mut sender, b"still unproven");
    assert_eq!(
        dropped(&mut receiver, 0, &frame),
        Some(DropReason::Unproven)
    );
}

#[test]
fn in_its_first_life_a_radio_asks_only_if_it_is_to() {
    let mut trusting = radio(1);
    assert_eq!(says(&mut trusting, 0), Vec::<Bytes>::new());
    let frame = sent_by(&mut radio(0), b"first");
    assert_eq!(dropped(&mut trusting, 0, &frame), None);

    let mut asking = drawn(1, 1, 5);
    let challenge = packet(&challenge_of(&mut asking));
    let of = [NodeId(0), NodeId(2)].into_iter().collect();
    assert_eq!(challenge, Packet::Challenge { nonce: 5, of });
    assert_eq!(dropped(&mut asking, 0, &frame), Some(DropReason::Unproven));
}

#[test]
fn a_radio_that_was_built_anew_before_it_said_anything_knows_that_it_was_there() {
    let mut first = radio(1);
    let (_, events) = stepped(&mut first, 0, Stimulus::Timeout);
    let [Event::Checkpoint(checkpoint)] = events.as_slice() else {
        panic!("its first step leaves a checkpoint, not {events:?}");
    };
    let mut second = Radio::new(config(1), IdealAuthenticator, 1, *checkpoint, 3);
    let frame = sent_by(&mut radio(0), b"");
    assert_eq!(dropped(&mut second, 0, &frame), Some(DropReason::Unproven));
}

#[test]
fn two_radios_that_both_lived_before_prove_themselves_to_each_other() {
    let (mut one, mut other) = (reborn(0, 7), reborn(1, 8));
    prove(0, &mut one, &mut other);
    prove(100, &mut other, &mut one);
    let frame = sent_by(&mut one, b"hello");
    assert_eq!(dropped(&mut other, 100, &frame), None);
    let frame = sent_by(&mut other, b"hello");
    assert_eq!(dropped(&mut one, 100, &frame), None);
}

#[test]
fn whoever_is_unproven_is_asked_again_when_it_is_heard_and_no_more_often_than_that() {
    let mut receiver = reborn(1, 99);
    let mut asked = 0;
    // Nobody is there: it asks a few times, and then it waits.
    for now in 0..5_000 {
        asked += says(&mut receiver, now).len();
    }
    assert_eq!(asked, 3);
    // A thousand frames in a second, replayed or made up: ten challenges, and no signature is looked at.
    let mut sender = radio(0);
    let frame = unsigned(&sent_by(&mut sender, b"junk"));
    let mut asked = Vec::new();
    for now in 5_000..6_000 {
        let (transmits, events) = told(&mut receiver, now, received(&frame, None));
        assert_eq!(events, [Event::Dropped(DropReason::Unproven)]);
        asked.extend(frames(transmits));
        asked.extend(says(&mut receiver, now));
    }
    assert_eq!(asked.len(), 10);
    let response = answers(&mut sender, 6_000, asked.last().unwrap());
    assert_eq!(dropped(&mut receiver, 6_000, &response[0]), None);
}

#[test]
fn who_is_proven_is_not_asked_again() {
    let (mut sender, mut receiver) = (radio(0), reborn(1, 99));
    prove(0, &mut receiver, &mut sender);
    let again = says(&mut receiver, 200).pop().unwrap();
    let of = NodeId(2).into();
    assert_eq!(packet(&again), Packet::Challenge { nonce: 99, of });
    assert_eq!(answers(&mut sender, 200, &again), Vec::<Bytes>::new());
}

#[test]
fn all_who_ask_within_a_moment_are_answered_together() {
    let mut sender = radio(0);
    let [first, second, third] = [(1, 5), (2, 6), (1, 7)].map(|(id, nonce)| {
        let mut asks = reborn(id, nonce);
        asks.incarnation += u32::try_from(nonce).unwrap();
        challenge_of(&mut asks)
    });
    let answered = |frames: Vec<Bytes>| frames.iter().map(packet).collect::<Vec<_>>();
    let at_once = answered(answers(&mut sender, 0, &first));
    assert_eq!(at_once, [Packet::Response(vec![(NodeId(1), 5)])]);
    assert_eq!(answers(&mut sender, 1, &second), Vec::<Bytes>::new());
    assert_eq!(answers(&mut sender, 2, &third), Vec::<Bytes>::new());
    assert_eq!(sender.deadline(), Some(at(20)));
    let together = answered(says(&mut sender, 20));
    let both = vec![(NodeId(1), 7), (NodeId(2), 6)];
    assert_eq!(together, [Packet::Response(both)]);
}

/// Whether a frame has what this drone asks for.
fn has_answered(frame: &Bytes, id: u32, nonce: u64) -> bool {
    match packet(frame) {
        Packet::Response(answered) => answered.contains(&(NodeId(id), nonce)),
        _ => false,
    }
}

/// What the drone `id` asked in so many lives, as somebody recorded it.
fn recorded_challenges(id: u32, incarnations: u32) -> Vec<Bytes> {
    let asked = (1..=incarnations)
        .map(|incarnation| challenge_of(&mut drawn(id, incarnation, incarnation.into())));
    asked.collect()
}

#[test]
fn an_old_challenge_that_is_sent_again_does_not_take_the_place_of_a_new_one() {
    let mut sender = drawn(0, 100, 100);
    says(&mut sender, 0);
    let old = recorded_challenges(1, 2);
    let new = challenge_of(&mut drawn(1, 3, 33));
    // It has just answered another, and so answers these together.
    answers(&mut sender, 0, &challenge_of(&mut drawn(2, 4, 44)));
    for challenge in [&old[0], &new, &old[1]] {
        answers(&mut sender, 1, challenge);
    }
    let responses = says(&mut sender, 20);
    assert!(responses.iter().any(|it| has_answered(it, 1, 33)));
}

#[test]
fn challenges_that_are_sent_again_and_again_make_a_drone_say_little_and_remember_little() {
    let mut sender = drawn(0, 100, 100);
    let old = recorded_challenges(1, 40);
    let mut responses = 0;
    for now in 0..10_000 {
        let challenge = &old[usize::try_from(now).unwrap() % old.len()];
        let mut said = answers(&mut sender, now, challenge);
        said.extend(says(&mut sender, now));
        for frame in said {
            if let Packet::Response(answered) = packet(&frame) {
                responses += 1;
                assert!(answered.len() <= 4, "{answered:?}");
            }
        }
    }
    // Ten at once, and five a second.
    assert_eq!(responses, 59);
    // All the same it answers who asks now.
    let mut asks = drawn(2, 1, 22);
    let mut answered = answers(&mut sender, 10_000, &challenge_of(&mut asks));
    answered.extend((10_001..10_300).flat_map(|now| says(&mut sender, now)));
    assert!(answered.iter().any(|it| has_answered(it, 2, 22)));
}

/// Two lives of drone 0, and a radio that is in between: it has proved itself in the first, and started anew.
fn after_a_restart() -> [Radio<IdealAuthenticator>; 3] {
    let (mut first, mut receiver) = (drawn(0, 7, 70), drawn(1, 1, 99));
    prove(0, &mut receiver, &mut first);
    [first, drawn(0, 3, 30), receiver]
}

/// Lets `sender` be heard in a life that is new to `receiver`, which asks, and answer.
fn prove_anew(
    now_ms: u64,
    receiver: &mut Radio<IdealAuthenticator>,
    sender: &mut Radio<IdealAuthenticator>,
) {
    let frame = sent_by(sender, b"here I am again");
    let (transmits, events) = told(receiver, now_ms, received(&frame, None));
    assert_eq!(events, [Event::Dropped(DropReason::Unproven)]);
    let challenge = frames(transmits).pop().expect("it asks at once");
    let said = answers(sender, now_ms, &challenge);
    let is_response = |frame: &&Bytes| matches!(packet(frame), Packet::Response(_));
    let response = said.iter().find(is_response).unwrap();
    assert_eq!(dropped(receiver, now_ms, response), None);
}

#[test]
fn what_was_recorded_of_another_life_is_not_believed_whatever_number_and_counters_it_has() {
    for recorded_incarnation in [3, 5, u32::MAX] {
        let mut earlier = drawn(0, recorded_incarnation, 1);
        let recorded: Vec<_> = (0..100).map(|_| sent_by(&mut earlier, b"land")).collect();
        let (mut sender, mut receiver) = (drawn(0, 4, 40), drawn(1, 1, 99));
        prove(0, &mut receiver, &mut sender);
        for frame in &recorded {
            let unproven = dropped(&mut receiver, 10, frame);
            assert_eq!(unproven, Some(DropReason::Unproven));
        }
        // Nor is its sender kept out.
        let frame = sent_by(&mut sender, b"fly on");
        assert_eq!(dropped(&mut receiver, 20, &frame), None);
    }
}

#[test]
fn a_sender_that_has_started_anew_is_believed_once_it_has_signed_and_its_last_life_no_more() {
    let [mut first, mut second, mut receiver] = after_a_restart();
    let late = sent_by(&mut first, b"not heard yet");
    prove_anew(200, &mut receiver, &mut second);
    let frame = sent_by(&mut second, b"believe me");
    assert_eq!(dropped(&mut receiver, 300, &frame), None);
    assert_eq!(
        dropped(&mut receiver, 300, &late),
        Some(DropReason::Unproven)
    );
}

#[test]
fn what_a_sender_signed_in_its_last_life_does_not_bring_that_back() {
    let [mut first, mut second, mut receiver] = after_a_restart();
    // It has answered more than once, and not all of that has come in.
    let challenge = challenge_at(&mut receiver, 100);
    let withheld = wire::encode_radio_packet(&Packet::Response(vec![(
        NodeId(1),
        match packet(&challenge) {
            Packet::Challenge { nonce, .. } => nonce,
            other => panic!("{other:?}"),
        },
    )]));
    let withheld = sent_by(&mut first, &withheld);
    prove_anew(200, &mut receiver, &mut second);
    assert_eq!(
        dropped(&mut receiver, 500, &withheld),
        Some(DropReason::Unproven)
    );
    let frame = sent_by(&mut second, b"still believed");
    assert_eq!(dropped(&mut receiver, 500, &frame), None);
}

#[test]
fn recordings_of_another_life_make_a_radio_ask_little() {
    let [mut first, _, mut receiver] = after_a_restart();
    prove(100, &mut receiver, &mut drawn(2, 1, 2));
    says(&mut receiver, 200);
    let recorded = sent_by(&mut drawn(0, 3, 30), b"land");
    let mut asked = Vec::new();
    for now in 1_000..11_000 {
        asked.extend(answers(&mut receiver, now, &recorded));
        asked.extend(says(&mut receiver, now));
        if now % 1_000 == 0 {
            let frame = sent_by(&mut first, b"");
            assert_eq!(dropped(&mut receiver, now, &frame), None);
        }
    }
    // Three at once, and one a second.
    assert_eq!(asked.len(), 12);
}

#[test]
fn a_challenge_that_nobody_has_signed_is_not_answered() {
    let (mut sender, mut receiver) = (radio(0), reborn(1, 99));
    let challenge = unsigned(&challenge_of(&mut receiver));
    assert_eq!(
        dropped(&mut sender, 0, &challenge),
        Some(DropReason::Forged)
    );
    assert_eq!(says(&mut sender, 100), Vec::<Bytes>::new());
}

#[test]
fn what_a_challenge_names_fits_a_datagram_however_many_members_there_are() {
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
    // Every other one is proven.
    for id in (0..large.members).step_by(2) {
        let config = Config {
            id: NodeId(id),
            ..large.clone()
        };
        let mut sender = Radio::new(config, IdealAuthenticator, 1, Checkpoint::default(), 0);
        let response = wire::encode_radio_packet(&Packet::Response(vec![(NodeId(1), 1)]));
        let frame = sent_by(&mut sender, &response);
        assert_eq!(dropped(&mut receiver, 0, &frame), None);
    }
    let challenge = says(&mut receiver, 100).pop().unwrap();
    assert!(challenge.len() < 200);
    let of = NodeSet::from(0..large.members);
    assert_eq!(packet(&challenge), Packet::Challenge { nonce: 1, of });
}
