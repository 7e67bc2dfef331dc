//! What a supervisor does when an actor fails: one for one, with back-off, up to an intensity limit.

use std::collections::VecDeque;
use std::time::Duration;

use crate::flaw::{self, Flaw};
use crate::time::Timestamp;

/// When failed actors are restarted and when that is given up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RestartLimits {
    /// The most restarts of a drone's actors within the window.
    pub restarts_max: u32,
    /// How long a restart counts.
    pub window: Duration,
    /// The first pause before a restart that follows another; doubled for each further one within the window.
    pub back_off: Duration,
    /// The longest pause.
    pub back_off_max: Duration,
}

/// What is to be done about a failed actor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum RestartDecision {
    /// Restart it then.
    Restart {
        /// When.
        at: Timestamp,
    },
    /// It can't be kept alive: land.
    GiveUp,
}

/// The restarts of one drone's actors.
#[derive(Debug, Clone)]
pub struct Supervision {
    limits: RestartLimits,
    recent: VecDeque<Timestamp>,
    given_up: bool,
}

impl Supervision {
    /// A supervision that has seen no failure yet.
    #[must_use]
    pub const fn new(limits: RestartLimits) -> Self {
        Self {
            limits,
            recent: VecDeque::new(),
            given_up: false,
        }
    }

    /// Decides about an actor that failed at `now`.
    ///
    /// The first failure in a window is mended at once. Once it has given up it never restarts anything again.
    pub fn failed(&mut self, now: Timestamp) -> RestartDecision {
        while self
            .recent
            .front()
            .is_some_and(|restart| now.since(*restart) > self.limits.window)
        {
            self.recent.pop_front();
        }
        if self.given_up || self.recent.len() >= self.limits.restarts_max as usize {
            self.given_up = true;
            return RestartDecision::GiveUp;
        }
        let pause = match self.recent.len() {
            _ if flaw::has(Flaw::LeavesWhatFails) => Duration::MAX,
            0 => Duration::ZERO,
            before => {
                let doublings = u32::try_from(before - 1).unwrap_or(u32::MAX).min(30);
                (self.limits.back_off * 2_u32.pow(doublings)).min(self.limits.back_off_max)
            }
        };
        self.recent.push_back(now);
        RestartDecision::Restart { at: now + pause }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: RestartLimits = RestartLimits {
        restarts_max: 3,
        window: Duration::from_secs(10),
        back_off: Duration::from_millis(100),
        back_off_max: Duration::from_millis(150),
    };

    fn at(seconds: f64) -> Timestamp {
        Timestamp::from_secs_f64(seconds)
    }

    #[test]
    fn the_first_failure_is_mended_at_once_and_later_ones_wait_longer() {
        let mut supervision = Supervision::new(LIMITS);
        let pauses: Vec<_> = [1.0, 2.0, 3.0]
            .map(|now| match supervision.failed(at(now)) {
                RestartDecision::Restart { at: then } => then - at(now),
                RestartDecision::GiveUp => panic!("within the limit"),
            })
            .into();
        assert_eq!(pauses, [0, 100, 150].map(Duration::from_millis));
    }

    #[test]
    fn too_many_failures_in_a_window_are_given_up_for_good() {
        let mut supervision = Supervision::new(LIMITS);
        for now in [1.0, 2.0, 3.0] {
            assert_ne!(supervision.failed(at(now)), RestartDecision::GiveUp);
        }
        assert_eq!(supervision.failed(at(4.0)), RestartDecision::GiveUp);
        assert_eq!(supervision.failed(at(400.0)), RestartDecision::GiveUp);
    }

    #[test]
    fn restarts_older_than_the_window_do_not_count() {
        let mut supervision = Supervision::new(LIMITS);
        for now in [1.0, 2.0, 3.0] {
            assert_ne!(supervision.failed(at(now)), RestartDecision::GiveUp);
        }
        let verdict = supervision.failed(at(14.0));
        assert_eq!(verdict, RestartDecision::Restart { at: at(14.0) });
    }
}
