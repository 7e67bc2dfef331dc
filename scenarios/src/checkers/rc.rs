//! Rule 7: RC frames without gaps.

use std::time::Duration;

use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;

use super::Violation;

/// Longest gap between two RC frames to an armed controller over an open port. Betaflight takes its receiver for lost after
/// 150 ms.
pub const RC_GAP_MAX: Duration = Duration::from_millis(100);

/// The gaps between a drone's RC frames.
///
/// A port is open once the controller has said who it is. A gap counts while the controller is armed behind an open port, and
/// the drone's process runs with a link that neither hangs nor has failed for good. Once the controller's failsafe flies, or it
/// has told nothing for a second, RC must stop.
#[derive(Debug, Default)]
pub(crate) struct RcGaps {
    /// The newest frame, or when frames became due.
    since: Option<Timestamp>,
    longest: Duration,
}

impl RcGaps {
    /// An RC frame leaves.
    pub(crate) fn sent(&mut self, now: Timestamp) {
        if let Some(since) = self.since.replace(now) {
            self.longest = self.longest.max(now.since(since));
        }
    }

    /// Whether frames are due from now on, until the next call.
    pub(crate) fn look(&mut self, now: Timestamp, are_due: bool) {
        if !are_due {
            self.since = None;
            return;
        }
        let since = *self.since.get_or_insert(now);
        self.longest = self.longest.max(now.since(since));
    }

    /// The longest gap so far.
    pub(crate) const fn longest(&self) -> Duration {
        self.longest
    }

    /// Whether a gap of a drone was too long. To ask whenever frames were sent or looked for.
    pub(crate) fn check(&self, now: Timestamp, drone: NodeId) -> Option<Violation> {
        (self.longest >= RC_GAP_MAX).then(|| Violation {
            rule: 7,
            at: now,
            drones: vec![drone],
            what: format!(
                "the armed flight controller of drone {drone} got no RC frame for {} ms",
                self.longest.as_millis()
            ),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(milliseconds: u64) -> Timestamp {
        Timestamp::from_nanos(milliseconds * 1_000_000)
    }

    fn is_kept(gaps: &RcGaps) -> bool {
        gaps.check(at(0), NodeId(0)).is_none()
    }

    #[test]
    fn a_gap_of_a_tenth_of_a_second_while_armed_breaks_the_rule() {
        let mut gaps = RcGaps::default();
        for now in (0..1_000).step_by(20) {
            gaps.look(at(now), true);
            gaps.sent(at(now));
        }
        gaps.look(at(1_070), true);
        assert!(is_kept(&gaps));
        gaps.look(at(1_080), true);
        assert!(!is_kept(&gaps));
    }

    #[test]
    fn frames_that_are_not_due_may_be_missing() {
        let mut gaps = RcGaps::default();
        gaps.sent(at(0));
        gaps.look(at(10), false);
        gaps.look(at(5_000), true);
        gaps.look(at(5_090), true);
        assert!(is_kept(&gaps));
    }
}
