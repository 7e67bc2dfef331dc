use std::collections::VecDeque;

use bytes::Bytes;
use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;
use rand_chacha::ChaCha8Rng;

use super::contention::Contention;
use super::reception::Reception;
use super::timing::RETRIES_MAX;
use crate::Destination;

/// One radio: what waits to be sent, and how far it is with the first of it.
///
/// **Invariant:** while a datagram is ready, either a turn is asked for or the first datagram is under way: being
/// sent, or waiting for its acknowledgement.
#[derive(Debug)]
pub(super) struct Station {
    pub(super) contention: Contention,
    pub(super) reception: Reception,
    /// Whether it sends anything, acknowledgements included.
    pub(super) is_sending: bool,
    queue: VecDeque<Queued>,
    /// How many of the queue, from its front, the sender's program has handed over.
    ready: usize,
    ready_last: Timestamp,
    is_under_way: bool,
    /// Until when an acknowledgement may begin to come in.
    awaits_until: Option<Timestamp>,
    retries: u32,
}

/// A datagram that waits for its turn, or for its acknowledgement.
#[derive(Debug)]
pub(super) struct Queued {
    pub(super) to: Destination,
    pub(super) datagram: Bytes,
    /// At whom it has arrived; what is sent again is not handed out to them again.
    pub(super) arrived_at: Vec<NodeId>,
}

/// What is to be done with a frame that was not acknowledged.
#[derive(Debug)]
pub(super) enum Unacknowledged {
    /// It is in the queue and goes out again.
    Retried,
    /// It has been sent often enough.
    GivenUp(Queued),
}

impl Station {
    pub(super) const fn new() -> Self {
        Self {
            contention: Contention::new(),
            reception: Reception::new(),
            is_sending: false,
            queue: VecDeque::new(),
            ready: 0,
            ready_last: Timestamp::ZERO,
            is_under_way: false,
            awaits_until: None,
            retries: 0,
        }
    }

    pub(super) fn waiting(&self) -> usize {
        self.queue.len()
    }

    /// Takes a datagram that is ready at `ready_at` or, since none overtakes another, when the one before it is.
    pub(super) fn push(&mut self, queued: Queued, ready_at: Timestamp) -> Timestamp {
        self.queue.push_back(queued);
        self.ready_last = self.ready_last.max(ready_at);
        self.ready_last
    }

    /// One more datagram is ready.
    pub(super) fn ready(&mut self, now: Timestamp, rng: &mut ChaCha8Rng) {
        self.ready += 1;
        self.go_on(now, rng);
    }

    /// Whether now is the time to send the first datagram; if so it is under way.
    pub(super) fn take_turn(&mut self, now: Timestamp) -> bool {
        let is_due = self.contention.take_turn(now);
        self.is_under_way |= is_due;
        is_due
    }

    /// The datagram that is being sent.
    pub(super) fn first(&mut self) -> Option<&mut Queued> {
        self.queue.front_mut()
    }

    /// The first datagram has been sent to all, or has been acknowledged.
    pub(super) fn done(&mut self, now: Timestamp, rng: &mut ChaCha8Rng) -> Option<Queued> {
        self.is_under_way = false;
        self.awaits_until = None;
        self.retries = 0;
        self.ready -= 1;
        let done = self.queue.pop_front();
        self.contention.done(now, rng);
        self.go_on(now, rng);
        done
    }

    /// The first datagram has been sent to one drone, whose answer is due.
    pub(super) const fn awaits(&mut self, until: Timestamp) {
        self.awaits_until = Some(until);
    }

    pub(super) const fn is_awaiting(&self) -> bool {
        self.awaits_until.is_some()
    }

    /// Nothing came by now, if now is when it should have.
    pub(super) fn unacknowledged(
        &mut self,
        now: Timestamp,
        rng: &mut ChaCha8Rng,
    ) -> Option<Unacknowledged> {
        if self.awaits_until != Some(now) {
            return None;
        }
        if self.retries == RETRIES_MAX {
            return self.done(now, rng).map(Unacknowledged::GivenUp);
        }
        self.is_under_way = false;
        self.awaits_until = None;
        self.retries += 1;
        self.contention.failed(now, rng);
        self.go_on(now, rng);
        Some(Unacknowledged::Retried)
    }

    /// Nobody sends any more, as far as this radio can tell.
    pub(super) fn is_idle(&self) -> bool {
        !self.is_sending && self.reception.is_quiet()
    }

    fn go_on(&mut self, now: Timestamp, rng: &mut ChaCha8Rng) {
        if self.ready > 0 && !self.is_under_way && !self.contention.is_wanted() {
            self.contention.request(now, rng);
        }
    }
}
