use std::collections::BTreeMap;
use std::time::Duration;

use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Losses in bursts: each link alternates between a clear state and a burst.
///
/// A two-state Markov chain in continuous time, after Gilbert ("Capacity of a burst-noise channel", 1960) and Elliott
/// ("Estimates of error rates for codes on burst-noise channels", 1963). Both states last an exponentially distributed
/// time. The model loses nothing outside of bursts. Deviation from the source: frames are not equally spaced, so the chain
/// runs in time instead of per symbol.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bursts {
    /// Mean time from the end of a burst to the start of the next; above 0.
    pub every: Duration,
    /// Mean length of a burst; above 0.
    pub length: Duration,
    /// Loss probability within a burst, 0 to 1.
    pub loss: f64,
}

impl Bursts {
    /// Share of time that a link is in a burst, 0 to 1.
    #[must_use]
    pub fn share(&self) -> f64 {
        let length_s = self.length.as_secs_f64();
        length_s / (self.every.as_secs_f64() + length_s)
    }

    /// Long-term share of frames that are lost, 0 to 1.
    #[must_use]
    pub fn mean_loss(&self) -> f64 {
        self.share() * self.loss
    }

    /// The probability that a link is in a burst, `elapsed` after that probability was `before`.
    #[must_use]
    pub fn share_after(&self, before: f64, elapsed: Duration) -> f64 {
        let rate = self.every.as_secs_f64().recip() + self.length.as_secs_f64().recip();
        let share = self.share();
        share + (before - share) * libm::exp(-rate * elapsed.as_secs_f64())
    }
}

/// The burst states of links.
///
/// An obstacle or a fade affects both directions, so each pair of radios has one state. It is drawn when a frame uses the
/// link, from the exact distribution for the time since the last frame. A frame costs one or two draws and the logarithm of
/// the number of links; memory is one entry per used link.
#[derive(Debug)]
pub(super) struct BurstyLinks {
    bursts: Bursts,
    /// The last time that a link was used, and whether it was in a burst then. The key has the lower id first.
    links: BTreeMap<(NodeId, NodeId), (Timestamp, bool)>,
}

impl BurstyLinks {
    pub(super) const fn new(bursts: Bursts) -> Self {
        Self {
            bursts,
            links: BTreeMap::new(),
        }
    }

    pub(super) fn mean_loss(&self) -> f64 {
        self.bursts.mean_loss()
    }

    /// Draws whether a frame between two radios is lost in a burst.
    pub(super) fn draw_loss(
        &mut self,
        now: Timestamp,
        (a, b): (NodeId, NodeId),
        rng: &mut ChaCha8Rng,
    ) -> bool {
        let link = (a.min(b), a.max(b));
        let chance = match self.links.get(&link) {
            Some(&(last, was_in_burst)) => {
                let before = if was_in_burst { 1.0 } else { 0.0 };
                self.bursts.share_after(before, now.since(last))
            }
            None => self.bursts.share(),
        };
        let is_in_burst = rng.random::<f64>() < chance;
        self.links.insert(link, (now, is_in_burst));
        is_in_burst && rng.random::<f64>() < self.bursts.loss
    }
}
