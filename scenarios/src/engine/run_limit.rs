use std::fmt;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Steps between two looks at the clock: a few milliseconds.
const LOOK_EVERY: u32 = 4_096;

/// Tells whether a run is to end early. It is asked on the thread that flies, once in a few milliseconds.
#[derive(Clone)]
pub struct Stop(Arc<dyn Fn() -> bool + Send + Sync>);

impl Stop {
    /// The run ends once `is_wanted` returns true. From then on it must return true.
    pub fn when(is_wanted: impl Fn() -> bool + Send + Sync + 'static) -> Self {
        Self(Arc::new(is_wanted))
    }

    pub(crate) fn is_wanted(&self) -> bool {
        (self.0)()
    }
}

impl fmt::Debug for Stop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Stop").finish_non_exhaustive()
    }
}

/// Wall-clock time that a run may take, for runs that would not end, and who may stop it. Whether a run is ended by these
/// depends on the computer; any other end of a run is deterministic.
#[derive(Debug)]
pub(crate) struct RunLimit {
    pub(crate) limit: Duration,
    started: Instant,
    steps: u32,
    stop: Option<Stop>,
}

impl RunLimit {
    /// Starts now.
    pub(crate) fn begin(limit: Duration) -> Self {
        Self {
            limit,
            started: Instant::now(),
            steps: 0,
            stop: None,
        }
    }

    /// Any time, until a stop is wanted.
    pub(crate) fn until(stop: Stop) -> Self {
        Self {
            stop: Some(stop),
            ..Self::begin(Duration::MAX)
        }
    }

    /// Whether the time is over, or the run is to stop. Call it at each step; it can't end a step that does not return.
    pub(crate) fn is_over(&mut self) -> bool {
        self.steps = (self.steps + 1) % LOOK_EVERY;
        self.steps == 0
            && (self.started.elapsed() >= self.limit
                || self.stop.as_ref().is_some_and(Stop::is_wanted))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_passed_limit_is_noticed_within_the_steps_between_looks() {
        let over_at = |limit| {
            let mut limit = RunLimit::begin(limit);
            (1..=LOOK_EVERY).find(|_| limit.is_over())
        };
        assert_eq!(over_at(Duration::ZERO), Some(LOOK_EVERY));
        assert_eq!(over_at(Duration::from_secs(3_600)), None);
    }
}
