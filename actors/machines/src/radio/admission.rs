use std::hint::black_box;
use std::num::NonZeroU64;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::Source;
use super::budget::{Budget, FailedVerifications, TokenBucket};
use crate::flaw::{self, Flaw};
use crate::identity::{NodeId, NodeSet};
use crate::node_map::NodeMap;
use crate::time::Timestamp;
use crate::wire::{FrameError, Header};

/// Length of the replay window, in counters.
const REPLAY_WINDOW: u64 = 64;

/// Why a frame was dropped, in the order of the checks, cheap checks first.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Error, Serialize, Deserialize,
)]
pub enum DropReason {
    /// Longer than any frame.
    #[error("frame too long")]
    TooLong,
    /// Ends before its authenticator.
    #[error("too short")]
    TooShort,
    /// Another version of the frame format.
    #[error("other version")]
    Version,
    /// Another swarm.
    #[error("other swarm")]
    OtherSwarm,
    /// An own frame that came back.
    #[error("own echo")]
    OwnEcho,
    /// Sent by another drone than the peer of its connection.
    #[error("relayed")]
    Relayed,
    /// The sender is on the revocation list.
    #[error("revoked")]
    Revoked,
    /// The sender is not a member of the swarm.
    #[error("stranger")]
    Stranger,
    /// Received before, older than the replay window, or of an earlier incarnation if these are counted.
    #[error("replayed")]
    Replayed,
    /// The sender has not signed this radio's nonce, or not in this incarnation: possibly a recording.
    #[error("unproven")]
    Unproven,
    /// More signed frames than the sender's budget.
    #[error("over budget")]
    OverBudget,
    /// Not verified: too many failed verifications from this source or in all.
    #[error("verification limit reached")]
    Unverified,
    /// Not signed by its sender.
    #[error("forged")]
    Forged,
    /// A revocation list that the fleet has not signed.
    #[error("unsigned list")]
    UnsignedList,
}

impl From<FrameError> for DropReason {
    fn from(error: FrameError) -> Self {
        match error {
            FrameError::TooLong => Self::TooLong,
            FrameError::TooShort => Self::TooShort,
            FrameError::Version => Self::Version,
        }
    }
}

/// Which senders must sign a radio's nonce before they are accepted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ProofPolicy {
    /// None: no frame was ever sent before.
    NotRequired,
    /// Senders without an admitted frame; they are accepted in later incarnations too.
    UnknownSenders,
    /// Every sender, in each of its incarnations.
    EachIncarnation,
}

/// Token buckets and replay windows, one entry per sender.
#[derive(Debug)]
pub struct Admission {
    budget: Budget,
    members: u32,
    proof_policy: ProofPolicy,
    senders: NodeMap<Sender>,
    failures: FailedVerifications,
}

/// Entry of a sender in the table, as found by [`Admission::find`].
#[derive(Debug, Clone, Copy)]
pub struct SenderLookup {
    at: usize,
    state: SenderState,
}

/// State of a frame's sender.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum SenderState {
    /// It must sign a nonce first; no frame of it was admitted.
    Unknown,
    /// It must sign a nonce first; it is known in another incarnation.
    OtherIncarnation,
    /// The frame has another source than the sender's last admitted frame.
    OtherSource,
    /// The frame has the same source as the sender's last admitted frame.
    SameSource,
}

impl SenderLookup {
    /// Whether the sender has signed the radio's nonce, or need not.
    #[must_use]
    pub fn is_proven(&self) -> bool {
        !matches!(
            self.state,
            SenderState::Unknown | SenderState::OtherIncarnation
        )
    }

    /// Whether the sender is proven in another incarnation than that of the frame.
    #[must_use]
    pub fn is_of_other_incarnation(&self) -> bool {
        self.state == SenderState::OtherIncarnation
    }
}

#[derive(Debug)]
struct Sender {
    /// Bucket of its signed frames.
    bucket: TokenBucket,
    /// `None` before its first admitted frame.
    newest: Option<Newest>,
}

#[derive(Debug, Clone, Copy)]
struct Newest {
    incarnation: u32,
    /// Source of the last admitted frame.
    source: Option<Source>,
    counter: u64,
    /// A bit per counter, the newest in the lowest bit.
    seen: NonZeroU64,
}

/// Only the newest counter was seen.
const ONLY_NEWEST: NonZeroU64 = NonZeroU64::MIN;
/// All earlier counters count as seen.
const ALL: NonZeroU64 = NonZeroU64::MAX;

impl Admission {
    /// An empty table for a swarm with ids from 0 to `members` − 1; frames of other senders take no entry.
    #[must_use]
    pub fn new(budget: Budget, members: u32, proof_policy: ProofPolicy) -> Self {
        Self {
            budget,
            members,
            proof_policy,
            senders: NodeMap::new(),
            failures: FailedVerifications::new(),
        }
    }

    /// Number of entries.
    #[must_use]
    pub const fn senders(&self) -> usize {
        self.senders.len()
    }

    /// Members without an admitted frame.
    #[must_use]
    pub fn unproven(&self) -> NodeSet {
        let is_proven = |id: &NodeId| self.senders.get(*id).is_some_and(|it| it.newest.is_some());
        let members = (0..self.members).map(NodeId);
        members.filter(|id| !is_proven(id)).collect()
    }

    /// Prefetches; see [`NodeMachine::read_ahead`](crate::node::NodeMachine::read_ahead).
    pub(super) fn read_ahead(&self) {
        black_box((self.members, self.budget.burst, self.senders.len()));
    }

    /// Prefetches; see [`NodeMachine::read_further_ahead`](crate::node::NodeMachine::read_further_ahead).
    pub(super) fn read_further_ahead(&self, sender: Option<NodeId>) {
        let known = sender.and_then(|sender| self.senders.get(sender));
        black_box(known.map(|it| it.bucket));
    }

    /// Finds the sender of a frame, and adds an entry for a new one.
    ///
    /// # Errors
    /// A replay, which costs its sender no tokens, or a sender that is not a member.
    #[inline]
    pub fn find(
        &mut self,
        header: &Header,
        source: Option<Source>,
    ) -> Result<SenderLookup, DropReason> {
        if header.sender.0 >= self.members {
            return Err(DropReason::Stranger);
        }
        let at = self.senders.find(header.sender).unwrap_or_else(|at| {
            let sender = Sender {
                bucket: TokenBucket::FULL,
                newest: None,
            };
            self.senders.insert(at, header.sender, sender);
            at
        });
        let newest = self.senders.at(at).newest.as_ref();
        let needs_proof = match newest {
            None => self.proof_policy != ProofPolicy::NotRequired,
            Some(newest) => {
                self.proof_policy == ProofPolicy::EachIncarnation
                    && newest.incarnation != header.incarnation
            }
        };
        let needs_proof = needs_proof && !flaw::has(Flaw::SkipsFreshnessProof);
        let state = match newest {
            None if needs_proof => SenderState::Unknown,
            Some(_) if needs_proof => SenderState::OtherIncarnation,
            Some(newest) if newest.has_seen(header) => return Err(DropReason::Replayed),
            Some(newest) if source.is_some() && newest.source == source => SenderState::SameSource,
            _ => SenderState::OtherSource,
        };
        Ok(SenderLookup { at, state })
    }

    /// Whether to verify the signature of a frame.
    ///
    /// # Errors
    /// The reason to drop the frame.
    ///
    /// # Panics
    /// If another table found the entry; so do the other methods.
    #[inline]
    pub fn check(
        &mut self,
        now: Timestamp,
        lookup: SenderLookup,
        source: Option<Source>,
    ) -> Result<(), DropReason> {
        if !self
            .senders
            .at(lookup.at)
            .bucket
            .has_tokens(now, &self.budget)
        {
            return Err(DropReason::OverBudget);
        }
        let may_verify = match (lookup.state, source) {
            (SenderState::SameSource, Some(source)) => {
                self.failures.has_tokens_at(source, now, &self.budget)
            }
            _ => self.failures.has_tokens(now, source),
        };
        may_verify.then_some(()).ok_or(DropReason::Unverified)
    }

    /// Records a failed verification: the signature was wrong, or an unproven sender proved nothing. Frames of the
    /// sender from elsewhere are not affected, because the first drone that forwards its frame counts as its source.
    pub fn refuse(&mut self, now: Timestamp, lookup: SenderLookup, source: Option<Source>) {
        match (lookup.state, source) {
            (SenderState::SameSource, Some(source)) => {
                self.failures.charge_at(source, now, &self.budget);
            }
            _ => self.failures.charge(now, source),
        }
    }

    /// Marks a verified frame as seen and charges its sender's bucket. For an unproven sender all earlier counters
    /// count as seen. Returns whether it is the sender's newest frame.
    #[inline]
    pub fn admit(
        &mut self,
        now: Timestamp,
        lookup: SenderLookup,
        header: &Header,
        source: Option<Source>,
    ) -> bool {
        let sender = self.senders.at(lookup.at);
        sender.bucket.charge(now, &self.budget);
        match &mut sender.newest {
            Some(newest) if newest.incarnation == header.incarnation => {
                newest.source = source;
                let is_newest = header.counter > newest.counter;
                newest.mark(header.counter);
                is_newest
            }
            newest => {
                *newest = Some(Newest {
                    incarnation: header.incarnation,
                    source,
                    counter: header.counter,
                    seen: if lookup.is_proven() { ONLY_NEWEST } else { ALL },
                });
                true
            }
        }
    }
}

impl Newest {
    #[inline]
    fn has_seen(&self, header: &Header) -> bool {
        if header.incarnation != self.incarnation {
            return header.incarnation < self.incarnation
                && !flaw::has(Flaw::AcceptsEarlierIncarnations);
        }
        match self.counter.checked_sub(header.counter) {
            None => false,
            Some(behind) => behind >= REPLAY_WINDOW || self.seen.get() & (1 << behind) != 0,
        }
    }

    #[inline]
    fn mark(&mut self, counter: u64) {
        match self.counter.checked_sub(counter) {
            Some(behind) => self.seen |= 1 << behind.min(REPLAY_WINDOW - 1),
            None => {
                let ahead = counter - self.counter;
                self.seen = if ahead < REPLAY_WINDOW {
                    ONLY_NEWEST | self.seen.get() << ahead
                } else {
                    ONLY_NEWEST
                };
                self.counter = counter;
            }
        }
    }
}
