//! A simulated radio medium: positions, propagation, losses and medium access.

mod bursts;
mod channel;
mod csma;
mod disturbance;
mod gamma;
mod grid;
mod ideal;
mod propagation;

use std::collections::VecDeque;
use std::num::NonZeroUsize;
use std::time::Duration;

use bytes::Bytes;
use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;
use rand_chacha::ChaCha8Rng;

pub use self::bursts::Bursts;
use self::channel::Channel;
use self::csma::Csma;
use self::ideal::Ideal;
pub use self::propagation::Propagation;
use crate::{Destination, Event, SendError, Transport};

/// Configuration of a medium.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Config {
    /// Propagation model.
    pub propagation: Propagation,
    /// Additional loss probability, drawn for each frame and receiver; 0 to 1.
    pub loss: f64,
    /// Additional losses in bursts; if `None`, nothing is drawn for them.
    pub bursts: Option<Bursts>,
    /// Medium access.
    pub access: Access,
    /// Largest datagram, in bytes.
    pub datagram_max: usize,
}

/// Medium access: how radios share the medium.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Access {
    /// No sharing: frames never wait and never collide.
    Ideal {
        /// Shortest delay of a frame.
        latency: Duration,
        /// Largest additional delay, drawn for each frame and receiver.
        jitter: Duration,
    },
    /// 802.11a at 6 Mb/s: airtime, carrier sense, back-off, collisions of hidden terminals, half-duplex radios. Unicasts are
    /// acknowledged and sent up to 8 times. Radios overhear the unicasts of others.
    Csma {
        /// Largest delay of the sender's program before it passes a frame to its radio, drawn for each frame. Without it,
        /// drones that answer the same frame collide.
        jitter: Duration,
        /// Most datagrams in a radio's queue, including the one being sent; further ones are dropped.
        queue_max: NonZeroUsize,
    },
}

/// Counters of a shared medium, summed over all radios.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Data frames sent, including retries.
    pub datagrams: u64,
    /// Acknowledgements sent.
    pub acknowledgements: u64,
    /// Retries of frames without acknowledgement.
    pub retries: u64,
    /// Unicasts given up after the last retry.
    pub given_up: u64,
    /// Datagrams dropped for a full queue.
    pub dropped: u64,
    /// Frames that a radio sensed but did not decode: they collided, or it was sending.
    pub collided: u64,
    /// Frames that a radio decoded but lost to the configured loss.
    pub lost: u64,
}

/// A simulated medium.
///
/// The cost of a frame depends on the radios in reach, not on the size of the swarm: radios are sorted in memory by grid
/// squares as wide as the reach. Random draws come from the medium's own generator, for receivers in rising order.
#[derive(Debug)]
pub struct Medium {
    datagram_max: usize,
    channel: Channel,
    access: AccessState,
    events: VecDeque<Event>,
    changes: u64,
}

#[derive(Debug)]
enum AccessState {
    Ideal(Ideal),
    Csma(Box<Csma>),
}

impl Medium {
    /// A medium with a radio at each position, starting with drone 0.
    #[must_use]
    pub fn new(config: Config, rng: ChaCha8Rng, positions: &[Ned]) -> Self {
        Self {
            datagram_max: config.datagram_max,
            channel: Channel::new(&config, rng, positions),
            access: match config.access {
                Access::Ideal { latency, jitter } => {
                    AccessState::Ideal(Ideal::new(latency, jitter))
                }
                Access::Csma { jitter, queue_max } => {
                    AccessState::Csma(Box::new(Csma::new(jitter, queue_max, positions.len())))
                }
            },
            events: VecDeque::new(),
            changes: 0,
        }
    }

    /// Moves a drone's radio. The receivers of a frame are determined at its start.
    ///
    /// # Panics
    /// If the medium has no such drone.
    pub fn set_position(&mut self, id: NodeId, position: Ned) {
        self.changes += u64::from(self.channel.set_position(id, position));
    }

    /// Sets an additional loss probability of the frames from one radio to another; `None` removes it. With probability 1 the
    /// receiver does not even sense the frames.
    pub fn set_loss(&mut self, from: NodeId, to: NodeId, loss: Option<f64>) {
        self.changes += 1;
        self.channel.disturbance.set_loss(from, to, loss);
    }

    /// Starts a jammer: radios within a horizontal distance of `radius_m` metres of `centre` decode nothing until it is
    /// stopped. They still sense frames, and can be received outside of the area.
    pub fn jam(&mut self, jammer: u32, centre: Ned, radius_m: f64) {
        self.changes += 1;
        self.channel.disturbance.jam(jammer, centre, radius_m);
    }

    /// Stops a jammer, if it runs.
    pub fn stop_jamming(&mut self, jammer: u32) {
        self.changes += 1;
        self.channel.disturbance.stop_jamming(jammer);
    }

    /// The probability that a frame from one radio to another is lost, 0 to 1. It combines distance, configured loss, the
    /// long-term mean of bursts, and jammers or link faults, but not collisions. 1 for an unknown radio.
    #[must_use]
    pub fn loss(&self, from: NodeId, to: NodeId) -> f64 {
        self.channel.loss(from, to)
    }

    /// Visits each pair of radios in reach once, with the loss probabilities from the first to the second and back. All other
    /// pairs have a loss of 1. The order depends only on the history of positions.
    pub fn each_link(&mut self, visit: impl FnMut(NodeId, NodeId, [f64; 2])) {
        self.channel.each_link(visit);
    }

    /// A counter that rises whenever a loss probability may have changed.
    #[must_use]
    pub const fn changes(&self) -> u64 {
        self.changes
    }

    /// Counters since the start; all zero for an ideal medium.
    #[must_use]
    pub fn counters(&self) -> Counters {
        match &self.access {
            AccessState::Ideal(_) => Counters::default(),
            AccessState::Csma(csma) => csma.counters(),
        }
    }
}

impl Transport for Medium {
    fn datagram_max(&self) -> usize {
        self.datagram_max
    }

    fn send(
        &mut self,
        now: Timestamp,
        from: NodeId,
        to: Destination,
        datagram: &Bytes,
    ) -> Result<(), SendError> {
        if datagram.len() > self.datagram_max {
            return Err(SendError::TooLong {
                len: datagram.len(),
                max: self.datagram_max,
            });
        }
        if let Destination::To(to) = to
            && !self.channel.knows(to)
        {
            return Err(SendError::UnknownReceiver(to));
        }
        let (channel, events) = (&mut self.channel, &mut self.events);
        match &mut self.access {
            AccessState::Ideal(ideal) => ideal.send(now, from, to, datagram, channel, events),
            AccessState::Csma(csma) => csma.send(now, from, to, datagram, channel, events),
        }
    }

    fn next_timeout(&self) -> Option<Timestamp> {
        match &self.access {
            AccessState::Ideal(_) => None,
            AccessState::Csma(csma) => csma.next_timeout(),
        }
    }

    fn handle_timeout(&mut self, now: Timestamp) {
        if let AccessState::Csma(csma) = &mut self.access {
            csma.handle_timeout(now, &mut self.channel, &mut self.events);
        }
    }

    fn poll_event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }
}

#[cfg(test)]
mod tests;
