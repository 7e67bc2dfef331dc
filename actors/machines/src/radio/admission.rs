use std::hint::black_box;
use std::num::NonZeroU64;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::flaw::{self, Flaw};
use crate::identity::NodeId;
use crate::roster::Roster;
use crate::time::Timestamp;
use crate::wire::{FrameError, Header};

/// How far behind the newest counter of a sender a frame may be, in frames.
const WINDOW: u64 = 64;

/// How many frames of one sender are let in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Budget {
    /// How long it takes to earn one frame.
    pub interval: Duration,
    /// How many frames may come at once.
    pub burst: u32,
}

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
    /// Of a drone that has been expelled from the swarm.
    #[error("expelled")]
    Expelled,
    /// Of a drone that is none of the swarm's.
    #[error("stranger")]
    Stranger,
    /// Of an earlier life of the sender, seen before, or too old to tell.
    #[error("replayed")]
    Replayed,
    /// More frames than the sender's budget.
    #[error("over budget")]
    OverBudget,
    /// Not signed by the sender that it names.
    #[error("forged")]
    Forged,
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

/// Budgets and replay windows, an entry a sender.
#[derive(Debug)]
pub struct Admission {
    budget: Budget,
    members: u32,
    senders: Roster<Sender>,
}

/// Where a sender stands in the table, as [`Admission::check`] found it.
#[derive(Debug, Clone, Copy)]
pub struct Place(usize);

#[derive(Debug)]
struct Sender {
    /// When the whole burst will have been earned back.
    full_at: Timestamp,
    /// Nothing yet, or the newest life and counter.
    newest: Option<Newest>,
}

#[derive(Debug, Clone, Copy)]
struct Newest {
    boot: u32,
    counter: u64,
    /// A bit for each counter, the newest in the lowest.
    seen: NonZeroU64,
}

/// Only the newest counter was seen.
const ONLY_NEWEST: NonZeroU64 = NonZeroU64::MIN;

impl Admission {
    /// An empty table for a swarm of so many members, whose ids run from 0 to one below: nobody else's frame takes a
    /// place in it.
    #[must_use]
    pub fn new(budget: Budget, members: u32) -> Self {
        Self {
            budget,
            members,
            senders: Roster::new(),
        }
    }

    /// How many senders the table holds.
    #[must_use]
    pub const fn senders(&self) -> usize {
        self.senders.len()
    }

    /// As [`Cell::read_ahead`](crate::cell::Cell::read_ahead) says.
    pub(super) fn read_ahead(&self, sender: Option<NodeId>) {
        let known = sender.and_then(|sender| self.senders.get(sender));
        black_box((self.members, self.budget.burst, known.map(|it| it.full_at)));
    }

    /// Whether a frame may go on to the costly check of its signature; charges the sender's budget.
    ///
    /// # Errors
    /// With the reason for which the frame is to be dropped.
    #[inline]
    pub fn check(&mut self, now: Timestamp, header: &Header) -> Result<Place, DropReason> {
        if header.sender.0 >= self.members {
            return Err(DropReason::Stranger);
        }
        let at = self.senders.find(header.sender).unwrap_or_else(|at| {
            let sender = Sender {
                full_at: now,
                newest: None,
            };
            self.senders.insert(at, header.sender, sender);
            at
        });
        let sender = self.senders.at(at);
        // A replay is not to use up what its sender may say.
        if sender.newest.is_some_and(|newest| newest.has_seen(header)) {
            return Err(DropReason::Replayed);
        }
        let full_at = sender.full_at.max(now) + self.budget.interval;
        if full_at.since(now) > self.budget.interval * self.budget.burst {
            return Err(DropReason::OverBudget);
        }
        sender.full_at = full_at;
        Ok(Place(at))
    }

    /// Marks a frame, whose signature was right, as seen.
    ///
    /// # Panics
    /// When another table than this one found the place.
    #[inline]
    pub fn admit(&mut self, place: Place, header: &Header) {
        match &mut self.senders.at(place.0).newest {
            Some(newest) if newest.boot == header.boot => newest.mark(header.counter),
            newest => {
                *newest = Some(Newest {
                    boot: header.boot,
                    counter: header.counter,
                    seen: ONLY_NEWEST,
                });
            }
        }
    }
}

impl Newest {
    #[inline]
    fn has_seen(&self, header: &Header) -> bool {
        if header.boot != self.boot {
            return header.boot < self.boot && !flaw::has(Flaw::AcceptsEarlierLives);
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
