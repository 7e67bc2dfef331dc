use std::hint::black_box;
use std::num::NonZeroU64;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::Source;
use super::budget::{Budget, Forgeries, TokenBucket};
use crate::flaw::{self, Flaw};
use crate::identity::{NodeId, NodeSet};
use crate::roster::Roster;
use crate::time::Timestamp;
use crate::wire::{FrameError, Header};

/// How far behind the newest counter of a sender a frame may be, in frames.
const WINDOW: u64 = 64;

/// Why a frame was not let in; in the order in which it is checked, the cheap checks first.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Error, Serialize, Deserialize,
)]
pub enum DropReason {
    /// Longer than any frame.
    #[error("too long")]
    TooLong,
    /// Ends before its authenticator.
    #[error("too short")]
    TooShort,
    /// Of another version of the frame.
    #[error("other version")]
    Version,
    /// For another swarm.
    #[error("other swarm")]
    OtherSwarm,
    /// A frame of our own that came back.
    #[error("own echo")]
    OwnEcho,
    /// Came by a connection with another drone than the one that it names as its sender.
    #[error("relayed")]
    Relayed,
    /// Of a drone that has been expelled from the swarm.
    #[error("revoked")]
    Revoked,
    /// Of a drone that is none of the swarm's.
    #[error("stranger")]
    Stranger,
    /// Seen before or too old to tell, or of an earlier life of the sender where lives are counted.
    #[error("replayed")]
    Replayed,
    /// Of a sender that has not signed this radio's nonce yet, or not in this life: it may have been recorded.
    #[error("unproven")]
    Unproven,
    /// More frames, signed by their sender, than its budget.
    #[error("over budget")]
    OverBudget,
    /// Not looked at, for too many forged ones came from there, or in all.
    #[error("unverified")]
    Unverified,
    /// Not signed by the sender that it names.
    #[error("forged")]
    Forged,
    /// A list of the expelled that the fleet has not signed.
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

/// Who must sign a radio's nonce before it is believed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Asked {
    /// Nobody: nothing was ever said before.
    Nobody,
    /// A sender of whom nothing was let in yet; it is believed in its later lives, too.
    TheUnknown,
    /// Every sender, in each of its lives.
    EachIncarnation,
}

/// Budgets and replay windows, an entry a sender.
#[derive(Debug)]
pub struct Admission {
    budget: Budget,
    members: u32,
    asked: Asked,
    senders: Roster<Sender>,
    forgeries: Forgeries,
}

/// Where a sender stands in the table, as [`Admission::find`] found it.
#[derive(Debug, Clone, Copy)]
pub struct Place {
    at: usize,
    state: SenderState,
}

/// What is known of whoever a frame names as its sender.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum SenderState {
    /// It must sign a nonce first, and nothing of it was let in yet.
    Unknown,
    /// It must sign a nonce first, for it is known in another life.
    OtherIncarnation,
    /// The frame does not come from where the last one came from that it had signed.
    Elsewhere,
    /// The frame comes from there.
    Home,
}

impl Place {
    /// Whether the sender has signed the radio's nonce, or need not.
    #[must_use]
    pub fn is_proven(&self) -> bool {
        !matches!(
            self.state,
            SenderState::Unknown | SenderState::OtherIncarnation
        )
    }

    /// Whether the sender is believed, but in another life than the frame has.
    #[must_use]
    pub fn is_of_other_incarnation(&self) -> bool {
        self.state == SenderState::OtherIncarnation
    }
}

#[derive(Debug)]
struct Sender {
    /// Of frames that it has signed.
    bucket: TokenBucket,
    /// Nothing yet, or the newest life and counter.
    newest: Option<Newest>,
}

#[derive(Debug, Clone, Copy)]
struct Newest {
    incarnation: u32,
    /// Where the last frame came from that was let in.
    source: Option<Source>,
    counter: u64,
    /// A bit for each counter, the newest in the lowest.
    seen: NonZeroU64,
}

/// Only the newest counter was seen.
const ONLY_NEWEST: NonZeroU64 = NonZeroU64::MIN;
/// All before it may have been.
const ALL: NonZeroU64 = NonZeroU64::MAX;

impl Admission {
    /// An empty table for a swarm of so many members, whose ids run from 0 to one below: nobody else's frame takes a
    /// place in it.
    #[must_use]
    pub fn new(budget: Budget, members: u32, asked: Asked) -> Self {
        Self {
            budget,
            members,
            asked,
            senders: Roster::new(),
            forgeries: Forgeries::new(),
        }
    }

    /// How many senders the table holds.
    #[must_use]
    pub const fn senders(&self) -> usize {
        self.senders.len()
    }

    /// The members of whom nothing was let in yet.
    #[must_use]
    pub fn unproven(&self) -> NodeSet {
        let is_proven = |id: &NodeId| self.senders.get(*id).is_some_and(|it| it.newest.is_some());
        let members = (0..self.members).map(NodeId);
        members.filter(|id| !is_proven(id)).collect()
    }

    /// As [`NodeMachine::read_ahead`](crate::node::NodeMachine::read_ahead) says.
    pub(super) fn read_ahead(&self) {
        black_box((self.members, self.budget.burst, self.senders.len()));
    }

    /// As [`NodeMachine::read_further_ahead`](crate::node::NodeMachine::read_further_ahead) says.
    pub(super) fn read_further_ahead(&self, sender: Option<NodeId>) {
        let known = sender.and_then(|sender| self.senders.get(sender));
        black_box(known.map(|it| it.bucket));
    }

    /// What is known of a frame's sender.
    ///
    /// # Errors
    /// With the reason for which the frame is to be dropped: a replay, which uses up nothing of what its sender may say,
    /// or a stranger.
    #[inline]
    pub fn find(&mut self, header: &Header, source: Option<Source>) -> Result<Place, DropReason> {
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
        let is_asked = match newest {
            None => self.asked != Asked::Nobody,
            Some(newest) => {
                self.asked == Asked::EachIncarnation && newest.incarnation != header.incarnation
            }
        };
        let is_asked = is_asked && !flaw::has(Flaw::BelievesTheUnproven);
        let state = match newest {
            None if is_asked => SenderState::Unknown,
            Some(_) if is_asked => SenderState::OtherIncarnation,
            Some(newest) if newest.has_seen(header) => return Err(DropReason::Replayed),
            Some(newest) if source.is_some() && newest.source == source => SenderState::Home,
            _ => SenderState::Elsewhere,
        };
        Ok(Place { at, state })
    }

    /// Whether a frame may go on to the costly check of its signature.
    ///
    /// # Errors
    /// With the reason for which the frame is to be dropped.
    ///
    /// # Panics
    /// When another table than this one found the place; so do the others.
    #[inline]
    pub fn check(
        &mut self,
        now: Timestamp,
        place: Place,
        source: Option<Source>,
    ) -> Result<(), DropReason> {
        if !self.senders.at(place.at).bucket.has_left(now, &self.budget) {
            return Err(DropReason::OverBudget);
        }
        let has_left = match (place.state, source) {
            (SenderState::Home, Some(home)) => self.forgeries.has_left_at(home, now, &self.budget),
            _ => self.forgeries.has_left(now, source),
        };
        has_left.then_some(()).ok_or(DropReason::Unverified)
    }

    /// Takes in that a frame was looked at in vain: its signature was wrong, or it came of an unproven sender and proved
    /// nothing. What its sender may say from elsewhere is no less by that, for whoever was the first to pass on a frame of
    /// its has its home.
    pub fn refuse(&mut self, now: Timestamp, place: Place, source: Option<Source>) {
        match (place.state, source) {
            (SenderState::Home, Some(home)) => self.forgeries.charge_at(home, now, &self.budget),
            _ => self.forgeries.charge(now, source),
        }
    }

    /// Marks a frame, whose signature was right, as seen, and charges its sender's budget. Where the sender was unproven all
    /// that it said before is taken for seen, for it may have been.
    #[inline]
    pub fn admit(&mut self, now: Timestamp, place: Place, header: &Header, source: Option<Source>) {
        let sender = self.senders.at(place.at);
        sender.bucket.charge(now, &self.budget);
        match &mut sender.newest {
            Some(newest) if newest.incarnation == header.incarnation => {
                newest.source = source;
                newest.mark(header.counter);
            }
            newest => {
                *newest = Some(Newest {
                    incarnation: header.incarnation,
                    source,
                    counter: header.counter,
                    seen: if place.is_proven() { ONLY_NEWEST } else { ALL },
                });
            }
        }
    }
}

impl Newest {
    #[inline]
    fn has_seen(&self, header: &Header) -> bool {
        if header.incarnation != self.incarnation {
            return header.incarnation < self.incarnation && !flaw::has(Flaw::AcceptsEarlierLives);
        }
        match self.counter.checked_sub(header.counter) {
            None => false,
            Some(behind) => behind >= WINDOW || self.seen.get() & (1 << behind) != 0,
        }
    }

    #[inline]
    fn mark(&mut self, counter: u64) {
        match self.counter.checked_sub(counter) {
            Some(behind) => self.seen |= 1 << behind.min(WINDOW - 1),
            None => {
                let ahead = counter - self.counter;
                self.seen = if ahead < WINDOW {
                    ONLY_NEWEST | self.seen.get() << ahead
                } else {
                    ONLY_NEWEST
                };
                self.counter = counter;
            }
        }
    }
}
