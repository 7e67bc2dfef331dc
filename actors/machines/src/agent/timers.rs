//! An agent's timers.

use super::{TIMERS_MAX, TimerId};
use crate::time::Timestamp;

/// Running timers, at most [`TIMERS_MAX`].
///
/// Invariant: sorted by expiry, then in the order in which they were set; each id occurs once.
#[derive(Debug, Default)]
pub(super) struct Timers(Vec<(Timestamp, TimerId)>);

impl Timers {
    /// Starts a timer, or restarts it.
    ///
    /// # Panics
    /// [`TIMERS_MAX`] others run.
    pub(super) fn set(&mut self, timer: TimerId, at: Timestamp) {
        self.cancel(timer);
        let running = self.0.len();
        assert!(
            running < TIMERS_MAX,
            "{running} timers run; accepted are at most {TIMERS_MAX}"
        );
        let place = self.0.partition_point(|(other, _)| *other <= at);
        self.0.insert(place, (at, timer));
    }

    pub(super) fn cancel(&mut self, timer: TimerId) {
        self.0.retain(|(_, other)| *other != timer);
    }

    /// Removes and returns the first timer that has expired.
    pub(super) fn pop_expired(&mut self, now: Timestamp) -> Option<TimerId> {
        let (at, timer) = *self.0.first()?;
        (at <= now).then(|| {
            self.0.remove(0);
            timer
        })
    }

    /// The running timers, the next to expire first.
    pub(super) fn running(&self) -> impl Iterator<Item = TimerId> {
        self.0.iter().map(|(_, timer)| *timer)
    }

    pub(super) fn next(&self) -> Option<Timestamp> {
        self.0.first().map(|(at, _)| *at)
    }

    pub(super) fn clear(&mut self) {
        self.0.clear();
    }
}
