//! Offset of a host's clock from ours, and its uncertainty. Estimated from round trips like NTP (RFC 5905, section 8, with
//! the clock filter of section 10).

use std::collections::VecDeque;
use std::time::Duration;

use muster_machines::time::Timestamp;

/// Number of latest samples that the filter keeps.
const SAMPLES_MAX: usize = 8;

/// Largest relative drift of two clocks: their crystals are within 50 ppm each.
const DRIFT: f64 = 100e-6;

/// A measurement of a host's clock.
#[derive(Debug, Clone, Copy)]
struct Sample {
    /// Arrival of the answer, by our clock.
    at: Timestamp,
    /// How far the host's clock was ahead of ours, in nanoseconds.
    ahead_ns: i64,
    round_trip: Duration,
}

/// Estimate of the offset of a host's clock.
#[derive(Debug, Default)]
pub(super) struct Offset {
    /// Oldest first.
    samples: VecDeque<Sample>,
}

impl Offset {
    /// Adds a sample: the host, asked at `asked`, reported `host_time`; the answer arrived at `now`.
    pub(super) fn add_sample(&mut self, asked: Timestamp, host_time: Timestamp, now: Timestamp) {
        if self.samples.len() == SAMPLES_MAX {
            self.samples.pop_front();
        }
        let round_trip = now.since(asked);
        let local_time = asked + round_trip / 2;
        self.samples.push_back(Sample {
            at: now,
            ahead_ns: nanos(host_time) - nanos(local_time),
            round_trip,
        });
    }

    /// How far the host's clock is ahead of ours, in nanoseconds, and the uncertainty at `now`: [`Duration::MAX`] without
    /// samples.
    pub(super) fn ahead_ns(&self, now: Timestamp) -> (i64, Duration) {
        let uncertainty = |it: &Sample| it.round_trip / 2 + now.since(it.at).mul_f64(DRIFT);
        let best = self.samples.iter().min_by_key(|it| uncertainty(it));
        best.map_or((0, Duration::MAX), |best| {
            (best.ahead_ns, uncertainty(best))
        })
    }

    /// Converts a time of the host's clock into ours, with the uncertainty at `now`.
    pub(super) fn local_time_of(
        &self,
        host_time: Timestamp,
        now: Timestamp,
    ) -> (Timestamp, Duration) {
        let (ahead_ns, uncertainty) = self.ahead_ns(now);
        (add_nanos(host_time, ahead_ns.saturating_neg()), uncertainty)
    }

    /// Longest round trip of the latest samples.
    pub(super) fn longest_round_trip(&self) -> Duration {
        let all = self.samples.iter().map(|it| it.round_trip);
        all.max().unwrap_or_default()
    }
}

/// Adds signed nanoseconds; saturates.
pub(super) fn add_nanos(at: Timestamp, nanos: i64) -> Timestamp {
    Timestamp::from_nanos(at.as_nanos().saturating_add_signed(nanos))
}

/// Exact until the year 2262.
fn nanos(at: Timestamp) -> i64 {
    i64::try_from(at.as_nanos()).unwrap_or(i64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(ms: u64) -> Timestamp {
        Timestamp::from_nanos(ms * 1_000_000)
    }

    #[test]
    fn shortest_round_trip_gives_the_offset_and_its_half_the_uncertainty() {
        let mut offset = Offset::default();
        assert_eq!(offset.local_time_of(ms(5), ms(5)).1, Duration::MAX);
        // The host is an hour ahead. The second ping took 2 ms out and 40 ms back.
        let hour = 3_600_000;
        offset.add_sample(ms(1_000), ms(hour + 1_002), ms(1_004));
        offset.add_sample(ms(2_000), ms(hour + 2_002), ms(2_042));
        let (local, uncertainty) = offset.local_time_of(ms(hour + 2_002), ms(2_042));
        assert_eq!(local, ms(2_002));
        assert!(
            uncertainty >= Duration::from_millis(2) && uncertainty < Duration::from_millis(3),
            "{uncertainty:?}"
        );
        assert_eq!(offset.longest_round_trip(), Duration::from_millis(42));
    }

    #[test]
    fn drift_makes_old_samples_less_certain_than_new_ones() {
        let mut offset = Offset::default();
        offset.add_sample(ms(0), ms(1), ms(2));
        let later = ms(100_000);
        offset.add_sample(later, ms(100_007), ms(100_004));
        // 10 ms of drift since the first sample outweigh half a round trip of 2 ms.
        assert_eq!(
            offset.local_time_of(ms(100_007), ms(100_004)).0,
            ms(100_002)
        );
        // A clock behind ours.
        let mut behind = Offset::default();
        behind.add_sample(ms(5_000), ms(2_001), ms(5_002));
        assert_eq!(behind.local_time_of(ms(2_001), ms(5_002)).0, ms(5_001));
    }

    #[test]
    fn only_the_latest_samples_count() {
        let mut offset = Offset::default();
        offset.add_sample(ms(0), ms(0), ms(0));
        for n in 1..=8 {
            offset.add_sample(ms(n), ms(n + 500), ms(n + 2));
        }
        assert_eq!(offset.local_time_of(ms(508), ms(10)).0, ms(9));
    }
}
