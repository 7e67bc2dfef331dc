//! Values and failures that agents reported.

use std::collections::BTreeMap;

use muster_machines::agent::Observed;
use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;

/// Most values, and most failures, of agents that are kept. Later ones are left out, but the last of each name of a drone.
const KEPT_MAX: usize = 100_000;
/// Most names, over all drones, of which the last value is kept when [`KEPT_MAX`] are.
const NAMES_MAX: usize = 10_000;

/// What the agents of a swarm have reported.
///
/// Invariant: at most [`KEPT_MAX`] values and as many failures, in order of time. After those values come the last ones of at
/// most [`NAMES_MAX`] names, in any order.
#[derive(Debug, Default)]
pub(super) struct AgentReports {
    observed: Vec<(Timestamp, NodeId, Observed)>,
    /// Where in `observed` the last value of a drone's name is, after the first [`KEPT_MAX`].
    last: BTreeMap<(NodeId, String), usize>,
    failures: Vec<(Timestamp, NodeId, String)>,
}

impl AgentReports {
    /// An agent reports a value.
    pub(super) fn observes(&mut self, now: Timestamp, id: NodeId, observed: &Observed) {
        let value = (now, id, observed.clone());
        if self.observed.len() < KEPT_MAX {
            self.observed.push(value);
            return;
        }
        let name = (id, observed.name.clone());
        if let Some(place) = self.last.get(&name) {
            self.observed[*place] = value;
        } else if self.last.len() < NAMES_MAX {
            self.last.insert(name, self.observed.len());
            self.observed.push(value);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_too_many_values_the_last_of_each_name_are_kept() {
        let mut reports = AgentReports::default();
        let observed = |name: &str, value| Observed {
            name: name.to_owned(),
            value,
        };
        let total = KEPT_MAX as u64 + 10;
        for value in 0..total {
            let at = Timestamp::from_nanos(value);
            reports.observes(at, NodeId(1), &observed("finds", value as f64));
            reports.observes(at, NodeId(2), &observed("finds", -(value as f64)));
        }
        let last = |id| {
            let mut own = (reports.observed().iter().rev()).filter(|(_, of, _)| *of == NodeId(id));
            own.next().map(|(at, _, observed)| (*at, observed.value))
        };
        let (at, value) = (Timestamp::from_nanos(total - 1), (total - 1) as f64);
        assert_eq!([last(1), last(2)], [Some((at, value)), Some((at, -value))]);
        assert!(reports.observed().len() <= KEPT_MAX + 2);
    }
}
