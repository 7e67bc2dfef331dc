//! A twin that follows the reports of processes at a fixed distance behind the clock.

use std::collections::BTreeMap;
use std::time::Duration;

use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;
use muster_scenarios::twin::{ProcessReport, Twin};

/// Time step of a twin, and how often it is to move on.
pub(super) const TICK: Duration = Duration::from_millis(5);

/// A twin, and the reports that it has not reached yet.
///
/// Invariant: it takes reports in the order of their times, if they arrive before it reaches them.
#[derive(Debug)]
pub(super) struct Follower {
    pub(super) twin: Twin,
    /// How far it is behind the clock.
    behind: Duration,
    /// The twin's time, since the start of the flight.
    time: Timestamp,
    /// By their times; those of the same time in the order of arrival.
    reports: BTreeMap<(Timestamp, u64), (NodeId, ProcessReport)>,
    pushed: u64,
}

impl Follower {
    pub(super) const fn new(twin: Twin, behind: Duration) -> Self {
        Self {
            twin,
            behind,
            time: Timestamp::ZERO,
            reports: BTreeMap::new(),
            pushed: 0,
        }
    }

    /// Adds a report of something that happened at `at`, since the start of the flight.
    pub(super) fn push(&mut self, at: Timestamp, drone: NodeId, report: ProcessReport) {
        self.pushed += 1;
        self.reports.insert((at, self.pushed), (drone, report));
    }

    /// Moves one step on, unless that is too near to `elapsed`, the time since the start of the flight. Returns whether it did.
    pub(super) fn step(&mut self, elapsed: Duration) -> bool {
        let until = Timestamp::ZERO + elapsed.saturating_sub(self.behind);
        let moves = self.time < until;
        if moves {
            let now = until.min(self.time + TICK);
            while let Some(first) = self.reports.first_entry()
                && first.key().0 <= now
            {
                let ((at, _), (drone, report)) = first.remove_entry();
                self.twin.receive(at, drone, report);
            }
            self.twin.advance(now);
            self.time = now;
        }
        moves
    }

    /// Moves on to where another follower is.
    pub(super) fn catch_up(&mut self, other: &Self) {
        let elapsed = other.time.since(Timestamp::ZERO) + self.behind;
        while self.step(elapsed) {}
    }

    /// The twin, once it has taken all reports.
    pub(super) fn finish(mut self) -> Twin {
        for ((at, _), (drone, report)) in self.reports {
            self.twin.receive(at, drone, report);
        }
        self.twin
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use muster_scenarios::scenario::load;

    use super::*;

    /// A drone that was not to end ends: that breaks rule 9 when it is taken in.
    #[test]
    fn a_late_report_counts_at_its_time_if_the_twin_is_not_there_yet() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenarios/thesis-1.toml");
        let scenario = load(Path::new(path), &[]).unwrap();
        let seconds = Duration::from_secs_f64;
        for (behind_s, counts_at_s) in [(0.05, 5.95), (3.0, 5.0)] {
            let twin = Twin::new(&scenario, seconds(0.05));
            let mut follower = Follower::new(twin, seconds(behind_s));
            while follower.step(seconds(6.0)) {}
            let at = Timestamp::from_secs_f64(5.0);
            follower.push(at, NodeId(2), ProcessReport::Ended);
            while follower.step(seconds(12.0)) {}
            let (report, _) = follower.finish().interrupt(&scenario, seconds(12.0));
            let found: Vec<_> = (report.violations.iter())
                .map(|it| (it.rule, it.at_s))
                .collect();
            assert_eq!(found, [(9, counts_at_s)]);
        }
    }
}
