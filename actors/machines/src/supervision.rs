//! Decides when a failed actor is restarted: one for one, with back-off, up to a limit for each actor. The link to the
//! vehicle (the actor msp) restarts without back-off, up to a limit of its own: a flight controller waits 150 ms for RC
//! frames.

use std::collections::VecDeque;
use std::time::Duration;

use crate::flaw::{self, Flaw};
use crate::node::Address;
use crate::time::Timestamp;

/// Limits of restarts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RestartLimits {
    /// The most restarts of one actor within the window, except msp.
    pub restarts_max: u32,
    /// The most restarts of the actor msp within the window.
    pub msp_restarts_max: u32,
    /// How long a restart counts towards the limit.
    pub window: Duration,
    /// The pause before the second restart within the window; doubled for each further one.
    pub back_off: Duration,
    /// The longest pause.
    pub back_off_max: Duration,
}

/// What to do about a failed actor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum RestartDecision {
    /// Restart the actor.
    Restart {
        /// When to restart it.
        at: Timestamp,
    },
    /// It failed too often: land the drone.
    GiveUp,
}

/// The restarts of one drone's actors, counted for each actor.
#[derive(Debug, Clone)]
pub struct Supervision {
    limits: RestartLimits,
    /// Restarts within the window, by actor.
    recent: [VecDeque<Timestamp>; 5],
    given_up: bool,
}

impl Supervision {
    /// A supervision without failures.
    #[must_use]
    pub const fn new(limits: RestartLimits) -> Self {
        Self {
            limits,
            recent: [const { VecDeque::new() }; 5],
            given_up: false,
        }
    }

    /// Decides what to do about an actor that failed at `now`: its first failure in a window is answered with a restart
    /// at once, each further one later. The actor msp is always restarted at once: without it RC ends after 100 ms, and the
    /// flight controller's failsafe lands the drone. After the first [`RestartDecision::GiveUp`] no actor is restarted again.
    pub fn failed(&mut self, now: Timestamp, actor: Address) -> RestartDecision {
        let recent = &mut self.recent[actor as usize];
        while (recent.front()).is_some_and(|restart| now.since(*restart) > self.limits.window) {
            recent.pop_front();
        }
        let restarts_max = match actor {
            Address::Msp => self.limits.msp_restarts_max,
            _ => self.limits.restarts_max,
        };
        if self.given_up || recent.len() >= restarts_max as usize {
            self.given_up = true;
            return RestartDecision::GiveUp;
        }
        let pause = match recent.len() {
            _ if flaw::has(Flaw::IgnoresFailedActors) => Duration::MAX,
            0 => Duration::ZERO,
            _ if actor == Address::Msp => Duration::ZERO,
            before => {
                let doublings = u32::try_from(before - 1).unwrap_or(u32::MAX).min(30);
                (self.limits.back_off * 2_u32.pow(doublings)).min(self.limits.back_off_max)
            }
        };
        recent.push_back(now);
        RestartDecision::Restart { at: now + pause }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: RestartLimits = RestartLimits {
        restarts_max: 3,
        msp_restarts_max: 5,
        window: Duration::from_secs(10),
        back_off: Duration::from_millis(100),
        back_off_max: Duration::from_millis(150),
    };

    fn at(seconds: f64) -> Timestamp {
        Timestamp::from_secs_f64(seconds)
    }

    #[test]
    fn first_restart_is_immediate_and_later_ones_back_off() {
        let mut supervision = Supervision::new(LIMITS);
        let pauses: Vec<_> = [1.0, 2.0, 3.0]
            .map(|now| match supervision.failed(at(now), Address::Radio) {
                RestartDecision::Restart { at: then } => then - at(now),
                RestartDecision::GiveUp => panic!("within the limit"),
            })
            .into();
        assert_eq!(pauses, [0, 100, 150].map(Duration::from_millis));
    }

    #[test]
    fn link_to_the_vehicle_restarts_without_back_off_up_to_its_own_limit() {
        let mut supervision = Supervision::new(LIMITS);
        for now in [1.0, 2.0, 3.0, 4.0, 5.0].map(at) {
            let decision = supervision.failed(now, Address::Msp);
            assert_eq!(decision, RestartDecision::Restart { at: now });
        }
        let decision = supervision.failed(at(6.0), Address::Msp);
        assert_eq!(decision, RestartDecision::GiveUp);
    }

    #[test]
    fn too_many_failures_of_one_actor_give_up_for_good() {
        let mut supervision = Supervision::new(LIMITS);
        for now in [1.0, 2.0, 3.0] {
            assert_ne!(
                supervision.failed(at(now), Address::Radio),
                RestartDecision::GiveUp
            );
        }
        assert_eq!(
            supervision.failed(at(4.0), Address::Radio),
            RestartDecision::GiveUp
        );
        assert_eq!(
            supervision.failed(at(400.0), Address::Radio),
            RestartDecision::GiveUp
        );
    }

    #[test]
    fn restarts_count_for_each_actor() {
        let mut supervision = Supervision::new(LIMITS);
        for actor in Address::ALL {
            for now in [1.0, 2.0, 3.0] {
                assert_ne!(supervision.failed(at(now), actor), RestartDecision::GiveUp);
            }
        }
        let decision = supervision.failed(at(4.0), Address::Radio);
        assert_eq!(decision, RestartDecision::GiveUp);
    }

    #[test]
    fn restarts_outside_the_window_do_not_count() {
        let mut supervision = Supervision::new(LIMITS);
        for now in [1.0, 2.0, 3.0] {
            assert_ne!(
                supervision.failed(at(now), Address::Radio),
                RestartDecision::GiveUp
            );
        }
        let verdict = supervision.failed(at(14.0), Address::Radio);
        assert_eq!(verdict, RestartDecision::Restart { at: at(14.0) });
    }
}
