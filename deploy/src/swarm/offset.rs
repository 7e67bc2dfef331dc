//! How far a host's clock is from ours, and how sure that is: told from how long it takes to be told the time, as NTP does
//! (RFC 5905, section 8, with the clock filter of section 10).

use std::collections::VecDeque;
use std::time::Duration;

use muster_machines::time::Timestamp;

/// How many of the last answers count.
const ANSWERS_MAX: usize = 8;

/// By how much two clocks may drift apart, as a share of the time that goes by: crystals are within 50 ppm each.
const DRIFT: f64 = 100e-6;

/// A time that a host told.
#[derive(Debug, Clone, Copy)]
struct Answer {
    /// When it came in.
    at: Timestamp,
    /// How far ahead of ours the host's clock was, in nanoseconds.
    ahead_ns: i64,
    /// How long after it was asked for.
    round_trip: Duration,
}

/// How far a host's clock is from ours.
#[derive(Debug, Default)]
pub(super) struct Offset {
    /// The newest last.
    answers: VecDeque<Answer>,
}

impl Offset {
    /// Takes in that a host, asked at `asked`, said that it was `theirs`, which came in at `now`.
    pub(super) fn heard(&mut self, asked: Timestamp, theirs: Timestamp, now: Timestamp) {
        if self.answers.len() == ANSWERS_MAX {
            self.answers.pop_front();
        }
        let round_trip = now.since(asked);
        let ours = asked + round_trip / 2;
        self.answers.push_back(Answer {
            at: now,
            ahead_ns: nanos(theirs) - nanos(ours),
            round_trip,
        });
    }

    /// How far ahead of ours the host's clock is, in nanoseconds, and how sure that is at `now`: not at all, of a host that
    /// was never heard.
    pub(super) fn ahead_ns(&self, now: Timestamp) -> (i64, Duration) {
        let sure = |it: &Answer| it.round_trip / 2 + now.since(it.at).mul_f64(DRIFT);
        let best = self.answers.iter().min_by_key(|it| sure(it));
        best.map_or((0, Duration::MAX), |best| (best.ahead_ns, sure(best)))
    }

    /// What our clock says when the host's does, and how sure that is at `now`.
    pub(super) fn ours(&self, theirs: Timestamp, now: Timestamp) -> (Timestamp, Duration) {
        let (ahead_ns, sure) = self.ahead_ns(now);
        (ahead(theirs, ahead_ns.saturating_neg()), sure)
    }

    /// The longest round trip of the last answers.
    pub(super) fn longest_round_trip(&self) -> Duration {
        let all = self.answers.iter().map(|it| it.round_trip);
        all.max().unwrap_or_default()
    }
}

/// So much later, or earlier.
pub(super) fn ahead(at: Timestamp, ahead_ns: i64) -> Timestamp {
    Timestamp::from_nanos(at.as_nanos().saturating_add_signed(ahead_ns))
}

/// Enough until the year 2262.
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
    fn the_answer_with_the_shortest_way_tells_and_half_that_way_is_how_sure_it_is() {
        let mut offset = Offset::default();
        assert_eq!(offset.ours(ms(5), ms(5)).1, Duration::MAX);
        // An hour ahead; the second answer took 40 ms to come back, and 2 ms to get there.
        let hour = 3_600_000;
        offset.heard(ms(1_000), ms(hour + 1_002), ms(1_004));
        offset.heard(ms(2_000), ms(hour + 2_002), ms(2_042));
        let (ours, sure) = offset.ours(ms(hour + 2_002), ms(2_042));
        assert_eq!(ours, ms(2_002));
        assert!(
            sure >= Duration::from_millis(2) && sure < Duration::from_millis(3),
            "{sure:?}"
        );
        assert_eq!(offset.longest_round_trip(), Duration::from_millis(42));
    }

    #[test]
    fn an_old_answer_is_worth_less_than_a_new_one_for_clocks_drift() {
        let mut offset = Offset::default();
        offset.heard(ms(0), ms(1), ms(2));
        let later = ms(100_000);
        offset.heard(later, ms(100_007), ms(100_004));
        // 10 ms of drift in the meantime, against 2 ms of way.
        assert_eq!(offset.ours(ms(100_007), ms(100_004)).0, ms(100_002));
        // A clock that is behind ours.
        let mut behind = Offset::default();
        behind.heard(ms(5_000), ms(2_001), ms(5_002));
        assert_eq!(behind.ours(ms(2_001), ms(5_002)).0, ms(5_001));
    }

    #[test]
    fn only_the_last_answers_count() {
        let mut offset = Offset::default();
        offset.heard(ms(0), ms(0), ms(0));
        for n in 1..=8 {
            offset.heard(ms(n), ms(n + 500), ms(n + 2));
        }
        assert_eq!(offset.ours(ms(508), ms(10)).0, ms(9));
    }
}
