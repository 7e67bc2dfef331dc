use bytes::Bytes;
use muster_machines::cell::Envelope;
use muster_machines::identity::NodeId;
use muster_machines::radio;
use muster_machines::time::Timestamp;

use super::Violation;

/// Rule 2: no drone obeys a stranger, another swarm, or a replay. What a drone's radio lets in is obeyed; so it must let
/// in nothing that its sender did not say, and nothing twice.
#[derive(Debug, Default)]
pub(crate) struct AdmissionChecker {
    /// What is on the way to a drone's radio and must not be let in.
    spurious: Vec<(NodeId, Bytes)>,
    /// Whether a radio is being told of such a frame.
    is_spurious: bool,
}

impl AdmissionChecker {
    /// A frame arrives that must not be let in; no other arrival has its bytes at the same place in memory.
    pub(crate) fn spurious(&mut self, drone: NodeId, datagram: &Bytes) {
        self.spurious.push((drone, datagram.clone()));
    }

    /// A drone's actor is about to be told something.
    pub(crate) fn told(&mut self, drone: NodeId, envelope: &Envelope) {
        self.is_spurious = false;
        if self.spurious.is_empty() {
            return;
        }
        if let Envelope::Radio(radio::Input::Received(datagram)) = envelope {
            let is_it = |it: &(NodeId, Bytes)| it.0 == drone && it.1.as_ptr() == datagram.as_ptr();
            if let Some(index) = self.spurious.iter().position(is_it) {
                self.spurious.swap_remove(index);
                self.is_spurious = true;
            }
        }
    }

    /// A drone's radio lets in what it was told of last.
    pub(crate) fn lets_in(&self, now: Timestamp, drone: NodeId) -> Option<Violation> {
        self.is_spurious.then(|| Violation {
            rule: 2,
            at: now,
            drones: vec![drone],
            what: format!(
                "drone {drone} let in a frame that was altered, replayed or made up by somebody"
            ),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(datagram: &Bytes) -> Envelope {
        Envelope::Radio(radio::Input::Received(datagram.clone()))
    }

    #[test]
    fn a_forged_frame_that_is_let_in_is_found_and_a_genuine_one_is_not() {
        let (genuine, forged) = (Bytes::from(vec![1; 9]), Bytes::from(vec![1; 9]));
        let mut checker = AdmissionChecker::default();
        checker.spurious(NodeId(1), &forged);
        for (drone, datagram, is_found) in [
            (1, &genuine, false),
            (2, &forged, false),
            (1, &forged, true),
            (1, &genuine, false),
        ] {
            checker.told(NodeId(drone), &told(datagram));
            let found = checker.lets_in(Timestamp::ZERO, NodeId(drone));
            assert_eq!(found.is_some(), is_found);
        }
    }
}
