use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;

/// A link over which frames are heard and missed by a fixed random draw.
struct Heard {
    quality: Quality,
    missed: u32,
    rng: ChaCha8Rng,
}

impl Heard {
    fn new() -> Self {
        Self {
            quality: Quality::new(),
            missed: 0,
            rng: ChaCha8Rng::seed_from_u64(1),
        }
    }

    /// After so many frames, of which this share is lost.
    fn after(frames: u32, loss: f64) -> Self {
        let mut heard = Self::new();
        for _ in 0..frames {
            heard.frame(loss);
        }
        heard
    }

    fn frame(&mut self, loss: f64) {
        if self.rng.random_bool(loss) {
            self.missed += 1;
        } else {
            self.quality.learn_missed(std::mem::take(&mut self.missed));
            self.quality.learn_heard();
        }
    }

    fn burst(&mut self, frames: u32) {
        self.missed += frames;
        self.frame(0.0);
    }
}

fn sixteenths(it: u8) -> f64 {
    f64::from(it) / f64::from(WELL)
}

#[test]
fn the_estimates_are_the_true_loss_in_the_mean() {
    for loss in [0.0, 0.1, 0.3, 0.5, 0.7] {
        let mut heard = Heard::after(500, loss);
        let (mut short, mut long, mut reported) = (0.0, 0.0, 0.0);
        const FRAMES: u32 = 20_000;
        for _ in 0..FRAMES {
            heard.frame(loss);
            short += heard.quality.loss();
            long += heard.quality.long_loss();
            reported += 1.0 - sixteenths(heard.quality.heard());
        }
        let [short, long, reported] = [short, long, reported].map(|it| it / f64::from(FRAMES));
        assert!((short - loss).abs() < 0.02, "{short} of {loss}");
        assert!((long - loss).abs() < 0.01, "{long} of {loss}");
        // What is reported changes when a frame is heard, and begins with one that was: both are in the link's favour.
        let favour = loss - reported;
        assert!(
            (-0.01..loss / 6.0 + 0.01).contains(&favour),
            "{reported} of {loss}"
        );
    }
}

#[test]
fn the_estimate_stays_near_a_loss_that_does_not_change() {
    for loss in [0.1, 0.5] {
        let mut heard = Heard::after(500, loss);
        // The mean of the last 50, with weights: five standard deviations.
        let within = 5.0 * libm::sqrt(loss * (1.0 - loss) / 99.0);
        for _ in 0..20_000 {
            heard.frame(loss);
            let estimate = heard.quality.loss();
            assert!((estimate - loss).abs() < within, "{estimate} of {loss}");
        }
    }
}

#[test]
fn a_link_that_changes_is_seen_to_within_thirty_frames() {
    let mut heard = Heard::after(200, 0.0);
    assert!(heard.quality.is_good() && heard.quality.cost() == ETX_UNIT);
    for _ in 0..30 {
        heard.frame(0.7);
    }
    assert!(heard.quality.cost() > ETX_UNIT * 4);
    for _ in 0..45 {
        heard.frame(0.0);
    }
    assert!(heard.quality.is_good() && heard.quality.cost() == ETX_UNIT);
}

#[test]
fn a_burst_makes_no_good_link_poor_at_once() {
    for frames in 1..=12 {
        let mut heard = Heard::after(100, 0.0);
        heard.burst(frames);
        assert!(!heard.quality.is_poor(), "{frames} in a row");
        assert_eq!(heard.quality.is_good(), frames == 1, "{frames} in a row");
    }
    let mut heard = Heard::after(100, 0.0);
    heard.burst(30);
    assert!(heard.quality.is_poor(), "that is no burst any more");
}

#[test]
fn one_lost_frame_in_fifty_is_not_worth_a_report() {
    let mut heard = Heard::new();
    for _ in 0..100 {
        for _ in 0..49 {
            heard.frame(0.0);
        }
        heard.burst(1);
        assert_eq!(heard.quality.heard(), WELL);
    }
}

#[test]
fn what_is_reported_stays_as_long_as_the_estimate_is_near() {
    let mut heard = Heard::after(200, 0.4);
    let (mut changes, mut before) = (0, heard.quality.heard());
    for _ in 0..1_000 {
        heard.frame(0.4);
        let now = heard.quality.heard();
        let share = 1.0 - heard.quality.recent_loss * 12.0 / 13.0;
        assert!((share * 16.0 - f64::from(now)).abs() <= 0.8 + 0.5);
        changes += u32::from(now != before);
        before = now;
    }
    // Rounded each time, it would be another one with more than every second frame.
    assert!((100..500).contains(&changes), "{changes}");
}

#[test]
fn few_frames_prove_nothing() {
    let mut heard = Heard::new();
    let mut probes = heard.quality.probes();
    assert_eq!(
        probes, 73,
        "nothing is known: half of them may be lost, each way"
    );
    for frames in 1..50 {
        assert_eq!(heard.quality.is_proven(), frames > PROVEN);
        heard.frame(0.0);
        let fewer = heard.quality.probes();
        assert!(fewer <= probes && heard.quality.is_good());
        probes = fewer;
    }
    assert!(probes <= 7);
    // Frames that were missed are counted, too.
    let mut heard = Heard::new();
    heard.burst(3);
    assert!(heard.quality.is_proven());
}

#[test]
fn the_more_a_link_loses_the_longer_its_silence_is_borne_and_never_beyond_the_bounds() {
    let mut before = Quality::new();
    before.frames = MEMORY;
    before.judge();
    for percent in 0..=100 {
        let mut quality = before;
        quality.loss = f64::from(percent) / 100.0;
        quality.judge();
        assert!(quality.stale_beacons >= before.stale_beacons);
        assert!(quality.lost_beacons >= before.lost_beacons);
        assert!(quality.probes() >= before.probes() && quality.probes() <= PROBES_MAX);
        assert!((1..=STALE_BEACONS_MAX).contains(&quality.stale_beacons));
        assert!((1..=LOST_BEACONS_MAX).contains(&quality.lost_beacons));
        // Where more than half is lost, few frames make it seem less.
        if percent > 50 {
            before = quality;
            continue;
        }
        let silent = |beacons: u16| libm::pow(quality.loss, f64::from(beacons));
        let stale = quality.stale_beacons;
        assert!(
            stale == STALE_BEACONS_MAX || silent(stale) <= STALE,
            "{percent} %"
        );
        let lost = quality.lost_beacons;
        assert!(
            lost == LOST_BEACONS_MAX || silent(lost) <= LOST,
            "{percent} %"
        );
        before = quality;
    }
}

#[test]
fn a_living_neighbour_leaves_all_probes_unanswered_once_in_a_thousand_million_times() {
    for (loss, there) in [
        (0.0, 16),
        (0.1, 16),
        (0.1, 14),
        (0.2, 13),
        (0.3, 11),
        (0.3, 16),
    ] {
        let mut quality = Quality::new();
        quality.frames = MEMORY;
        quality.loss = loss;
        quality.judge();
        quality.learn_reception(there);
        let answered = (1.0 - loss) * (1.0 - loss).min(sixteenths(there));
        let probes = quality.probes();
        assert!(probes < PROBES_MAX);
        let unanswered = libm::pow(1.0 - answered, f64::from(probes));
        assert!(unanswered <= UNANSWERED, "{unanswered} at {loss}, {there}");
    }
}

#[test]
fn a_neighbour_that_flies_away_is_probed_by_what_is_lost_now() {
    let mut quality = Quality::new();
    for _ in 0..MEMORY {
        quality.learn_heard();
    }
    let near = quality.probes();
    for _ in 0..RECENT {
        quality.learn_missed(1);
        quality.learn_heard();
    }
    let answered = libm::pow(1.0 - quality.recent_loss, 2.0);
    assert!(quality.recent_loss > quality.loss && quality.probes() > near);
    let unanswered = libm::pow(1.0 - answered, f64::from(quality.probes()));
    assert!(unanswered <= UNANSWERED, "{unanswered}");
}

#[test]
fn costs_are_expected_transmissions_of_a_frame_and_its_acknowledgement() {
    let cost = |here, there| {
        let mut quality = Quality::new();
        quality.heard = here;
        quality.learn_reception(there);
        quality.cost()
    };
    assert_eq!(cost(16, 16), ETX_UNIT);
    assert_eq!(cost(8, 16), ETX_UNIT * 2);
    assert_eq!((cost(16, 8), cost(8, 8)), (ETX_UNIT * 2, ETX_UNIT * 4));
    for here in 1..16 {
        for there in 1..=16 {
            assert!(cost(here, there) > cost(here + 1, there));
            assert_eq!(cost(here, there), cost(there, here));
        }
    }
    // Before the neighbour says how well it hears, both directions are taken to be alike.
    let mut unknown = Quality::new();
    unknown.heard = 8;
    assert_eq!(unknown.cost(), ETX_UNIT * 4);
}

#[test]
fn a_link_is_poor_if_it_is_either_way() {
    for (here, there, is_poor) in [(5, 5, false), (4, 16, true), (16, 4, true), (1, 1, true)] {
        let mut quality = Quality::new();
        quality.heard = here;
        quality.learn_reception(there);
        assert_eq!(quality.is_poor(), is_poor, "{here} and {there}");
    }
}
