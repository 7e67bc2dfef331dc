//! Whether a release proves itself on a host: its drones run, are healthy and hear their peers, for long enough and in time.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use serde::{Deserialize, Serialize};

/// Time that a drone may be unhealthy after it was healthy. An answer that a busy machine delays is shorter.
const RELAPSE_MAX: Duration = Duration::from_secs(3);

/// Limits of a trial.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct GateLimits {
    /// Time for all drones to be healthy, in seconds.
    pub within_s: u32,
    /// Time that they must then stay so, in seconds.
    pub hold_s: u32,
}

/// How a drone's service does.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum DroneHealth {
    /// It is not yet known to be healthy, in words.
    Starting(String),
    /// It runs and reports no fault.
    Healthy {
        /// Drones that it has accepted frames of.
        proven: BTreeSet<u32>,
    },
    /// Its flight is over: by its journal it stays on the ground.
    FlightOver,
    /// It reports faults, in words.
    Unhealthy(String),
    /// Its process ended or was ended, in words.
    Dead(String),
}

/// What a gate says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Verdict {
    /// Not yet known.
    Pending,
    /// The release has proven itself.
    Passed,
    /// It has not; why, in words.
    Failed(String),
}

/// The gate of one trial. Times are since its start.
#[derive(Debug)]
pub(super) struct Gate {
    limits: GateLimits,
    /// Drones of other hosts that each drone must hear.
    peers: BTreeSet<u32>,
    healthy_since: Option<Duration>,
    /// When a drone was first seen unhealthy after all had been healthy.
    relapsed_since: Option<Duration>,
}

impl Gate {
    pub(super) const fn new(limits: GateLimits, peers: BTreeSet<u32>) -> Self {
        Self {
            limits,
            peers,
            healthy_since: None,
            relapsed_since: None,
        }
    }

    /// Judges what was seen of the drones `at` this time.
    pub(super) fn judge(&mut self, at: Duration, drones: &BTreeMap<u32, DroneHealth>) -> Verdict {
        let mut complaint = None;
        for (id, health) in drones {
            match self.complaint(health) {
                Some((words, true)) => return Verdict::Failed(format!("drone {id}: {words}")),
                Some((words, false)) => {
                    complaint = complaint.or(Some(format!("drone {id}: {words}")));
                }
                None => {}
            }
        }
        match complaint {
            None => self.healthy(at),
            Some(words) => self.not_healthy(at, &words),
        }
    }

    /// What is wrong with a drone, and whether that can't get better.
    fn complaint(&self, health: &DroneHealth) -> Option<(String, bool)> {
        match health {
            DroneHealth::Dead(words) => Some((words.clone(), true)),
            DroneHealth::Starting(words) | DroneHealth::Unhealthy(words) => {
                Some((words.clone(), false))
            }
            DroneHealth::FlightOver => None,
            DroneHealth::Healthy { proven } => {
                let missing: Vec<_> = self.peers.difference(proven).map(u32::to_string).collect();
                let words = || format!("has not proven itself to {}", missing.join(", "));
                (!missing.is_empty()).then(|| (words(), false))
            }
        }
    }

    fn healthy(&mut self, at: Duration) -> Verdict {
        self.relapsed_since = None;
        let since = *self.healthy_since.get_or_insert(at);
        if at.saturating_sub(since) >= seconds(self.limits.hold_s) {
            Verdict::Passed
        } else {
            Verdict::Pending
        }
    }

    fn not_healthy(&mut self, at: Duration, words: &str) -> Verdict {
        if self.healthy_since.is_none() {
            let is_late = at >= seconds(self.limits.within_s);
            let failed = || Verdict::Failed(format!("{words}, after {} s", self.limits.within_s));
            return if is_late { failed() } else { Verdict::Pending };
        }
        let since = *self.relapsed_since.get_or_insert(at);
        if at.saturating_sub(since) >= RELAPSE_MAX {
            return Verdict::Failed(format!("healthy at first, then not: {words}"));
        }
        Verdict::Pending
    }
}

fn seconds(seconds: u32) -> Duration {
    Duration::from_secs(seconds.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: GateLimits = GateLimits {
        within_s: 60,
        hold_s: 10,
    };

    fn proven<const N: usize>(peers: [u32; N]) -> DroneHealth {
        DroneHealth::Healthy {
            proven: peers.into(),
        }
    }

    /// The verdict and its time, if a drone with the peers 1 and 2 does as `health` says at each quarter of a second.
    fn verdict(health: impl Fn(f64) -> DroneHealth) -> (f64, Verdict) {
        let mut gate = Gate::new(LIMITS, BTreeSet::from([1, 2]));
        for quarter in 0..1_000 {
            let at = f64::from(quarter) / 4.0;
            let drones = BTreeMap::from([(0, health(at))]);
            match gate.judge(Duration::from_secs_f64(at), &drones) {
                Verdict::Pending => {}
                verdict => return (at, verdict),
            }
        }
        panic!("no verdict");
    }

    #[track_caller]
    fn assert_fails(verdict: &(f64, Verdict), at: f64, words: &str) {
        let failed = Verdict::Failed(format!("drone 0: {words}"));
        assert_eq!(verdict, &(at, failed));
    }

    #[test]
    fn healthy_release_passes_once_it_has_held() {
        let passed = verdict(|at| match at {
            ..5.0 => DroneHealth::Starting("starts".to_owned()),
            5.0..7.0 => proven([1]),
            _ => proven([1, 2, 3]),
        });
        assert_eq!(passed, (17.0, Verdict::Passed));
    }

    #[test]
    fn crash_fails_at_once() {
        let failed = verdict(|_| DroneHealth::Dead("ended with exit code 1".to_owned()));
        assert_fails(&failed, 0.0, "ended with exit code 1");
    }

    #[test]
    fn release_that_never_proves_itself_to_a_peer_fails_in_time() {
        let (at, failed) = verdict(|_| proven([1]));
        let words = "drone 0: has not proven itself to 2, after 60 s";
        assert_eq!((at, failed), (60.0, Verdict::Failed(words.to_owned())));
    }

    #[test]
    fn healthy_for_five_seconds_and_then_not_fails() {
        let failed = verdict(|at| match at {
            ..5.0 => proven([1, 2]),
            _ => DroneHealth::Unhealthy("an actor hangs".to_owned()),
        });
        let words = "healthy at first, then not: drone 0: an actor hangs";
        assert_eq!(failed, (8.0, Verdict::Failed(words.to_owned())));
    }

    #[test]
    fn short_relapse_is_forgiven() {
        let passed = verdict(|at| match at {
            5.0..6.0 => DroneHealth::Unhealthy("an answer is late".to_owned()),
            _ => proven([1, 2]),
        });
        assert_eq!(passed, (10.0, Verdict::Passed));
    }

    #[test]
    fn drone_on_the_ground_after_its_flight_needs_no_peer() {
        assert_eq!(verdict(|_| DroneHealth::FlightOver).1, Verdict::Passed);
    }
}
