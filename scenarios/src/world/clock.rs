use muster_machines::time::Timestamp;

/// A drone's own clock, which may run fast or slow.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Clock {
    /// The time of the world from which on it has run as it does.
    since: Timestamp,
    /// What it showed then.
    shown: Timestamp,
    /// How much it gains, in millionths.
    ppm: i32,
}

/// A rate of one, in millionths.
const UNIT: i64 = 1_000_000;

impl Clock {
    /// What it shows at a time of the world.
    pub(super) fn at(self, now: Timestamp) -> Timestamp {
        let elapsed = now.as_nanos().saturating_sub(self.since.as_nanos());
        let gone = match self.ppm {
            0 => elapsed,
            _ => nanos(u128::from(elapsed) * self.rate() / u128::from(UNIT.unsigned_abs())),
        };
        Timestamp::from_nanos(self.shown.as_nanos().saturating_add(gone))
    }

    /// The first time of the world at which it shows `shown` or later, as far as it runs on as it does.
    pub(super) fn when(self, shown: Timestamp) -> Timestamp {
        let ahead = shown.as_nanos().saturating_sub(self.shown.as_nanos());
        let elapsed = match self.ppm {
            0 => ahead,
            _ => nanos((u128::from(ahead) * u128::from(UNIT.unsigned_abs())).div_ceil(self.rate())),
        };
        Timestamp::from_nanos(self.since.as_nanos().saturating_add(elapsed))
    }

    /// From `now` on it gains `ppm` millionths.
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
    fn a_clock_that_was_never_skewed_shows_the_time() {
        let now = Timestamp::from_nanos(123_456_789);
        assert_eq!(Clock::default().at(now), now);
        assert_eq!(Clock::default().when(now), now);
    }

    #[test]
    fn a_fast_clock_gains_as_much_as_it_is_said_to() {
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
        fn a_timer_goes_off_once_its_time_is_shown_and_not_before(
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
