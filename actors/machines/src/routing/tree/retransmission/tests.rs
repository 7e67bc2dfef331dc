use proptest::prelude::*;

use super::super::tests::neighbourhood::{member, order_of};
use super::*;

const REPAIR: Duration = Duration::from_millis(8);
const REPAIR_MAX: Duration = Duration::from_millis(200);

#[test]
fn repair_delay_is_between_half_and_one_and_a_half_intervals() {
    let mut shared = member(1);
    let now = Timestamp::from_nanos(1_000_000_000);
    let (mut first, mut last) = (REPAIR_MAX * 2, Duration::ZERO);
    for _ in 0..1_000 {
        let mut retransmission = Retransmission::new(REPAIR, REPAIR_MAX);
        retransmission.start(&mut shared, now);
        let pause = retransmission.deadline().unwrap().since(now);
        (first, last) = (first.min(pause), last.max(pause));
    }
    let tenth = REPAIR / 10;
    assert!(
        first >= REPAIR / 2 && first < REPAIR / 2 + tenth,
        "{first:?}"
    );
    assert!(
        last < REPAIR * 3 / 2 && last > REPAIR * 3 / 2 - tenth,
        "{last:?}"
    );
}

#[test]
fn repair_interval_backs_off_after_steady_tries() {
    let mut shared = member(1);
    let mut retransmission = Retransmission::new(REPAIR, REPAIR_MAX);
    let mut now = Timestamp::from_nanos(1_000_000_000);
    retransmission.start(&mut shared, now);
    let mut pause = REPAIR;
    for tries in 0..40 {
        let due = retransmission.deadline().unwrap();
        let waited = due.since(now);
        assert!(
            waited >= pause / 2 && waited < pause * 3 / 2,
            "{tries}: {waited:?}"
        );
        now = due;
        assert_eq!(retransmission.take_due(now), Some(Due::Repair));
        retransmission.back_off(&mut shared, now);
        if tries >= STEADY_TRIES {
            pause = (pause * 3 / 2).min(REPAIR_MAX);
        }
    }
    assert_eq!(pause, REPAIR_MAX);
    assert!(retransmission.has_exhausted_tries(Timestamp::ZERO));
    assert!(
        !retransmission.has_exhausted_tries(now),
        "the parent was heard meanwhile"
    );
    retransmission.stop();
    assert_eq!(retransmission.deadline(), None);
}

#[test]
fn repeated_requests_get_one_answer_per_repair() {
    let mut shared = member(1);
    let mut retransmission = Retransmission::new(REPAIR, REPAIR_MAX);
    let mut now = Timestamp::from_nanos(1_000_000_000);
    let end = now + Duration::from_secs(1);
    let mut answers = 0;
    while now < end {
        retransmission.schedule_answer(&mut shared, now, 1);
        if retransmission.take_due(now) == Some(Due::Answer) {
            answers += 1;
            retransmission.record_sent(now);
        }
        now += Duration::from_micros(100);
    }
    assert!((100..=126).contains(&answers), "{answers}");
}

#[test]
fn answer_delay_grows_with_the_number_of_requests() {
    let mut shared = member(1);
    let now = Timestamp::from_nanos(1_000_000_000);
    for requested in [0, 1, 8] {
        let mut last = Duration::ZERO;
        for _ in 0..1_000 {
            let mut retransmission = Retransmission::new(REPAIR, REPAIR_MAX);
            retransmission.schedule_answer(&mut shared, now, requested);
            let at = retransmission.deadline().unwrap().since(now);
            assert!(at >= ANSWER_SLOT / 4);
            last = last.max(at - ANSWER_SLOT / 4);
        }
        let slots = u32::try_from(requested.max(1)).unwrap();
        assert!(last < ANSWER_SLOT * slots && last > ANSWER_SLOT * slots * 9 / 10);
    }
}

#[test]
fn newer_order_cancels_retransmissions_of_the_old() {
    let mut shared = member(1);
    order_of(&mut shared, 1);
    let mut retransmission = Retransmission::new(REPAIR, REPAIR_MAX);
    let now = Timestamp::from_nanos(1_000_000_000);
    retransmission.start(&mut shared, now);
    retransmission.schedule_relay(&mut shared, now, 3);
    retransmission.schedule_copy(&mut shared, now, 1);
    retransmission.schedule_request(&mut shared, now, NodeId(2));
    assert!(retransmission.deadline().is_some());
    retransmission.start_order();
    assert_eq!(retransmission.deadline(), None);
    retransmission.schedule_answer(&mut shared, now, 1);
    retransmission.start_order();
    assert!(
        retransmission.deadline().is_some(),
        "requests are answered with the newest order"
    );
}

/// A call that makes a drone send.
#[derive(Debug, Clone, Copy)]
enum Call {
    Send,
    Start,
    Expedite,
    Retry,
    Relay(usize),
    Answer(usize),
    Copy,
    Request,
}

fn call() -> impl Strategy<Value = Call> {
    prop_oneof![
        3 => Just(Call::Send),
        1 => Just(Call::Start),
        1 => Just(Call::Expedite),
        1 => Just(Call::Retry),
        1 => (0..20_usize).prop_map(Call::Relay),
        1 => (0..20_usize).prop_map(Call::Answer),
        1 => Just(Call::Copy),
        1 => Just(Call::Request),
    ]
}

proptest! {
    /// The send rate never exceeds the token bucket, and deadlines lie in the future.
    #[test]
    fn send_rate_never_exceeds_the_token_bucket(
        calls in prop::collection::vec((0..4_000_u64, call()), 1..400),
    ) {
        let mut shared = member(1);
        order_of(&mut shared, 1);
        let mut retransmission = Retransmission::new(REPAIR, REPAIR_MAX);
        let mut now = Timestamp::from_nanos(1_000_000_000);
        let mut sent_at = Vec::new();
        for (micros, call) in calls {
            let until = now + Duration::from_micros(micros);
            while let Some(due) = retransmission.deadline().filter(|due| *due <= until) {
                prop_assert!(due >= now);
                now = due;
                while let Some(due) = retransmission.take_due(now) {
                    if due == Due::Repair {
                        retransmission.back_off(&mut shared, now);
                    }
                    retransmission.record_sent(now);
                    sent_at.push(now);
                }
                prop_assert!(retransmission.deadline().is_none_or(|due| due > now));
            }
            now = until;
            match call {
                Call::Send => {
                    if retransmission.may_send(now) {
                        retransmission.record_sent(now);
                        sent_at.push(now);
                    }
                }
                Call::Start => retransmission.start(&mut shared, now),
                Call::Expedite => retransmission.expedite(&mut shared, now),
                Call::Retry => retransmission.retry(&mut shared, now),
                Call::Relay(others) => retransmission.schedule_relay(&mut shared, now, others),
                Call::Answer(requested) => retransmission.schedule_answer(&mut shared, now, requested),
                Call::Copy => retransmission.schedule_copy(&mut shared, now, 1),
                Call::Request => retransmission.schedule_request(&mut shared, now, NodeId(2)),
            }
        }
        for (first, at) in sent_at.iter().enumerate() {
            for (count, other) in (1..).zip(&sent_at[first..]) {
                let frames_max = u128::from(TOKENS_MAX) + other.since(*at).as_nanos() / TOKEN_INTERVAL.as_nanos();
                prop_assert!(count <= frames_max, "{} frames in {:?}", count, other.since(*at));
            }
        }
    }
}
