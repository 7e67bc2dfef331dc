use std::collections::BTreeMap;

use proptest::prelude::*;
use rand::SeedableRng;

use super::*;
use crate::{Arrival, Fate};

const CONFIG: Config = Config {
    propagation: Propagation::Range { range_m: RANGE_M },
    loss: 0.0,
    bursts: None,
    access: Access::Ideal {
        latency: Duration::from_micros(200),
        jitter: Duration::from_micros(100),
    },
    datagram_max: 100,
};
const RANGE_M: f64 = 300.0;

fn medium(config: Config, seed: u64, positions: &[Ned]) -> Medium {
    Medium::new(config, ChaCha8Rng::seed_from_u64(seed), positions)
}

fn line(count: u32, spacing_m: f64) -> Vec<Ned> {
    (0..count)
        .map(|index| Ned::new(0.0, f64::from(index) * spacing_m, -25.0))
        .collect()
}

fn send(medium: &mut Medium, from: u32, to: Destination) -> Vec<Event> {
    let datagram = Bytes::from_static(b"datagram");
    medium
        .send(Timestamp::ZERO, NodeId(from), to, &datagram)
        .unwrap();
    std::iter::from_fn(|| medium.poll_event()).collect()
}

fn arrivals(medium: &mut Medium, from: u32) -> Vec<Arrival> {
    send(medium, from, Destination::Broadcast)
        .into_iter()
        .filter_map(|event| match event {
            Event::Arrival(arrival) => Some(arrival),
            Event::Outcome(_) => None,
        })
        .collect()
}

fn receivers(medium: &mut Medium, from: u32) -> Vec<u32> {
    arrivals(medium, from).iter().map(|it| it.to.0).collect()
}

#[test]
fn exactly_the_radios_in_range_receive() {
    let mut medium = medium(CONFIG, 1, &line(5, 150.0));
    assert_eq!(
        receivers(&mut medium, 0),
        [1, 2],
        "300 m is within the range"
    );
    assert_eq!(receivers(&mut medium, 2), [0, 1, 3, 4]);
}

#[test]
fn moved_radio_is_received_at_its_new_position() {
    let mut medium = medium(CONFIG, 1, &line(3, 1_000.0));
    assert_eq!(receivers(&mut medium, 0), [0_u32; 0]);
    medium.set_position(NodeId(2), Ned::new(10.0, -250.0, 0.0));
    assert_eq!(receivers(&mut medium, 0), [2]);
    assert_eq!(receivers(&mut medium, 2), [0]);
}

#[test]
fn delay_is_between_latency_and_latency_plus_jitter() {
    let mut medium = medium(CONFIG, 1, &line(40, 1.0));
    let times: Vec<_> = arrivals(&mut medium, 0)
        .iter()
        .map(|it| it.at.as_nanos())
        .collect();
    assert_eq!(times.len(), 39);
    assert!(times.iter().all(|at| (200_000..300_000).contains(at)));
    assert!(times.windows(2).any(|pair| pair[0] != pair[1]));
}

#[test]
fn loss_is_drawn_for_each_frame_and_receiver() {
    let lossy = Config {
        loss: 0.3,
        ..CONFIG
    };
    let mut medium = medium(lossy, 5, &line(11, 1.0));
    let received: usize = (0..1_000).map(|_| arrivals(&mut medium, 0).len()).sum();
    // 10,000 draws at 0.7: the standard deviation is 46.
    assert!((6_770..7_230).contains(&received), "{received}");
}

#[test]
fn seed_determines_every_draw() {
    let lossy = Config {
        loss: 0.5,
        ..CONFIG
    };
    let run = |seed| {
        let mut medium = medium(lossy, seed, &line(20, 1.0));
        (0..20)
            .flat_map(|from| arrivals(&mut medium, from))
            .collect::<Vec<_>>()
    };
    assert_eq!(run(1), run(1));
    assert_ne!(run(1), run(2));
}

#[test]
fn too_long_datagrams_and_unknown_senders_are_refused() {
    let mut medium = medium(CONFIG, 1, &line(2, 1.0));
    let long = Bytes::from(vec![0; 101]);
    let refused = medium.send(Timestamp::ZERO, NodeId(0), Destination::Broadcast, &long);
    assert_eq!(refused, Err(SendError::TooLong { len: 101, max: 100 }));
    let refused = medium.send(
        Timestamp::ZERO,
        NodeId(2),
        Destination::Broadcast,
        &Bytes::new(),
    );
    assert_eq!(refused, Err(SendError::UnknownSender(NodeId(2))));
    assert_eq!(medium.poll_event(), None);
}

#[test]
fn unicast_on_an_ideal_medium_is_sent_once_and_overheard() {
    let mut medium = medium(CONFIG, 1, &line(3, 200.0));
    let fate = |medium: &mut Medium, to: u32| {
        let events = send(medium, 0, Destination::To(NodeId(to)));
        match &events[..] {
            [Event::Arrival(arrival), Event::Outcome(outcome)] => {
                assert_eq!(arrival.to, NodeId(1), "the radio in reach receives it");
                assert!(arrival.at <= outcome.at);
                outcome.fate
            }
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(fate(&mut medium, 1), Fate::Delivered);
    assert_eq!(fate(&mut medium, 2), Fate::GivenUp);
}

#[test]
fn ieee80211a_and_fading_are_drawn_for_each_frame() {
    let nakagami = Propagation::Nakagami {
        range_m: RANGE_M,
        shape: 1.0,
    };
    for propagation in [Propagation::Ieee80211a { range_m: 1_400.0 }, nakagami] {
        let config = Config {
            propagation,
            ..CONFIG
        };
        let mut medium = medium(config, 3, &line(2, 500.0));
        let received: usize = (0..10_000).map(|_| arrivals(&mut medium, 0).len()).sum();
        let expected = 10_000.0 * propagation.delivery(500.0);
        // The standard deviation is 36 at most.
        let difference = (f64::from(u32::try_from(received).unwrap()) - expected).abs();
        assert!(difference < 150.0, "{received} for {expected}");
    }
}

#[test]
fn loss_probability_combines_distance_and_configured_loss() {
    let lossy = Config {
        propagation: Propagation::Ieee80211a { range_m: RANGE_M },
        loss: 0.2,
        ..CONFIG
    };
    let mut medium = medium(lossy, 1, &line(3, 160.0));
    medium.set_loss(NodeId(2), NodeId(1), Some(0.5));
    let mut losses = BTreeMap::new();
    medium.each_link(|a, b, [there, back]| {
        losses.insert((a.0, b.0), there);
        losses.insert((b.0, a.0), back);
    });
    // By hand: 5.335e-7 · 160² + 3.395e-5 · 160 = 0.01909; 80 % of the rest is delivered.
    let delivery = 0.8 * (1.0 - 0.019_09);
    for (link, delivery) in [
        ((0, 1), delivery),
        ((1, 0), delivery),
        ((1, 2), delivery),
        ((2, 1), delivery / 2.0),
    ] {
        assert!((losses[&link] - (1.0 - delivery)).abs() < 1e-5, "{link:?}");
        let loss = medium.loss(NodeId(link.0), NodeId(link.1));
        assert!((losses[&link] - loss).abs() < 1e-12, "{link:?}");
    }
    for to in [2, 9] {
        assert!(medium.loss(NodeId(0), NodeId(to)) >= 1.0);
    }
    assert_eq!(losses.len(), 4, "0 and 2 are out of range of each other");
    medium.jam(1, Ned::new(0.0, 320.0, 0.0), 10.0);
    medium.each_link(|a, b, [there, _]| {
        assert_eq!((a.0, b.0, there >= 1.0), (a.0, a.0 + 1, b.0 == 2));
    });
}

proptest! {
    #[test]
    fn grid_finds_the_same_radios_as_exhaustive_search(
        positions in prop::collection::vec((-900.0..900.0_f64, -900.0..900.0_f64), 1..40),
        moves in prop::collection::vec((0_usize..40, -900.0..900.0_f64, -900.0..900.0_f64), 0..40),
    ) {
        let mut positions: Vec<Ned> =
            positions.into_iter().map(|(n, e)| Ned::new(n, e, -20.0)).collect();
        let mut medium = medium(CONFIG, 1, &positions);
        for (index, north, east) in moves {
            let index = index % positions.len();
            positions[index] = Ned::new(north, east, -20.0);
            medium.set_position(NodeId(u32::try_from(index).unwrap()), positions[index]);
        }
        let mut pairs = Vec::new();
        medium.each_link(|a, b, _| pairs.push((a.0.min(b.0), a.0.max(b.0))));
        pairs.sort_unstable();
        let mut all = Vec::new();
        for (from, position) in (0..).zip(&positions) {
            let near: Vec<u32> = (0..)
                .zip(&positions)
                .filter(|(id, other)| *id != from && other.distance_m(*position) <= RANGE_M)
                .map(|(id, _)| id)
                .collect();
            all.extend(near.iter().filter(|id| **id > from).map(|id| (from, *id)));
            prop_assert_eq!(receivers(&mut medium, from), near);
        }
        prop_assert_eq!(pairs, all);
    }
}

#[test]
fn link_cut_in_one_direction_works_in_the_other() {
    let mut medium = medium(CONFIG, 1, &line(3, 150.0));
    medium.set_loss(NodeId(0), NodeId(1), Some(1.0));
    assert_eq!(receivers(&mut medium, 0), [2]);
    assert_eq!(receivers(&mut medium, 1), [0, 2]);
    medium.set_loss(NodeId(0), NodeId(1), None);
    assert_eq!(receivers(&mut medium, 0), [1, 2]);
}

#[test]
fn degraded_link_loses_the_configured_share() {
    let mut medium = medium(CONFIG, 1, &line(2, 150.0));
    medium.set_loss(NodeId(0), NodeId(1), Some(0.3));
    let received: usize = (0..2_000).map(|_| receivers(&mut medium, 0).len()).sum();
    assert!((1_300..1_500).contains(&received), "{received} of 2000");
}

#[test]
fn jammed_radios_receive_nothing_until_the_jammer_stops() {
    for access in [CONFIG.access, CSMA] {
        let mut medium = medium(Config { access, ..CONFIG }, 1, &line(3, 150.0));
        medium.jam(7, Ned::new(10.0, 300.0, 0.0), 100.0);
        assert_eq!(final_receivers(&mut medium, 1), [0]);
        assert_eq!(final_receivers(&mut medium, 2), [0, 1], "{access:?}");
        medium.stop_jamming(7);
        assert_eq!(final_receivers(&mut medium, 1), [0, 2], "{access:?}");
    }
}

const CSMA: Access = Access::Csma {
    jitter: Duration::ZERO,
    queue_max: NonZeroUsize::MIN,
};

/// The receivers of a frame on a medium with airtime.
fn final_receivers(medium: &mut Medium, from: u32) -> Vec<u32> {
    let mut received_by = receivers(medium, from);
    while let Some(at) = medium.next_timeout() {
        medium.handle_timeout(at);
        let events = std::iter::from_fn(|| medium.poll_event());
        received_by.extend(events.filter_map(|event| match event {
            Event::Arrival(arrival) => Some(arrival.to.0),
            Event::Outcome(_) => None,
        }));
    }
    received_by
}

/// Bursts during 5 % of the time.
const BURSTS: Bursts = Bursts {
    every: Duration::from_millis(380),
    length: Duration::from_millis(20),
    loss: 1.0,
};

/// Which frames are lost between two radios that send alternately, one frame per millisecond.
fn lost_in_bursts(access: Access, bursts: Bursts, frames: u64) -> Vec<bool> {
    let config = Config {
        bursts: Some(bursts),
        access,
        ..CONFIG
    };
    let mut medium = medium(config, 11, &line(2, 100.0));
    let mut lost = Vec::new();
    for frame in 0..frames {
        let now = Timestamp::from_nanos(frame * 1_000_000);
        let from = NodeId(u32::from(frame % 2 == 1));
        medium
            .send(now, from, Destination::Broadcast, &Bytes::new())
            .unwrap();
        while let Some(at) = medium.next_timeout() {
            medium.handle_timeout(at);
        }
        lost.push(std::iter::from_fn(|| medium.poll_event()).count() == 0);
    }
    lost
}

/// The share of true values.
fn share<'a>(values: impl IntoIterator<Item = &'a bool>) -> f64 {
    let (mut count, mut all) = (0.0, 0.0);
    for value in values {
        count += f64::from(u8::from(*value));
        all += 1.0;
    }
    count / all
}

#[test]
fn bursts_have_the_configured_length_and_frequency() {
    for access in [CONFIG.access, CSMA] {
        let lost = lost_in_bursts(access, BURSTS, 400_000);
        // The state has a time constant of 19 ms, so the share in 400 s has a standard deviation of
        // √(2 · 0.05 · 0.95 · 0.019 / 400) = 0.0021.
        let lost_share = share(&lost);
        assert!((lost_share - 0.05).abs() < 0.009, "{lost_share} {access:?}");
        let starts: Vec<bool> = lost.windows(2).map(|it| !it[0] && it[1]).collect();
        // Bursts shorter than a millisecond are missed: 1 / (0.95 · (1 − exp(−1 / 19))) = 20.5 frames. The mean of a thousand
        // bursts has a standard deviation of 0.65.
        let frames_a_burst = lost_share / share(&starts);
        assert!(
            (frames_a_burst - 20.5).abs() < 2.6,
            "{frames_a_burst} {access:?}"
        );
    }
}

#[test]
fn losses_within_bursts_have_the_configured_share() {
    let half = Bursts {
        loss: 0.5,
        ..BURSTS
    };
    for access in [CONFIG.access, CSMA] {
        let lost = lost_in_bursts(access, half, 400_000);
        let lost_share = share(&lost);
        assert!(
            (lost_share - half.mean_loss()).abs() < 0.005,
            "{lost_share}"
        );
        // A millisecond later the link is still in a burst with probability 0.951, and loses half of the frames. About
        // 10,000 draws in a thousand bursts have a standard deviation of at most 0.01.
        let after_a_loss = lost.windows(2).filter(|it| it[0]).map(|it| &it[1]);
        let after_a_loss = share(after_a_loss);
        assert!((after_a_loss - 0.476).abs() < 0.04, "{after_a_loss}");
    }
}

#[test]
fn each_pair_of_radios_has_independent_bursts() {
    let config = Config {
        bursts: Some(BURSTS),
        ..CONFIG
    };
    let mut medium = medium(config, 2, &line(41, 1.0));
    let mut received = Vec::new();
    for second in 0..100 {
        let now = Timestamp::ZERO + Duration::from_secs(second);
        medium
            .send(now, NodeId(0), Destination::Broadcast, &Bytes::new())
            .unwrap();
        received.push(std::iter::from_fn(|| medium.poll_event()).count());
    }
    // 40 links in a burst 5 % of the time: 38 ± 1.4 receivers per frame, 3,800 ± 14 in total.
    let all: usize = received.iter().sum();
    assert!((3_740..3_860).contains(&all), "{all}");
    assert!(received.iter().all(|it| *it > 28), "{received:?}");
}

#[test]
fn loss_probability_includes_the_mean_loss_of_bursts() {
    let half = Bursts {
        loss: 0.5,
        ..BURSTS
    };
    let config = Config {
        loss: 0.2,
        bursts: Some(half),
        ..CONFIG
    };
    let mut medium = medium(config, 1, &line(2, 100.0));
    let expected = 1.0 - 0.8 * 0.975;
    assert!((medium.loss(NodeId(0), NodeId(1)) - expected).abs() < 1e-12);
    medium.each_link(|_, _, losses| {
        assert!(losses.iter().all(|loss| (loss - expected).abs() < 1e-12));
    });
}

#[test]
fn burst_state_of_an_unused_link_decays_at_the_exact_rate() {
    // By hand: 0.05 + 0.95 · exp(−1) after a time constant of 19 ms, and 0.05 · (1 − exp(−1)).
    let constant = Duration::from_millis(19);
    assert!((BURSTS.share_after(1.0, constant) - 0.399_485).abs() < 1e-6);
    assert!((BURSTS.share_after(0.0, constant) - 0.031_606).abs() < 1e-6);
    // Two half steps equal one step.
    let half = BURSTS.share_after(1.0, constant / 2);
    assert!((BURSTS.share_after(half, constant / 2) - 0.399_485).abs() < 1e-6);
    assert!((BURSTS.share_after(1.0, Duration::ZERO) - 1.0).abs() < 1e-12);
}
