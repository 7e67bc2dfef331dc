use std::time::Duration;

use muster_machines::identity::NodeId;
use muster_machines::node::Address;
use muster_machines::time::Timestamp;

use super::Violation;

/// Steps that a drone may take at one instant, for each node and each message that may wait for an actor. At one instant it
/// may hear every other node, and receive every message held back while it hung. Each leads to about ten steps. On a radio
/// without latency, answers fall into the same instant; hence a thousand times as many.
const STEPS_EACH_MAX: u64 = 10_000;

/// Rule 10: no machine spins. After a timeout, its next deadline lies after now. A drone takes a limited number of steps at
/// one instant. A run with a limit of wall-clock time ends within it.
#[derive(Debug)]
pub(crate) struct ProgressChecker {
    steps_max: u64,
}

impl ProgressChecker {
    /// For this many nodes, each of whose actors may have `waiting_max` messages queued.
    pub(crate) const fn new(nodes: u32, waiting_max: usize) -> Self {
        let sources = (nodes as u64).saturating_add(waiting_max as u64);
        Self {
            steps_max: STEPS_EACH_MAX.saturating_mul(sources),
        }
    }

    /// A machine was stepped; `is_overdue` is
    /// [`StepOutput::is_overdue`](muster_machines::node::StepOutput::is_overdue).
    pub(crate) fn stepped(
        at: Timestamp,
        drone: NodeId,
        address: Address,
        is_overdue: bool,
    ) -> Option<Violation> {
        is_overdue.then(|| Violation {
            rule: 10,
            at,
            drones: vec![drone],
            what: format!(
                "the {address} actor of drone {drone} handled a timeout and its next deadline is not after it"
            ),
        })
    }

    /// A drone has taken its `nth` step at this instant, from 1.
    pub(crate) fn steps(
        &self,
        at: Timestamp,
        drone: NodeId,
        address: Address,
        nth: u64,
    ) -> Option<Violation> {
        (nth > self.steps_max).then(|| Violation {
            rule: 10,
            at,
            drones: vec![drone],
            what: format!(
                "drone {drone} took more than {} steps at one instant, the last in its {address} actor",
                self.steps_max
            ),
        })
    }

    /// A run has used up its wall-clock time.
    pub(crate) fn overran(at: Timestamp, run_limit: Duration) -> Violation {
        Violation {
            rule: 10,
            at,
            drones: Vec::new(),
            what: format!(
                "the run did not end within {} s of wall-clock time",
                run_limit.as_secs_f64()
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_past_deadline_after_a_timeout_breaks_the_rule() {
        let stepped = |is_overdue| {
            ProgressChecker::stepped(Timestamp::ZERO, NodeId(3), Address::Mission, is_overdue)
        };
        assert_eq!(stepped(false), None);
        let found = stepped(true).unwrap();
        assert_eq!((found.rule, found.drones), (10, vec![NodeId(3)]));
        assert!(found.what.contains("mission"), "{}", found.what);
    }

    #[test]
    fn the_step_limit_grows_with_nodes_and_queued_messages() {
        let checker = ProgressChecker::new(5, 64);
        let steps = |nth| checker.steps(Timestamp::ZERO, NodeId(1), Address::Routing, nth);
        assert_eq!(steps(690_000), None);
        assert_eq!(steps(690_001).map(|found| found.rule), Some(10));
        let large = ProgressChecker::new(10_000, 64);
        assert_eq!(
            large.steps(Timestamp::ZERO, NodeId(1), Address::Routing, 690_001),
            None
        );
    }
}
