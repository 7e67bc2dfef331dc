//! Medium access of 802.11a: carrier sense multiple access with collision avoidance.

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
use super::channel::Channel;
use crate::{Arrival, Destination, Event, Fate, Outcome, SendError};

/// Index of a frame in the table of frames on the air.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct FrameId(usize);

/// A frame on the air.
#[derive(Debug)]
struct Frame {
    from: NodeId,
    kind: Kind,
    receivers: Vec<Receiver>,
}

#[derive(Debug, Clone, Copy)]
enum Kind {
    /// The first datagram of the sender's queue.
    Datagram(Destination),
    /// The acknowledgement of a unicast.
    Acknowledgement { to: NodeId },
}

/// A radio that senses a frame.
#[derive(Debug, Clone, Copy)]
struct Receiver {
    id: NodeId,
    /// Whether the frame is lost there, though it is sensed.
    is_damaged: bool,
}

/// A shared medium with carrier sense, back-off, collisions and acknowledgements.
///
/// A radio that a frame does not reach (distance, fade, burst) does not sense it; one that loses it (`loss`) does. Not
/// modelled: propagation delay (1 µs at 300 m), the longer pause after a collision (EIFS), RTS/CTS, other rates than 6 Mb/s.
/// A frame costs as much as its receivers, times the logarithm of the number of timers.
#[derive(Debug)]
pub(super) struct Csma {
    jitter: Duration,
    queue_max: NonZeroUsize,
    stations: Vec<Station>,
    frames: Vec<Frame>,
    /// Free indices of the table; used last in, first out.
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

    /// Adds a datagram to the sender's queue. If the queue is full, the datagram is dropped.
    pub(super) fn send(
        &mut self,
        now: Timestamp,
        from: NodeId,
        to: Destination,
        datagram: &Bytes,
        channel: &mut Channel,
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
        if station.queue_len() >= self.queue_max.get() {
            self.counters.dropped += 1;
            report_outcome(now, from, queued, Fate::GivenUp, events);
            return Ok(());
        }
        let jitter = u64::try_from(self.jitter.as_nanos()).unwrap_or(u64::MAX);
        if jitter == 0 {
            station.push(queued, now);
            self.ready(now, from, channel);
        } else {
            let delay = Duration::from_nanos(channel.rng.next_u64() % jitter);
            let ready_at = station.push(queued, now + delay);
            self.timers.plan(ready_at, Timer::Ready(from));
        }
        Ok(())
    }

    pub(super) fn handle_timeout(
        &mut self,
        now: Timestamp,
        channel: &mut Channel,
        events: &mut VecDeque<Event>,
    ) {
        while let Some((at, timer)) = self.timers.pop_due(now) {
            match timer {
                Timer::Ready(id) => self.ready(at, id, channel),
                Timer::Start(id) => self.start_datagram(at, id, channel),
                Timer::End(frame) => self.end_frame(at, frame, channel, events),
                Timer::Acknowledge { by, to } => self.acknowledge(at, by, to, channel),
                Timer::Expire(id) => self.expire(at, id, channel, events),
            }
        }
    }

    fn ready(&mut self, now: Timestamp, id: NodeId, channel: &mut Channel) {
        self.station(id).ready(now, &mut channel.rng);
        self.plan_start(id);
    }

    fn start_datagram(&mut self, now: Timestamp, id: NodeId, channel: &mut Channel) {
        let station = self.station(id);
        if !station.try_start(now) {
            return;
        }
        let first = station
            .first()
            .expect("access is requested only while a datagram is queued");
        let (to, len) = (first.to, first.datagram.len());
        self.counters.datagrams += 1;
        self.start_frame(now, id, Kind::Datagram(to), timing::airtime(len), channel);
    }

    fn acknowledge(&mut self, now: Timestamp, by: NodeId, to: NodeId, channel: &mut Channel) {
        if !self.station(by).is_sending {
            self.counters.acknowledgements += 1;
            let kind = Kind::Acknowledgement { to };
            self.start_frame(now, by, kind, timing::acknowledgement_airtime(), channel);
        }
    }

    /// Starts a frame: the radios that it reaches sense it, and start to decode it if they can.
    fn start_frame(
        &mut self,
        now: Timestamp,
        from: NodeId,
        kind: Kind,
        airtime: Duration,
        channel: &mut Channel,
    ) {
        let frame = self.free.pop().unwrap_or_else(|| {
            self.frames.push(Frame {
                from,
                kind,
                receivers: Vec::new(),
            });
            FrameId(self.frames.len() - 1)
        });
        let sender = self.station(from);
        sender.is_sending = true;
        sender.reception.abort();
        sender.contention.busy(now);

        let mut in_reach = std::mem::take(&mut self.in_reach);
        channel
            .in_reach(from, &mut in_reach)
            .expect("every station has a position");
        let mut receivers = std::mem::take(&mut self.frames[frame.0].receivers);
        for id in in_reach.drain(..) {
            if channel.draw_reception(now, from, id) {
                let is_damaged = channel.draw_loss(from, id);
                receivers.push(Receiver { id, is_damaged });
                let receiver = self.station(id);
                receiver
                    .reception
                    .frame_starts(now, frame, receiver.is_sending);
                receiver.contention.busy(now);
            }
        }
        self.in_reach = in_reach;
        self.frames[frame.0] = Frame {
            from,
            kind,
            receivers,
        };
        self.timers.plan(now + airtime, Timer::End(frame));
    }

    /// Ends a frame: it is received where it was decoded, and the medium is idle where no other frame is sensed.
    fn end_frame(
        &mut self,
        now: Timestamp,
        frame: FrameId,
        channel: &mut Channel,
        events: &mut VecDeque<Event>,
    ) {
        let Frame { from, kind, .. } = self.frames[frame.0];
        let mut receivers = std::mem::take(&mut self.frames[frame.0].receivers);
        self.station(from).is_sending = false;
        self.medium_changed(now, from);
        for Receiver { id, is_damaged } in receivers.drain(..) {
            let is_decoded = self.station(id).reception.frame_ends(frame);
            self.medium_changed(now, id);
            if is_decoded && !is_damaged {
                self.received(now, id, from, kind, channel, events);
            } else if is_decoded {
                self.counters.lost += 1;
            } else {
                self.counters.collided += 1;
            }
        }
        self.frames[frame.0].receivers = receivers;
        self.free.push(frame);
        match kind {
            Kind::Datagram(Destination::Broadcast) => {
                self.station(from).done(now, &mut channel.rng);
                self.plan_start(from);
            }
            Kind::Datagram(Destination::To(_)) => {
                // SIFS and the acknowledgement's airtime, plus a slot for propagation.
                let until = now + acknowledgement_time() + timing::SLOT;
                self.station(from).await_acknowledgement(until);
                self.timers.plan(until, Timer::Expire(from));
            }
            Kind::Acknowledgement { .. } => {}
        }
    }

    /// Radio `id` has received a frame of `from`.
    fn received(
        &mut self,
        now: Timestamp,
        id: NodeId,
        from: NodeId,
        kind: Kind,
        channel: &mut Channel,
        events: &mut VecDeque<Event>,
    ) {
        let (at, to) = (now, id);
        match kind {
            Kind::Datagram(destination) => {
                let first = self
                    .station(from)
                    .first()
                    .expect("a datagram on the air is still in its queue");
                if !first.arrived_at.contains(&id) {
                    // A broadcast is never retried.
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
                        let timer = Timer::Acknowledge { by: id, to: from };
                        self.timers.plan(now + timing::SIFS, timer);
                    }
                    Destination::To(_) => {
                        let until = now + acknowledgement_time();
                        self.station(id).contention.reserve(now, until);
                        self.plan_start(id);
                    }
                }
            }
            Kind::Acknowledgement { to } if to == id => {
                let station = self.station(id);
                if station.is_awaiting()
                    && let Some(queued) = station.done(now, &mut channel.rng)
                {
                    report_outcome(now, id, queued, Fate::Delivered, events);
                    self.plan_start(id);
                }
            }
            Kind::Acknowledgement { .. } => {}
        }
    }

    fn expire(
        &mut self,
        now: Timestamp,
        id: NodeId,
        channel: &mut Channel,
        events: &mut VecDeque<Event>,
    ) {
        match self.station(id).unacknowledged(now, &mut channel.rng) {
            Some(Unacknowledged::Retried) => self.counters.retries += 1,
            Some(Unacknowledged::GivenUp(queued)) => {
                self.counters.given_up += 1;
                report_outcome(now, id, queued, Fate::GivenUp, events);
            }
            None => return,
        }
        self.plan_start(id);
    }

    /// A frame that `id` sent or sensed has ended.
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

/// Time from the end of a unicast to the end of its acknowledgement.
fn acknowledgement_time() -> Duration {
    timing::SIFS + timing::acknowledgement_airtime()
}

/// Reports the outcome of a unicast to its sender; does nothing for a broadcast.
fn report_outcome(
    now: Timestamp,
    from: NodeId,
    queued: Queued,
    fate: Fate,
    events: &mut VecDeque<Event>,
) {
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
