use super::*;

/// A host by its number, and one of its ports.
fn from(host: u16) -> Option<Source> {
    Some(source(host, 4_700))
}

/// How many of so many forgeries in the name of drone 0 have their signature looked at, all within a millisecond.
fn looked_at(
    receiver: &mut Radio<IdealAuthenticator>,
    forged: &Bytes,
    hosts: impl Iterator<Item = u16>,
) -> usize {
    let reasons = hosts.filter_map(|it| dropped_from(receiver, 0, forged, from(it)));
    reasons.filter(|it| *it == DropReason::Forged).count()
}

#[test]
fn forgeries_from_elsewhere_use_up_nothing_of_what_a_drone_may_say() {
    let (mut sender, mut receiver) = (radio(0), radio(1));
    let frame = sent_by(&mut sender, b"");
    assert_eq!(dropped_from(&mut receiver, 0, &frame, from(1)), None);
    let forged = unsigned(&sent_by(&mut sender, b""));
    let attackers = (0..10_000).map(|nth| 2 + nth % 2_000);
    looked_at(&mut receiver, &forged, attackers);
    for _ in 0..2 {
        let frame = sent_by(&mut sender, b"");
        assert_eq!(dropped_from(&mut receiver, 0, &frame, from(1)), None);
    }
}

#[test]
fn of_one_host_few_forgeries_are_looked_at_and_others_are_heard_meanwhile() {
    let mut receiver = radio(1);
    let forged = unsigned(&sent_by(&mut radio(0), b""));
    // From each of its ports.
    let reasons =
        (1..=u16::MAX).map(|port| dropped_from(&mut receiver, 0, &forged, Some(source(2, port))));
    let looked_at = reasons.filter(|it| *it == Some(DropReason::Forged)).count();
    assert_eq!(looked_at, 128);
    let unverified = dropped_from(&mut receiver, 0, &forged, from(2));
    assert_eq!(unverified, Some(DropReason::Unverified));
    // Who was never heard before is taken in.
    let frame = sent_by(&mut radio(2), b"");
    assert_eq!(dropped_from(&mut receiver, 0, &frame, from(3)), None);
}

#[test]
fn of_all_hosts_together_no_more_forgeries_are_looked_at_than_a_processor_has_time_for() {
    let mut receiver = radio(1);
    let forged = unsigned(&sent_by(&mut radio(0), b""));
    assert_eq!(looked_at(&mut receiver, &forged, 2..10_000), 256);
    // A millisecond later one more.
    let two = [1, 1].map(|now| dropped_from(&mut receiver, now, &forged, from(60_000)));
    assert_eq!(
        two,
        [Some(DropReason::Forged), Some(DropReason::Unverified)]
    );
    assert!(receiver.admission.senders() <= 1);
}

#[test]
fn forgeries_from_where_a_drone_is_keep_it_from_being_heard_there_and_nobody_else() {
    let (mut sender, mut receiver) = (radio(0), radio(1));
    let frame = sent_by(&mut sender, b"");
    assert_eq!(dropped_from(&mut receiver, 0, &frame, from(1)), None);
    let forged = unsigned(&sent_by(&mut sender, b""));
    // As many as it may say itself.
    let junk = std::iter::repeat_n(1, 100);
    assert_eq!(looked_at(&mut receiver, &forged, junk), 3);
    let frame = sent_by(&mut sender, b"");
    let unheard = dropped_from(&mut receiver, 0, &frame, from(1));
    assert_eq!(unheard, Some(DropReason::Unverified));
    assert_eq!(dropped_from(&mut receiver, 0, &frame, from(5)), None);
    let frame = sent_by(&mut radio(2), b"");
    assert_eq!(
        dropped_from(&mut receiver, 0, &frame, Some(source(1, 9))),
        None
    );
}

#[test]
fn whoever_passes_on_a_drones_frame_and_then_forges_its_others_does_not_silence_it() {
    let (mut sender, mut receiver) = (radio(0), radio(1));
    for now in (0..10_000).step_by(400) {
        // One of its frames is there first by way of another, which so has its home.
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
fn a_drone_that_has_moved_is_at_home_where_it_is_heard() {
    let (mut sender, mut receiver) = (radio(0), radio(1));
    for host in [1, 2] {
        let frame = sent_by(&mut sender, b"");
        assert_eq!(dropped_from(&mut receiver, 0, &frame, from(host)), None);
    }
    // From where it was, as from anywhere.
    let forged = unsigned(&sent_by(&mut sender, b""));
    assert_eq!(
        looked_at(&mut receiver, &forged, std::iter::repeat_n(1, 200)),
        128
    );
    let frame = sent_by(&mut sender, b"");
    assert_eq!(dropped_from(&mut receiver, 0, &frame, from(2)), None);
}
