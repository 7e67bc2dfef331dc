//! Frames in the air: sent, tampered with, and scheduled to arrive.

use std::time::Duration;

use bytes::Bytes;
use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;
use muster_machines::node::Envelope;
use muster_machines::{radio, wire};
use muster_transport::sim::{Counters, Medium};
use muster_transport::{Arrival, Destination, Event as MediumEvent, Transport};

use super::core::Core;
use super::event::Event;
use super::message::{Message, Origin};
use super::swarm::Swarms;
use super::tampering::{Tampering, paced};
use super::trace::{HEADING_LEN, Kind};
use crate::scenario::{LinkFault, Links, Tampered};
use crate::segments;
use muster_machines::time::Timestamp;

/// The medium that all radios share, and those who tamper with it.
///
/// Invariant: whenever the medium has a timeout, an event is scheduled for it, at `wakes_at`; what it yields is scheduled
/// at once.
#[derive(Debug)]
pub(super) struct Air {
    medium: Medium,
    wakes_at: Option<Timestamp>,
    tampering: Tampering,
    /// The frame that a radio receives in this step, if frames are recorded.
    received: Option<Bytes>,
}

impl Air {
    /// A medium without traffic; frames of `listened_to` are recorded, to be replayed or forged.
    pub(super) const fn new(medium: Medium, tampering: Tampering) -> Self {
        Self {
            medium,
            wakes_at: None,
            tampering,
            received: None,
        }
    }

    /// Sends a frame, to one drone or to all in range.
    pub(super) fn send(
        &mut self,
        core: &mut Core,
        from: NodeId,
        to: Option<NodeId>,
        frame: &Bytes,
    ) {
        let now = core.now();
        let covered = frame.len().saturating_sub(wire::AUTHENTICATOR_LEN);
        core.trace.bytes(now, from, Kind::Sent, &frame[..covered]);
        self.tampering.record(from, frame);
        if let Some(to) = to {
            (core.trace).bytes(now, from, Kind::Addressed, &to.0.to_le_bytes());
        }
        let to = to.map_or(Destination::Broadcast, Destination::To);
        self.medium
            .send(now, from, to, frame)
            .expect("a radio sends no more than a datagram, and every drone has a place");
        self.schedule(core);
    }

    /// The medium's timeout. An earlier event may have handled it.
    pub(super) fn wake(&mut self, core: &mut Core) {
        if self.wakes_at == Some(core.now()) {
            self.wakes_at = None;
            self.medium.handle_timeout(core.now());
            let retries = self.medium.counters().retries;
            core.swarms.retried(retries);
            self.schedule(core);
        }
    }

    /// Schedules what the medium yields, and its next timeout.
    fn schedule(&mut self, core: &mut Core) {
        while let Some(event) = self.medium.poll_event() {
            match event {
                MediumEvent::Arrival(arrival) => self.schedule_arrival(core, arrival),
                MediumEvent::Outcome(outcome) => {
                    core.schedule(outcome.at, Event::Outcome(outcome));
                }
            }
        }
        if let Some(next) = self.medium.next_timeout()
            && self.wakes_at.is_none_or(|scheduled| next < scheduled)
        {
            self.wakes_at = Some(next);
            core.schedule(next, Event::Medium);
        }
    }

    /// Schedules the arrival of a frame: as it was sent, unless frames are tampered with or there are other swarms.
    fn schedule_arrival(&mut self, core: &mut Core, arrival: Arrival) {
        let (at, to) = (arrival.at, arrival.to);
        if core.swarms.is_one() && self.tampering.is_idle() {
            let arrive = Event::Arrive {
                to,
                datagram: arrival.datagram,
                origin: Origin::Genuine,
            };
            return core.schedule(at, arrive);
        }
        let from = core.swarms.sender(&arrival.datagram);
        let is_own = from.is_none_or(|from| core.swarms.of(from).has(to));
        let (first, second) = self.tampering.pass(from, arrival.datagram);
        for passage in std::iter::once(first).chain(second) {
            let arrive = Event::Arrive {
                to,
                datagram: passage.datagram,
                origin: passage.origin.within(is_own),
            };
            core.schedule(at + passage.late, arrive);
        }
    }

    /// A frame reaches a radio: the message for it.
    pub(super) fn arrive(core: &mut Core, to: NodeId, datagram: Bytes, origin: Origin) -> Message {
        let covered = datagram.len().saturating_sub(wire::AUTHENTICATOR_LEN);
        let heading = &datagram[..covered.min(HEADING_LEN)];
        core.trace.bytes(core.now(), to, Kind::Arrived, heading);
        Message {
            envelope: Envelope::Radio(radio::Input::Received {
                datagram,
                source: None,
                peer: None,
            }),
            origin,
        }
    }

    /// An actor is about to receive a message. Returns whether a radio may admit the frame in it.
    pub(super) fn delivers(
        &mut self,
        swarms: &Swarms,
        to: NodeId,
        origin: Origin,
        envelope: &Envelope,
    ) -> bool {
        self.received = match envelope {
            Envelope::Radio(radio::Input::Received { datagram, .. })
                if self.tampering.listens() =>
            {
                Some(datagram.clone())
            }
            _ => None,
        };
        match origin {
            Origin::Genuine => true,
            Origin::Spurious => false,
            Origin::Replayed => self.received.as_ref().is_some_and(|frame| {
                let from = swarms.sender(frame);
                from.is_some_and(|from| !self.tampering.was_admitted(from, to, frame))
            }),
        }
    }

    /// A radio admits the frame that it has just received.
    pub(super) fn admitted(&mut self, swarms: &Swarms, by: NodeId) {
        if let Some(frame) = self.received.take()
            && let Some(from) = swarms.sender(&frame)
        {
            self.tampering.admitted(from, by, &frame);
        }
    }

    /// Sends a drone's recorded frames again, where it is.
    pub(super) fn replay(&self, core: &mut Core, of: NodeId) {
        self.play(core, of, self.tampering.recorded(of), Origin::Replayed);
    }

    /// Sends forged frames in a drone's name, where it is.
    pub(super) fn forge(&mut self, core: &mut Core, of: NodeId) {
        let forged = self.tampering.forgeries(of);
        self.play(core, of, forged, Origin::Spurious);
    }

    /// Schedules frames to arrive, one after another, at all who may hear a drone.
    fn play(&self, core: &mut Core, of: NodeId, frames: Vec<Bytes>, origin: Origin) {
        let ids = (0..core.swarms.nodes()).map(NodeId);
        let audience: Vec<NodeId> = ids
            .filter(|id| *id != of && self.medium.loss(of, *id) < 1.0)
            .collect();
        for (index, datagram) in (0..).zip(frames) {
            for to in audience.iter().copied() {
                let arrive = Event::Arrive {
                    to,
                    datagram: datagram.clone(),
                    origin: origin.within(core.swarms.of(of).has(to)),
                };
                core.schedule(paced(core.now(), index), arrive);
            }
        }
    }

    /// Changes the links between two groups of drones.
    pub(super) fn set_links(&mut self, core: &mut Core, links: &Links, link: LinkFault) {
        let (there, back) = match link {
            LinkFault::Cut => (Some(1.0), Some(1.0)),
            LinkFault::OneWay => (None, Some(1.0)),
            LinkFault::Degraded(loss) => (Some(loss), Some(loss)),
            LinkFault::Healed => (None, None),
        };
        for from in links.from.iter().copied() {
            for to in links.to.iter().copied() {
                self.medium.set_loss(from, to, there);
                self.medium.set_loss(to, from, back);
            }
        }
        core.swarms.links_changed(core.timeline.now(), links);
    }

    /// Begins to jam a disc, by the number of the fault.
    pub(super) fn jam(&mut self, fault: usize, centre: Ned, radius_m: f64) {
        self.medium.jam(jammer(fault), centre, radius_m);
    }

    pub(super) fn stop_jamming(&mut self, fault: usize) {
        self.medium.stop_jamming(jammer(fault));
    }

    /// Begins to tamper with frames, by the number of the fault.
    pub(super) fn tamper(&mut self, core: &mut Core, fault: usize, tampered: Tampered) {
        self.tampering.begin(fault, tampered);
        timing_changed(core, tampered);
    }

    pub(super) fn stop_tampering(&mut self, core: &mut Core, fault: usize) {
        if let Some(tampered) = self.tampering.end(fault) {
            timing_changed(core, tampered);
        }
    }

    /// Sets the position of a radio.
    pub(super) fn place(&mut self, id: NodeId, place: Ned) {
        self.medium.set_position(id, place);
    }

    /// The chance that a frame from one drone is not admitted by another, 0 to 1.
    pub(super) fn loss(&self, from: NodeId, to: NodeId) -> f64 {
        self.medium.loss(from, to)
    }

    /// A number that rises whenever a loss may have changed.
    pub(super) const fn changes(&self) -> u64 {
        self.medium.changes()
    }

    /// All links that are up or grey. Frames that are later by more than `tolerated` are as good as lost.
    pub(super) fn links(&mut self, tolerated: Duration) -> Vec<segments::Link> {
        let tampering = &self.tampering;
        segments::Link::all(&mut self.medium, |from| {
            [tampering.corrupted(from), tampering.late(from, tolerated)]
        })
    }

    pub(super) fn counters(&self) -> Counters {
        self.medium.counters()
    }
}

/// A delay has begun or ended: until the first late frame arrives, its sender is silent.
fn timing_changed(core: &mut Core, tampered: Tampered) {
    if tampered.how.delay_max().is_some() {
        let now = core.now();
        core.swarms.delays_changed(now, tampered.from);
    }
}

/// The medium's number for the jammer of a fault.
fn jammer(fault: usize) -> u32 {
    u32::try_from(fault).unwrap_or(u32::MAX)
}
