//! Link quality, measured from received and missed frames.

use crate::routing::ETX_UNIT;
use crate::routing::heartbeat::RESTART_GAP;

/// Number of frames in the loss estimate behind the link timeout. With fewer frames it is their mean.
const WINDOW: u16 = 50;
/// Number of frames in the estimate behind the duration of probing.
const LONG_WINDOW: u16 = 250;
/// Number of frames in the estimate behind route costs; it follows drones that fly apart.
const SHORT_WINDOW: u16 = 12;
/// Odds at which silence of a live neighbour exceeds the link timeout.
const LOST_ODDS: f64 = 1e-6;
/// Odds at which silence of a live neighbour makes its link stale, so that it is probed and others are preferred.
const STALE_ODDS: f64 = 1e-2;
/// Odds at which a live neighbour answers none of the probes.
const UNANSWERED_ODDS: f64 = 1e-9;
/// Most probes, however lossy the link.
pub(super) const PROBES_MAX: u32 = 80;
/// Longest link timeout in heartbeat periods, however lossy the link.
const LOST_HEARTBEATS_MAX: u16 = 30;
/// Longest silence before a link is stale, in heartbeat periods; a probe costs only a frame.
pub(super) const STALE_HEARTBEATS_MAX: u16 = 5;

/// Reported share of a link that loses next to nothing, in sixteenths.
pub(super) const LOSSLESS: u8 = 16;
/// A link reported as lossless stays so down to this share.
const LOSSLESS_MIN: f64 = 0.92;
/// A lossy link is reported as lossless from this share on.
const LOSSLESS_REGAINED: f64 = 0.95;
/// The reported share changes if the estimate differs from it by more than this, in sixteenths.
const REPORT_HYSTERESIS: f64 = 0.8;
/// A link with a smaller share in either direction is poor: the last resort for a route.
pub(super) const POOR_BELOW: u8 = 5;

/// Number of frames, missed ones included, from which on a link may replace one in use. A single received frame proves
/// nothing.
const PROVEN_FRAMES: u16 = 4;

/// How well a neighbour is received, and how well it receives this drone.
///
/// Invariant: `stale_heartbeats` and `lost_heartbeats` follow from the losses. `own_share` is within
/// [`REPORT_HYSTERESIS`] of the estimate, so the reported share changes seldom.
#[derive(Debug, Clone, Copy)]
pub(super) struct Quality {
    /// Share of its last [`WINDOW`] broadcasts that were missed, derived from gaps between packet numbers.
    loss: f64,
    /// The same over [`SHORT_WINDOW`] broadcasts.
    recent_loss: f64,
    /// Number of frames behind these estimates, up to [`WINDOW`].
    frames: u16,
    /// The same over [`LONG_WINDOW`] broadcasts, and the number of frames behind it.
    long_loss: f64,
    long_frames: u16,
    /// Heartbeat periods of silence after which the link is stale, and after which it times out.
    pub(super) stale_heartbeats: u16,
    pub(super) lost_heartbeats: u16,
    /// Reported share of its broadcasts that this drone receives, in sixteenths.
    own_share: u8,
    /// Share of this drone's broadcasts that it receives, in sixteenths, as it reports; `None` before its first report.
    peer_share: Option<u8>,
}

impl Quality {
    /// Of a neighbour that was heard once.
    pub(super) fn new() -> Self {
        let mut quality = Self {
            loss: 0.0,
            recent_loss: 0.0,
            frames: 0,
            long_loss: 0.0,
            long_frames: 0,
            stale_heartbeats: 0,
            lost_heartbeats: 0,
            own_share: LOSSLESS,
            peer_share: None,
        };
        quality.update_derived();
        quality
    }

    /// Records the broadcasts missed before a received one. A gap of a restart is no loss.
    #[inline]
    pub(super) fn record_missed(&mut self, missed: u32) {
        if missed > 0 && missed < RESTART_GAP {
            for _ in 0..missed.min(WINDOW.into()) {
                self.update_losses(1.0);
            }
            self.update_derived();
        }
    }

    /// Records a received broadcast.
    #[inline]
    pub(super) fn record_received(&mut self) {
        if self.is_lossless() {
            self.record_received_lossless();
            return;
        }
        let before = (self.loss, self.recent_loss, self.frames);
        self.update_losses(0.0);
        if before != (self.loss, self.recent_loss, self.frames) {
            self.update_derived();
        }
    }

    /// Whether no broadcast was missed.
    fn is_lossless(&self) -> bool {
        self.loss == 0.0 && self.recent_loss == 0.0 && self.long_loss == 0.0
    }

    /// [`Self::record_received`] for a lossless link: only the number of frames changes.
    fn record_received_lossless(&mut self) {
        self.long_frames = (self.long_frames + 1).min(LONG_WINDOW);
        if self.frames < WINDOW {
            self.frames += 1;
            self.update_derived();
        }
    }

    /// Records a missed (1) or received (0) frame.
    fn update_losses(&mut self, missed: f64) {
        self.frames = (self.frames + 1).min(WINDOW);
        self.loss += (missed - self.loss) / f64::from(self.frames);
        self.long_frames = (self.long_frames + 1).min(LONG_WINDOW);
        self.long_loss += (missed - self.long_loss) / f64::from(self.long_frames);
        self.recent_loss += (missed - self.recent_loss) / f64::from(self.frames.min(SHORT_WINDOW));
    }

    /// Records the share of this drone's broadcasts that the neighbour receives; returns whether it changed.
    pub(super) fn record_peer_share(&mut self, sixteenths: u8) -> bool {
        self.peer_share.replace(sixteenths) != Some(sixteenths)
    }

    fn update_derived(&mut self) {
        self.stale_heartbeats = self.tolerated_silence(STALE_ODDS, STALE_HEARTBEATS_MAX);
        self.lost_heartbeats = self.tolerated_silence(LOST_ODDS, LOST_HEARTBEATS_MAX);
        self.own_share = self.quantised_share();
    }

    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between 1 and `LOSSLESS`"
    )]
    fn quantised_share(&self) -> u8 {
        // The first received frame counts, too, so a new link starts as lossless.
        let frames = f64::from(self.frames.min(SHORT_WINDOW));
        let share = 1.0 - self.recent_loss * frames / (frames + 1.0);
        let full = if self.own_share == LOSSLESS {
            LOSSLESS_MIN
        } else {
            LOSSLESS_REGAINED
        };
        if share >= full {
            return LOSSLESS;
        }
        let exact = share * f64::from(LOSSLESS);
        if self.own_share != LOSSLESS
            && (exact - f64::from(self.own_share)).abs() <= REPORT_HYSTERESIS
        {
            return self.own_share;
        }
        exact.round().clamp(1.0, f64::from(LOSSLESS - 1)) as u8
    }

    /// Share of its broadcasts that this drone receives, in sixteenths, to be reported.
    pub(super) const fn own_share(&self) -> u8 {
        self.own_share
    }

    #[cfg(test)]
    pub(super) const fn loss(&self) -> f64 {
        self.loss
    }

    /// Shares of both directions, in sixteenths. Before the neighbour reports, both are taken to be equal.
    fn shares(&self) -> [u8; 2] {
        [self.own_share, self.peer_share.unwrap_or(self.own_share)]
    }

    /// Probability that a frame and its answer are both received.
    pub(super) fn round_trip(&self) -> f64 {
        let [own, peer] = self.shares().map(|it| f64::from(it) / f64::from(LOSSLESS));
        own * peer
    }

    /// Whether the link loses next to nothing in both directions.
    pub(super) fn is_good(&self) -> bool {
        self.shares() == [LOSSLESS; 2]
    }

    /// Whether the link is a last resort for routes.
    pub(super) fn is_poor(&self) -> bool {
        self.shares().into_iter().any(|it| it < POOR_BELOW)
    }

    /// Long-term loss; a link that loses often may lose in bursts.
    pub(super) const fn long_loss(&self) -> f64 {
        self.long_loss
    }

    /// Whether enough frames were counted to prefer this link to one in use.
    pub(super) const fn is_proven(&self) -> bool {
        self.frames >= PROVEN_FRAMES
    }

    /// ETX: expected transmissions until a frame and its acknowledgement are received, in [`ETX_UNIT`]s (De Couto et
    /// al., MobiCom 2003).
    pub(super) fn cost(&self) -> u16 {
        if self.is_good() {
            return ETX_UNIT;
        }
        let [own, peer] = self.shares().map(u32::from);
        let full = u32::from(LOSSLESS) * u32::from(LOSSLESS);
        let cost = u32::from(ETX_UNIT) * full / (own * peer).max(1);
        u16::try_from(cost).unwrap_or(u16::MAX)
    }

    /// Whether the cost differs from `before`'s.
    pub(super) fn cost_differs_from(&self, before: &Self) -> bool {
        self.shares() != before.shares() && self.cost() != before.cost()
    }

    /// Heartbeat periods for which a neighbour that sends once per period is silent with probability `odds`.
    fn tolerated_silence(&self, odds: f64, heartbeats_max: u16) -> u16 {
        let loss = self.cautious_loss();
        let (mut heartbeats, mut chance) = (1, loss);
        while chance > odds && heartbeats < heartbeats_max {
            chance *= loss;
            heartbeats += 1;
        }
        heartbeats
    }

    /// Number of probes before the neighbour counts as gone. Probe and answer may be lost like any frame. If the recent
    /// loss is more than twice the loss, as when drones fly apart, the recent loss counts.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between 1 and `PROBES_MAX`"
    )]
    pub(super) fn probes(&self) -> u32 {
        let worsens = self.recent_loss > 2.0 * self.loss;
        let loss = if worsens { self.recent_loss } else { 0.0 };
        let own = 1.0 - self.cautious_loss().max(loss);
        let peer = match self.peer_share {
            Some(peer) if peer < LOSSLESS => own.min(f64::from(peer) / f64::from(LOSSLESS)),
            _ => own,
        };
        let probes = libm::log(UNANSWERED_ODDS) / libm::log(1.0 - own * peer);
        probes.ceil().clamp(1.0, PROBES_MAX.into()) as u32
    }

    /// Loss by the rule of succession, so that few frames prove little.
    fn cautious_loss(&self) -> f64 {
        let frames = f64::from(self.frames);
        (self.loss * frames + 1.0) / (frames + 2.0)
    }
}

#[cfg(test)]
mod tests;
