//! Gaps between RC frames.

use std::time::Duration;

use muster_machines::time::Timestamp;

/// RC frames over MSP that came to a controller.
#[derive(Debug, Clone, Copy, Default)]
pub struct RcFrames {
    newest: Option<Timestamp>,
    longest_gap: Duration,
}

impl RcFrames {
    /// Another frame has come.
    pub fn count(&mut self, now: Timestamp) {
        if let Some(before) = self.newest.replace(now) {
            self.longest_gap = self.longest_gap.max(now.since(before));
        }
    }

    /// The longest time without a frame since the last call, that up to now included. `None` before the first frame.
    pub fn take_gap(&mut self, now: Timestamp) -> Option<Duration> {
        let open = now.since(self.newest?);
        Some(std::mem::take(&mut self.longest_gap).max(open))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(milliseconds: u64) -> Timestamp {
        Timestamp::from_nanos(milliseconds * 1_000_000)
    }

    #[test]
    fn longest_gap_counts_once_and_the_open_one_always() {
        let mut frames = RcFrames::default();
        assert_eq!(frames.take_gap(at(50)), None);
        for now in [100, 120, 180, 200] {
            frames.count(at(now));
        }
        assert_eq!(frames.take_gap(at(210)), Some(Duration::from_millis(60)));
        assert_eq!(frames.take_gap(at(215)), Some(Duration::from_millis(15)));
        assert_eq!(frames.take_gap(at(300)), Some(Duration::from_millis(100)));
    }
}
