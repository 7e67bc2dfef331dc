use muster_machines::identity::NodeId;
use muster_machines::node::Address;
use muster_machines::time::Timestamp;

use super::Violation;

/// Rule 9: no actor fails, and no process ends, unless a fault makes it.
#[derive(Debug, Default)]
pub(crate) struct FailureChecker {
    /// The actor that the last event made panic.
    planned: Option<(NodeId, Address)>,
}

impl FailureChecker {
    /// The actor that is about to panic because of a fault, if any.
    pub(crate) const fn plan(&mut self, crashes: Option<(NodeId, Address)>) {
        self.planned = crashes;
    }

    /// An actor failed.
    pub(crate) fn failed(
        &mut self,
        at: Timestamp,
        drone: NodeId,
        address: Address,
    ) -> Option<Violation> {
        let is_planned = self.planned.take() == Some((drone, address));
        (!is_planned).then(|| Violation {
            rule: 9,
            at,
            drones: vec![drone],
            what: format!("the {address} actor of drone {drone} panicked without a fault"),
        })
    }
}

/// A process that ended in flight without a fault.
pub(crate) fn unplanned_end(at: Timestamp, drone: NodeId) -> Violation {
    Violation {
        rule: 9,
        at,
        drones: vec![drone],
        what: format!("the process of drone {drone} ended in flight without a fault"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_planned_failure_keeps_the_rule() {
        let (drone, mut checker) = (NodeId(3), FailureChecker::default());
        let mut fails = |address| checker.failed(Timestamp::ZERO, drone, address).is_some();
        assert!(fails(Address::Radio));
        checker.plan(Some((drone, Address::Radio)));
        let mut fails = |address| checker.failed(Timestamp::ZERO, drone, address).is_some();
        assert!(!fails(Address::Radio));
        assert!(fails(Address::Radio), "once");
    }
}
