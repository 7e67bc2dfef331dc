//! One sonar: from its ping to a reading.

use std::time::Duration;

use muster_indoor::reading::{Echo, Mounting, Reading};
use muster_indoor::sensor::ECHO_MAX;

use super::edges::{EchoTimer, Edge};

/// What came of pings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// Echoes, and silences.
    pub echoes: u64,
    /// Pings of which an edge was lost, doubled or out of order.
    pub broken: u64,
    /// Pings of which the line did not end the echo in time, as without a sonar.
    pub overdue: u64,
    /// Edges of lines without a sonar, or of sonars that wait for none.
    pub stray: u64,
}

/// A sonar that waits for the echo of its ping, or for its turn.
#[derive(Debug)]
pub(super) struct Sonar {
    mounting: Mounting,
    timer: EchoTimer,
    /// When it was fired, if its echo has not ended.
    fired: Option<Duration>,
}

impl Sonar {
    pub(super) fn new(mounting: Mounting) -> Self {
        Self {
            mounting,
            timer: EchoTimer::default(),
            fired: None,
        }
    }

    pub(super) fn fire(&mut self, now: Duration) {
        self.timer.restart();
        self.fired = Some(now);
    }

    /// Takes an edge of its echo line.
    pub(super) fn edge(&mut self, edge: Edge, counts: &mut Counts) {
        if self.fired.is_none() {
            counts.stray += 1;
        }
        self.timer.edge(edge);
    }

    /// The reading, once it is there or no longer to be expected. It is used for as long as `used`.
    pub(super) fn reading(
        &mut self,
        now: Duration,
        used: Duration,
        counts: &mut Counts,
    ) -> Option<Reading> {
        let fired = self.fired?;
        let echo = match self.timer.echo() {
            Some(Echo::Failed) => {
                counts.broken += 1;
                Echo::Failed
            }
            Some(echo) => {
                counts.echoes += 1;
                echo
            }
            None if now.saturating_sub(fired) >= ECHO_MAX => {
                counts.overdue += 1;
                Echo::Failed
            }
            None => return None,
        };
        self.fired = None;
        Some(Reading {
            mounting: self.mounting,
            echo,
            taken: fired,
            expires: fired + used,
        })
    }
}

#[cfg(test)]
mod tests {
    use muster_indoor::frames::BodyXy;

    use super::*;

    const USED: Duration = Duration::from_millis(250);

    fn millis(millis: u64) -> Duration {
        Duration::from_millis(millis)
    }

    /// A sonar that was fired at 1,000 ms, and edges at these times.
    fn fired(edges: &[(u64, bool)], counts: &mut Counts) -> Sonar {
        let mut sonar = Sonar::new(Mounting::laser(BodyXy::new(0.0, 0.0), 0.0, 4.0));
        sonar.fire(millis(1_000));
        for (at, is_rising) in edges {
            let (at, is_rising) = (millis(*at), *is_rising);
            sonar.edge(Edge { at, is_rising }, counts);
        }
        sonar
    }

    #[test]
    fn an_echo_is_as_old_as_its_ping() {
        let mut counts = Counts::default();
        let mut sonar = fired(&[(1_001, true), (1_011, false)], &mut counts);
        let reading = sonar.reading(millis(1_020), USED, &mut counts).unwrap();
        assert_eq!(
            (reading.taken, reading.expires),
            (millis(1_000), millis(1_250))
        );
        assert!(reading.range_m(millis(1_020)).is_some());
        assert_eq!(sonar.reading(millis(1_021), USED, &mut counts), None);
        assert_eq!((counts.echoes, counts.broken, counts.overdue), (1, 0, 0));
    }

    #[test]
    fn what_is_bad_fails_its_reading_and_is_counted() {
        let mut counts = Counts::default();
        let mut sonar = fired(&[(1_001, false)], &mut counts);
        let reading = sonar.reading(millis(1_020), USED, &mut counts).unwrap();
        assert_eq!((reading.echo, counts.broken), (Echo::Failed, 1));
        let late = Edge {
            at: millis(1_030),
            is_rising: true,
        };
        sonar.edge(late, &mut counts);
        assert_eq!(counts.stray, 1);
    }

    #[test]
    fn a_sonar_that_answers_nothing_fails_before_it_can_be_fired_again() {
        let mut counts = Counts::default();
        let mut sonar = fired(&[], &mut counts);
        assert_eq!(sonar.reading(millis(1_044), USED, &mut counts), None);
        let reading = sonar.reading(millis(1_000) + ECHO_MAX, USED, &mut counts);
        assert_eq!(reading.unwrap().echo, Echo::Failed);
        assert_eq!(counts.overdue, 1);
    }
}
