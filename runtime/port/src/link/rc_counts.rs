//! How regularly RC is written.

use std::time::Duration;

use crate::rate::Rate;
use crate::status::Status;

/// RC frames written and acknowledged since the start.
///
/// Invariant: the longest gap is between two frames while sticks were given.
#[derive(Debug, Default)]
pub(super) struct RcCounts {
    sent: u64,
    acknowledged: u64,
    rate: Rate,
    /// When RC was written last, while sticks are given.
    last: Option<Duration>,
    gap_max: Duration,
}

impl RcCounts {
    /// No sticks are given.
    pub(super) const fn pause(&mut self) {
        self.last = None;
    }

    /// A frame was written.
    pub(super) fn written(&mut self, now: Duration) {
        self.sent += 1;
        self.rate.count(now);
        if let Some(before) = self.last.replace(now) {
            self.gap_max = self.gap_max.max(now - before);
        }
    }

    /// The controller acknowledged a frame.
    pub(super) const fn acknowledged(&mut self) {
        self.acknowledged += 1;
    }

    /// Enters the counts into a status.
    pub(super) fn enter(&self, now: Duration, status: &mut Status) {
        status.rc_sent = self.sent;
        status.rc_per_second = self.rate.per_second(now);
        status.rc_acknowledged = self.acknowledged;
        status.rc_gap_max = self.gap_max;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_without_sticks_is_no_gap() {
        let (at, mut rc) = (Duration::from_millis, RcCounts::default());
        rc.written(at(0));
        rc.written(at(20));
        rc.pause();
        rc.written(at(5_000));
        rc.acknowledged();
        let mut status = Status::default();
        rc.enter(at(5_000), &mut status);
        assert_eq!((status.rc_sent, status.rc_acknowledged), (3, 1));
        assert_eq!(status.rc_gap_max, at(20));
    }
}
