//! Detects a stalled host: a machine is stepped much later than its deadline.
//!
//! A stalled drone receives nothing, so the silence of others proves nothing. A machine that detects a stall restarts
//! its silence timeouts.

use std::time::Duration;

use crate::time::Timestamp;

/// Shortest delay of a deadline that counts as a stall: twice the 50 ms after which an actor counts as hung, and about
/// ten times the timer delay of a busy Linux without real-time scheduling.
pub(crate) const STALL_MIN: Duration = Duration::from_millis(100);

/// Remembers a machine's deadline to detect a late step.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct StallDetector {
    expected: Option<Timestamp>,
}

impl StallDetector {
    /// Call at the end of each step with the machine's next deadline. A deadline that has passed already counts from
    /// `now`.
    #[inline]
    pub(crate) fn expect_step(&mut self, now: Timestamp, deadline: Option<Timestamp>) {
        self.expected = deadline.map(|deadline| deadline.max(now));
    }

    /// Call at the start of each step. Returns by how much the host stalled; `None` if it did not. Inputs are delayed
    /// as timers are, so any step can detect a stall.
    #[inline]
    pub(crate) fn stalled_for(self, now: Timestamp) -> Option<Duration> {
        let late = now.since(self.expected?);
        (late > STALL_MIN).then_some(late)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn at_ms(millis: u64) -> Timestamp {
        Timestamp::from_nanos(millis * 1_000_000)
    }

    fn expecting(now_ms: u64, deadline_ms: Option<u64>) -> StallDetector {
        let mut stall_detector = StallDetector::default();
        stall_detector.expect_step(at_ms(now_ms), deadline_ms.map(at_ms));
        stall_detector
    }

    #[test]
    fn step_long_after_its_deadline_is_a_stall() {
        let stall_detector = expecting(1_000, Some(1_500));
        for now_ms in [1_000, 1_500, 1_600] {
            assert_eq!(stall_detector.stalled_for(at_ms(now_ms)), None);
        }
        let stalled = stall_detector.stalled_for(at_ms(2_000));
        assert_eq!(stalled, Some(Duration::from_millis(500)));
    }

    #[test]
    fn past_deadline_counts_from_the_step_that_set_it() {
        let stall_detector = expecting(1_000, Some(200));
        assert_eq!(stall_detector.stalled_for(at_ms(1_050)), None);
        assert!(stall_detector.stalled_for(at_ms(1_200)).is_some());
    }

    #[test]
    fn machine_without_deadline_never_stalls() {
        assert_eq!(expecting(0, None).stalled_for(at_ms(1_000_000)), None);
    }
}
