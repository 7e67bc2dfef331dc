use super::*;

fn source(number: u32) -> Option<Source> {
    NonZeroU32::new(number).map(Source)
}

/// How many of so many forgeries in the name of drone 0 have their signature looked at, all within a millisecond.
fn looked_at(
    receiver: &mut Radio<IdealAuthenticator>,
    forged: &Bytes,
    sources: impl Iterator<Item = u32>,
) -> usize {
    let reasons = sources.filter_map(|it| dropped_from(receiver, 0, forged, source(it)));
    reasons.filter(|it| *it == DropReason::Forged).count()
}

#[test]
fn forgeries_from_elsewhere_use_up_nothing_of_what_a_drone_may_say() {
    let (mut sender, mut receiver) = (radio(0), radio(1));
    let frame = sent_by(&mut sender, b"");
    assert_eq!(dropped_from(&mut receiver, 0, &frame, source(1)), None);
    let forged = unsigned(&sent_by(&mut sender, b""));
    let attackers = (0..10_000).map(|nth| 2 + nth % 2_000);
    looked_at(&mut receiver, &forged, attackers);
    for _ in 0..2 {
        let frame = sent_by(&mut sender, b"");
        assert_eq!(dropped_from(&mut receiver, 0, &frame, source(1)), None);
    }
}

#[test]
fn of_one_source_few_forgeries_are_looked_at_and_others_are_heard_meanwhile() {
    let mut receiver = radio(1);
    let forged = unsigned(&sent_by(&mut radio(0), b""));
    let looked_at = looked_at(&mut receiver, &forged, std::iter::repeat_n(2, 10_000));
    assert_eq!(looked_at, 20);
    let unverified = dropped_from(&mut receiver, 0, &forged, source(2));
    assert_eq!(unverified, Some(DropReason::Unverified));
    // Who was never heard before is taken in.
    let frame = sent_by(&mut radio(2), b"");
    assert_eq!(dropped_from(&mut receiver, 0, &frame, source(3)), None);
}

#[test]
fn of_all_sources_together_no_more_forgeries_are_looked_at_than_a_processor_has_time_for() {
    let mut receiver = radio(1);
    let forged = unsigned(&sent_by(&mut radio(0), b""));
    assert_eq!(looked_at(&mut receiver, &forged, 2..10_000), 256);
    // A millisecond later one more.
    let two = [1, 1].map(|now| dropped_from(&mut receiver, now, &forged, source(70_000)));
    assert_eq!(
        two,
        [Some(DropReason::Forged), Some(DropReason::Unverified)]
    );
    assert!(receiver.admission.senders() <= 1);
}

#[test]
fn forgeries_from_where_a_drone_is_use_up_what_it_may_say_and_nobody_elses() {
    let (mut sender, mut receiver) = (radio(0), radio(1));
    let frame = sent_by(&mut sender, b"");
    assert_eq!(dropped_from(&mut receiver, 0, &frame, source(1)), None);
    let forged = unsigned(&sent_by(&mut sender, b""));
    assert_eq!(
        looked_at(&mut receiver, &forged, std::iter::repeat_n(1, 100)),
        2
    );
    let frame = sent_by(&mut sender, b"");
    let over = dropped_from(&mut receiver, 0, &frame, source(1));
    assert_eq!(over, Some(DropReason::OverBudget));
    let frame = sent_by(&mut radio(2), b"");
    assert_eq!(dropped_from(&mut receiver, 0, &frame, source(4)), None);
}

#[test]
fn a_drone_that_has_moved_is_at_home_where_it_is_heard() {
    let (mut sender, mut receiver) = (radio(0), radio(1));
    for from in [1, 2] {
        let frame = sent_by(&mut sender, b"");
        assert_eq!(dropped_from(&mut receiver, 0, &frame, source(from)), None);
    }
    // From where it was, as from anywhere.
    let forged = unsigned(&sent_by(&mut sender, b""));
    assert_eq!(
        looked_at(&mut receiver, &forged, std::iter::repeat_n(1, 100)),
        20
    );
    let frame = sent_by(&mut sender, b"");
    assert_eq!(dropped_from(&mut receiver, 0, &frame, source(2)), None);
}
