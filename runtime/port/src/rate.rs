//! How often something happens.

use std::time::Duration;

/// Counts what happens in each second.
#[derive(Debug, Default)]
pub(crate) struct Rate {
    /// The second of the last count.
    second: u64,
    /// What happened in it so far.
    count: u64,
    /// What happened in the second before it.
    before: u64,
}

impl Rate {
    pub(crate) fn count(&mut self, now: Duration) {
        self.before = self.per_second(now);
        if self.second != now.as_secs() {
            self.second = now.as_secs();
            self.count = 0;
        }
        self.count += 1;
    }

    /// How often it happened in the last whole second.
    pub(crate) fn per_second(&self, now: Duration) -> u64 {
        match now.as_secs().saturating_sub(self.second) {
            0 => self.before,
            1 => self.count,
            _ => 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rate_is_that_of_the_last_whole_second_and_zero_after_a_silent_one() {
        let at = |milliseconds| Duration::from_millis(milliseconds);
        let mut rate = Rate::default();
        for milliseconds in [1_000, 1_500, 1_999, 2_000] {
            rate.count(at(milliseconds));
        }
        assert_eq!(rate.per_second(at(2_001)), 3);
        assert_eq!(rate.per_second(at(3_000)), 1);
        assert_eq!(rate.per_second(at(4_000)), 0);
        rate.count(at(4_500));
        assert_eq!(rate.per_second(at(4_600)), 0);
    }
}
