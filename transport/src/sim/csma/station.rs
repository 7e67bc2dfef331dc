use std::collections::VecDeque;

use bytes::Bytes;
use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;
use rand_chacha::ChaCha8Rng;

use super::contention::Contention;
use super::reception::Reception;
use super::timing::RETRIES_MAX;
use crate::Destination;

/// One radio: its queue and the state of the first datagram.
///
/// **Invariant:** while a datagram is ready, either access is requested or the first datagram is in progress: being sent, or
/// waiting for its acknowledgement.
#[derive(Debug)]
pub(super) struct Station {
    pub(super) contention: Contention,
    pub(super) reception: Reception,
    /// Whether it sends a datagram or an acknowledgement.
    pub(super) is_sending: bool,
    queue: VecDeque<Queued>,
    /// Number of queued datagrams, from the front, that the sender's program has passed on.
    ready: usize,
    last_ready_at: Timestamp,
    is_in_progress: bool,
    /// Deadline of the awaited acknowledgement.
    acknowledgement_until: Option<Timestamp>,
    retries: u32,
}

/// A queued datagram.
#[derive(Debug)]
pub(super) struct Queued {
    pub(super) to: Destination,
    pub(super) datagram: Bytes,
    /// The receivers so far; they don't get the datagram of a retry again.
    pub(super) arrived_at: Vec<NodeId>,
}

/// The result of a missing acknowledgement.
#[derive(Debug)]
pub(super) enum Unacknowledged {
    /// The datagram stays in the queue and is retried.
    Retried,
    /// The retries are used up.
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
            last_ready_at: Timestamp::ZERO,
            is_in_progress: false,
            acknowledgement_until: None,
            retries: 0,
        }
    }

    pub(super) fn queue_len(&self) -> usize {
        self.queue.len()
    }

    /// Queues a datagram. Returns when it is ready: at `ready_at`, but not before the one ahead of it.
    pub(super) fn push(&mut self, queued: Queued, ready_at: Timestamp) -> Timestamp {
        self.queue.push_back(queued);
        self.last_ready_at = self.last_ready_at.max(ready_at);
        self.last_ready_at
    }

    /// One more datagram is ready.
    pub(super) fn ready(&mut self, now: Timestamp, rng: &mut ChaCha8Rng) {
        self.ready += 1;
        self.request_access(now, rng);
    }

    /// Starts the first datagram if now is the planned time; returns whether it is.
    pub(super) fn try_start(&mut self, now: Timestamp) -> bool {
        let is_due = self.contention.try_start(now);
        self.is_in_progress |= is_due;
        is_due
    }

    /// The first datagram of the queue.
    pub(super) fn first(&mut self) -> Option<&mut Queued> {
        self.queue.front_mut()
    }

    /// Finishes the first datagram: a broadcast was sent, or a unicast was acknowledged.
    pub(super) fn done(&mut self, now: Timestamp, rng: &mut ChaCha8Rng) -> Option<Queued> {
        self.is_in_progress = false;
        self.acknowledgement_until = None;
        self.retries = 0;
        self.ready -= 1;
        let done = self.queue.pop_front();
        self.contention.done(now, rng);
        self.request_access(now, rng);
        done
    }

    /// Waits for the acknowledgement of the first datagram.
    pub(super) const fn await_acknowledgement(&mut self, until: Timestamp) {
        self.acknowledgement_until = Some(until);
    }

    pub(super) const fn is_awaiting(&self) -> bool {
        self.acknowledgement_until.is_some()
    }

    /// Handles a missing acknowledgement if now is its deadline; otherwise returns `None`.
    pub(super) fn unacknowledged(
        &mut self,
        now: Timestamp,
        rng: &mut ChaCha8Rng,
    ) -> Option<Unacknowledged> {
        if self.acknowledgement_until != Some(now) {
            return None;
        }
        if self.retries == RETRIES_MAX {
            return self.done(now, rng).map(Unacknowledged::GivenUp);
        }
        self.is_in_progress = false;
        self.acknowledgement_until = None;
        self.retries += 1;
        self.contention.failed(now, rng);
        self.request_access(now, rng);
        Some(Unacknowledged::Retried)
    }

    /// Whether the medium is idle for this radio.
    pub(super) fn is_idle(&self) -> bool {
        !self.is_sending && self.reception.is_quiet()
    }

    fn request_access(&mut self, now: Timestamp, rng: &mut ChaCha8Rng) {
        if self.ready > 0 && !self.is_in_progress && !self.contention.is_requested() {
            self.contention.request(now, rng);
        }
    }
}
