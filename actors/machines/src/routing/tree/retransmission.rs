//! When unacknowledged frames are sent again, and the drone's own rate limit.

use std::time::Duration;

use crate::identity::NodeId;
use crate::routing::shared::SharedState;
use crate::time::{Timestamp, first_of};

/// An undelivered frame is tried again after the repair interval divided by this.
const RETRY_SHARE: u32 = 4;
/// Number of tries before back-off starts; then each interval grows by half. Up to there, losses are random.
const STEADY_TRIES: u32 = 4;
/// Number of tries after which a parent that stayed silent is marked unreachable.
const TRIES_MAX: u32 = 6;
/// Time slot of an answer; each neighbour that a frame requests adds one, and the slot is random. An answer of 150
/// bytes takes a third of a millisecond over 802.11a at 6 Mb/s, back-off included.
const ANSWER_SLOT: Duration = Duration::from_micros(500);
/// Delay of the second copy of an order, in repair intervals: after the answers to the first.
const COPY_REPAIRS: u32 = 2;
/// Time slot of a relayed order; each relay at the same distance adds one, and the slot is random. Relays that do not
/// hear each other would collide at receivers of both.
const RELAY_SLOT: Duration = Duration::from_micros(300);
/// Upper bound of the number of relay slots.
const RELAY_SLOTS_MAX: u32 = 10;

/// Token bucket: one frame per interval. That is less than radios admit from one sender (`radio::Config::budget`), so
/// none is dropped for its rate.
const TOKEN_INTERVAL: Duration = Duration::from_millis(6);
/// Token bucket: capacity in frames.
const TOKENS_MAX: u32 = 20;

/// What waits to be sent again.
///
/// Invariant: each time lies after the step in which it was set. An attempt goes on until no recipient lacks anything.
#[derive(Debug)]
pub(super) struct Retransmission {
    repair: Duration,
    repair_max: Duration,
    attempt: Option<Attempt>,
    /// When a new order is relayed.
    relay_at: Option<Timestamp>,
    /// When requests are answered, and when they were last.
    answer_at: Option<Timestamp>,
    answered_at: Option<Timestamp>,
    /// When the order with this number is broadcast a second time.
    copy: Option<(Timestamp, u32)>,
    /// When this neighbour is asked for a missed order.
    request: Option<(Timestamp, NodeId)>,
    /// When the token bucket is full again.
    full_at: Timestamp,
}

/// A frame that is not acknowledged yet.
#[derive(Debug, Clone, Copy)]
struct Attempt {
    since: Timestamp,
    due: Timestamp,
    pause: Duration,
    tries: u32,
}

/// What is due.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Due {
    /// A new order.
    Relay,
    /// An unacknowledged frame.
    Repair,
    /// An answer to requests.
    Answer,
    /// The second copy of the order with this number.
    Copy(u32),
    /// A request for a missed order.
    Request(NodeId),
}

impl Retransmission {
    /// Repair intervals start at `repair` and back off to `repair_max`.
    pub(super) const fn new(repair: Duration, repair_max: Duration) -> Self {
        Self {
            repair,
            repair_max,
            attempt: None,
            relay_at: None,
            answer_at: None,
            answered_at: None,
            copy: None,
            request: None,
            full_at: Timestamp::ZERO,
        }
    }

    pub(super) fn start_epoch(&mut self) {
        *self = Self {
            full_at: self.full_at,
            ..Self::new(self.repair, self.repair_max)
        };
    }

    /// Cancels what belongs to the order before.
    pub(super) const fn start_order(&mut self) {
        self.attempt = None;
        self.relay_at = None;
        self.copy = None;
        self.request = None;
    }

    /// The next time at which something is due.
    pub(super) fn deadline(&self) -> Option<Timestamp> {
        let attempt = self.attempt.map(|it| it.due);
        let copy = self.copy.map(|it| it.0);
        let request = self.request.map(|it| it.0);
        let first = first_of([self.relay_at, attempt, self.answer_at, copy, request]);
        first.map(|due| due.max(self.next_send_at()))
    }

    /// The first time at which the token bucket allows a frame.
    fn next_send_at(&self) -> Timestamp {
        Timestamp::ZERO
            + self
                .full_at
                .since(Timestamp::ZERO + TOKEN_INTERVAL * (TOKENS_MAX - 1))
    }

    /// Takes what is due at `now`.
    pub(super) fn take_due(&mut self, now: Timestamp) -> Option<Due> {
        if self.next_send_at() > now {
            return None;
        }
        if self.relay_at.is_some_and(|at| at <= now) {
            self.relay_at = None;
            return Some(Due::Relay);
        }
        if self.answer_at.is_some_and(|at| at <= now) {
            self.answer_at = None;
            self.answered_at = Some(now);
            return Some(Due::Answer);
        }
        if let Some((_, sequence)) = self.copy.filter(|(at, _)| *at <= now) {
            self.copy = None;
            return Some(Due::Copy(sequence));
        }
        if let Some((_, neighbour)) = self.request.filter(|(at, _)| *at <= now) {
            self.request = None;
            return Some(Due::Request(neighbour));
        }
        self.attempt
            .is_some_and(|it| it.due <= now)
            .then_some(Due::Repair)
    }

    /// Whether the token bucket allows a frame now. If not, the frame is scheduled as a repair at the first possible
    /// time.
    pub(super) fn may_send(&mut self, now: Timestamp) -> bool {
        let may = self.next_send_at() <= now;
        if !may {
            let due = self.next_send_at();
            self.bring_forward(now, due);
        }
        may
    }

    /// Takes a token for a sent frame.
    pub(super) fn record_sent(&mut self, now: Timestamp) {
        self.full_at = self.full_at.max(now) + TOKEN_INTERVAL;
    }

    /// Whether a frame is unacknowledged.
    pub(super) const fn is_active(&self) -> bool {
        self.attempt.is_some()
    }

    /// All frames are acknowledged.
    pub(super) const fn stop(&mut self) {
        self.attempt = None;
    }

    /// A frame with new content was sent.
    pub(super) fn start(&mut self, shared: &mut SharedState, now: Timestamp) {
        self.attempt = Some(Attempt {
            since: now,
            due: now + self.repair / 2 + shared.jitter(self.repair),
            pause: self.repair,
            tries: 0,
        });
    }

    /// The content was sent again.
    pub(super) fn back_off(&mut self, shared: &mut SharedState, now: Timestamp) {
        let Some(attempt) = &mut self.attempt else {
            return self.start(shared, now);
        };
        attempt.tries += 1;
        if attempt.tries > STEADY_TRIES {
            attempt.pause = (attempt.pause * 3 / 2).min(self.repair_max);
        }
        attempt.due = now + attempt.pause / 2 + shared.jitter(attempt.pause);
    }

    /// Sends the unacknowledged content at `due` at the latest.
    pub(super) fn bring_forward(&mut self, now: Timestamp, due: Timestamp) {
        match &mut self.attempt {
            Some(attempt) => attempt.due = attempt.due.min(due),
            None => {
                self.attempt = Some(Attempt {
                    since: now,
                    due,
                    pause: self.repair,
                    tries: 0,
                });
            }
        }
    }

    /// A neighbour lacks something that was not sent to it: sends it soon, once for all that lack it.
    pub(super) fn expedite(&mut self, shared: &mut SharedState, now: Timestamp) {
        let due = now + self.repair / 16 + shared.jitter(self.repair / 4);
        self.bring_forward(now, due);
    }

    /// The medium reported a failure: sends again sooner than without a report.
    pub(super) fn retry(&mut self, shared: &mut SharedState, now: Timestamp) {
        let pause = self.attempt.map_or(self.repair, |it| it.pause) / RETRY_SHARE;
        let due = now + pause / 4 + shared.jitter(pause);
        self.bring_forward(now, due);
    }

    /// Schedules a new order, which `others` relay at the same time.
    pub(super) fn schedule_relay(
        &mut self,
        shared: &mut SharedState,
        now: Timestamp,
        others: usize,
    ) {
        let others = u32::try_from(others).unwrap_or(u32::MAX);
        let within = RELAY_SLOT
            .saturating_mul(others)
            .min(RELAY_SLOT * RELAY_SLOTS_MAX);
        self.relay_at = Some(now + shared.jitter(within));
    }

    /// Schedules an answer to a frame that requests `requested` neighbours. Repeated requests get one answer per repair
    /// interval.
    pub(super) fn schedule_answer(
        &mut self,
        shared: &mut SharedState,
        now: Timestamp,
        requested: usize,
    ) {
        let requested = u32::try_from(requested).unwrap_or(u32::MAX).max(1);
        let at = now + ANSWER_SLOT / 4 + shared.jitter(ANSWER_SLOT.saturating_mul(requested));
        let at = self
            .answered_at
            .map_or(at, |before| at.max(before + self.repair));
        self.answer_at = Some(self.answer_at.map_or(at, |known| known.min(at)));
    }

    /// Schedules a request to a neighbour that knows a newer order.
    pub(super) fn schedule_request(
        &mut self,
        shared: &mut SharedState,
        now: Timestamp,
        neighbour: NodeId,
    ) {
        let at = now + self.repair / 16 + shared.jitter(self.repair / 2);
        self.request.get_or_insert((at, neighbour));
    }

    /// Schedules the second copy of an order that `leaves` neighbours are trusted to have received.
    pub(super) fn schedule_copy(
        &mut self,
        shared: &mut SharedState,
        now: Timestamp,
        leaves: usize,
    ) {
        if leaves > 0 {
            let at = now + self.repair * COPY_REPAIRS + shared.jitter(self.repair);
            self.copy = Some((at, shared.sequence()));
        }
    }

    /// Whether this drone has tried in vain to reach a parent that was last heard at `heard_at`.
    pub(super) fn has_exhausted_tries(&self, heard_at: Timestamp) -> bool {
        self.attempt
            .is_some_and(|it| it.tries >= TRIES_MAX && heard_at < it.since)
    }
}

#[cfg(test)]
mod tests;
