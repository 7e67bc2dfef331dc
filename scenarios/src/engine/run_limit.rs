use std::time::{Duration, Instant};

/// Steps between two looks at the clock: a few milliseconds.
const LOOK_EVERY: u32 = 4_096;

/// Wall-clock time that a run may take, for runs that would not end. Whether a run reaches it depends on the computer; any
/// other end of a run is deterministic.
#[derive(Debug)]
pub(crate) struct RunLimit {
    pub(crate) limit: Duration,
    started: Instant,
    steps: u32,
}

impl RunLimit {
    /// Starts now.
    pub(crate) fn begin(limit: Duration) -> Self {
        Self {
            limit,
            started: Instant::now(),
            steps: 0,
        }
    }

    /// Whether the time is over. Call it at each step; it can't end a step that does not return.
    pub(crate) fn is_over(&mut self) -> bool {
        self.steps = (self.steps + 1) % LOOK_EVERY;
        self.steps == 0 && self.started.elapsed() >= self.limit
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
