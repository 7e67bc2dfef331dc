use std::collections::BTreeMap;
use std::time::Duration;

use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Losses that come in bursts: each link is now clear, now in a burst.
///
/// A two-state Markov chain in continuous time, after Gilbert ("Capacity of a burst-noise channel", 1960) and Elliott
/// ("Estimates of error rates for codes on burst-noise channels", 1963). Both states last an exponentially distributed
/// time. Outside of a burst nothing is lost by this model. Deviation from the source: a radio's frames do not come at
/// equal steps, so the chain runs in time and not from symbol to symbol.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bursts {
    /// The mean time from the end of a burst to the start of the next; above 0.
    pub every: Duration,
    /// The mean length of a burst; above 0.
    pub length: Duration,
    /// The share of frames that is lost in a burst, 0 to 1.
    pub loss: f64,
}

impl Bursts {
    /// The share of time that a link is in a burst, 0 to 1.
    #[must_use]
    pub fn share(&self) -> f64 {
        let length_s = self.length.as_secs_f64();
        length_s / (self.every.as_secs_f64() + length_s)
    }

    /// The share of frames that is lost in the long run, 0 to 1.
    #[must_use]
    pub fn mean_loss(&self) -> f64 {
        self.share() * self.loss
    }

    /// The chance that a link is in a burst, some time after that chance was `before`.
    #[must_use]
    pub fn share_after(&self, before: f64, elapsed: Duration) -> f64 {
        let rate = self.every.as_secs_f64().recip() + self.length.as_secs_f64().recip();
        let share = self.share();
        share + (before - share) * libm::exp(-rate * elapsed.as_secs_f64())
    }
}

/// Which links are in a burst.
///
/// An obstacle or a fade weakens both directions, so two radios share one state. It is drawn when a frame crosses the
/// link, from the exact distribution for the time since the last one. A frame costs a draw or two and the logarithm of the
/// number of links; memory is an entry for each two radios between which a frame was on its way.
#[derive(Debug)]
pub(super) struct BurstyLinks {
    bursts: Bursts,
    /// Whether the link of two radios, the lower id first, was in a burst when last looked at.
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
    pub(super) fn is_lost(
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
