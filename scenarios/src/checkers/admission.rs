use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;

use super::Violation;

/// Rule 2: no drone follows a stranger, another swarm or a replay. A drone follows what its radio admits. So a radio must
/// admit no frame that its sender did not send, none of another swarm, and none twice.
#[derive(Debug, Default)]
pub(crate) struct AdmissionChecker {
    /// Whether the frame that a radio receives must not be admitted.
    is_spurious: bool,
}

impl AdmissionChecker {
    /// An actor is about to receive a message; a frame in it may be admitted if it is genuine.
    pub(crate) const fn receives(&mut self, is_genuine: bool) {
        self.is_spurious = !is_genuine;
    }

    /// A radio admits the frame that it has just received.
    pub(crate) fn admits(&self, now: Timestamp, drone: NodeId) -> Option<Violation> {
        self.is_spurious.then(|| Violation {
            rule: 2,
            at: now,
            drones: vec![drone],
            what: format!(
                "drone {drone} admitted a frame that was altered, replayed, forged, or another swarm's"
            ),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_admitted_frame_breaks_the_rule_unless_it_is_genuine() {
        let mut checker = AdmissionChecker::default();
        for is_genuine in [true, false, true] {
            checker.receives(is_genuine);
            let found = checker.admits(Timestamp::ZERO, NodeId(1));
            assert_eq!(found.is_some(), !is_genuine);
        }
    }
}
