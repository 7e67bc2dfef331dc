//! How well a link carries, measured from the frames that were heard and missed over it.

use crate::routing::ETX_UNIT;
use crate::routing::heartbeat::RESTART_GAP;

/// How many frames the estimate of a link's loss remembers by which a neighbour is missed; it is their mean as long as
/// there were fewer.
const MEMORY: u16 = 50;
/// And the one by which it is probed for longer.
const LONG: u16 = 250;
/// And the one by which routes are chosen, which follows drones that fly apart.
const RECENT: u16 = 12;
/// How unlikely it must be that a living neighbour is silent for as long as it takes to be given up.
const LOST: f64 = 1e-6;
/// How unlikely it must be that it is silent for as long as it takes to prefer another, and to probe it.
const STALE: f64 = 1e-2;
/// How unlikely it must be that a living neighbour answers none of the probes.
const UNANSWERED: f64 = 1e-9;
/// However lossy a link is, no more probes are sent.
pub(super) const PROBES_MAX: u32 = 80;
/// However lossy a link is, it is given up after this many beacons.
const LOST_BEACONS_MAX: u16 = 30;
/// And probed after this many: a probe costs a frame.
pub(super) const STALE_BEACONS_MAX: u16 = 5;

/// The share of frames that is reported as heard where next to none is missed, in sixteenths.
pub(super) const WELL: u8 = 16;
/// A link that was reported as good is so until it delivers less than this share.
const WELL_MIN: f64 = 0.92;
/// A link that was not is so once it delivers this share.
const WELL_AGAIN: f64 = 0.95;
/// By how many sixteenths an estimate must differ from what was reported until something else is reported.
const REPORTED_WITHIN: f64 = 0.8;
/// A link that delivers a smaller share either way is used for a route only where there is no better one.
pub(super) const POOR: u8 = 5;

/// From so many frames on, missed ones included, a link is taken in the place of one that is in use: one frame that was
/// heard by chance proves nothing.
const PROVEN: u16 = 4;

/// How well a neighbour is heard, and how well it hears this drone.
///
/// Invariant: `stale_beacons` and `lost_beacons` follow from the losses; `heard` is within
/// [`REPORTED_WITHIN`] of the estimate, so that what is reported changes seldom.
#[derive(Debug, Clone, Copy)]
pub(super) struct Quality {
    /// The share of its broadcasts that was missed, of the last [`MEMORY`], told from the gaps between their numbers.
    loss: f64,
    /// And of the last [`RECENT`].
    recent_loss: f64,
    /// How many frames that was told from, up to [`MEMORY`].
    frames: u16,
    /// And of the last [`LONG`]; and of how many it is the mean.
    long_loss: f64,
    long_frames: u16,
    /// After how many beacons of silence it is stale, and after how many it is lost.
    pub(super) stale_beacons: u16,
    pub(super) lost_beacons: u16,
    /// The share of its broadcasts that is heard, in sixteenths, as it is reported.
    heard: u8,
    /// The share of this drone's broadcasts that it hears, likewise, as it reports; `None` if it has not said.
    hears: Option<u8>,
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
            stale_beacons: 0,
            lost_beacons: 0,
            heard: WELL,
            hears: None,
        };
        quality.judge();
        quality
    }

    /// Takes in that so many broadcasts were missed before the one that was heard, unless their sender skipped them when
    /// it restarted.
    #[inline]
    pub(super) fn learn_missed(&mut self, missed: u32) {
        if missed > 0 && missed < RESTART_GAP {
            for _ in 0..missed.min(MEMORY.into()) {
                self.learn(1.0);
            }
            self.judge();
        }
    }

    /// Takes in that a broadcast was heard.
    #[inline]
    pub(super) fn learn_heard(&mut self) {
        if self.is_lossless() {
            self.learn_heard_again();
            return;
        }
        let before = (self.loss, self.recent_loss, self.frames);
        self.learn(0.0);
        if before != (self.loss, self.recent_loss, self.frames) {
            self.judge();
        }
    }

    /// Whether none of its broadcasts was missed.
    fn is_lossless(&self) -> bool {
        self.loss == 0.0 && self.recent_loss == 0.0 && self.long_loss == 0.0
    }

    /// As [`Self::learn_heard`] where nothing was missed before: no loss changes, only how much is known.
    fn learn_heard_again(&mut self) {
        self.long_frames = (self.long_frames + 1).min(LONG);
        if self.frames < MEMORY {
            self.frames += 1;
            self.judge();
        }
    }

    /// Takes in that a frame was missed (1) or heard (0).
    fn learn(&mut self, missed: f64) {
        self.frames = (self.frames + 1).min(MEMORY);
        self.loss += (missed - self.loss) / f64::from(self.frames);
        self.long_frames = (self.long_frames + 1).min(LONG);
        self.long_loss += (missed - self.long_loss) / f64::from(self.long_frames);
        self.recent_loss += (missed - self.recent_loss) / f64::from(self.frames.min(RECENT));
    }

    /// Takes in which share of this drone's broadcasts the neighbour says that it hears; whether that is news.
    pub(super) fn learn_reception(&mut self, sixteenths: u8) -> bool {
        self.hears.replace(sixteenths) != Some(sixteenths)
    }

    fn judge(&mut self) {
        self.stale_beacons = self.patience(STALE, STALE_BEACONS_MAX);
        self.lost_beacons = self.patience(LOST, LOST_BEACONS_MAX);
        self.heard = self.reported();
    }

    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between 1 and `WELL`"
    )]
    fn reported(&self) -> u8 {
        // One frame that was heard is known besides: who hears each other for the first time takes links to be good.
        let frames = f64::from(self.frames.min(RECENT));
        let share = 1.0 - self.recent_loss * frames / (frames + 1.0);
        let well = if self.heard == WELL {
            WELL_MIN
        } else {
            WELL_AGAIN
        };
        if share >= well {
            return WELL;
        }
        let exact = share * f64::from(WELL);
        if self.heard != WELL && (exact - f64::from(self.heard)).abs() <= REPORTED_WITHIN {
            return self.heard;
        }
        exact.round().clamp(1.0, f64::from(WELL - 1)) as u8
    }

    /// The share of its broadcasts that is heard, in sixteenths, for it to know.
    pub(super) const fn heard(&self) -> u8 {
        self.heard
    }

    #[cfg(test)]
    pub(super) const fn loss(&self) -> f64 {
        self.loss
    }

    /// The shares that are heard here and there, in sixteenths; before it has said, as if both were the same.
    fn both(&self) -> [u8; 2] {
        [self.heard, self.hears.unwrap_or(self.heard)]
    }

    /// The chance that a frame and the answer to it are both heard.
    pub(super) fn round_trip(&self) -> f64 {
        let [here, there] = self.both().map(|it| f64::from(it) / f64::from(WELL));
        here * there
    }

    /// Whether the link loses next to nothing either way.
    pub(super) fn is_good(&self) -> bool {
        self.both() == [WELL; 2]
    }

    /// Whether the link is to be used only where there is no better one.
    pub(super) fn is_poor(&self) -> bool {
        self.both().into_iter().any(|it| it < POOR)
    }

    /// The share of what is missed over a long time; a link that loses often may lose in bursts.
    pub(super) const fn long_loss(&self) -> f64 {
        self.long_loss
    }

    /// Whether it is known well enough to be preferred to another.
    pub(super) const fn is_proven(&self) -> bool {
        self.frames >= PROVEN
    }

    /// Expected transmissions until a frame and its acknowledgement are heard, in [`ETX_UNIT`]s (De Couto et al.,
    /// MobiCom 2003).
    pub(super) fn cost(&self) -> u16 {
        if self.is_good() {
            return ETX_UNIT;
        }
        let [here, there] = self.both().map(u32::from);
        let well = u32::from(WELL) * u32::from(WELL);
        let cost = u32::from(ETX_UNIT) * well / (here * there).max(1);
        u16::try_from(cost).unwrap_or(u16::MAX)
    }

    /// Whether its cost is another one.
    pub(super) fn costs_otherwise_than(&self, before: &Self) -> bool {
        self.both() != before.both() && self.cost() != before.cost()
    }

    /// For how many beacons a neighbour that speaks once in each may be silent by a chance of `odds`.
    fn patience(&self, odds: f64, beacons_max: u16) -> u16 {
        let loss = self.cautious_loss();
        let (mut beacons, mut chance) = (1, loss);
        while chance > odds && beacons < beacons_max {
            chance *= loss;
            beacons += 1;
        }
        beacons
    }

    /// How often it is probed before it is taken to be gone: a probe or its answer may be lost, each like any frame, or like
    /// the last few where those were lost twice as often, as while drones fly apart.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between 1 and `PROBES_MAX`"
    )]
    pub(super) fn probes(&self) -> u32 {
        let worsens = self.recent_loss > 2.0 * self.loss;
        let loss = if worsens { self.recent_loss } else { 0.0 };
        let here = 1.0 - self.cautious_loss().max(loss);
        let there = match self.hears {
            Some(hears) if hears < WELL => here.min(f64::from(hears) / f64::from(WELL)),
            _ => here,
        };
        let probes = libm::log(UNANSWERED) / libm::log(1.0 - here * there);
        probes.ceil().clamp(1.0, PROBES_MAX.into()) as u32
    }

    /// Its loss, by the rule of succession: so that few frames prove little.
    fn cautious_loss(&self) -> f64 {
        let frames = f64::from(self.frames);
        (self.loss * frames + 1.0) / (frames + 2.0)
    }
}

#[cfg(test)]
mod tests;
