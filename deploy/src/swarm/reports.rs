//! Reports of processes that the twin has not reached yet.

use std::collections::BTreeMap;

use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;
use muster_scenarios::twin::ProcessReport;

/// Reports in the order of their times; those of the same time in the order of arrival.
#[derive(Debug, Default)]
pub(super) struct ReportQueue {
    by_time: BTreeMap<(Timestamp, u64), (NodeId, ProcessReport)>,
    pushed: u64,
}

impl ReportQueue {
    /// Adds a report of something that happened at `at`, since the start of the flight.
    pub(super) fn push(&mut self, at: Timestamp, drone: NodeId, report: ProcessReport) {
        self.pushed += 1;
        self.by_time.insert((at, self.pushed), (drone, report));
    }

    /// Removes the first report that is due at `now`.
    pub(super) fn pop_due(&mut self, now: Timestamp) -> Option<(Timestamp, NodeId, ProcessReport)> {
        let first = self.by_time.first_entry()?;
        (first.key().0 <= now).then(|| {
            let ((at, _), (drone, report)) = first.remove_entry();
            (at, drone, report)
        })
    }

    /// Removes the first report, due or not.
    pub(super) fn pop(&mut self) -> Option<(Timestamp, NodeId, ProcessReport)> {
        let ((at, _), (drone, report)) = self.by_time.pop_first()?;
        Some((at, drone, report))
    }
}
