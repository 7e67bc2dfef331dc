//! Frames on their way: sent, tampered with, and planned to arrive.

use bytes::Bytes;
use muster_machines::identity::NodeId;
use muster_machines::wire;
use muster_transport::{Arrival, Destination, Event, Transport};

use super::trace::Kind;
use super::{Origin, Planned, World};

impl World {
    pub(super) fn send(&mut self, drone: NodeId, to: Option<NodeId>, frame: &Bytes) {
        let covered = frame.len().saturating_sub(wire::AUTHENTICATOR_LEN);
        self.trace
            .bytes(self.now, drone, Kind::Sent, &frame[..covered]);
        self.tampering.record(drone, frame);
        if let Some(to) = to {
            self.trace
                .bytes(self.now, drone, Kind::Addressed, &to.0.to_le_bytes());
        }
        let to = to.map_or(Destination::Broadcast, Destination::To);
        self.medium
            .send(self.now, drone, to, frame)
            .expect("a radio sends no more than a datagram, and every drone has a place");
        self.follow_medium();
    }

    pub(super) fn wake_medium(&mut self) {
        // Another wake-up may have been planned before this one, and have done its work.
        if self.medium_wakes == Some(self.now) {
            self.medium_wakes = None;
            self.medium.handle_timeout(self.now);
            let retries = self.medium.counters().retries;
            for swarm in &mut self.swarms {
                swarm.recorder.retried(retries);
            }
            self.follow_medium();
        }
    }

    /// Plans what the medium says will come, and when it is to be asked again.
    pub(super) fn follow_medium(&mut self) {
        while let Some(event) = self.medium.poll_event() {
            match event {
                Event::Arrival(arrival) => self.plan_arrival(arrival),
                Event::Outcome(outcome) => {
                    self.heap.plan(outcome.at, Planned::Outcome(outcome));
                }
            }
        }
        if let Some(next) = self.medium.next_timeout()
            && self.medium_wakes.is_none_or(|planned| next < planned)
        {
            self.medium_wakes = Some(next);
            self.heap.plan(next, Planned::Medium);
        }
    }

    /// Plans what comes of a frame that arrives: that it does, as it was sent, where nobody tampers with any and there is no
    /// other swarm.
    pub(super) fn plan_arrival(&mut self, arrival: Arrival) {
        let (at, to) = (arrival.at, arrival.to);
        if self.swarms.len() == 1 && self.tampering.is_idle() {
            let arrive = Planned::Arrive {
                to,
                datagram: arrival.datagram,
                origin: Origin::Genuine,
            };
            return self.heap.plan(at, arrive);
        }
        let from = self.sender(&arrival.datagram);
        let is_told = from.is_none_or(|from| self.swarm(from).has(to));
        let (first, twin) = self.tampering.pass(from, arrival.datagram);
        for passage in std::iter::once(first).chain(twin) {
            let arrive = Planned::Arrive {
                to,
                datagram: passage.datagram,
                origin: if is_told {
                    passage.origin
                } else {
                    Origin::Spurious
                },
            };
            self.heap.plan(at + passage.late, arrive);
        }
    }
}
