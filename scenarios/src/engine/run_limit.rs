use std::time::{Duration, Instant};

/// Steps between two looks at the clock, some milliseconds.
const LOOK_EVERY: u32 = 4_096;

/// Wall-clock time that a run may take. This is for runs that never end: whether a run reaches its limit depends on the machine,
/// while any other end of a run is the same each time.
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

    /// Whether the time is over. To be asked at each step; a step that never returns is not ended.
    pub(crate) fn is_over(&mut self) -> bool {
        self.steps = (self.steps + 1) % LOOK_EVERY;
        self.steps == 0 && self.started.elapsed() >= self.limit
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_that_has_passed_is_noticed_within_so_many_steps() {
        let over_at = |limit| {
            let mut limit = RunLimit::begin(limit);
            (1..=LOOK_EVERY).find(|_| limit.is_over())
        };
        assert_eq!(over_at(Duration::ZERO), Some(LOOK_EVERY));
        assert_eq!(over_at(Duration::from_secs(3_600)), None);
    }
}
