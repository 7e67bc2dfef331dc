use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;

use super::Violation;

/// Rule 2: no drone obeys a stranger, another swarm, or a replay. What a drone's radio lets in is obeyed; so it must let
/// in nothing that its sender did not say, nothing that was said to another swarm, and nothing twice.
#[derive(Debug, Default)]
pub(crate) struct AdmissionChecker {
    /// Whether a radio is being told of a frame that it must not let in.
    is_spurious: bool,
}

impl AdmissionChecker {
    /// An actor is about to be told something: a frame that must not be let in, unless it is genuine.
    pub(crate) const fn told(&mut self, is_genuine: bool) {
        self.is_spurious = !is_genuine;
    }

    /// A drone's radio lets in what it was told of last.
    pub(crate) fn lets_in(&self, now: Timestamp, drone: NodeId) -> Option<Violation> {
        self.is_spurious.then(|| Violation {
            rule: 2,
            at: now,
            drones: vec![drone],
            what: format!(
                "drone {drone} let in a frame that was altered, replayed, made up by somebody, or another swarm's"
            ),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_forged_frame_that_is_let_in_is_found_and_a_genuine_one_is_not() {
        let mut checker = AdmissionChecker::default();
        for is_genuine in [true, false, true] {
            checker.told(is_genuine);
            let found = checker.lets_in(Timestamp::ZERO, NodeId(1));
            assert_eq!(found.is_some(), !is_genuine);
        }
    }
}
