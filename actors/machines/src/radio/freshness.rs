//! What proves that a frame was said now, and not recorded before this radio was there and sent again: its sender has
//! signed a number that the radio has drawn for this life and nobody knew before.

use std::collections::BTreeMap;
use std::time::Duration;

use crate::identity::NodeId;
use crate::time::Timestamp;

/// How soon after one challenge the next may follow, however many frames of unproven senders come in, so that nobody who
/// sends again or makes up frames makes a drone say much.
const CHALLENGE_INTERVAL: Duration = Duration::from_millis(100);

/// How many challenges are sent at the start, in case some are lost, or answers to them, before others are heard.
const FIRST_CHALLENGES: u32 = 3;

/// How soon after one response the next may follow; whoever asks meanwhile is answered with it.
const RESPONSE_INTERVAL: Duration = Duration::from_millis(20);

/// How many are answered at once, so that a response fits a datagram.
const ANSWERED_MAX: usize = 64;

/// Asks those who are unproven.
#[derive(Debug)]
pub(super) struct Challenger {
    nonce: u64,
    /// How many challenges are still to be sent.
    left: u32,
    next_at: Timestamp,
}

impl Challenger {
    /// Asks at once, with a number that was never used before.
    pub(super) const fn new(nonce: u64) -> Self {
        Self {
            nonce,
            left: FIRST_CHALLENGES,
            next_at: Timestamp::ZERO,
        }
    }

    pub(super) const fn nonce(&self) -> u64 {
        self.nonce
    }

    /// Somebody who is unproven was heard, or a frame in its name.
    pub(super) fn hears(&mut self) {
        self.left = self.left.max(1);
    }

    pub(super) fn deadline(&self) -> Option<Timestamp> {
        (self.left > 0).then_some(self.next_at)
    }

    /// Whether a challenge is to be sent now.
    pub(super) fn is_due(&self, now: Timestamp) -> bool {
        self.deadline().is_some_and(|at| at <= now)
    }

    /// A challenge is sent; with this nonce.
    pub(super) fn sends(&mut self, now: Timestamp) -> u64 {
        self.left = self.left.saturating_sub(1);
        self.next_at = now + CHALLENGE_INTERVAL;
        self.nonce
    }

    /// All are proven.
    pub(super) const fn rest(&mut self) {
        self.left = 0;
    }
}

/// Answers those who ask.
#[derive(Debug, Default)]
pub(super) struct Responder {
    /// Members who have asked since they were last answered.
    asked: BTreeMap<NodeId, u64>,
    next_at: Timestamp,
}

impl Responder {
    pub(super) fn asks(&mut self, who: NodeId, nonce: u64) {
        self.asked.insert(who, nonce);
    }

    pub(super) fn deadline(&self) -> Option<Timestamp> {
        (!self.asked.is_empty()).then_some(self.next_at)
    }

    /// Whom to answer now.
    pub(super) fn due(&mut self, now: Timestamp) -> Vec<(NodeId, u64)> {
        if self.deadline().is_none_or(|at| at > now) {
            return Vec::new();
        }
        self.next_at = now + RESPONSE_INTERVAL;
        let asked = std::iter::from_fn(|| self.asked.pop_first());
        asked.take(ANSWERED_MAX).collect()
    }
}
