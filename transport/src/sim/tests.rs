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

fn medium(config: Config, seed: u64, places: &[Ned]) -> Medium {
    Medium::new(config, ChaCha8Rng::seed_from_u64(seed), places)
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

fn heard_by(medium: &mut Medium, from: u32) -> Vec<u32> {
    arrivals(medium, from).iter().map(|it| it.to.0).collect()
}

#[test]
fn whoever_is_in_range_hears_and_nobody_else() {
    let mut medium = medium(CONFIG, 1, &line(5, 150.0));
    assert_eq!(
        heard_by(&mut medium, 0),
        [1, 2],
        "300 m is within the range"
    );
    assert_eq!(heard_by(&mut medium, 2), [0, 1, 3, 4]);
}

#[test]
fn a_radio_that_moves_is_heard_where_it_is() {
    let mut medium = medium(CONFIG, 1, &line(3, 1_000.0));
    assert_eq!(heard_by(&mut medium, 0), [0_u32; 0]);
    medium.place(NodeId(2), Ned::new(10.0, -250.0, 0.0));
    assert_eq!(heard_by(&mut medium, 0), [2]);
    assert_eq!(heard_by(&mut medium, 2), [0]);
}

#[test]
fn a_frame_takes_the_latency_and_at_most_the_jitter_more() {
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
    let heard: usize = (0..1_000).map(|_| arrivals(&mut medium, 0).len()).sum();
    // 10,000 draws at 0.7: the standard deviation is 46.
    assert!((6_770..7_230).contains(&heard), "{heard}");
}

#[test]
fn the_seed_decides_every_draw() {
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
fn what_is_too_long_or_from_nowhere_is_not_sent() {
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
fn without_medium_access_what_is_for_one_drone_is_tried_once_and_heard_by_all() {
    let mut medium = medium(CONFIG, 1, &line(3, 200.0));
    let fate = |medium: &mut Medium, to: u32| {
        let events = send(medium, 0, Destination::To(NodeId(to)));
        match &events[..] {
            [Event::Arrival(arrival), Event::Outcome(outcome)] => {
                assert_eq!(arrival.to, NodeId(1), "whoever is in reach hears it");
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
fn the_ancestors_curve_and_fading_are_drawn_for_each_frame() {
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
        let heard: usize = (0..10_000).map(|_| arrivals(&mut medium, 0).len()).sum();
        let expected = 10_000.0 * propagation.delivery(500.0);
        // The standard deviation is 36 at most.
        let differs = (f64::from(u32::try_from(heard).unwrap()) - expected).abs();
        assert!(differs < 150.0, "{heard} for {expected}");
    }
}

#[test]
fn the_chance_of_loss_is_that_of_the_distance_and_the_configured_share() {
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
    // By hand: 5.335e-7 · 160² + 3.395e-5 · 160 = 0.01909; 0.8 of the others get through.
    let heard = 0.8 * (1.0 - 0.019_09);
    for (link, heard) in [
        ((0, 1), heard),
        ((1, 0), heard),
        ((1, 2), heard),
        ((2, 1), heard / 2.0),
    ] {
        assert!((losses[&link] - (1.0 - heard)).abs() < 1e-5, "{link:?}");
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
    fn the_grid_finds_whom_a_look_at_all_finds(
        places in prop::collection::vec((-900.0..900.0_f64, -900.0..900.0_f64), 1..40),
        moves in prop::collection::vec((0_usize..40, -900.0..900.0_f64, -900.0..900.0_f64), 0..40),
    ) {
        let mut places: Vec<Ned> = places.into_iter().map(|(n, e)| Ned::new(n, e, -20.0)).collect();
        let mut medium = medium(CONFIG, 1, &places);
        for (index, north, east) in moves {
            let index = index % places.len();
            places[index] = Ned::new(north, east, -20.0);
            medium.place(NodeId(u32::try_from(index).unwrap()), places[index]);
        }
        let mut pairs = Vec::new();
        medium.each_link(|a, b, _| pairs.push((a.0.min(b.0), a.0.max(b.0))));
        pairs.sort_unstable();
        let mut all = Vec::new();
        for (from, place) in (0..).zip(&places) {
            let near: Vec<u32> = (0..)
                .zip(&places)
                .filter(|(id, other)| *id != from && other.distance_m(*place) <= RANGE_M)
                .map(|(id, _)| id)
                .collect();
            all.extend(near.iter().filter(|id| **id > from).map(|id| (from, *id)));
            prop_assert_eq!(heard_by(&mut medium, from), near);
        }
        prop_assert_eq!(pairs, all);
    }
}

#[test]
fn a_link_that_is_cut_one_way_still_carries_the_other() {
    let mut medium = medium(CONFIG, 1, &line(3, 150.0));
    medium.set_loss(NodeId(0), NodeId(1), Some(1.0));
    assert_eq!(heard_by(&mut medium, 0), [2]);
    assert_eq!(heard_by(&mut medium, 1), [0, 2]);
    medium.set_loss(NodeId(0), NodeId(1), None);
    assert_eq!(heard_by(&mut medium, 0), [1, 2]);
}

#[test]
fn a_degraded_link_loses_the_share_that_it_is_said_to() {
    let mut medium = medium(CONFIG, 1, &line(2, 150.0));
    medium.set_loss(NodeId(0), NodeId(1), Some(0.3));
    let heard: usize = (0..2_000).map(|_| heard_by(&mut medium, 0).len()).sum();
    assert!((1_300..1_500).contains(&heard), "{heard} of 2000");
}

#[test]
fn nothing_is_made_out_near_a_jammer_until_it_stops() {
    for access in [CONFIG.access, CSMA] {
        let mut medium = medium(Config { access, ..CONFIG }, 1, &line(3, 150.0));
        medium.jam(7, Ned::new(10.0, 300.0, 0.0), 100.0);
        assert_eq!(heard_by_all(&mut medium, 1), [0]);
        assert_eq!(heard_by_all(&mut medium, 2), [0, 1], "{access:?}");
        medium.stop_jamming(7);
        assert_eq!(heard_by_all(&mut medium, 1), [0, 2], "{access:?}");
    }
}

const CSMA: Access = Access::Csma {
    jitter: Duration::ZERO,
    queue_max: NonZeroUsize::MIN,
};

/// Likewise on a medium that takes its time.
fn heard_by_all(medium: &mut Medium, from: u32) -> Vec<u32> {
    let mut heard = heard_by(medium, from);
    while let Some(at) = medium.next_timeout() {
        medium.handle_timeout(at);
        let events = std::iter::from_fn(|| medium.poll_event());
        heard.extend(events.filter_map(|event| match event {
            Event::Arrival(arrival) => Some(arrival.to.0),
            Event::Outcome(_) => None,
        }));
    }
    heard
}

/// A twentieth of the time.
const BURSTS: Bursts = Bursts {
    every: Duration::from_millis(380),
    length: Duration::from_millis(20),
    loss: 1.0,
};

/// Which frames are lost between two radios that send by turns, one in each millisecond.
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

/// The share of frames of which that is so.
fn share<'a>(frames: impl IntoIterator<Item = &'a bool>) -> f64 {
    let (mut so, mut all) = (0.0, 0.0);
    for is_so in frames {
        so += f64::from(u8::from(*is_so));
        all += 1.0;
    }
    so / all
}

#[test]
fn bursts_last_as_long_and_come_as_often_as_configured_whoever_sends() {
    for access in [CONFIG.access, CSMA] {
        let lost = lost_in_bursts(access, BURSTS, 400_000);
        // States are forgotten with a time constant of 19 ms, so the share in 400 s has a standard deviation of
        // √(2 · 0.05 · 0.95 · 0.019 / 400) = 0.0021.
        let lost_share = share(&lost);
        assert!((lost_share - 0.05).abs() < 0.009, "{lost_share} {access:?}");
        let starts: Vec<bool> = lost.windows(2).map(|it| !it[0] && it[1]).collect();
        // Bursts within a millisecond are not seen: 1 / (0.95 · (1 − exp(−1 / 19))) = 20.5 frames. Of a thousand bursts
        // the mean has a standard deviation of 0.65.
        let frames_a_burst = lost_share / share(&starts);
        assert!(
            (frames_a_burst - 20.5).abs() < 2.6,
            "{frames_a_burst} {access:?}"
        );
    }
}

#[test]
fn losses_in_bursts_come_in_runs_of_the_configured_share() {
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
        // The link is still in a burst after a millisecond with 0.951, and then loses half. Some 10,000 draws in a
        // thousand bursts have a standard deviation of 0.01 at most.
        let after_a_loss = lost.windows(2).filter(|it| it[0]).map(|it| &it[1]);
        let after_a_loss = share(after_a_loss);
        assert!((after_a_loss - 0.476).abs() < 0.04, "{after_a_loss}");
    }
}

#[test]
fn each_two_radios_have_bursts_of_their_own() {
    let config = Config {
        bursts: Some(BURSTS),
        ..CONFIG
    };
    let mut medium = medium(config, 2, &line(41, 1.0));
    let mut heard = Vec::new();
    for second in 0..100 {
        let now = Timestamp::ZERO + Duration::from_secs(second);
        medium
            .send(now, NodeId(0), Destination::Broadcast, &Bytes::new())
            .unwrap();
        heard.push(std::iter::from_fn(|| medium.poll_event()).count());
    }
    // 40 links that are in a burst for a twentieth of the time: 38 ± 1.4 of each frame, 3,800 ± 14 of all.
    let all: usize = heard.iter().sum();
    assert!((3_740..3_860).contains(&all), "{all}");
    assert!(heard.iter().all(|it| *it > 28), "{heard:?}");
}

#[test]
fn the_chance_of_loss_has_that_of_bursts_in_the_long_run() {
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
fn an_unused_link_forgets_its_state_at_the_exact_rate() {
    // By hand: 0.05 + 0.95 · exp(−1) after a time constant of 19 ms, and 0.05 · (1 − exp(−1)).
    let constant = Duration::from_millis(19);
    assert!((BURSTS.share_after(1.0, constant) - 0.399_485).abs() < 1e-6);
    assert!((BURSTS.share_after(0.0, constant) - 0.031_606).abs() < 1e-6);
    // Twice half of the time comes to the same.
    let half = BURSTS.share_after(1.0, constant / 2);
    assert!((BURSTS.share_after(half, constant / 2) - 0.399_485).abs() < 1e-6);
    assert!((BURSTS.share_after(1.0, Duration::ZERO) - 1.0).abs() < 1e-12);
}
