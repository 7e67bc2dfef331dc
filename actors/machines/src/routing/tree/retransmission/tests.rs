use proptest::prelude::*;

use super::super::tests::neighbourhood::{Neighbourhood, member, order_of, with_route};
use super::*;
use crate::routing::Tree;

const REPAIR: Duration = Duration::from_millis(8);
const REPAIR_MAX: Duration = Duration::from_millis(200);

fn ids<const N: usize>(ids: [u32; N]) -> NodeSet {
    ids.into_iter().map(NodeId).collect()
}

/// What a neighbour says that knows order `sequence` and follows `parent`.
fn following(parent: u32, sequence: u32) -> Tree {
    Tree {
        parent: Some(NodeId(parent)),
        sequence,
        ..with_route(2, 64, 1)
    }
}

#[test]
fn nothing_is_owed_over_links_that_nobody_routes_over() {
    let mut core = member(1);
    order_of(&mut core, 1);
    let mut near = Neighbourhood::of(1);
    near.hear_well(0, &with_route(0, 0, 1));
    // A neighbour with another parent, a child that is behind, another that loses frames, and one that knows.
    near.hear_well(2, &following(7, 0));
    near.hear_well(3, &following(1, 0));
    near.hear_well(4, &following(1, 0));
    near.miss(4);
    near.miss(4);
    near.hear(4, following(1, 0));
    near.hear_well(5, &following(1, 1));
    let owed = |near: &Neighbourhood, parent| {
        let times = (near.now, Neighbourhood::BEACON);
        Owed::of(&core, &near.links, parent, times)
    };
    let now = owed(&near, None);
    assert_eq!((now.trusted, now.unaware), (ids([3]), ids([4])));
    assert_eq!(now.asking, ids([]));
    assert_eq!(owed(&near, Some(NodeId(0))).unaware, ids([0, 4]));
    // Who asks is answered, whoever its parent is.
    near.links.asks(NodeId(2));
    assert_eq!(owed(&near, None).asking, ids([2]));
    // Children that were silent for longer than by chance may have gone elsewhere.
    near.links.answered(None);
    near.now += Neighbourhood::BEACON * 6;
    assert!(!owed(&near, None).is_anyone_behind());
    assert!(owed(&near, None).trusted.is_empty());
}

#[test]
fn what_is_said_again_comes_at_random_half_a_pause_to_one_and_a_half_later() {
    let mut core = member(1);
    let now = Timestamp::from_nanos(1_000_000_000);
    let (mut first, mut last) = (REPAIR_MAX * 2, Duration::ZERO);
    for _ in 0..1_000 {
        let mut said = Retransmission::default();
        said.begin(&mut core, now, REPAIR);
        let pause = said.deadline().unwrap().since(now);
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
fn pauses_are_the_same_while_losses_are_by_chance_then_longer_and_bounded() {
    let mut core = member(1);
    let mut said = Retransmission::default();
    let mut now = Timestamp::from_nanos(1_000_000_000);
    said.begin(&mut core, now, REPAIR);
    let mut pause = REPAIR;
    for tries in 0..40 {
        let due = said.deadline().unwrap();
        let waited = due.since(now);
        assert!(
            waited >= pause / 2 && waited < pause * 3 / 2,
            "{tries}: {waited:?}"
        );
        now = due;
        assert_eq!(said.take_due(now), Some(Due::Repair));
        said.go_on(&mut core, now, (REPAIR, REPAIR_MAX));
        if tries >= STEADY_TRIES {
            pause = (pause * 3 / 2).min(REPAIR_MAX);
        }
    }
    assert_eq!(pause, REPAIR_MAX);
    assert!(said.has_tried_in_vain(Timestamp::ZERO));
    assert!(!said.has_tried_in_vain(now), "it was heard meanwhile");
    said.end();
    assert_eq!(said.deadline(), None);
}

#[test]
fn who_asks_again_and_again_is_answered_once_a_repair() {
    let mut core = member(1);
    let mut said = Retransmission::default();
    let mut now = Timestamp::from_nanos(1_000_000_000);
    let end = now + Duration::from_secs(1);
    let mut answers = 0;
    while now < end {
        said.answer(&mut core, now, (1, REPAIR));
        if said.take_due(now) == Some(Due::Answer) {
            answers += 1;
            said.spoken(now);
        }
        now += Duration::from_micros(100);
    }
    assert!((100..=126).contains(&answers), "{answers}");
}

#[test]
fn answers_share_as_many_slots_as_there_are_neighbours_asked() {
    let mut core = member(1);
    let now = Timestamp::from_nanos(1_000_000_000);
    for asked in [0, 1, 8] {
        let mut last = Duration::ZERO;
        for _ in 0..1_000 {
            let mut said = Retransmission::default();
            said.answer(&mut core, now, (asked, REPAIR));
            let at = said.deadline().unwrap().since(now);
            assert!(at >= ANSWER_SLOT / 4);
            last = last.max(at - ANSWER_SLOT / 4);
        }
        let slots = u32::try_from(asked.max(1)).unwrap();
        assert!(last < ANSWER_SLOT * slots && last > ANSWER_SLOT * slots * 9 / 10);
    }
}

#[test]
fn a_newer_order_ends_attempts_to_pass_on_the_one_before() {
    let mut core = member(1);
    order_of(&mut core, 1);
    let mut said = Retransmission::default();
    let now = Timestamp::from_nanos(1_000_000_000);
    said.begin(&mut core, now, REPAIR);
    said.relay(&mut core, now, 3);
    said.copy_for(&mut core, now, 1, REPAIR);
    said.ask(&mut core, now, NodeId(2), REPAIR);
    assert!(said.deadline().is_some());
    said.begin_order();
    assert_eq!(said.deadline(), None);
    said.answer(&mut core, now, (1, REPAIR));
    said.begin_order();
    assert!(
        said.deadline().is_some(),
        "who asks is answered with the newest"
    );
}

/// Something that makes a drone speak, so many microseconds after the one before.
#[derive(Debug, Clone, Copy)]
enum Call {
    Say,
    Begin,
    Hurry,
    Retry,
    Relay(usize),
    Answer(usize),
    Copy,
    Ask,
}

fn call() -> impl Strategy<Value = Call> {
    prop_oneof![
        3 => Just(Call::Say),
        1 => Just(Call::Begin),
        1 => Just(Call::Hurry),
        1 => Just(Call::Retry),
        1 => (0..20_usize).prop_map(Call::Relay),
        1 => (0..20_usize).prop_map(Call::Answer),
        1 => Just(Call::Copy),
        1 => Just(Call::Ask),
    ]
}

proptest! {
    /// However often it is to speak, a drone never says more than its pace allows for; and what
    /// is still to be said lies ahead.
    #[test]
    fn however_often_it_is_to_speak_a_drone_keeps_its_pace(
        calls in prop::collection::vec((0..4_000_u64, call()), 1..400),
    ) {
        let mut core = member(1);
        order_of(&mut core, 1);
        let mut said = Retransmission::default();
        let mut now = Timestamp::from_nanos(1_000_000_000);
        let mut spoken = Vec::new();
        for (micros, call) in calls {
            let until = now + Duration::from_micros(micros);
            while let Some(due) = said.deadline().filter(|due| *due <= until) {
                prop_assert!(due >= now);
                now = due;
                while let Some(due) = said.take_due(now) {
                    if due == Due::Repair {
                        said.go_on(&mut core, now, (REPAIR, REPAIR_MAX));
                    }
                    said.spoken(now);
                    spoken.push(now);
                }
                prop_assert!(said.deadline().is_none_or(|due| due > now));
            }
            now = until;
            match call {
                Call::Say => {
                    if said.may_speak(now, REPAIR) {
                        said.spoken(now);
                        spoken.push(now);
                    }
                }
                Call::Begin => said.begin(&mut core, now, REPAIR),
                Call::Hurry => said.hurry(&mut core, now, REPAIR),
                Call::Retry => said.retry(&mut core, now, REPAIR),
                Call::Relay(others) => said.relay(&mut core, now, others),
                Call::Answer(asked) => said.answer(&mut core, now, (asked, REPAIR)),
                Call::Copy => said.copy_for(&mut core, now, 1, REPAIR),
                Call::Ask => said.ask(&mut core, now, NodeId(2), REPAIR),
            }
        }
        for (begin, at) in spoken.iter().enumerate() {
            for (count, other) in (1..).zip(&spoken[begin..]) {
                let pace = u128::from(BURST) + other.since(*at).as_nanos() / PACE.as_nanos();
                prop_assert!(count <= pace, "{} frames in {:?}", count, other.since(*at));
            }
        }
    }
}
