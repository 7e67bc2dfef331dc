use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;

use super::Violation;

/// Rule 5: every drone ends on the ground, disarmed, within the bound; `armed` are those that did not.
pub(crate) fn check_landed(now: Timestamp, armed: Vec<NodeId>) -> Option<Violation> {
    (!armed.is_empty()).then(|| Violation {
        rule: 5,
        at: now,
        what: format!(
            "{} of the drones are still armed at the end of the time there is",
            armed.len()
        ),
        drones: armed,
    })
}
