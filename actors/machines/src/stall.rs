//! A host that stalls: a machine is stepped much later than it asked to be.
//!
//! While its host stood still a drone heard nobody; that nobody was heard then says nothing about the others. Whoever
//! finds that it was stepped late gives everything that it was waiting for one more period.

use std::time::Duration;

use crate::time::Timestamp;

/// How late a deadline may be handled before that counts as a stall: twice the 50 ms after which an actor counts as hung,
/// and some ten times what a busy Linux without real-time scheduling delays a timer.
const LATE: Duration = Duration::from_millis(100);

/// When a machine asked to be stepped next, remembered so that it notices when that was late.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct StallDetector {
    asked: Option<Timestamp>,
}

impl StallDetector {
    /// To be told at the end of each step at `now`: when the machine wants to act next. A deadline that has passed
    /// already is handled at once, so it counts from `now`.
    #[inline]
    pub(crate) fn ask(&mut self, now: Timestamp, deadline: Option<Timestamp>) {
        self.asked = deadline.map(|deadline| deadline.max(now));
    }

    /// To be asked at the beginning of each step: by how much the host stalled, if it did. Messages come late with the
    /// timers, so any step tells.
    #[inline]
    pub(crate) fn stalled_for(self, now: Timestamp) -> Option<Duration> {
        let late = now.since(self.asked?);
        (late > LATE).then_some(late)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn at_ms(millis: u64) -> Timestamp {
        Timestamp::from_nanos(millis * 1_000_000)
    }

    fn asked(now_ms: u64, deadline_ms: Option<u64>) -> StallDetector {
        let mut stall_detector = StallDetector::default();
        stall_detector.ask(at_ms(now_ms), deadline_ms.map(at_ms));
        stall_detector
    }

    #[test]
    fn only_a_step_long_after_the_deadline_is_a_stall() {
        let stall_detector = asked(1_000, Some(1_500));
        for now_ms in [1_000, 1_500, 1_600] {
            assert_eq!(stall_detector.stalled_for(at_ms(now_ms)), None);
        }
        let stalled = stall_detector.stalled_for(at_ms(2_000));
        assert_eq!(stalled, Some(Duration::from_millis(500)));
    }

    #[test]
    fn a_deadline_in_the_past_counts_from_when_it_was_asked_for() {
        let stall_detector = asked(1_000, Some(200));
        assert_eq!(stall_detector.stalled_for(at_ms(1_050)), None);
        assert!(stall_detector.stalled_for(at_ms(1_200)).is_some());
    }

    #[test]
    fn whoever_asked_for_nothing_is_never_late() {
        assert_eq!(asked(0, None).stalled_for(at_ms(1_000_000)), None);
    }
}
