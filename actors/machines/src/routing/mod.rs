//! Routing: neighbours, the route to the master, relaying; orders outwards and acknowledgements inwards.
//!
//! It serves any protocol in which a master gives numbered orders and members acknowledge them. It does not know what
//! an order means. A policy decides how orders and acknowledgements spread; [`Routing`] runs one of two.

mod checkpoint;
mod epoch;
pub mod flood;
mod heartbeat;
pub mod messages;
mod policy;
mod shared;
pub mod tree;

use std::time::Duration;

use bytes::Bytes;
use serde::{Deserialize, Serialize};

pub use self::checkpoint::{Checkpoint, Durable, PolicyCheckpoint};
pub use self::epoch::LeaderEpoch;
pub use self::heartbeat::Heartbeats;
pub use self::messages::{DropReason, Outcome, Outgoing, Reliability};
use self::policy::{Dissemination, Policy};
use self::shared::SharedState;
use crate::identity::{Ballot, NodeId, NodeSet};
use crate::machine::{Machine, Output};
use crate::time::Timestamp;
pub use crate::wire::{
    Destination, ETX_UNIT, Flood, MESSAGE_FRAME_MAX, MESSAGE_MAX, Member, Packet, Reception, Tree,
};

/// Configuration of a routing: its policy.
#[derive(Debug, Clone)]
pub enum Config {
    /// Periodic repetition, as in the thesis.
    Flood(flood::Config),
    /// On change, along a tree, repaired at each hop.
    Tree(tree::Config),
}

impl Config {
    /// Longest time until a drone reports a lost master as silent.
    #[must_use]
    pub fn detection_max(&self) -> Duration {
        match self {
            Self::Flood(config) => config.detection_max(),
            Self::Tree(config) => config.detection_max(),
        }
    }

    /// Time until a change reaches a neighbour, losses included, without the time in the air.
    #[must_use]
    pub fn hop_latency(&self) -> Duration {
        match self {
            Self::Flood(config) => config.hop_latency(),
            Self::Tree(config) => config.hop_latency(),
        }
    }

    /// Longest pause between two frames of a drone that is not landing.
    #[must_use]
    pub fn silence_max(&self) -> Duration {
        match self {
            Self::Flood(config) => config.silence_max(),
            Self::Tree(config) => config.silence_max(),
        }
    }

    /// Longest delay of a frame that drones put up with: the period of heartbeats. A neighbour has to answer probes, and to
    /// acknowledge, within a few of them.
    #[must_use]
    pub const fn tolerated_delay(&self) -> Duration {
        match self {
            Self::Flood(config) => config.period,
            Self::Tree(config) => config.heartbeat_period,
        }
    }

    /// Number of send periods without a newer heartbeat after which the master counts as silent; each hop adds up to
    /// one period. `None` for policy `tree`, which probes the parent instead.
    #[must_use]
    pub fn periods_to_timeout(&self) -> Option<u32> {
        match self {
            Self::Flood(config) => Some(config.periods_to_timeout()),
            Self::Tree(_) => None,
        }
    }
}

/// Input of a routing.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum Input {
    /// From the radio: a frame was admitted.
    Received {
        /// Its sender.
        sender: NodeId,
        /// The sender's current leader.
        ballot: Ballot,
        /// A packet, encoded.
        payload: Bytes,
    },
    /// From the radio: the result of a unicast, if the medium reports it.
    Delivery {
        /// The receiver.
        to: NodeId,
        /// The packet.
        payload: Bytes,
        /// Whether it arrived, as far as the medium knows.
        delivered: bool,
    },
    /// From the protocol: this drone leads under this ballot.
    Lead(Ballot),
    /// From the protocol of a master: the newest order.
    Publish {
        /// The master's ballot. The order is dropped if the routing has adopted another ballot meanwhile.
        ballot: Ballot,
        /// Number of the order, one more than of the order before.
        sequence: u32,
        /// The order, encoded.
        order: Bytes,
    },
    /// From the protocol: this order and all before it are carried out.
    Acknowledge {
        /// Ballot under which the order was given. The acknowledgement is dropped if another ballot is current.
        ballot: Ballot,
        /// Number of the order.
        sequence: u32,
    },
    /// From the protocol of a master: start neighbour discovery.
    Discover,
    /// From the protocol: the drones change positions, so known routes become invalid.
    TopologyChanges,
    /// From the protocol: this drone leaves the swarm, and must not be awaited. It sends messages, but no heartbeats, and
    /// no notices but of messages.
    Leave,
    /// From the protocol: this drone is going to land, and must not be awaited.
    Land,
    /// From the protocol: this drone is done; send the state once more and stop.
    Stop,
    /// From the protocol, after its restart: repeat the notices that still apply.
    Resync,
    /// From the protocol: send these messages.
    Messages(Vec<Outgoing>),
}

/// Output of a routing to other machines.
#[derive(Debug, Clone, PartialEq)]
pub enum Transmit {
    /// To the radio: send a frame.
    Send {
        /// Receiver of a unicast; `None` for a broadcast. Other drones may hear either.
        to: Option<NodeId>,
        /// This drone's current leader.
        ballot: Ballot,
        /// A packet, encoded.
        payload: Vec<u8>,
        /// Whether the frame is periodic, so that nothing has changed or is repaired.
        keep_alive: bool,
    },
    /// To the protocol.
    Inform(Notice),
    /// To the navigation: neighbours that are heard, and that may not hear this drone. On each change, and with each own
    /// periodic frame while there are any.
    Deaf(NodeSet),
}

/// What a routing tells its protocol.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum Notice {
    /// The routing adopted a better ballot.
    Leader(Ballot),
    /// There is a newer order.
    Order {
        /// Ballot under which it was given.
        ballot: Ballot,
        /// Number of the order.
        sequence: u32,
        /// The order, encoded.
        order: Bytes,
    },
    /// To a master: changes in the progress of members.
    Progress {
        /// Number of the newest order.
        sequence: u32,
        /// Members that have newly carried it out.
        acknowledged: NodeSet,
        /// Members that are newly going to land.
        landing: NodeSet,
    },
    /// To a master, before routes are up: the drones that it hears itself.
    Neighbours(NodeSet),
    /// To a master: members not heard of for their time to live.
    Silent(NodeSet),
    /// To a master: members that were silent and are back.
    Returned(NodeSet),
    /// The master's heartbeat sequence has not risen for its time to live.
    MasterSilent,
    /// The master is back.
    MasterReturned,
    /// The master is going to land, and this drone knows its last order.
    MasterLands,
    /// Neighbour discovery has started.
    DiscoveryStarted,
    /// Neighbour discovery has ended; hop update has started.
    HopUpdateStarted,
    /// Routes are up.
    RoutesReady,
    /// This routing restarted: repeat the inputs that still apply. It has forgotten the messages that were not sent or
    /// not acknowledged; their outcomes do not follow.
    Resync,
    /// A message of another drone, or of this one to itself. At most once for each message, unless this routing
    /// restarted.
    Message {
        /// The drone that sent it, as the neighbour says that passed it on.
        from: NodeId,
        /// The message.
        payload: Bytes,
    },
    /// What became of messages that were to be acknowledged, each with the protocol's number of it. Of a best-effort message
    /// only that it was not sent. At most one such notice in a step.
    Sent(Vec<(u32, Outcome)>),
}

/// Observable events of a routing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Event {
    /// A neighbour became stable.
    NeighbourStable(NodeId),
    /// This drone's route to the master changed.
    Routes(Routes),
    /// On a master: the path to a member changed.
    Reached {
        /// The member.
        member: NodeId,
        /// The master's neighbour that forwards the member's acknowledgements; the member itself if the master hears
        /// it.
        via: NodeId,
        /// Whether the member does not hear the master itself.
        out_of_range: bool,
    },
    /// A frame of this sender was dropped: malformed payload, unknown sender or older ballot, or a message of an origin
    /// over its budget.
    Ignored(NodeId),
    /// This drone has left the swarm: it relays nothing but messages from now on.
    Left,
    /// State from which a restarted routing resumes.
    Checkpoint(Box<Checkpoint>),
}

/// A drone's route to the master.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
pub struct Routes {
    /// Hops to the master, 0 for the master itself; `None` without a route.
    pub hops: Option<u16>,
    /// Next hop towards the master, which gets this drone's acknowledgements.
    pub parent: Option<NodeId>,
    /// The thesis's routing list (its table 8).
    pub routing_list: Vec<NodeId>,
    /// Whether this drone relays orders.
    pub relay: bool,
    /// Whether this drone does not hear the master itself.
    pub out_of_range: bool,
}

/// The routing of one drone.
#[derive(Debug)]
pub struct Routing(PolicyKind);

#[derive(Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "there is one per drone, on the heap already"
)]
enum PolicyKind {
    Flood(Box<Dissemination<flood::FloodPolicy>>),
    Tree(Dissemination<tree::TreePolicy>),
}

impl Routing {
    /// Resumes from `checkpoint`; starts empty if it is `None` or another policy's.
    #[must_use]
    pub fn new(config: Config, seed: u64, now: Timestamp, checkpoint: Option<Checkpoint>) -> Self {
        Self(match config {
            Config::Flood(config) => {
                let shared = SharedState::new(config.id, config.drones, seed);
                let checkpoint = checkpoint.and_then(|it| match it.policy {
                    PolicyCheckpoint::Flood(own) => Some((it.common, own)),
                    PolicyCheckpoint::Tree(_) => None,
                });
                let new = |shared: &mut SharedState| {
                    flood::FloodPolicy::new(config, shared, now, checkpoint)
                };
                PolicyKind::Flood(Box::new(Dissemination::new(shared, new)))
            }
            Config::Tree(config) => {
                let shared = SharedState::new(config.id, config.drones, seed);
                let checkpoint = checkpoint.and_then(|it| match it.policy {
                    PolicyCheckpoint::Tree(own) => Some((it.common, own)),
                    PolicyCheckpoint::Flood(_) => None,
                });
                let new = |shared: &mut SharedState| {
                    tree::TreePolicy::new(config, shared, now, checkpoint)
                };
                PolicyKind::Tree(Dissemination::new(shared, new))
            }
        })
    }

    /// Number of entries in the largest table, and that table's limit.
    #[must_use]
    pub fn occupancy(&self) -> (usize, usize) {
        match &self.0 {
            PolicyKind::Flood(routing) => routing.occupancy(),
            PolicyKind::Tree(routing) => routing.occupancy(),
        }
    }

    /// See [`NodeMachine::read_ahead`](crate::node::NodeMachine::read_ahead). Policy `flood` is for small swarms, which
    /// do not need it.
    pub(crate) fn read_ahead(&self) {
        if let PolicyKind::Tree(routing) = &self.0 {
            routing.read_ahead();
        }
    }

    /// See [`NodeMachine::read_further_ahead`](crate::node::NodeMachine::read_further_ahead).
    pub(crate) fn read_further_ahead(&self, sender: Option<NodeId>) {
        if let PolicyKind::Tree(routing) = &self.0 {
            routing.read_further_ahead(sender);
        }
    }
}

impl Machine for Routing {
    type Input = Input;
    type Transmit = Transmit;
    type Event = Event;

    fn handle_input(&mut self, now: Timestamp, input: Input) {
        match &mut self.0 {
            PolicyKind::Flood(routing) => routing.handle_input(now, input),
            PolicyKind::Tree(routing) => routing.handle_input(now, input),
        }
    }

    fn handle_timeout(&mut self, now: Timestamp) {
        match &mut self.0 {
            PolicyKind::Flood(routing) => routing.handle_timeout(now),
            PolicyKind::Tree(routing) => routing.handle_timeout(now),
        }
    }

    fn poll_output(&mut self) -> Output<Transmit, Event> {
        match &mut self.0 {
            PolicyKind::Flood(routing) => routing.poll_output(),
            PolicyKind::Tree(routing) => routing.poll_output(),
        }
    }
}
