//! A drone's own messages: waiting, sent and not acknowledged, or on their way in pieces.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use super::limits::{
    ACKNOWLEDGED_LIFETIME, BEST_EFFORT_LIFETIME, ORIGIN_BUDGET, QUEUE_BYTES_MAX, QUEUE_MAX,
    RETRY_MAX, RETRY_MIN, TRY_LIFETIME,
};
use super::queue::Report;
use super::transfer::Transfer;
use super::{Outgoing, Reliability};
use crate::identity::NodeId;
use crate::radio::TokenBucket;
use crate::time::{Timestamp, first_of};
use crate::wire::{Destination, MessageBody};

/// A frame that an own message starts.
#[derive(Debug)]
pub(super) struct Start {
    /// Number of the message.
    pub(super) message: u32,
    pub(super) to: Destination,
    pub(super) body: MessageBody,
    pub(super) lifetime: Duration,
    pub(super) report: Report,
}

/// Own messages until their end.
///
/// Invariant: `bytes` is the size of all that wait or are not acknowledged. With the count, it is within the limits of
/// the queue.
#[derive(Debug)]
pub(super) struct Own {
    waiting: VecDeque<Waiting>,
    /// By number.
    unacknowledged: BTreeMap<u32, Unacknowledged>,
    transfer: Option<(u32, Outgoing, Transfer)>,
    bytes: usize,
    budget: TokenBucket,
    /// Number of the last message.
    last: u32,
}

#[derive(Debug)]
struct Waiting {
    outgoing: Outgoing,
    expires_at: Timestamp,
}

/// A whole message that was sent and not acknowledged.
#[derive(Debug)]
struct Unacknowledged {
    outgoing: Outgoing,
    expires_at: Timestamp,
    retry_at: Timestamp,
    pause: Duration,
}

impl Own {
    pub(super) const fn new() -> Self {
        Self {
            waiting: VecDeque::new(),
            unacknowledged: BTreeMap::new(),
            transfer: None,
            bytes: 0,
            budget: TokenBucket::FULL,
            last: 0,
        }
    }

    /// Number of messages that wait or are not acknowledged.
    pub(super) fn len(&self) -> usize {
        self.waiting.len() + self.unacknowledged.len() + usize::from(self.transfer.is_some())
    }

    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Adds a message. If there is no room, the oldest best-effort messages that wait are dropped, or only the new one if
    /// that makes no room. Returns the dropped messages.
    pub(super) fn submit(&mut self, now: Timestamp, outgoing: Outgoing) -> Vec<u32> {
        let mut dropped = Vec::new();
        let bytes = outgoing.payload.len();
        let is_best_effort = |it: &&Waiting| !it.outgoing.is_acknowledged();
        let best_effort = || self.waiting.iter().filter(is_best_effort);
        let best_effort_bytes: usize = best_effort().map(|it| it.outgoing.payload.len()).sum();
        if self.len() - best_effort().count() >= QUEUE_MAX
            || self.bytes - best_effort_bytes + bytes > QUEUE_BYTES_MAX
        {
            dropped.push(outgoing.id);
            return dropped;
        }
        while self.len() >= QUEUE_MAX || self.bytes + bytes > QUEUE_BYTES_MAX {
            let oldest = self.waiting.iter().position(|it| is_best_effort(&it));
            let Some(oldest) = oldest.and_then(|at| self.waiting.remove(at)) else {
                break;
            };
            self.bytes -= oldest.outgoing.payload.len();
            dropped.push(oldest.outgoing.id);
        }
        self.bytes += bytes;
        let lifetime = if outgoing.is_acknowledged() || outgoing.is_large() {
            ACKNOWLEDGED_LIFETIME
        } else {
            BEST_EFFORT_LIFETIME
        };
        let expires_at = now + lifetime;
        self.waiting.push_back(Waiting {
            outgoing,
            expires_at,
        });
        dropped
    }

    /// The next frame, within the budget; `None` if there is none now. `is_queued` tells whether a message, or a piece
    /// of it, still waits at this drone.
    pub(super) fn start(
        &mut self,
        now: Timestamp,
        is_queued: impl Fn(u32, Option<u32>) -> bool,
    ) -> Option<Start> {
        if self.is_empty() || !self.budget.has_tokens(now, &ORIGIN_BUDGET) {
            return None;
        }
        let start = self
            .start_again(now, &is_queued)
            .or_else(|| self.start_next(now))
            .or_else(|| self.start_piece(now, &is_queued))?;
        self.budget.charge(now, &ORIGIN_BUDGET);
        Some(start)
    }

    /// Repeats a whole message that was not acknowledged in time.
    fn start_again(
        &mut self,
        now: Timestamp,
        is_queued: impl Fn(u32, Option<u32>) -> bool,
    ) -> Option<Start> {
        for (message, it) in &mut self.unacknowledged {
            if it.retry_at > now {
                continue;
            }
            it.retry_at = now + it.pause;
            if is_queued(*message, None) {
                continue;
            }
            it.pause = (it.pause * 2).min(RETRY_MAX);
            it.retry_at = now + it.pause;
            return Some(Start {
                message: *message,
                to: it.outgoing.to,
                body: MessageBody::Whole {
                    acknowledge: true,
                    payload: it.outgoing.payload.clone(),
                },
                lifetime: TRY_LIFETIME.min(it.expires_at.since(now)),
                report: Report::Nothing,
            });
        }
        None
    }

    /// Starts the first message that waits. A large one waits until the one before has arrived, and others overtake it.
    fn start_next(&mut self, now: Timestamp) -> Option<Start> {
        if self.transfer.is_none()
            && let Some(at) = self.waiting.iter().position(|it| it.outgoing.is_large())
            && let Some(Waiting { outgoing, .. }) = self.waiting.remove(at)
        {
            self.last = self.last.wrapping_add(1);
            let transfer = Transfer::new(outgoing.payload.clone(), now);
            self.transfer = Some((self.last, outgoing, transfer));
        }
        let at = self.waiting.iter().position(|it| !it.outgoing.is_large())?;
        let Waiting {
            outgoing,
            expires_at,
        } = self.waiting.remove(at)?;
        self.last = self.last.wrapping_add(1);
        let message = self.last;
        let to = outgoing.to;
        let is_confirmed = outgoing.is_acknowledged() && to != Destination::Neighbours;
        let start = Start {
            message,
            to,
            body: MessageBody::Whole {
                acknowledge: is_confirmed,
                payload: outgoing.payload.clone(),
            },
            lifetime: if is_confirmed {
                TRY_LIFETIME.min(expires_at.since(now))
            } else {
                expires_at.since(now)
            },
            report: match outgoing.reliability {
                Reliability::BestEffort => Report::Losses(outgoing.id),
                Reliability::Acknowledged if is_confirmed => Report::Nothing,
                Reliability::Acknowledged => Report::Outcome(outgoing.id),
            },
        };
        if is_confirmed {
            let it = Unacknowledged {
                outgoing,
                expires_at,
                retry_at: now + RETRY_MIN,
                pause: RETRY_MIN,
            };
            self.unacknowledged.insert(message, it);
        } else {
            self.bytes -= outgoing.payload.len();
        }
        Some(start)
    }

    fn start_piece(
        &mut self,
        now: Timestamp,
        is_queued: impl Fn(u32, Option<u32>) -> bool,
    ) -> Option<Start> {
        let (message, outgoing, transfer) = self.transfer.as_mut()?;
        let body = transfer.take_piece(now, |piece| is_queued(*message, Some(piece)))?;
        Some(Start {
            message: *message,
            to: outgoing.to,
            body,
            lifetime: TRY_LIFETIME,
            report: Report::Nothing,
        })
    }

    /// A receiver acknowledges whole messages; returns those that were not acknowledged before.
    pub(super) fn record_receipt(&mut self, message: u32, before: u32) -> Vec<u32> {
        let earlier = (0..32).filter(|bit| before & (1 << bit) != 0);
        let earlier = earlier.filter_map(|bit| message.checked_sub(1 + bit));
        let delivered = std::iter::once(message).chain(earlier);
        let delivered = delivered.filter_map(|number| self.unacknowledged.remove(&number));
        let delivered: Vec<Outgoing> = delivered.map(|it| it.outgoing).collect();
        let ids = delivered.into_iter().map(|outgoing| {
            self.bytes -= outgoing.payload.len();
            outgoing.id
        });
        ids.collect()
    }

    /// A receiver acknowledges pieces; returns the message if all have arrived, and whether its end is to be reported.
    pub(super) fn record_progress(
        &mut self,
        now: Timestamp,
        receiver: (NodeId, u32),
        message: u32,
        pieces: (u32, u64),
        leader: Option<NodeId>,
    ) -> Option<(u32, bool)> {
        let (current, outgoing, transfer) = self.transfer.as_mut()?;
        let is_receiver = match outgoing.to {
            Destination::Drone(id) => id == receiver.0,
            _ => true,
        };
        if *current != message || !is_receiver {
            return None;
        }
        let may_take_over = leader == Some(receiver.0);
        if !transfer.record_progress(now, receiver, pieces, may_take_over) {
            return None;
        }
        let (_, outgoing, _) = self.transfer.take()?;
        self.bytes -= outgoing.payload.len();
        Some((outgoing.id, outgoing.is_acknowledged()))
    }

    /// Removes messages whose time is over, and returns them.
    pub(super) fn expire(&mut self, now: Timestamp) -> Vec<u32> {
        let mut expired = Vec::new();
        if self.is_empty() {
            return Vec::new();
        }
        self.waiting.retain(|it| {
            let keeps = it.expires_at > now;
            if !keeps {
                expired.push((it.outgoing.id, it.outgoing.payload.len()));
            }
            keeps
        });
        self.unacknowledged.retain(|_, it| {
            let keeps = it.expires_at > now;
            if !keeps {
                expired.push((it.outgoing.id, it.outgoing.payload.len()));
            }
            keeps
        });
        let is_over =
            |(_, _, transfer): &mut (u32, Outgoing, Transfer)| transfer.expires_at() <= now;
        if let Some((_, outgoing, _)) = self.transfer.take_if(is_over) {
            expired.push((outgoing.id, outgoing.payload.len()));
        }
        self.bytes -= expired.iter().map(|(_, bytes)| bytes).sum::<usize>();
        expired.into_iter().map(|(id, _)| id).collect()
    }

    /// Removes all messages, and returns them.
    pub(super) fn clear(&mut self) -> Vec<u32> {
        let waiting = self.waiting.drain(..).map(|it| it.outgoing.id);
        let mut ids: Vec<u32> = waiting.collect();
        let unacknowledged = std::mem::take(&mut self.unacknowledged);
        ids.extend(unacknowledged.into_values().map(|it| it.outgoing.id));
        ids.extend(self.transfer.take().map(|(_, outgoing, _)| outgoing.id));
        self.bytes = 0;
        ids
    }

    /// When [`Self::start`] or [`Self::expire`] have something to do next. With `has_room` false nothing is started.
    pub(super) fn deadline(&self, has_room: bool) -> Option<Timestamp> {
        if self.is_empty() {
            return None;
        }
        let waits = self.waiting.iter();
        let is_startable = |it: &Waiting| self.transfer.is_none() || !it.outgoing.is_large();
        let next = waits.clone().any(is_startable).then_some(Timestamp::ZERO);
        let again = self.unacknowledged.values().map(|it| it.retry_at).min();
        let piece = self.transfer.as_ref().map(|(_, _, it)| it.next_at());
        let start = first_of([next, again, piece]).filter(|_| has_room);
        let start = start.map(|start| start.max(self.budget.available_at(&ORIGIN_BUDGET)));
        let expired = waits.map(|it| it.expires_at).min();
        let unacknowledged = self.unacknowledged.values().map(|it| it.expires_at).min();
        let transfer = self.transfer.as_ref().map(|(_, _, it)| it.expires_at());
        first_of([start, expired, unacknowledged, transfer])
    }
}
