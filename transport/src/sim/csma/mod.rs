//! Medium access as in 802.11a: radios that listen before they talk, and take turns.

mod contention;
mod reception;
mod station;
mod timers;
mod timing;

use std::collections::VecDeque;
use std::num::NonZeroUsize;
use std::time::Duration;

use bytes::Bytes;
use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;
use rand::Rng;

use self::station::{Queued, Station, Unacknowledged};
use self::timers::{Timer, Timers};
use super::Counters;
use super::air::Air;
use crate::{Arrival, Destination, Event, Fate, Outcome, SendError};

/// The place of a frame in the table of those that are in the air.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct FrameId(usize);

/// A frame in the air.
#[derive(Debug)]
struct Frame {
    from: NodeId,
    kind: Kind,
    hearers: Vec<Hearer>,
}

#[derive(Debug, Clone, Copy)]
enum Kind {
    /// The first datagram of the sender's queue.
    Datagram(Destination),
    /// The answer to a datagram for one drone.
    Acknowledgement { to: NodeId },
}

#[derive(Debug, Clone, Copy)]
struct Hearer {
    id: NodeId,
    /// Whether the frame is lost on it though it hears it.
    is_damaged: bool,
}

/// A medium that radios share: carrier sense, back-off, collisions, acknowledgements.
///
/// A radio that a frame does not get to at all (too far, a fade, a burst) does not sense it either; one on which it is lost
/// (`loss`) does. Left out: propagation delay (1 µs at 300 m), the longer pause after a spoilt frame (EIFS), RTS/CTS,
/// rates other than 6 Mb/s. A frame costs the radios that hear it, and the logarithm of what is planned for each.
#[derive(Debug)]
pub(super) struct Csma {
    jitter: Duration,
    queue_max: NonZeroUsize,
    stations: Vec<Station>,
    frames: Vec<Frame>,
    /// Places of the table that are free, the last to be filled first.
    free: Vec<FrameId>,
    timers: Timers,
    counters: Counters,
    in_reach: Vec<NodeId>,
}

impl Csma {
    pub(super) fn new(jitter: Duration, queue_max: NonZeroUsize, radios: usize) -> Self {
        Self {
            jitter,
            queue_max,
            stations: (0..radios).map(|_| Station::new()).collect(),
            frames: Vec::new(),
            free: Vec::new(),
            timers: Timers::default(),
            counters: Counters::default(),
            in_reach: Vec::new(),
        }
    }

    pub(super) const fn counters(&self) -> Counters {
        self.counters
    }

    pub(super) fn next_timeout(&self) -> Option<Timestamp> {
        self.timers.next()
    }

    /// Puts a datagram in the sender's queue. A datagram that finds it full is dropped: what waits longer goes first.
    pub(super) fn send(
        &mut self,
        now: Timestamp,
        from: NodeId,
        to: Destination,
        datagram: &Bytes,
        air: &mut Air,
        events: &mut VecDeque<Event>,
    ) -> Result<(), SendError> {
        let Some(station) = self.stations.get_mut(from.0 as usize) else {
            return Err(SendError::UnknownSender(from));
        };
        let queued = Queued {
            to,
            datagram: datagram.clone(),
            arrived_at: Vec::new(),
        };
        if station.waiting() >= self.queue_max.get() {
            self.counters.dropped += 1;
            tell(now, from, queued, Fate::GivenUp, events);
            return Ok(());
        }
        let jitter = u64::try_from(self.jitter.as_nanos()).unwrap_or(u64::MAX);
        if jitter == 0 {
            station.push(queued, now);
            self.ready(now, from, air);
        } else {
            let late = Duration::from_nanos(air.rng.next_u64() % jitter);
            let ready_at = station.push(queued, now + late);
            self.timers.plan(ready_at, Timer::Ready(from));
        }
        Ok(())
    }

    pub(super) fn handle_timeout(
        &mut self,
        now: Timestamp,
        air: &mut Air,
        events: &mut VecDeque<Event>,
    ) {
        while let Some((at, timer)) = self.timers.pop_due(now) {
            match timer {
                Timer::Ready(id) => self.ready(at, id, air),
                Timer::Start(id) => self.start(at, id, air),
                Timer::End(frame) => self.end(at, frame, air, events),
                Timer::Acknowledge { by, to } => self.acknowledge(at, by, to, air),
                Timer::Expire(id) => self.expire(at, id, air, events),
            }
        }
    }

    fn ready(&mut self, now: Timestamp, id: NodeId, air: &mut Air) {
        self.station(id).ready(now, &mut air.rng);
        self.plan_start(id);
    }

    fn start(&mut self, now: Timestamp, id: NodeId, air: &mut Air) {
        let station = self.station(id);
        if !station.take_turn(now) {
            return;
        }
        let first = station
            .first()
            .expect("a turn is asked for while a datagram waits");
        let (to, len) = (first.to, first.datagram.len());
        self.counters.datagrams += 1;
        self.begin(now, id, Kind::Datagram(to), timing::airtime(len), air);
    }

    fn acknowledge(&mut self, now: Timestamp, by: NodeId, to: NodeId, air: &mut Air) {
        if !self.station(by).is_sending {
            self.counters.acknowledgements += 1;
            let kind = Kind::Acknowledgement { to };
            self.begin(now, by, kind, timing::acknowledgement_airtime(), air);
        }
    }

    /// A frame begins: whoever it gets to senses it, and makes it out if it can.
    fn begin(
        &mut self,
        now: Timestamp,
        from: NodeId,
        kind: Kind,
        airtime: Duration,
        air: &mut Air,
    ) {
        let frame = self.free.pop().unwrap_or_else(|| {
            self.frames.push(Frame {
                from,
                kind,
                hearers: Vec::new(),
            });
            FrameId(self.frames.len() - 1)
        });
        let sender = self.station(from);
        sender.is_sending = true;
        sender.reception.give_up();
        sender.contention.busy(now);

        let mut in_reach = std::mem::take(&mut self.in_reach);
        air.in_reach(from, &mut in_reach)
            .expect("every station has a place");
        let mut hearers = std::mem::take(&mut self.frames[frame.0].hearers);
        for id in in_reach.drain(..) {
            if air.carries(now, from, id) {
                let is_damaged = air.is_lost(from, id);
                hearers.push(Hearer { id, is_damaged });
                let hearer = self.station(id);
                hearer.reception.begins(now, frame, hearer.is_sending);
                hearer.contention.busy(now);
            }
        }
        self.in_reach = in_reach;
        self.frames[frame.0] = Frame {
            from,
            kind,
            hearers,
        };
        self.timers.plan(now + airtime, Timer::End(frame));
    }

    /// A frame is over: whoever made it out has it, and the medium is idle for whoever hears no other.
    fn end(&mut self, now: Timestamp, frame: FrameId, air: &mut Air, events: &mut VecDeque<Event>) {
        let Frame { from, kind, .. } = self.frames[frame.0];
        let mut hearers = std::mem::take(&mut self.frames[frame.0].hearers);
        self.station(from).is_sending = false;
        self.medium_changed(now, from);
        for Hearer { id, is_damaged } in hearers.drain(..) {
            let is_made_out = self.station(id).reception.ends(frame);
            self.medium_changed(now, id);
            if is_made_out && !is_damaged {
                self.received(now, id, from, kind, air, events);
            } else if is_made_out {
                self.counters.lost += 1;
            } else {
                self.counters.collided += 1;
            }
        }
        self.frames[frame.0].hearers = hearers;
        self.free.push(frame);
        match kind {
            Kind::Datagram(Destination::Broadcast) => {
                self.station(from).done(now, &mut air.rng);
                self.plan_start(from);
            }
            Kind::Datagram(Destination::To(_)) => {
                // The answer takes SIFS and its airtime; a slot more is for the way there and back.
                let until = now + answer_time() + timing::SLOT;
                self.station(from).awaits(until);
                self.timers.plan(until, Timer::Expire(from));
            }
            Kind::Acknowledgement { .. } => {}
        }
    }

    /// `id` made out a frame of `from` to its end.
    fn received(
        &mut self,
        now: Timestamp,
        id: NodeId,
        from: NodeId,
        kind: Kind,
        air: &mut Air,
        events: &mut VecDeque<Event>,
    ) {
        let (at, to) = (now, id);
        match kind {
            Kind::Datagram(destination) => {
                let first = self
                    .station(from)
                    .first()
                    .expect("what is in the air is in the queue");
                if !first.arrived_at.contains(&id) {
                    // A broadcast is never sent again.
                    if destination != Destination::Broadcast {
                        first.arrived_at.push(id);
                    }
                    let datagram = first.datagram.clone();
                    let source = None;
                    events.push_back(Event::Arrival(Arrival {
                        at,
                        to,
                        datagram,
                        source,
                        peer: None,
                    }));
                }
                match destination {
                    Destination::Broadcast => {}
                    Destination::To(other) if other == id => {
                        let answer = Timer::Acknowledge { by: id, to: from };
                        self.timers.plan(now + timing::SIFS, answer);
                    }
                    Destination::To(_) => {
                        let until = now + answer_time();
                        self.station(id).contention.reserve(now, until);
                        self.plan_start(id);
                    }
                }
            }
            Kind::Acknowledgement { to } if to == id => {
                let station = self.station(id);
                if station.is_awaiting()
                    && let Some(queued) = station.done(now, &mut air.rng)
                {
                    tell(now, id, queued, Fate::Delivered, events);
                    self.plan_start(id);
                }
            }
            Kind::Acknowledgement { .. } => {}
        }
    }

    fn expire(&mut self, now: Timestamp, id: NodeId, air: &mut Air, events: &mut VecDeque<Event>) {
        match self.station(id).unacknowledged(now, &mut air.rng) {
            Some(Unacknowledged::Retried) => self.counters.retries += 1,
            Some(Unacknowledged::GivenUp(queued)) => {
                self.counters.given_up += 1;
                tell(now, id, queued, Fate::GivenUp, events);
            }
            None => return,
        }
        self.plan_start(id);
    }

    /// A frame is over that `id` sent or heard.
    fn medium_changed(&mut self, now: Timestamp, id: NodeId) {
        let station = self.station(id);
        if station.is_idle() {
            station.contention.idle(now);
            self.plan_start(id);
        }
    }

    fn plan_start(&mut self, id: NodeId) {
        if let Some(start) = self.station(id).contention.start() {
            self.timers.plan(start, Timer::Start(id));
        }
    }

    fn station(&mut self, id: NodeId) -> &mut Station {
        &mut self.stations[id.0 as usize]
    }
}

/// How long an acknowledgement takes from the end of what it answers.
fn answer_time() -> Duration {
    timing::SIFS + timing::acknowledgement_airtime()
}

/// Tells the sender of a datagram for one drone what became of it.
fn tell(now: Timestamp, from: NodeId, queued: Queued, fate: Fate, events: &mut VecDeque<Event>) {
    if let Destination::To(to) = queued.to {
        events.push_back(Event::Outcome(Outcome {
            at: now,
            from,
            to,
            datagram: queued.datagram,
            fate,
        }));
    }
}

#[cfg(test)]
mod tests;
