//! How fast the picture plays: fast over most of a flight, slowly while a leader is elected.

use muster_scenarios::report::{Flight, MarkKind, Report};

/// Seconds that a picture takes, without what is slow and the rest at the end.
const PLAYED_S: f64 = 13.0;
/// What is seen before and after a death, in seconds of the flight.
const BEFORE_S: f64 = 22.0;
const AFTER_S: f64 = 66.0;
/// Slow parts are this long; around an election they begin and end this much before and after it.
const SLOW_PLAYED_S: f64 = 5.0;
const SLOW_MARGIN_S: f64 = 0.12;
/// A longer election is not slowed down.
const SLOW_MAX_S: f64 = 4.0;
/// Rest at the end, until it starts again.
const REST_S: f64 = 1.5;

/// Maps the flight's time to the picture's.
#[derive(Debug)]
pub(super) struct Clock {
    /// Pairs of flight time and picture time in seconds, rising.
    knots: Vec<(f64, f64)>,
    /// Length of the picture, in seconds.
    pub(super) total_s: f64,
    /// The part that is slow, in flight time.
    pub(super) slow_s: Option<(f64, f64)>,
}

impl Clock {
    /// Around the first death of a flight, or over all of it.
    pub(super) fn of(report: &Report, flight: &Flight) -> Self {
        let marks = &flight.history.marks;
        let death = marks.iter().find(|mark| mark.kind == MarkKind::Death);
        let death_s = death.map(|mark| mark.at.as_secs_f64());
        let end_s = report.simulated_s.max(1.0);
        let (from_s, to_s) = match death_s {
            Some(death_s) => (
                (death_s - BEFORE_S).max(0.0),
                (death_s + AFTER_S).min(end_s),
            ),
            None => (0.0, end_s),
        };
        // From the death to when all that were elected because of it lead and are followed.
        let settled_s = report.elections.iter().find_map(|election| {
            let settled_s = election.at_s + election.settled_after_s?;
            (settled_s >= death_s? && election.at_s <= death_s? + SLOW_MAX_S).then_some(settled_s)
        });
        let slow_s = death_s
            .zip(settled_s)
            .filter(|(death_s, settled_s)| settled_s - death_s <= SLOW_MAX_S);
        let slow_s = slow_s.map(|(death_s, settled_s)| {
            (
                (death_s - SLOW_MARGIN_S).max(from_s),
                (settled_s + 2.0 * SLOW_MARGIN_S).min(to_s),
            )
        });
        Self::new((from_s, to_s), slow_s)
    }

    fn new((from_s, to_s): (f64, f64), slow_s: Option<(f64, f64)>) -> Self {
        let slow_length_s = slow_s.map_or(0.0, |(from_s, to_s)| to_s - from_s);
        let speed = ((to_s - from_s - slow_length_s) / PLAYED_S).max(1.0);
        let mut knots = vec![(from_s, 0.0)];
        let mut add = |until_s: f64, speed: f64| {
            let (before_s, played_s) = knots[knots.len() - 1];
            if until_s > before_s {
                knots.push((until_s, played_s + (until_s - before_s) / speed));
            }
        };
        if let Some((from_s, to_s)) = slow_s {
            add(from_s, speed);
            add(to_s, (to_s - from_s) / SLOW_PLAYED_S);
        }
        add(to_s, speed);
        let played_s = knots.last().map_or(0.0, |(_, played_s)| *played_s);
        Self {
            total_s: played_s + REST_S,
            knots,
            slow_s,
        }
    }

    /// First and last time of the flight that are seen.
    pub(super) fn span_s(&self) -> (f64, f64) {
        let last = self.knots.len() - 1;
        (self.knots[0].0, self.knots[last].0)
    }

    /// Times of the flight at which the speed changes, and both ends.
    pub(super) fn knots_s(&self) -> impl Iterator<Item = f64> + '_ {
        self.knots.iter().map(|(at_s, _)| *at_s)
    }

    /// Whether a time of the flight is seen.
    pub(super) fn shows(&self, at_s: f64) -> bool {
        let (from_s, to_s) = self.span_s();
        (from_s..=to_s).contains(&at_s)
    }

    /// The share of the picture's length that has passed at a time of the flight.
    pub(super) fn share(&self, at_s: f64) -> f64 {
        let next = self.knots.partition_point(|(knot_s, _)| *knot_s < at_s);
        let Some(&(to_s, to)) = self.knots.get(next) else {
            return (self.total_s - REST_S) / self.total_s;
        };
        let Some(&(from_s, from)) = next.checked_sub(1).and_then(|at| self.knots.get(at)) else {
            return 0.0;
        };
        let played_s = from + (to - from) * (at_s - from_s) / (to_s - from_s);
        played_s / self.total_s
    }

    /// The share of the picture's length that a time of the picture is.
    pub(super) fn share_of_played(&self, played_s: f64) -> f64 {
        played_s / self.total_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_election_is_slow_and_the_rest_is_fast() {
        let clock = Clock::new((10.0, 88.5), Some((30.0, 30.5)));
        assert_eq!(clock.span_s(), (10.0, 88.5));
        let played_s = |at_s| clock.share(at_s) * clock.total_s;
        assert!((played_s(30.5) - played_s(30.0) - SLOW_PLAYED_S).abs() < 1e-9);
        assert!((played_s(88.5) - (PLAYED_S + SLOW_PLAYED_S)).abs() < 1e-9);
        assert!(played_s(5.0).abs() < 1e-9 && clock.share(1e6) < 1.0);
    }
}
