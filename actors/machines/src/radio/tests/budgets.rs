use super::*;

/// A port of host number `host`.
fn from(host: u16) -> Option<Source> {
    Some(source(host, 4_700))
}

/// Number of forgeries in the name of drone 0 that are verified, all within a millisecond.
fn verified_count(
    receiver: &mut Radio<IdealAuthenticator>,
    forged: &Bytes,
    hosts: impl Iterator<Item = u16>,
) -> usize {
    let reasons = hosts.filter_map(|it| dropped_from(receiver, 0, forged, from(it)));
    reasons.filter(|it| *it == DropReason::Forged).count()
}

#[test]
fn forgeries_from_other_sources_cost_a_drone_no_tokens() {
    let (mut sender, mut receiver) = (radio(0), radio(1));
    let frame = sent_by(&mut sender, b"");
    assert_eq!(dropped_from(&mut receiver, 0, &frame, from(1)), None);
    let forged = unsigned(&sent_by(&mut sender, b""));
    let attackers = (0..10_000).map(|nth| 2 + nth % 2_000);
    verified_count(&mut receiver, &forged, attackers);
    for _ in 0..2 {
        let frame = sent_by(&mut sender, b"");
        assert_eq!(dropped_from(&mut receiver, 0, &frame, from(1)), None);
    }
}

#[test]
fn verified_forgeries_of_one_host_are_limited_and_others_are_admitted() {
    let mut receiver = radio(1);
    let forged = unsigned(&sent_by(&mut radio(0), b""));
    // From each of its ports.
    let reasons =
        (1..=u16::MAX).map(|port| dropped_from(&mut receiver, 0, &forged, Some(source(2, port))));
    let verified_count = reasons.filter(|it| *it == Some(DropReason::Forged)).count();
    assert_eq!(verified_count, 128);
    let unverified = dropped_from(&mut receiver, 0, &forged, from(2));
    assert_eq!(unverified, Some(DropReason::Unverified));
    // A new sender is admitted.
    let frame = sent_by(&mut radio(2), b"");
    assert_eq!(dropped_from(&mut receiver, 0, &frame, from(3)), None);
}

#[test]
fn verified_forgeries_of_all_hosts_are_limited() {
    let mut receiver = radio(1);
    let forged = unsigned(&sent_by(&mut radio(0), b""));
    assert_eq!(verified_count(&mut receiver, &forged, 2..10_000), 256);
    // One more a millisecond later.
    let two = [1, 1].map(|now| dropped_from(&mut receiver, now, &forged, from(60_000)));
    assert_eq!(
        two,
        [Some(DropReason::Forged), Some(DropReason::Unverified)]
    );
    assert!(receiver.admission.senders() <= 1);
}

#[test]
fn forgeries_from_a_drone_s_source_block_that_drone_there_and_no_other() {
    let (mut sender, mut receiver) = (radio(0), radio(1));
    let frame = sent_by(&mut sender, b"");
    assert_eq!(dropped_from(&mut receiver, 0, &frame, from(1)), None);
    let forged = unsigned(&sent_by(&mut sender, b""));
    // As many as its own budget.
    let junk = std::iter::repeat_n(1, 100);
    assert_eq!(verified_count(&mut receiver, &forged, junk), 3);
    let frame = sent_by(&mut sender, b"");
    let blocked = dropped_from(&mut receiver, 0, &frame, from(1));
    assert_eq!(blocked, Some(DropReason::Unverified));
    assert_eq!(dropped_from(&mut receiver, 0, &frame, from(5)), None);
    let frame = sent_by(&mut radio(2), b"");
    assert_eq!(
        dropped_from(&mut receiver, 0, &frame, Some(source(1, 9))),
        None
    );
}

#[test]
fn forwarding_a_frame_and_forging_others_does_not_silence_a_drone() {
    let (mut sender, mut receiver) = (radio(0), radio(1));
    for now in (0..10_000).step_by(400) {
        // Another host forwards one of its frames first and so counts as its source.
        let frame = sent_by(&mut sender, b"");
        assert_eq!(dropped_from(&mut receiver, now, &frame, from(2)), None);
        let forged = unsigned(&sent_by(&mut sender, b""));
        let junk = (0..50).filter_map(|_| dropped_from(&mut receiver, now, &forged, from(2)));
        assert_eq!(junk.filter(|it| *it == DropReason::Forged).count(), 3);
        let frame = sent_by(&mut sender, b"");
        assert_eq!(dropped_from(&mut receiver, now, &frame, from(1)), None);
    }
}

#[test]
fn drone_is_known_at_the_source_of_its_last_frame() {
    let (mut sender, mut receiver) = (radio(0), radio(1));
    for host in [1, 2] {
        let frame = sent_by(&mut sender, b"");
        assert_eq!(dropped_from(&mut receiver, 0, &frame, from(host)), None);
    }
    // Its earlier source is like any other.
    let forged = unsigned(&sent_by(&mut sender, b""));
    assert_eq!(
        verified_count(&mut receiver, &forged, std::iter::repeat_n(1, 200)),
        128
    );
    let frame = sent_by(&mut sender, b"");
    assert_eq!(dropped_from(&mut receiver, 0, &frame, from(2)), None);
}
