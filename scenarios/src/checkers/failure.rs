use muster_machines::identity::NodeId;
use muster_machines::node::Address;
use muster_machines::time::Timestamp;

use super::Violation;

/// Rule 9: an actor failed that nobody made fail.
pub(crate) fn unplanned_failure(at: Timestamp, drone: NodeId, address: Address) -> Violation {
    Violation {
        rule: 9,
        at,
        drones: vec![drone],
        what: format!("its actor {address:?} panicked, and no fault made it").to_lowercase(),
    }
}
