//! Freshness proofs: a frame is not a recording from before this incarnation if its sender has signed a nonce drawn for
//! it.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use super::budget::{Budget, TokenBucket};
use crate::identity::{NodeId, NodeSet};
use crate::time::Timestamp;

/// Minimum interval of challenges, however many frames of unproven senders arrive: replayed or made-up frames cause
/// little traffic.
const CHALLENGE_INTERVAL: Duration = Duration::from_millis(100);

/// Challenges at the start, in case some or their responses are lost, before others are heard.
const INITIAL_CHALLENGES: u32 = 3;

/// Challenges for a proven sender because of a frame in its name from another incarnation: a few at once in case it
/// restarted, then one a second, because it may be a replayed recording.
const RECHECKS: Budget = Budget {
    interval: Duration::from_secs(1),
    burst: 3,
};

/// Minimum interval of responses; challenges in between are answered together.
const RESPONSE_INTERVAL: Duration = Duration::from_millis(20);

/// Budget of responses: recorded challenges can be replayed without end.
const RESPONSES: Budget = Budget {
    interval: Duration::from_millis(200),
    burst: 10,
};

/// Challenges per response, so that it fits a datagram.
const ANSWERED_MAX: usize = 64;

/// Pending challenges of one sender: a replayed one can't be told from a new one.
const PENDING_BY_SENDER_MAX: usize = 4;

/// Pending challenges of all senders.
const PENDING_MAX: usize = 1_024;

/// Challenges unproven senders.
#[derive(Debug)]
pub(super) struct Challenger {
    nonce: u64,
    /// Senders that have signed the nonce. Each proof counts once, so that an old one does not bring back an earlier
    /// incarnation.
    answered: NodeSet,
    /// Proven senders to challenge again, because of a frame from another incarnation.
    rechecked: NodeSet,
    /// Challenges for these senders.
    asked: BTreeMap<NodeId, TokenBucket>,
    /// Challenges still to send.
    remaining: u32,
    next_at: Timestamp,
}

impl Challenger {
    /// Challenges at once, with a nonce that was never used before.
    pub(super) const fn new(nonce: u64) -> Self {
        Self {
            nonce,
            answered: NodeSet::new(),
            rechecked: NodeSet::new(),
            asked: BTreeMap::new(),
            remaining: INITIAL_CHALLENGES,
            next_at: Timestamp::ZERO,
        }
    }

    /// The nonce that proves `sender`; `None` if it has signed the nonce.
    pub(super) fn nonce_for(&self, sender: NodeId) -> Option<u64> {
        (!self.answered.contains(sender)).then_some(self.nonce)
    }

    /// A sender has signed the nonce.
    pub(super) fn record_proof(&mut self, by: NodeId) {
        self.answered.insert(by);
        self.rechecked = self.rechecked.difference(&by.into());
    }

    /// An unproven sender was heard: sends at least one more challenge.
    pub(super) fn request(&mut self) {
        self.remaining = self.remaining.max(1);
    }

    /// A proven sender was heard in another incarnation, or a recording of one was replayed.
    pub(super) fn recheck(&mut self, now: Timestamp, sender: NodeId) {
        let asked = self.asked.get(&sender);
        if asked.is_none_or(|bucket| bucket.has_tokens(now, &RECHECKS)) {
            self.rechecked.insert(sender);
            self.request();
        }
    }

    /// Proven senders to challenge again.
    pub(super) const fn rechecked(&self) -> &NodeSet {
        &self.rechecked
    }

    pub(super) fn deadline(&self) -> Option<Timestamp> {
        (self.remaining > 0).then_some(self.next_at)
    }

    /// Whether a challenge is due.
    pub(super) fn is_due(&self, now: Timestamp) -> bool {
        self.deadline().is_some_and(|at| at <= now)
    }

    /// Starts a challenge and returns its nonce. The nonce changes if a sender to recheck has signed the last one.
    pub(super) fn next_nonce(&mut self, now: Timestamp) -> u64 {
        let rechecked = std::mem::take(&mut self.rechecked);
        if !rechecked.intersection(&self.answered).is_empty() {
            self.nonce = self.nonce.wrapping_add(1);
            self.answered = NodeSet::new();
        }
        for sender in rechecked.iter() {
            let bucket = self.asked.entry(sender).or_insert(TokenBucket::FULL);
            bucket.charge(now, &RECHECKS);
        }
        self.remaining = self.remaining.saturating_sub(1);
        self.next_at = now + CHALLENGE_INTERVAL;
        self.nonce
    }

    /// Stops: all senders are proven.
    pub(super) const fn stop(&mut self) {
        self.remaining = 0;
    }
}

/// Answers challenges.
#[derive(Debug)]
pub(super) struct Responder {
    /// Pending challenges: sender and nonce.
    asked: BTreeSet<(NodeId, u64)>,
    /// Start of the next response, if not all fit into one.
    next: (NodeId, u64),
    next_at: Timestamp,
    responses: TokenBucket,
}

/// Lowest possible challenge.
const FIRST: (NodeId, u64) = (NodeId(0), 0);

impl Responder {
    pub(super) const fn new() -> Self {
        Self {
            asked: BTreeSet::new(),
            next: FIRST,
            next_at: Timestamp::ZERO,
            responses: TokenBucket::FULL,
        }
    }

    /// Adds a challenge; drops it if this sender or all together have too many pending.
    pub(super) fn enqueue(&mut self, who: NodeId, nonce: u64) {
        let by_one = self.asked.range((who, 0)..=(who, u64::MAX)).count();
        if by_one < PENDING_BY_SENDER_MAX && self.asked.len() < PENDING_MAX {
            self.asked.insert((who, nonce));
        }
    }

    pub(super) fn deadline(&self) -> Option<Timestamp> {
        (!self.asked.is_empty()).then_some(self.next_at)
    }

    /// The challenges to answer now.
    pub(super) fn take_due(&mut self, now: Timestamp) -> Vec<(NodeId, u64)> {
        if self.deadline().is_none_or(|at| at > now) {
            return Vec::new();
        }
        self.responses.charge(now, &RESPONSES);
        let earned_at = self.responses.available_at(&RESPONSES);
        self.next_at = earned_at.max(now + RESPONSE_INTERVAL);
        let (before, behind) = (self.asked.range(..self.next), self.asked.range(self.next..));
        let answered: Vec<_> = behind.chain(before).take(ANSWERED_MAX).copied().collect();
        for asked in &answered {
            self.asked.remove(asked);
        }
        let is_all = self.asked.is_empty();
        self.next = (answered.last().copied().filter(|_| !is_all)).unwrap_or(FIRST);
        answered
    }
}
