//! How long the other end of a link may be silent.

use std::time::Duration;

use crate::time::Timestamp;

/// A timer that is later than this was held up in this process: the silence is not the other end's fault.
const LATE: Duration = Duration::from_millis(100);

/// Watches whether a vehicle that is armed, or may be, is heard.
#[derive(Debug)]
pub(super) struct Silence {
    max: Duration,
    /// When it has lasted too long. `None` if the vehicle is disarmed.
    ends: Option<Timestamp>,
}

impl Silence {
    /// A silence that begins now.
    pub(super) fn new(max: Duration, may_be_armed: bool, now: Timestamp) -> Self {
        let ends = may_be_armed.then_some(now + max);
        Self { max, ends }
    }

    /// The vehicle said whether it is armed.
    pub(super) fn watch(&mut self, now: Timestamp, armed: bool) {
        self.ends = armed.then_some(now + self.max);
    }

    /// The vehicle said something else.
    pub(super) fn heard(&mut self, now: Timestamp) {
        self.watch(now, self.ends.is_some());
    }

    /// When to call [`Self::handle_timeout`].
    pub(super) const fn deadline(&self) -> Option<Timestamp> {
        self.ends
    }

    /// Returns whether it has just lasted too long.
    pub(super) fn handle_timeout(&mut self, now: Timestamp) -> bool {
        let Some(at) = self.ends.filter(|at| *at <= now) else {
            return false;
        };
        let is_too_long = now.since(at) <= LATE;
        self.watch(now, !is_too_long);
        is_too_long
    }
}
