//! What proves that a frame was said now, and not recorded before this radio was there and sent again: its sender has
//! signed a number that the radio has drawn for this life and nobody knew before.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use super::budget::{Budget, TokenBucket};
use crate::identity::{NodeId, NodeSet};
use crate::time::Timestamp;

/// How soon after one challenge the next may follow, however many frames of unproven senders come in, so that nobody who
/// sends again or makes up frames makes a drone say much.
const CHALLENGE_INTERVAL: Duration = Duration::from_millis(100);

/// How many challenges are sent at the start, in case some are lost, or answers to them, before others are heard.
const FIRST_CHALLENGES: u32 = 3;

/// How often a sender that is believed in one life is asked because another life speaks in its name: so many times at once,
/// should it have started anew, and then once a second, for it may be a recording that is said again and again.
const DOUBTS: Budget = Budget {
    interval: Duration::from_secs(1),
    burst: 3,
};

/// How soon after one response the next may follow; whoever asks meanwhile is answered with it.
const RESPONSE_INTERVAL: Duration = Duration::from_millis(20);

/// How many responses are sent, at once and from then on: recorded challenges can be said again without end.
const RESPONSES: Budget = Budget {
    interval: Duration::from_millis(200),
    burst: 10,
};

/// How many are answered at once, so that a response fits a datagram.
const ANSWERED_MAX: usize = 64;

/// How many nonces of one who asks wait to be answered: which of them is not an old one said again, nobody can tell.
const ASKED_BY_ONE_MAX: usize = 4;

/// How many wait in all.
const ASKED_MAX: usize = 1_024;

/// Asks those who are unproven.
#[derive(Debug)]
pub(super) struct Challenger {
    nonce: u64,
    /// Who has signed that. It counts once for each, so that what a sender signed in an earlier life does not bring that
    /// life back.
    answered: NodeSet,
    /// Senders that are believed, and in whose name another life speaks: they are to be asked.
    doubted: NodeSet,
    /// How often these were asked.
    asked: BTreeMap<NodeId, TokenBucket>,
    /// How many challenges are still to be sent.
    left: u32,
    next_at: Timestamp,
}

impl Challenger {
    /// Asks at once, with a number that was never used before.
    pub(super) const fn new(nonce: u64) -> Self {
        Self {
            nonce,
            answered: NodeSet::new(),
            doubted: NodeSet::new(),
            asked: BTreeMap::new(),
            left: FIRST_CHALLENGES,
            next_at: Timestamp::ZERO,
        }
    }

    /// What proves a sender if it signs it now.
    pub(super) fn nonce_for(&self, sender: NodeId) -> Option<u64> {
        (!self.answered.contains(sender)).then_some(self.nonce)
    }

    /// A sender has signed the nonce.
    pub(super) fn is_answered(&mut self, by: NodeId) {
        self.answered.insert(by);
        self.doubted = self.doubted.difference(&by.into());
    }

    /// Somebody of whom nothing was let in yet was heard, or a frame in its name.
    pub(super) fn hears(&mut self) {
        self.left = self.left.max(1);
    }

    /// A sender that is believed was heard in another life, or a frame in its name that was recorded.
    pub(super) fn doubts(&mut self, now: Timestamp, sender: NodeId) {
        let asked = self.asked.get(&sender);
        if asked.is_none_or(|bucket| bucket.has_left(now, &DOUBTS)) {
            self.doubted.insert(sender);
            self.hears();
        }
    }

    /// Who is believed and is to be asked all the same.
    pub(super) const fn doubted(&self) -> &NodeSet {
        &self.doubted
    }

    pub(super) fn deadline(&self) -> Option<Timestamp> {
        (self.left > 0).then_some(self.next_at)
    }

    /// Whether a challenge is to be sent now.
    pub(super) fn is_due(&self, now: Timestamp) -> bool {
        self.deadline().is_some_and(|at| at <= now)
    }

    /// A challenge is sent; with this nonce, which is another one if somebody has signed the one before who is to prove
    /// itself again.
    pub(super) fn sends(&mut self, now: Timestamp) -> u64 {
        let doubted = std::mem::take(&mut self.doubted);
        if !doubted.intersection(&self.answered).is_empty() {
            self.nonce = self.nonce.wrapping_add(1);
            self.answered = NodeSet::new();
        }
        for sender in doubted.iter() {
            let bucket = self.asked.entry(sender).or_insert(TokenBucket::FULL);
            bucket.charge(now, &DOUBTS);
        }
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
#[derive(Debug)]
pub(super) struct Responder {
    /// What members have asked since they were last answered.
    asked: BTreeSet<(NodeId, u64)>,
    /// Where to go on if not all can be answered at once.
    next: (NodeId, u64),
    next_at: Timestamp,
    responses: TokenBucket,
}

/// Before all that can be asked.
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

    /// Somebody asks; in vain if it or all together have asked too much since they were last answered.
    pub(super) fn asks(&mut self, who: NodeId, nonce: u64) {
        let by_one = self.asked.range((who, 0)..=(who, u64::MAX)).count();
        if by_one < ASKED_BY_ONE_MAX && self.asked.len() < ASKED_MAX {
            self.asked.insert((who, nonce));
        }
    }

    pub(super) fn deadline(&self) -> Option<Timestamp> {
        (!self.asked.is_empty()).then_some(self.next_at)
    }

    /// Whom to answer now.
    pub(super) fn due(&mut self, now: Timestamp) -> Vec<(NodeId, u64)> {
        if self.deadline().is_none_or(|at| at > now) {
            return Vec::new();
        }
        self.responses.charge(now, &RESPONSES);
        let earned_at = self.responses.earns_at(&RESPONSES);
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
