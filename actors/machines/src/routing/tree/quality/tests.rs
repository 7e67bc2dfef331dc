use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;

/// A link that loses frames by a seeded random draw.
struct SampledLink {
    quality: Quality,
    missed: u32,
    rng: ChaCha8Rng,
}

impl SampledLink {
    fn new() -> Self {
        Self {
            quality: Quality::new(),
            missed: 0,
            rng: ChaCha8Rng::seed_from_u64(1),
        }
    }

    /// After `frames` frames with this loss.
    fn after(frames: u32, loss: f64) -> Self {
        let mut link = Self::new();
        for _ in 0..frames {
            link.frame(loss);
        }
        link
    }

    fn frame(&mut self, loss: f64) {
        if self.rng.random_bool(loss) {
            self.missed += 1;
        } else {
            self.quality.record_missed(std::mem::take(&mut self.missed));
            self.quality.record_received();
        }
    }

    fn burst(&mut self, frames: u32) {
        self.missed += frames;
        self.frame(0.0);
    }
}

fn sixteenths(it: u8) -> f64 {
    f64::from(it) / f64::from(LOSSLESS)
}

#[test]
fn estimates_are_unbiased() {
    for loss in [0.0, 0.1, 0.3, 0.5, 0.7] {
        let mut link = SampledLink::after(500, loss);
        let (mut short, mut long, mut reported) = (0.0, 0.0, 0.0);
        const FRAMES: u32 = 20_000;
        for _ in 0..FRAMES {
            link.frame(loss);
            short += link.quality.loss();
            long += link.quality.long_loss();
            reported += 1.0 - sixteenths(link.quality.own_share());
        }
        let [short, long, reported] = [short, long, reported].map(|it| it / f64::from(FRAMES));
        assert!((short - loss).abs() < 0.02, "{short} of {loss}");
        assert!((long - loss).abs() < 0.01, "{long} of {loss}");
        // The reported share changes when a frame is received and starts with a received one: both favour the link.
        let favour = loss - reported;
        assert!(
            (-0.01..loss / 6.0 + 0.01).contains(&favour),
            "{reported} of {loss}"
        );
    }
}

#[test]
fn estimate_stays_near_a_constant_loss() {
    for loss in [0.1, 0.5] {
        let mut link = SampledLink::after(500, loss);
        // Five standard deviations of the weighted mean of the last 50.
        let within = 5.0 * libm::sqrt(loss * (1.0 - loss) / 99.0);
        for _ in 0..20_000 {
            link.frame(loss);
            let estimate = link.quality.loss();
            assert!((estimate - loss).abs() < within, "{estimate} of {loss}");
        }
    }
}

#[test]
fn quality_follows_a_change_within_thirty_frames() {
    let mut link = SampledLink::after(200, 0.0);
    assert!(link.quality.is_good() && link.quality.cost() == ETX_UNIT);
    for _ in 0..30 {
        link.frame(0.7);
    }
    assert!(link.quality.cost() > ETX_UNIT * 4);
    for _ in 0..45 {
        link.frame(0.0);
    }
    assert!(link.quality.is_good() && link.quality.cost() == ETX_UNIT);
}

#[test]
fn short_burst_does_not_make_a_good_link_poor() {
    for frames in 1..=12 {
        let mut link = SampledLink::after(100, 0.0);
        link.burst(frames);
        assert!(!link.quality.is_poor(), "{frames} consecutive losses");
        assert_eq!(
            link.quality.is_good(),
            frames == 1,
            "{frames} consecutive losses"
        );
    }
    let mut link = SampledLink::after(100, 0.0);
    link.burst(30);
    assert!(link.quality.is_poor(), "30 losses are no burst");
}

#[test]
fn one_lost_frame_in_fifty_is_reported_as_lossless() {
    let mut link = SampledLink::new();
    for _ in 0..100 {
        for _ in 0..49 {
            link.frame(0.0);
        }
        link.burst(1);
        assert_eq!(link.quality.own_share(), LOSSLESS);
    }
}

#[test]
fn reported_share_changes_with_hysteresis() {
    let mut link = SampledLink::after(200, 0.4);
    let (mut changes, mut before) = (0, link.quality.own_share());
    for _ in 0..1_000 {
        link.frame(0.4);
        let now = link.quality.own_share();
        let share = 1.0 - link.quality.recent_loss * 12.0 / 13.0;
        assert!((share * 16.0 - f64::from(now)).abs() <= 0.8 + 0.5);
        changes += u32::from(now != before);
        before = now;
    }
    // Simple rounding would change it with more than every second frame.
    assert!((100..500).contains(&changes), "{changes}");
}

#[test]
fn few_frames_need_more_probes() {
    let mut link = SampledLink::new();
    let mut probes = link.quality.probes();
    assert_eq!(
        probes, 73,
        "half of the frames may be lost in each direction"
    );
    for frames in 1..50 {
        assert_eq!(link.quality.is_proven(), frames > PROVEN_FRAMES);
        link.frame(0.0);
        let fewer = link.quality.probes();
        assert!(fewer <= probes && link.quality.is_good());
        probes = fewer;
    }
    assert!(probes <= 7);
    // Missed frames count, too.
    let mut link = SampledLink::new();
    link.burst(3);
    assert!(link.quality.is_proven());
}

#[test]
fn tolerated_silence_grows_with_loss_within_bounds() {
    let mut before = Quality::new();
    before.frames = WINDOW;
    before.update_derived();
    for percent in 0..=100 {
        let mut quality = before;
        quality.loss = f64::from(percent) / 100.0;
        quality.update_derived();
        assert!(quality.stale_heartbeats >= before.stale_heartbeats);
        assert!(quality.lost_heartbeats >= before.lost_heartbeats);
        assert!(quality.probes() >= before.probes() && quality.probes() <= PROBES_MAX);
        assert!((1..=STALE_HEARTBEATS_MAX).contains(&quality.stale_heartbeats));
        assert!((1..=LOST_HEARTBEATS_MAX).contains(&quality.lost_heartbeats));
        // Above 50 %, the rule of succession lowers the estimate.
        if percent > 50 {
            before = quality;
            continue;
        }
        let silent = |heartbeats: u16| libm::pow(quality.loss, f64::from(heartbeats));
        let stale = quality.stale_heartbeats;
        assert!(
            stale == STALE_HEARTBEATS_MAX || silent(stale) <= STALE_ODDS,
            "{percent} %"
        );
        let lost = quality.lost_heartbeats;
        assert!(
            lost == LOST_HEARTBEATS_MAX || silent(lost) <= LOST_ODDS,
            "{percent} %"
        );
        before = quality;
    }
}

#[test]
fn all_probes_unanswered_has_odds_of_one_in_a_billion() {
    for (loss, peer) in [
        (0.0, 16),
        (0.1, 16),
        (0.1, 14),
        (0.2, 13),
        (0.3, 11),
        (0.3, 16),
    ] {
        let mut quality = Quality::new();
        quality.frames = WINDOW;
        quality.loss = loss;
        quality.update_derived();
        quality.record_peer_share(peer);
        let answered = (1.0 - loss) * (1.0 - loss).min(sixteenths(peer));
        let probes = quality.probes();
        assert!(probes < PROBES_MAX);
        let unanswered = libm::pow(1.0 - answered, f64::from(probes));
        assert!(
            unanswered <= UNANSWERED_ODDS,
            "{unanswered} at {loss}, {peer}"
        );
    }
}

#[test]
fn probes_follow_the_recent_loss() {
    let mut quality = Quality::new();
    for _ in 0..WINDOW {
        quality.record_received();
    }
    let near = quality.probes();
    for _ in 0..SHORT_WINDOW {
        quality.record_missed(1);
        quality.record_received();
    }
    let answered = libm::pow(1.0 - quality.recent_loss, 2.0);
    assert!(quality.recent_loss > quality.loss && quality.probes() > near);
    let unanswered = libm::pow(1.0 - answered, f64::from(quality.probes()));
    assert!(unanswered <= UNANSWERED_ODDS, "{unanswered}");
}

#[test]
fn cost_is_etx_of_both_directions() {
    let cost = |own, peer| {
        let mut quality = Quality::new();
        quality.own_share = own;
        quality.record_peer_share(peer);
        quality.cost()
    };
    assert_eq!(cost(16, 16), ETX_UNIT);
    assert_eq!(cost(8, 16), ETX_UNIT * 2);
    assert_eq!((cost(16, 8), cost(8, 8)), (ETX_UNIT * 2, ETX_UNIT * 4));
    for own in 1..16 {
        for peer in 1..=16 {
            assert!(cost(own, peer) > cost(own + 1, peer));
            assert_eq!(cost(own, peer), cost(peer, own));
        }
    }
    // Before the neighbour's first report both directions are taken to be equal.
    let mut unknown = Quality::new();
    unknown.own_share = 8;
    assert_eq!(unknown.cost(), ETX_UNIT * 4);
}

#[test]
fn link_is_poor_if_one_direction_is() {
    for (own, peer, is_poor) in [(5, 5, false), (4, 16, true), (16, 4, true), (1, 1, true)] {
        let mut quality = Quality::new();
        quality.own_share = own;
        quality.record_peer_share(peer);
        assert_eq!(quality.is_poor(), is_poor, "{own} and {peer}");
    }
}
