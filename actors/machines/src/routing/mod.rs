//! Who is near, which way the master is, who must relay; orders outwards and acknowledgements inwards.
//!
//! It serves any protocol in which a master gives numbered orders and its members acknowledge them; what an order
//! means is not known here. Policy `flood`, after the thesis (sections 4.2 and 4.4): before there are routes every
//! drone repeats all it knows; neighbour discovery and hop update then give each drone a parent, and from there on
//! acknowledgements go up through the parents only and orders are repeated by the master and those who must relay.

mod durable;
mod flood;
mod members;
mod neighbours;
mod packet;

use std::collections::BTreeSet;
use std::convert::Infallible;
use std::time::Duration;

use bytes::Bytes;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

pub use durable::{Checkpoint, Phase};
pub use packet::{Flood, Member, Packet};

use self::members::Members;
use self::neighbours::Neighbours;
use crate::identity::{Ballot, NodeId};
use crate::machine::{Machine, Outbox, Output};
use crate::time::Timestamp;
use crate::wire;

/// What a routing is built with.
#[derive(Debug, Clone)]
pub struct Config {
    /// Whose routing this is.
    pub id: NodeId,
    /// How many drones the swarm has; ids run from 0 to one below.
    pub drones: u32,
    /// How often a drone repeats what it knows.
    pub period: Duration,
    /// How often it does so once it has been going to land for its time to live: nobody waits for it any more, and
    /// whoever it relays to has been told.
    pub keep_alive: Duration,
    /// How often a drone says hello during discovery.
    pub hello_period: Duration,
    /// How long discovery lasts.
    pub discovery: Duration,
    /// How many hellos in a row make a neighbour stable.
    pub stable_after: u32,
    /// The longest pause between two hellos in a row.
    pub hello_gap: Duration,
    /// How long a drone may be silent before it is taken for lost, and the longest a hop update waits.
    pub time_to_live: Duration,
}

/// What a routing is told.
#[derive(Debug, Clone, PartialEq)]
pub enum Input {
    /// By the radio: a frame was let in.
    Heard {
        /// Who said it.
        sender: NodeId,
        /// Whom the sender obeys.
        ballot: Ballot,
        /// What was said.
        payload: Bytes,
    },
    /// By the protocol: this drone is the master, under this ballot.
    Lead(Ballot),
    /// By the protocol, as master: this is the newest order.
    Publish {
        /// One more than the order before it.
        sequence: u32,
        /// The order.
        order: Bytes,
    },
    /// By the protocol: this order and all before it are carried out.
    Acknowledge {
        /// The order's number.
        sequence: u32,
    },
    /// By the protocol, as master: start neighbour discovery.
    Discover,
    /// By the protocol: this drone is going to land; nobody is to wait for it.
    Land,
    /// By the protocol: this drone is done; say so once more and fall silent.
    Stop,
    /// By the protocol, restarted: tell me again what I should know.
    Resync,
}

/// What a routing sends.
#[derive(Debug, Clone, PartialEq)]
pub enum Transmit {
    /// To the radio: broadcast this.
    Send {
        /// Whom this drone obeys.
        ballot: Ballot,
        /// A packet, encoded.
        payload: Vec<u8>,
    },
    /// To the protocol.
    Inform(Notice),
}

/// What a routing lets its protocol know.
#[derive(Debug, Clone, PartialEq)]
pub enum Notice {
    /// There is a newer order.
    Order {
        /// Whose order it is.
        ballot: Ballot,
        /// Its number.
        sequence: u32,
        /// The order.
        order: Bytes,
    },
    /// To a master: how far a member has got.
    Progress {
        /// The member.
        member: NodeId,
        /// The newest order that it has carried out.
        acknowledged: u32,
        /// Whether it is going to land.
        landing: bool,
    },
    /// To a master: a member has not been heard of for its time to live.
    Silent(NodeId),
    /// To a master: a member that was silent is back.
    Returned(NodeId),
    /// The master's own number has not risen for its time to live.
    MasterSilent,
    /// The master is back.
    MasterReturned,
    /// Neighbour discovery has begun.
    DiscoveryStarted,
    /// Neighbour discovery has ended; hop update has begun.
    HopUpdateStarted,
    /// Routes are up.
    RoutesReady,
    /// This routing restarted: tell me again what I should know.
    Resync,
}

/// What can be seen of a routing.
#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    /// A neighbour became stable.
    NeighbourStable(NodeId),
    /// What this drone knows of its way to the master.
    Routes(Routes),
    /// As master: who speaks for a member, and whether it is out of the master's own range.
    Reached {
        /// The member.
        member: NodeId,
        /// The master's neighbour that its acknowledgements come through; itself when heard directly.
        via: NodeId,
        /// Whether the member does not hear the master itself.
        out_of_range: bool,
    },
    /// A peer sent a payload that is none, a member that is none, or obeys an older ballot.
    Ignored(NodeId),
    /// What a restarted routing is built from.
    Checkpoint(Box<Checkpoint>),
}

/// A drone's way to the master.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Default)]
pub struct Routes {
    /// Hops to the master; 0 for the master itself.
    pub hops: Option<u16>,
    /// The neighbour through which acknowledgements go.
    pub parent: Option<NodeId>,
    /// The thesis's routing list (its table 8).
    pub routing_list: Vec<NodeId>,
    /// Whether this drone must repeat orders because it reaches drones that are not listed yet.
    pub relay: bool,
    /// Whether this drone does not hear the master itself.
    pub out_of_range: bool,
}

/// The routing of one drone.
#[derive(Debug)]
pub struct Routing {
    config: Config,
    rng: ChaCha8Rng,
    durable: Checkpoint,
    neighbours: Neighbours,
    members: Members,
    /// Stable neighbours heard again since hop update began.
    heard_again: BTreeSet<NodeId>,
    pulse_rose_at: Timestamp,
    master_silent: bool,
    /// When this drone speaks next; `None` until it has something to say.
    next_send: Option<Timestamp>,
    outbox: Outbox<Transmit, Event>,
}

impl Routing {
    /// A routing as `checkpoint` left it; a default one knows nothing.
    #[must_use]
    pub fn new(config: Config, seed: u64, now: Timestamp, checkpoint: Option<Checkpoint>) -> Self {
        let mut routing = Self {
            rng: ChaCha8Rng::seed_from_u64(seed),
            neighbours: Neighbours::new(config.stable_after, config.hello_gap),
            members: Members::default(),
            heard_again: BTreeSet::new(),
            pulse_rose_at: now,
            master_silent: false,
            next_send: None,
            durable: Checkpoint::default(),
            outbox: Outbox::new(),
            config,
        };
        if let Some(checkpoint) = checkpoint {
            routing.resume(now, checkpoint);
        }
        routing
    }

    /// Entries in the larger of its tables, and the most either takes.
    #[must_use]
    pub fn occupancy(&self) -> (usize, usize) {
        (self.members.len(), self.config.drones as usize)
    }

    fn resume(&mut self, now: Timestamp, checkpoint: Checkpoint) {
        self.neighbours
            .remember(checkpoint.stable.iter().copied(), now);
        self.durable = checkpoint;
        self.durable.skip_reserved(self.is_master());
        if self.durable.ballot.is_some() && self.durable.phase != Phase::Stopped {
            self.next_send = Some(now + self.phase_in(self.config.period));
        }
        self.outbox.transmit(Transmit::Inform(Notice::Resync));
        self.checkpoint();
    }

    fn is_master(&self) -> bool {
        self.durable
            .ballot
            .is_some_and(|ballot| ballot.master == self.config.id)
    }

    fn is_member(&self, id: NodeId) -> bool {
        id.0 < self.config.drones
    }

    /// A random part of a period: drones do not speak in step.
    fn phase_in(&mut self, period: Duration) -> Duration {
        let nanos = u64::try_from(period.as_nanos()).unwrap_or(u64::MAX);
        Duration::from_nanos(self.rng.random_range(0..nanos.max(1)))
    }

    fn inform(&mut self, notice: Notice) {
        self.outbox.transmit(Transmit::Inform(notice));
    }

    fn checkpoint(&mut self) {
        self.durable.stable = self.neighbours.stable().collect();
        let checkpoint = Box::new(self.durable.clone());
        self.outbox.event(Event::Checkpoint(checkpoint));
    }

    fn start_speaking(&mut self, now: Timestamp) {
        if self.next_send.is_none() {
            self.next_send = Some(now + self.phase_in(self.config.period));
        }
    }

    fn heard(&mut self, now: Timestamp, sender: NodeId, ballot: Ballot, payload: &[u8]) {
        let Ok(packet) = wire::decode_packet(payload) else {
            self.outbox.event(Event::Ignored(sender));
            return;
        };
        if !self.is_member(sender) || !self.follow(now, ballot) {
            self.outbox.event(Event::Ignored(sender));
            return;
        }
        match packet {
            Packet::Hello { remaining } => self.heard_hello(now, sender, remaining),
            Packet::HopUpdate { hops, routing_list } => {
                self.heard_hop_update(now, sender, hops, &routing_list);
            }
            Packet::Flood(flood) => self.heard_flood(now, sender, flood),
        }
    }

    /// Whether a frame under `ballot` is to be heard; turns to a better ballot than the one obeyed so far.
    fn follow(&mut self, now: Timestamp, ballot: Ballot) -> bool {
        match self.durable.ballot {
            Some(own) if own == ballot => true,
            Some(own) if !ballot.beats(&own) => false,
            _ => {
                self.durable.ballot = Some(ballot);
                self.pulse_rose_at = now;
                self.start_speaking(now);
                self.checkpoint();
                true
            }
        }
    }

    fn resync(&mut self) {
        if let (Some(ballot), Some(order)) = (self.durable.ballot, self.durable.order.clone()) {
            let sequence = self.durable.sequence;
            self.inform(Notice::Order {
                ballot,
                sequence,
                order,
            });
        }
        match self.durable.phase {
            Phase::Gossip | Phase::Stopped => {}
            Phase::Discovery { .. } => self.inform(Notice::DiscoveryStarted),
            Phase::HopUpdate { .. } => self.inform(Notice::HopUpdateStarted),
            Phase::Following => self.inform(Notice::RoutesReady),
        }
        let members: Vec<_> = self.members.iter().collect();
        let silent: Vec<_> = self.members.silent().collect();
        for member in members {
            self.inform(Notice::Progress {
                member: member.id,
                acknowledged: member.acknowledged,
                landing: member.landing,
            });
        }
        for id in silent {
            self.inform(Notice::Silent(id));
        }
        if self.master_silent {
            self.inform(Notice::MasterSilent);
        }
    }
}

impl Machine for Routing {
    type Input = Input;
    type Transmit = Transmit;
    type Event = Event;
    type Rejection = Infallible;

    fn handle_input(&mut self, now: Timestamp, input: Input) -> Result<(), Infallible> {
        match input {
            Input::Heard {
                sender,
                ballot,
                payload,
            } => self.heard(now, sender, ballot, &payload),
            Input::Lead(ballot) => {
                self.durable.ballot = Some(ballot);
                self.start_speaking(now);
                self.checkpoint();
            }
            Input::Publish { sequence, order } if sequence > self.durable.sequence => {
                self.durable.sequence = sequence;
                self.durable.order = Some(order);
                self.checkpoint();
            }
            Input::Acknowledge { sequence } if sequence > self.durable.acknowledged => {
                self.durable.acknowledged = sequence;
                self.checkpoint();
            }
            Input::Publish { .. } | Input::Acknowledge { .. } => {}
            Input::Discover => self.start_discovery(now, self.config.discovery),
            Input::Land => {
                self.durable.landing.get_or_insert(now);
                self.checkpoint();
            }
            Input::Stop => self.stop(),
            Input::Resync => self.resync(),
        }
        Ok(())
    }

    fn handle_timeout(&mut self, now: Timestamp) {
        while let Some(due) = self.next_send.filter(|due| *due <= now) {
            self.next_send = self.speak(now, due);
        }
    }

    fn poll_output(&mut self) -> Output<Transmit, Event> {
        self.outbox.poll(self.next_send)
    }
}

#[cfg(test)]
mod tests;
