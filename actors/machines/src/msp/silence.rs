//! How long the other end of a link may be silent.

use std::time::Duration;

use crate::stall::STALL_MIN;
use crate::time::Timestamp;

/// How often a link is to be called while it watches.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// Watches whether a vehicle that is armed, or may be, is heard.
#[derive(Debug)]
pub(super) struct Silence {
    max: Duration,
    /// When it has lasted too long. `None` if the vehicle is disarmed.
    ends: Option<Timestamp>,
    /// The last call while it watched.
    looked: Timestamp,
}

impl Silence {
    /// A silence that begins now.
    pub(super) fn new(max: Duration, may_be_armed: bool, now: Timestamp) -> Self {
        Self {
            max,
            ends: may_be_armed.then_some(now + max),
            looked: now,
        }
    }

    /// The vehicle said whether it is armed.
    pub(super) fn watch(&mut self, now: Timestamp, armed: bool) {
        self.ends = armed.then_some(now + self.max);
        self.looked = now;
    }

    /// The vehicle said something else.
    pub(super) fn heard(&mut self, now: Timestamp) {
        self.watch(now, self.is_watching());
    }

    /// Whether the vehicle is armed, or may be.
    pub(super) const fn is_watching(&self) -> bool {
        self.ends.is_some()
    }

    /// When to call [`Self::handle_timeout`].
    pub(super) fn deadline(&self) -> Option<Timestamp> {
        Some(self.ends?.min(self.looked + LOOK_EVERY))
    }

    /// Returns whether it has just lasted too long. A silence during which the link was not called for longer than
    /// [`STALL_MIN`] begins anew: it was held up itself, and the silence may not be the other end's fault.
    pub(super) fn handle_timeout(&mut self, now: Timestamp) -> bool {
        if self.is_watching() && now.since(self.looked) > STALL_MIN {
            self.watch(now, true);
        }
        self.looked = now;
        self.ends.take_if(|ends| *ends <= now).is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(milliseconds: u64) -> Timestamp {
        Timestamp::from_nanos(milliseconds * 1_000_000)
    }

    /// When a silence of a second that begins at 0 has lasted too long, for a link that is called when it asks to be but while
    /// it is held up.
    fn ends(held_up: std::ops::Range<u64>) -> Timestamp {
        let mut silence = Silence::new(Duration::from_secs(1), true, at(0));
        loop {
            let mut now = silence.deadline().expect("it watches");
            if now >= at(held_up.start) && now < at(held_up.end) {
                now = at(held_up.end);
            }
            if silence.handle_timeout(now) {
                assert!(!silence.is_watching());
                return now;
            }
        }
    }

    #[test]
    fn silence_is_noticed_when_it_has_lasted_too_long() {
        assert_eq!(ends(0..0), at(1_000));
        assert_eq!(ends(400..440), at(1_000), "a moment");
    }

    #[test]
    fn silence_during_which_the_link_was_held_up_begins_anew() {
        for (from, to) in [(10, 900), (10, 1_050), (900, 1_090), (500, 3_000)] {
            assert_eq!(ends(from..to), at(to + 1_000), "{from} to {to} ms");
        }
    }
}
