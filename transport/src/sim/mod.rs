//! A simulated medium: radios at places, what each hears of the others, and when.

mod air;
mod bursts;
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

use self::air::Air;
pub use self::bursts::Bursts;
use self::csma::Csma;
use self::ideal::Ideal;
pub use self::propagation::Propagation;
use crate::{Destination, Event, SendError, Transport};

/// What a medium is like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Config {
    /// How far radios carry.
    pub propagation: Propagation,
    /// The share of frames that each receiver misses besides, drawn for each frame and receiver; 0 to 1.
    pub loss: f64,
    /// What is lost besides, in bursts; `None` if losses don't come in bursts, and then nothing is drawn for it.
    pub bursts: Option<Bursts>,
    /// How radios share the medium.
    pub access: Access,
    /// The largest datagram, in bytes.
    pub datagram_max: usize,
}

/// How radios share the medium.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Access {
    /// They need not: frames never wait for each other and never collide.
    Ideal {
        /// How long a frame takes at least.
        latency: Duration,
        /// How much longer it may take, drawn for each frame and receiver.
        jitter: Duration,
    },
    /// As in 802.11a at 6 Mb/s: frames take their airtime, radios sense the carrier and back off, hidden terminals
    /// collide, a radio that sends does not hear, and what is for one drone is acknowledged and tried up to 8 times.
    /// Radios listen to what is for others too.
    Csma {
        /// How much longer the sender's own program may take before it hands a frame to its radio, drawn for each
        /// frame. Without it, drones that answer the same frame do so at one instant and collide.
        jitter: Duration,
        /// The most datagrams that wait in a radio, the one that is being sent included; one more is dropped.
        queue_max: NonZeroUsize,
    },
}

/// What radios that share a medium have done, all of them together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Frames with a datagram that went on the air, those sent again included.
    pub datagrams: u64,
    /// Acknowledgements that did.
    pub acknowledgements: u64,
    /// Frames that were sent again for want of one.
    pub retries: u64,
    /// Datagrams for one drone that were given up after the last try.
    pub given_up: u64,
    /// Datagrams that found the queue full.
    pub dropped: u64,
    /// Frames that a radio heard and could not make out: others were in the air, or it was sending itself.
    pub collided: u64,
    /// Frames that a radio made out and that were lost on it, by the configured share.
    pub lost: u64,
}

/// A medium that carries datagrams between places.
///
/// A frame costs as much as the radios in reach, whatever the size of the swarm: they lie in memory by
/// squares as wide as the reach. Lots are drawn from the medium's own generator, for the receivers in rising order.
#[derive(Debug)]
pub struct Medium {
    datagram_max: usize,
    air: Air,
    sharing: Sharing,
    events: VecDeque<Event>,
    changes: u64,
}

#[derive(Debug)]
enum Sharing {
    Ideal(Ideal),
    Csma(Box<Csma>),
}

impl Medium {
    /// A medium with a radio at each of `places`, drone 0's first.
    #[must_use]
    pub fn new(config: Config, rng: ChaCha8Rng, places: &[Ned]) -> Self {
        Self {
            datagram_max: config.datagram_max,
            air: Air::new(&config, rng, places),
            sharing: match config.access {
                Access::Ideal { latency, jitter } => Sharing::Ideal(Ideal::new(latency, jitter)),
                Access::Csma { jitter, queue_max } => {
                    Sharing::Csma(Box::new(Csma::new(jitter, queue_max, places.len())))
                }
            },
            events: VecDeque::new(),
            changes: 0,
        }
    }

    /// Puts a drone's radio elsewhere. Who hears a frame is decided when it begins.
    ///
    /// # Panics
    /// When the medium was built without that drone.
    pub fn place(&mut self, id: NodeId, place: Ned) {
        self.changes += u64::from(self.air.place(id, place));
    }

    /// Lets a share of the frames from one radio to another be lost besides what is lost anyway, from now on; with
    /// nothing the link is as it was. Where all are lost the receiver does not even sense them.
    pub fn set_loss(&mut self, from: NodeId, to: NodeId, loss: Option<f64>) {
        self.changes += 1;
        self.air.disturbance.set_loss(from, to, loss);
    }

    /// Starts a jammer: radios within `radius_m` metres of `centre` over ground make nothing out, until that jammer
    /// is stopped. They sense frames as before, and what they send is heard where no jammer is.
    pub fn jam(&mut self, jammer: u32, centre: Ned, radius_m: f64) {
        self.changes += 1;
        self.air.disturbance.jam(jammer, centre, radius_m);
    }

    /// Stops a jammer, if there is such a one.
    pub fn stop_jamming(&mut self, jammer: u32) {
        self.changes += 1;
        self.air.disturbance.stop_jamming(jammer);
    }

    /// The chance that a frame from one radio is lost on its way to another as things are now, 0 to 1: by the distance,
    /// by the configured share, by bursts in the long run, and by what disturbs the link. What others send at the same time is not in it. 1 for a
    /// radio that is not there.
    #[must_use]
    pub fn loss(&self, from: NodeId, to: NodeId) -> f64 {
        self.air.loss(from, to)
    }

    /// Visits every two radios that may hear each other once, with that chance for frames of the first to the second, and
    /// of the second to the first; between all others each frame is lost. The order depends on nothing but where radios
    /// have been.
    pub fn each_link(&mut self, visit: impl FnMut(NodeId, NodeId, [f64; 2])) {
        self.air.each_link(visit);
    }

    /// A number that rises whenever those chances may be others than before.
    #[must_use]
    pub const fn changes(&self) -> u64 {
        self.changes
    }

    /// What the radios have done so far; an ideal medium does not count.
    #[must_use]
    pub fn counters(&self) -> Counters {
        match &self.sharing {
            Sharing::Ideal(_) => Counters::default(),
            Sharing::Csma(csma) => csma.counters(),
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
            && !self.air.knows(to)
        {
            return Err(SendError::UnknownReceiver(to));
        }
        let (air, events) = (&mut self.air, &mut self.events);
        match &mut self.sharing {
            Sharing::Ideal(ideal) => ideal.send(now, from, to, datagram, air, events),
            Sharing::Csma(csma) => csma.send(now, from, to, datagram, air, events),
        }
    }

    fn next_timeout(&self) -> Option<Timestamp> {
        match &self.sharing {
            Sharing::Ideal(_) => None,
            Sharing::Csma(csma) => csma.next_timeout(),
        }
    }

    fn handle_timeout(&mut self, now: Timestamp) {
        if let Sharing::Csma(csma) = &mut self.sharing {
            csma.handle_timeout(now, &mut self.air, &mut self.events);
        }
    }

    fn poll_event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }
}

#[cfg(test)]
mod tests;
