use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;

use super::Violation;

/// Rule 5: all drones end on the ground, disarmed, within the time limit. `armed` are those that do not.
pub(crate) fn check(now: Timestamp, armed: Vec<NodeId>) -> Option<Violation> {
    (!armed.is_empty()).then(|| Violation {
        rule: 5,
        at: now,
        what: format!(
            "{} drones are still armed at the end of the run",
            armed.len()
        ),
        drones: armed,
    })
}
