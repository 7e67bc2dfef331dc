//! Values and failures that agents reported.

use muster_machines::agent::Observed;
use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;

/// Most values, and most failures, of agents that are kept. Later ones are left out.
const KEPT_MAX: usize = 100_000;

/// What the agents of a swarm have reported, in order of time.
///
/// Invariant: at most [`KEPT_MAX`] values and as many failures.
#[derive(Debug, Default)]
pub(super) struct AgentReports {
    observed: Vec<(Timestamp, NodeId, Observed)>,
    failures: Vec<(Timestamp, NodeId, String)>,
}

impl AgentReports {
    /// An agent reports a value.
    pub(super) fn observes(&mut self, now: Timestamp, id: NodeId, observed: &Observed) {
        if self.observed.len() < KEPT_MAX {
            self.observed.push((now, id, observed.clone()));
        }
    }

    /// An agent has failed.
    pub(super) fn failed(&mut self, now: Timestamp, id: NodeId, what: &str) {
        if self.failures.len() < KEPT_MAX {
            self.failures.push((now, id, what.to_owned()));
        }
    }

    pub(super) fn observed(&self) -> &[(Timestamp, NodeId, Observed)] {
        &self.observed
    }

    pub(super) fn failures(&self) -> &[(Timestamp, NodeId, String)] {
        &self.failures
    }
}
