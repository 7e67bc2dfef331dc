//! Clocks of drones.

use muster_machines::time::Timestamp;

/// A drone's clock, which may run fast or slow.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Clock {
    /// When its rate last changed, in the world's time.
    since: Timestamp,
    /// The time that it showed then.
    shown: Timestamp,
    /// Its rate error in parts per million; it gains if positive.
    ppm: i32,
}

/// A rate of 1, in millionths.
const UNIT: i64 = 1_000_000;

impl Clock {
    /// The time that it shows at the world's time `now`.
    pub(super) fn at(self, now: Timestamp) -> Timestamp {
        let elapsed = now.as_nanos().saturating_sub(self.since.as_nanos());
        let shown = match self.ppm {
            0 => elapsed,
            _ => nanos(u128::from(elapsed) * self.rate() / u128::from(UNIT.unsigned_abs())),
        };
        Timestamp::from_nanos(self.shown.as_nanos().saturating_add(shown))
    }

    /// The world's first time at which it shows `shown` or later, at its present rate.
    pub(super) fn when(self, shown: Timestamp) -> Timestamp {
        let ahead = shown.as_nanos().saturating_sub(self.shown.as_nanos());
        let elapsed = match self.ppm {
            0 => ahead,
            _ => nanos((u128::from(ahead) * u128::from(UNIT.unsigned_abs())).div_ceil(self.rate())),
        };
        Timestamp::from_nanos(self.since.as_nanos().saturating_add(elapsed))
    }

    /// Sets its rate error from `now` on, in parts per million.
    pub(super) fn skew(&mut self, now: Timestamp, ppm: i32) {
        *self = Self {
            since: now,
            shown: self.at(now),
            ppm,
        };
    }

    fn rate(self) -> u128 {
        u128::from((UNIT + i64::from(self.ppm)).unsigned_abs())
    }
}

fn nanos(nanos: u128) -> u64 {
    u64::try_from(nanos).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_clock_without_skew_shows_the_time() {
        let now = Timestamp::from_nanos(123_456_789);
        assert_eq!(Clock::default().at(now), now);
        assert_eq!(Clock::default().when(now), now);
    }

    #[test]
    fn a_skewed_clock_gains_by_its_rate_error() {
        let mut clock = Clock::default();
        clock.skew(Timestamp::from_secs_f64(10.0), 50_000);
        let shown = clock.at(Timestamp::from_secs_f64(30.0));
        assert_eq!(shown, Timestamp::from_secs_f64(31.0));
        clock.skew(Timestamp::from_secs_f64(30.0), 0);
        let shown = clock.at(Timestamp::from_secs_f64(40.0));
        assert_eq!(shown, Timestamp::from_secs_f64(41.0));
    }

    proptest! {
        #[test]
        fn a_timer_expires_when_its_time_is_first_shown(
            ppm in -500_000..=500_000,
            since in 0_u64..1 << 40,
            ahead in 0_u64..1 << 40,
        ) {
            let mut clock = Clock::default();
            clock.skew(Timestamp::from_nanos(since), ppm);
            let deadline = clock.at(Timestamp::from_nanos(since)) + Duration::from_nanos(ahead);
            let when = clock.when(deadline);
            prop_assert!(clock.at(when) >= deadline);
            if ahead > 0 {
                let before = Timestamp::from_nanos(when.as_nanos() - 1);
                prop_assert!(clock.at(before) < deadline);
            }
        }
    }
}
