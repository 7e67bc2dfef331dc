//! The time of a run, and what is scheduled for it.

use std::time::Duration;

use muster_machines::time::Timestamp;

use super::event::Event;
use super::event_queue::EventQueue;

/// The time of the world and the events to come.
///
/// Invariant: time never goes back, and never beyond the limit while the engine takes events. Events are taken in the
/// order of their time; those of one instant in the order in which they were scheduled.
#[derive(Debug)]
pub(super) struct Timeline {
    now: Timestamp,
    /// When the run ends at the latest.
    limit: Timestamp,
    events: EventQueue<Event>,
}

impl Timeline {
    /// Time 0 of a run that ends at `limit`.
    pub(super) fn new(limit: Timestamp) -> Self {
        Self {
            now: Timestamp::ZERO,
            limit,
            events: EventQueue::new(),
        }
    }

    pub(super) const fn now(&self) -> Timestamp {
        self.now
    }

    /// Whether the time limit has been reached.
    pub(super) fn is_up(&self) -> bool {
        self.now >= self.limit
    }

    pub(super) fn schedule(&mut self, at: Timestamp, event: Event) {
        self.events.push(at, event);
    }

    pub(super) fn schedule_after(&mut self, delay: Duration, event: Event) {
        self.events.push(self.now + delay, event);
    }

    /// Takes the next event and moves time to it. `None` if there is none before the limit.
    pub(super) fn next(&mut self) -> Option<Event> {
        let (at, event) = self.events.pop()?;
        if at > self.limit {
            self.now = self.limit;
            return None;
        }
        self.now = at;
        Some(event)
    }

    /// Takes the next event that is due by `until`, which may be beyond the limit.
    pub(super) fn next_until(&mut self, until: Timestamp) -> Option<Event> {
        self.events.next_at().filter(|at| *at <= until)?;
        let (at, event) = self.events.pop()?;
        self.advance_to(at);
        Some(event)
    }

    /// Moves time to `at`, unless it is later already.
    pub(super) fn advance_to(&mut self, at: Timestamp) {
        self.now = self.now.max(at);
    }

    /// Events that are still to come in the queue's current slice. `None` if fewer than `at_least`, or asked before in
    /// this slice.
    pub(super) fn new_slice(&mut self, at_least: usize) -> Option<impl Iterator<Item = &Event>> {
        (self.events.newly_begun() >= at_least).then(|| self.events.begun())
    }
}
