//! From edges of an echo line to a range.

use std::time::Duration;

use muster_indoor::reading::Echo;
use muster_indoor::sensor::SOUND_MPS;

/// The echo line stays high for 38 ms if nothing comes back. Source: *HC-SR04 User Guide*, timing diagram.
const SILENCE: Duration = Duration::from_millis(38);

/// A change of an echo line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Edge {
    /// When, by the kernel's clock.
    pub at: Duration,
    /// Whether the line went high.
    pub is_rising: bool,
}

/// What one echo line said since its last ping.
#[derive(Debug, Clone, Copy, Default)]
pub struct EchoTimer {
    rising: Option<Duration>,
    width: Option<Duration>,
    is_broken: bool,
}

impl EchoTimer {
    /// Forgets all, for the next ping.
    pub fn restart(&mut self) {
        *self = Self::default();
    }

    /// Takes an edge, in the order of their times. An edge that misses its partner spoils the echo.
    pub fn edge(&mut self, edge: Edge) {
        match (edge.is_rising, self.rising, self.width) {
            (true, None, None) => self.rising = Some(edge.at),
            (false, Some(rising), None) if edge.at >= rising => self.width = Some(edge.at - rising),
            _ => self.is_broken = true,
        }
    }

    /// The echo, once the line has ended it.
    #[must_use]
    pub fn echo(&self) -> Option<Echo> {
        if self.is_broken {
            return Some(Echo::Failed);
        }
        let width = self.width?;
        Some(if width >= SILENCE {
            Echo::Silence
        } else {
            Echo::At(width.as_secs_f64() * SOUND_MPS / 2.0)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn echo(edges: &[(u64, bool)]) -> Option<Echo> {
        let mut timer = EchoTimer::default();
        for (micros, is_rising) in edges {
            timer.edge(Edge {
                at: Duration::from_micros(*micros),
                is_rising: *is_rising,
            });
        }
        timer.echo()
    }

    fn range_m(edges: &[(u64, bool)]) -> f64 {
        match echo(edges) {
            Some(Echo::At(range_m)) => range_m,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn fifty_eight_microseconds_are_a_centimetre() {
        // The user guide's rule, with 340 m/s.
        for centimetres in [2, 10, 100, 400] {
            let range_m = range_m(&[(500, true), (500 + 58 * centimetres, false)]);
            assert!((range_m * 100.0 - centimetres as f64).abs() < 0.01 * centimetres as f64);
        }
    }

    #[test]
    fn a_line_that_is_high_for_38_milliseconds_heard_nothing() {
        assert_eq!(echo(&[(450, true), (38_600, false)]), Some(Echo::Silence));
    }

    #[test]
    fn an_echo_that_has_not_ended_is_none() {
        assert_eq!(echo(&[]), None);
        assert_eq!(echo(&[(450, true)]), None);
    }

    #[test]
    fn lost_edges_fail_the_reading_and_not_the_next_one() {
        assert_eq!(echo(&[(450, false)]), Some(Echo::Failed));
        assert_eq!(echo(&[(450, true), (900, true)]), Some(Echo::Failed));
        assert_eq!(
            echo(&[(450, true), (1_600, false), (1_700, true)]),
            Some(Echo::Failed)
        );
        let mut timer = EchoTimer::default();
        timer.edge(Edge {
            at: Duration::ZERO,
            is_rising: false,
        });
        timer.restart();
        assert_eq!(timer.echo(), None);
    }

    #[test]
    fn a_clock_that_steps_back_fails_the_reading() {
        assert_eq!(echo(&[(450, true), (300, false)]), Some(Echo::Failed));
    }
}
