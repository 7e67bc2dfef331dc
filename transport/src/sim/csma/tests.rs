use muster_machines::geometry::Ned;
use proptest::prelude::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::super::{Access, Config, Medium, Propagation};
use super::*;
use crate::Transport;

const CONFIG: Config = Config {
    propagation: Propagation::Range { range_m: 300.0 },
    loss: 0.0,
    bursts: None,
    access: Access::Csma {
        jitter: Duration::ZERO,
        queue_max: NonZeroUsize::new(10).unwrap(),
    },
    datagram_max: 100,
};

const ALL: Destination = Destination::Broadcast;

fn to(id: u32) -> Destination {
    Destination::To(NodeId(id))
}

/// Radios in a line.
struct Line {
    medium: Medium,
}

impl Line {
    fn new(config: Config, radios: u32, spacing_m: f64, seed: u64) -> Self {
        let positions: Vec<Ned> = (0..radios)
            .map(|index| Ned::new(0.0, f64::from(index) * spacing_m, -25.0))
            .collect();
        let rng = ChaCha8Rng::seed_from_u64(seed);
        let medium = Medium::new(config, rng, &positions);
        Self { medium }
    }

    /// Sends a datagram of 64 bytes that starts with `mark`.
    fn send(&mut self, at_us: u64, from: u32, destination: Destination, mark: u8) {
        let now = at(at_us);
        self.medium.handle_timeout(now);
        let mut datagram = vec![0; 64];
        datagram[0] = mark;
        self.medium
            .send(now, NodeId(from), destination, &datagram.into())
            .unwrap();
    }

    /// Runs until no timer is left and returns all events.
    fn run(&mut self) -> Vec<Event> {
        while let Some(next) = self.medium.next_timeout() {
            self.medium.handle_timeout(next);
        }
        std::iter::from_fn(|| self.medium.poll_event()).collect()
    }
}

fn at(micros: u64) -> Timestamp {
    Timestamp::from_nanos(micros * 1_000)
}

/// Time in microseconds, receiver and mark of each arrival.
fn arrivals(events: &[Event]) -> Vec<(u64, u32, u8)> {
    let arrival = |event: &Event| match event {
        Event::Arrival(it) => Some((it.at.as_nanos() / 1_000, it.to.0, it.datagram[0])),
        Event::Outcome(_) => None,
    };
    events.iter().filter_map(arrival).collect()
}

/// Time in microseconds, sender, mark and fate of each unicast.
fn outcomes(events: &[Event]) -> Vec<(u64, u32, u8, Fate)> {
    let outcome = |event: &Event| match event {
        Event::Outcome(it) => {
            let micros = it.at.as_nanos() / 1_000;
            Some((micros, it.from.0, it.datagram[0], it.fate))
        }
        Event::Arrival(_) => None,
    };
    events.iter().filter_map(outcome).collect()
}

#[test]
fn frame_on_an_idle_medium_takes_difs_and_its_airtime() {
    let mut line = Line::new(CONFIG, 3, 200.0, 1);
    line.send(1_000, 1, ALL, 1);
    assert_eq!(arrivals(&line.run()), [(1_230, 0, 1), (1_230, 2, 1)]);
}

#[test]
fn radio_that_senses_a_frame_waits_for_its_end() {
    let mut line = Line::new(CONFIG, 2, 200.0, 1);
    line.send(0, 0, ALL, 1);
    line.send(50, 1, ALL, 2);
    let arrivals = arrivals(&line.run());
    assert_eq!(arrivals[0], (230, 1, 1));
    let (second, ..) = arrivals[1];
    assert!(second >= 230 + 34 + 196, "{second}");
    assert!(second <= 230 + 34 + 15 * 9 + 196, "{second}");
}

#[test]
fn first_frame_of_two_hidden_terminals_is_received() {
    let mut line = Line::new(CONFIG, 3, 200.0, 1);
    line.send(0, 0, ALL, 1);
    line.send(50, 2, ALL, 2);
    assert_eq!(arrivals(&line.run()), [(230, 1, 1)]);
    assert_eq!(line.medium.counters().collided, 1);
}

#[test]
fn simultaneous_frames_of_hidden_terminals_collide() {
    let mut line = Line::new(CONFIG, 3, 200.0, 1);
    line.send(0, 0, ALL, 1);
    line.send(3, 2, ALL, 2);
    assert_eq!(arrivals(&line.run()), []);
    assert_eq!(line.medium.counters().collided, 2);
}

#[test]
fn sending_radio_does_not_receive() {
    // Radios 0 and 1 start within the detection time. Radio 2 hears only radio 1.
    let mut line = Line::new(CONFIG, 3, 200.0, 1);
    line.send(0, 0, ALL, 1);
    line.send(3, 1, ALL, 2);
    assert_eq!(arrivals(&line.run()), [(233, 2, 2)]);
}

#[test]
fn radio_backs_off_between_two_frames() {
    let last = |seed| {
        let mut line = Line::new(CONFIG, 2, 200.0, seed);
        line.send(0, 0, ALL, 1);
        line.send(0, 0, ALL, 2);
        let arrivals = arrivals(&line.run());
        assert_eq!(arrivals.len(), 2);
        arrivals[1].0 - 230 - 230
    };
    let pauses: Vec<u64> = (0..50).map(last).collect();
    assert!(pauses.iter().all(|pause| pause % 9 == 0 && *pause <= 135));
    assert!(pauses.iter().any(|pause| *pause > 90));
    assert!(pauses.iter().any(|pause| *pause < 45));
}

#[test]
fn unicast_is_acknowledged_by_its_receiver_and_overheard_by_others() {
    let mut line = Line::new(CONFIG, 3, 200.0, 1);
    line.send(0, 1, to(2), 1);
    let events = line.run();
    assert_eq!(arrivals(&events), [(230, 0, 1), (230, 2, 1)]);
    assert_eq!(outcomes(&events), [(290, 1, 1, Fate::Delivered)]);
    let counters = line.medium.counters();
    assert_eq!((counters.datagrams, counters.acknowledgements), (1, 1));
}

#[test]
fn overhearing_radio_reserves_time_for_the_acknowledgement() {
    // Radio 0 hears the frame of radio 1, but not the acknowledgement of radio 2.
    for seed in 0..20 {
        let mut line = Line::new(CONFIG, 3, 200.0, seed);
        line.send(0, 1, to(2), 1);
        line.send(100, 0, ALL, 2);
        let events = line.run();
        assert_eq!(outcomes(&events), [(290, 1, 1, Fate::Delivered)]);
        let (broadcast, ..) = *arrivals(&events).last().unwrap();
        assert!(broadcast >= 290 + 34 + 196, "{broadcast}");
    }
}

#[test]
fn unacknowledged_unicast_is_sent_eight_times_and_given_up() {
    let mut line = Line::new(CONFIG, 2, 400.0, 1);
    line.send(0, 0, to(1), 1);
    line.send(0, 0, to(1), 2);
    let events = line.run();
    assert_eq!(arrivals(&events), []);
    let given_up: Vec<_> = outcomes(&events)
        .iter()
        .map(|(_, _, mark, fate)| (*mark, *fate))
        .collect();
    assert_eq!(given_up, [(1, Fate::GivenUp), (2, Fate::GivenUp)]);
    let counters = line.medium.counters();
    assert_eq!(counters.datagrams, 16);
    assert_eq!((counters.retries, counters.given_up), (14, 2));
}

#[test]
fn seven_retries_overcome_a_loss_of_a_third_without_duplicates() {
    let config = Config {
        loss: 0.33,
        ..CONFIG
    };
    let mut line = Line::new(config, 2, 200.0, 1);
    let mut events = Vec::new();
    for round in 0..500_u64 {
        line.send(round * 100_000, 0, to(1), 1);
        events.extend(line.run());
    }
    let delivered = outcomes(&events)
        .iter()
        .filter(|(.., fate)| *fate == Fate::Delivered)
        .count();
    // An attempt succeeds in both directions with probability 0.45; all eight fail in 0.8 % of the cases.
    assert!((485..=500).contains(&delivered), "{delivered}");
    let arrived = arrivals(&events).len();
    assert!((delivered..=500).contains(&arrived), "{arrived}");
}

#[test]
fn datagram_for_a_full_queue_is_dropped_and_reported() {
    let mut line = Line::new(CONFIG, 2, 200.0, 1);
    for mark in 0..10 {
        line.send(0, 0, ALL, mark);
    }
    line.send(0, 0, ALL, 10);
    line.send(0, 0, to(1), 11);
    let events = line.run();
    let arrived: Vec<u8> = arrivals(&events).iter().map(|it| it.2).collect();
    assert_eq!(arrived, [0, 1, 2, 3, 4, 5, 6, 7, 8, 9]);
    assert_eq!(outcomes(&events), [(0, 0, 11, Fate::GivenUp)]);
    assert_eq!(line.medium.counters().dropped, 2);
}

#[test]
fn jitter_keeps_the_order_of_datagrams() {
    let config = Config {
        access: Access::Csma {
            jitter: Duration::from_millis(1),
            queue_max: NonZeroUsize::new(10).unwrap(),
        },
        ..CONFIG
    };
    for seed in 0..20 {
        let mut line = Line::new(config, 2, 200.0, seed);
        for mark in 0..3 {
            line.send(0, 0, ALL, mark);
        }
        let arrivals = arrivals(&line.run());
        let marks: Vec<u8> = arrivals.iter().map(|it| it.2).collect();
        assert_eq!(marks, [0, 1, 2]);
        assert!((230..1_230).contains(&arrivals[0].0));
    }
}

#[test]
fn early_and_repeated_calls_do_nothing() {
    let mut line = Line::new(CONFIG, 2, 200.0, 1);
    line.send(0, 0, ALL, 1);
    assert_eq!(line.medium.next_timeout(), Some(at(34)));
    line.medium.handle_timeout(at(33));
    assert_eq!(line.medium.next_timeout(), Some(at(34)));
    line.medium.handle_timeout(at(34));
    line.medium.handle_timeout(at(34));
    assert_eq!(line.medium.next_timeout(), Some(at(230)));
    assert_eq!(line.medium.poll_event(), None);
}

#[test]
fn unknown_senders_and_receivers_are_refused() {
    let mut line = Line::new(CONFIG, 2, 200.0, 1);
    let refused = line.medium.send(at(0), NodeId(0), to(2), &Bytes::new());
    assert_eq!(refused, Err(SendError::UnknownReceiver(NodeId(2))));
    let refused = line.medium.send(at(0), NodeId(2), ALL, &Bytes::new());
    assert_eq!(refused, Err(SendError::UnknownSender(NodeId(2))));
}

/// Time, sender and destination of frames; destination 6 is a broadcast.
fn traffic() -> impl Strategy<Value = Vec<(u64, u32, u32)>> {
    prop::collection::vec((0_u64..20_000, 0_u32..6, 0_u32..7), 0..100).prop_map(|mut sends| {
        sends.sort_unstable();
        sends
    })
}

fn simulate(
    sends: &[(u64, u32, u32)],
    spacing_m: f64,
    loss: f64,
    seed: u64,
) -> (Vec<Event>, Counters) {
    let config = Config { loss, ..CONFIG };
    let mut line = Line::new(config, 6, spacing_m, seed);
    for (mark, (at_us, from, destination)) in (0..).zip(sends) {
        let destination = if *destination == 6 {
            ALL
        } else {
            to(*destination)
        };
        line.send(*at_us, *from, destination, mark);
    }
    (line.run(), line.medium.counters())
}

proptest! {
    #[test]
    fn seed_determines_everything(sends in traffic(), seed: u64) {
        prop_assert_eq!(simulate(&sends, 140.0, 0.1, seed), simulate(&sends, 140.0, 0.1, seed));
    }

    #[test]
    fn receptions_never_overlap_or_repeat(sends in traffic(), spacing_m in 10.0..320.0_f64, seed: u64) {
        let arrivals = arrivals(&simulate(&sends, spacing_m, 0.1, seed).0);
        for radio in 0..6 {
            let received: Vec<_> = arrivals.iter().filter(|it| it.1 == radio).collect();
            prop_assert!(received.windows(2).all(|pair| pair[1].0 >= pair[0].0 + 196));
            let mut marks: Vec<u8> = received.iter().map(|it| it.2).collect();
            marks.sort_unstable();
            marks.dedup();
            prop_assert_eq!(marks.len(), received.len());
        }
    }

    #[test]
    fn each_unicast_has_one_correct_outcome(
        sends in traffic(), spacing_m in 10.0..320.0_f64, seed: u64,
    ) {
        let (events, counters) = simulate(&sends, spacing_m, 0.1, seed);
        let arrivals = arrivals(&events);
        let outcomes = outcomes(&events);
        for (mark, (_, _, destination)) in (0_u8..).zip(&sends) {
            let own: Vec<_> = outcomes.iter().filter(|it| it.2 == mark).collect();
            prop_assert_eq!(own.len(), usize::from(*destination != 6));
            if own.iter().any(|it| it.3 == Fate::Delivered) {
                prop_assert!(arrivals.iter().any(|it| it.2 == mark && it.1 == *destination));
            }
        }
        let given_up = outcomes.iter().filter(|it| it.3 == Fate::GivenUp).count() as u64;
        prop_assert!(given_up >= counters.given_up && given_up <= counters.given_up + counters.dropped);
    }
}
