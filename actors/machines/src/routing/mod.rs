//! Who is near, which way the master is, who must relay; orders outwards and acknowledgements inwards.
//!
//! It serves any protocol in which a master gives numbered orders and its members acknowledge them; what an order
//! means is not known here. How orders and acknowledgements spread is a policy, a machine of its own.

mod beats;
pub mod flood;
mod packet;
mod reign;
pub mod tree;

use std::convert::Infallible;
use std::time::Duration;

use bytes::Bytes;

pub use beats::Beats;
pub use packet::{Flood, Member, Packet, Tree};
pub use reign::Reign;

use serde::{Deserialize, Serialize};

use crate::identity::{Ballot, NodeId, NodeSet};
use crate::machine::{Machine, Output};
use crate::time::Timestamp;

/// What a routing is built with: the policy that it follows.
#[derive(Debug, Clone)]
pub enum Config {
    /// Periodic repetition, as the thesis has it.
    Flood(flood::Config),
    /// On change, along a tree, repaired at each hop.
    Tree(tree::Config),
}

impl Config {
    /// How long a drone takes at most until it misses a master that is gone.
    #[must_use]
    pub fn detection(&self) -> Duration {
        match self {
            Self::Flood(config) => config.detection(),
            Self::Tree(config) => config.detection(),
        }
    }

    /// How long news takes to a neighbour, losses included, the way through the air apart.
    #[must_use]
    pub fn hop(&self) -> Duration {
        match self {
            Self::Flood(config) => config.hop(),
            Self::Tree(config) => config.hop(),
        }
    }

    /// The longest that a drone keeps silent that is not landing.
    #[must_use]
    pub fn turn(&self) -> Duration {
        match self {
            Self::Flood(config) => config.turn(),
            Self::Tree(config) => config.turn(),
        }
    }
}

/// What a routing is told.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
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
    /// By the radio: what became of a frame for one drone, where whatever carries frames tells.
    Outcome {
        /// For whom it was.
        to: NodeId,
        /// What was said.
        payload: Bytes,
        /// Whether it arrived there, as far as is known.
        delivered: bool,
    },
    /// By the protocol: this drone is the master, under this ballot.
    Lead(Ballot),
    /// By the protocol, as master: this is the newest order.
    Publish {
        /// Under which ballot of its own; nothing is published if another has been heard of meanwhile.
        ballot: Ballot,
        /// One more than the order before it.
        sequence: u32,
        /// The order.
        order: Bytes,
    },
    /// By the protocol: this order and all before it are carried out.
    Acknowledge {
        /// Whose order it is; nothing is acknowledged if the drone has turned to another meanwhile.
        ballot: Ballot,
        /// The order's number.
        sequence: u32,
    },
    /// By the protocol, as master: start neighbour discovery.
    Discover,
    /// By the protocol: the drones change places; ways that were learnt once don't hold any more.
    Scatter,
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
    /// To the radio: send this.
    Send {
        /// For whom it is; for all in range otherwise. Others may hear it in either case.
        to: Option<NodeId>,
        /// Whom this drone obeys.
        ballot: Ballot,
        /// A packet, encoded.
        payload: Vec<u8>,
        /// Whether it is sent only because its time has come, and not because anything has changed or was missed.
        keep_alive: bool,
    },
    /// To the protocol.
    Inform(Notice),
}

/// What a routing lets its protocol know.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum Notice {
    /// Whom this drone obeys from now on: it heard of a better ballot.
    Reign(Ballot),
    /// There is a newer order.
    Order {
        /// Whose order it is.
        ballot: Ballot,
        /// Its number.
        sequence: u32,
        /// The order.
        order: Bytes,
    },
    /// To a master: how far members have got, as far as that is news.
    Progress {
        /// The newest order.
        sequence: u32,
        /// Who has carried it out.
        acknowledged: NodeSet,
        /// Who is going to land.
        landing: NodeSet,
    },
    /// To a master, before routes are up: whom it hears itself.
    Hears(NodeSet),
    /// To a master: these members have not been heard of for their time to live.
    Silent(NodeSet),
    /// To a master: these members were silent and are back.
    Returned(NodeSet),
    /// The master's own number has not risen for its time to live.
    MasterSilent,
    /// The master is back.
    MasterReturned,
    /// The master says that it is going to land, and has given no order that this drone does not know of.
    MasterLands,
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
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
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
#[derive(Debug, Clone, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
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

/// What outlives a routing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Checkpoint {
    /// Of policy `flood`.
    Flood(flood::Checkpoint),
    /// Of policy `tree`.
    Tree(tree::Checkpoint),
}

impl Checkpoint {
    /// Whom the drone obeys, if anybody.
    #[must_use]
    pub const fn ballot(&self) -> Option<Ballot> {
        match self {
            Self::Flood(own) => own.reign.ballot(),
            Self::Tree(own) => own.reign.ballot(),
        }
    }

    /// Whether what must never fall back has changed since `before`: whom the drone obeys, which numbers it may have
    /// used, whether it is done.
    pub(crate) fn is_news(&self, before: &Self) -> bool {
        match (self, before) {
            (Self::Flood(own), Self::Flood(before)) => {
                (own.landing, own.phase) != (before.landing, before.phase)
                    || own.reign.is_news(&before.reign)
                    || own.beats.reserved() != before.beats.reserved()
            }
            (Self::Tree(own), Self::Tree(before)) => {
                (own.landing, own.stopped) != (before.landing, before.stopped)
                    || own.reign.is_news(&before.reign)
                    || own.beats.reserved() != before.beats.reserved()
            }
            _ => true,
        }
    }
}

/// The routing of one drone, by whichever policy.
#[derive(Debug)]
pub enum Routing {
    /// By periodic repetition.
    Flood(flood::FloodRouting),
    /// Along a tree.
    Tree(tree::TreeRouting),
}

impl Routing {
    /// A routing as `checkpoint` left it; one without, or with another policy's, knows nothing.
    #[must_use]
    pub fn new(config: Config, seed: u64, now: Timestamp, checkpoint: Option<Checkpoint>) -> Self {
        match config {
            Config::Flood(config) => {
                let checkpoint = checkpoint.and_then(|checkpoint| match checkpoint {
                    Checkpoint::Flood(checkpoint) => Some(checkpoint),
                    Checkpoint::Tree(_) => None,
                });
                Self::Flood(flood::FloodRouting::new(config, seed, now, checkpoint))
            }
            Config::Tree(config) => {
                let checkpoint = checkpoint.and_then(|checkpoint| match checkpoint {
                    Checkpoint::Tree(checkpoint) => Some(checkpoint),
                    Checkpoint::Flood(_) => None,
                });
                Self::Tree(tree::TreeRouting::new(config, seed, now, checkpoint))
            }
        }
    }

    /// Entries in the larger of its tables, and the most either takes.
    #[must_use]
    pub fn occupancy(&self) -> (usize, usize) {
        match self {
            Self::Flood(routing) => routing.occupancy(),
            Self::Tree(routing) => routing.occupancy(),
        }
    }

    /// As [`Cell::read_ahead`](crate::cell::Cell::read_ahead) says.
    pub(crate) fn read_ahead(&self) {
        match self {
            // Whoever repeats everything all the time flies in small swarms.
            Self::Flood(_) => {}
            Self::Tree(routing) => routing.read_ahead(),
        }
    }

    /// As [`Cell::read_further_ahead`](crate::cell::Cell::read_further_ahead) says.
    pub(crate) fn read_further_ahead(&self, sender: Option<NodeId>) {
        match self {
            // Whoever repeats everything all the time flies in small swarms.
            Self::Flood(_) => {}
            Self::Tree(routing) => routing.read_further_ahead(sender),
        }
    }
}

impl Machine for Routing {
    type Input = Input;
    type Transmit = Transmit;
    type Event = Event;
    type Rejection = Infallible;

    fn handle_input(&mut self, now: Timestamp, input: Input) -> Result<(), Infallible> {
        match self {
            Self::Flood(routing) => routing.handle_input(now, input),
            Self::Tree(routing) => routing.handle_input(now, input),
        }
    }

    fn handle_timeout(&mut self, now: Timestamp) {
        match self {
            Self::Flood(routing) => routing.handle_timeout(now),
            Self::Tree(routing) => routing.handle_timeout(now),
        }
    }

    fn poll_output(&mut self) -> Output<Transmit, Event> {
        match self {
            Self::Flood(routing) => routing.poll_output(),
            Self::Tree(routing) => routing.poll_output(),
        }
    }
}
