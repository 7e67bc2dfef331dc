use std::ops::Range;
use std::time::Duration;

use bytes::Bytes;

use super::Message;
use crate::identity::{NodeId, NodeSet};

/// A packet between routings.
#[derive(Debug, Clone, PartialEq)]
pub enum Packet {
    /// Neighbour discovery.
    Hello {
        /// Remaining time of discovery, so that drones that start late end with the others.
        remaining: Duration,
    },
    /// Hop update: the sender's distance to the master, and the drones that are reached so far.
    HopUpdate {
        /// Hops from the sender to the master.
        hops: u16,
        /// Drones that the senders up to this one reach, in the order in which they were listed.
        routing_list: Vec<NodeId>,
    },
    /// State of a drone with policy `flood`, repeated each period.
    Flood(Flood),
    /// State of a drone with policy `tree`, sent on change, for repair, and as heartbeat.
    Tree(Tree),
    /// Messages between drones, and their acknowledgements.
    Message(Message),
}

/// A drone's state in policy `flood`: the thesis's MOVE, WAYPOINT_REACHED and LAND in one.
#[derive(Debug, Clone, PartialEq)]
pub struct Flood {
    /// Hops from the sender to the master; `None` without a route.
    pub hops: Option<u16>,
    /// The drone that forwards the sender's acknowledgements; `None` if all drones forward them.
    pub parent: Option<NodeId>,
    /// Highest heartbeat sequence of the master that the sender knows.
    pub heartbeat: u32,
    /// Number of the newest order that the sender knows; 0 before the first.
    pub sequence: u32,
    /// Neighbours that the sender has heard within the time to live.
    pub hears: NodeSet,
    /// The sender, and the members whose acknowledgements it forwards.
    pub members: Vec<Member>,
    /// The newest order; from the master and relays only.
    pub order: Option<Bytes>,
}

/// A member's report to the master, which other drones forward.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Member {
    /// The member.
    pub id: NodeId,
    /// Rises with each frame that the member itself sends: proof of life.
    pub number: u32,
    /// Number of the newest order that it has carried out.
    pub acknowledged: u32,
    /// Whether it does not hear the master itself.
    pub out_of_range: bool,
    /// Whether it is going to land, acknowledges nothing more and is not awaited.
    pub landing: bool,
}

/// State of a drone and of its subtree in policy `tree`.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Tree {
    /// Packet number; rises with each broadcast of the sender.
    pub number: u32,
    /// Hops from the sender to the master; `None` without a route.
    pub hops: Option<u16>,
    /// Expected transmissions on the sender's route to the master, in [`ETX_UNIT`]s; 0 at the master and without a
    /// route.
    pub cost: u16,
    /// Next hop on that route.
    pub parent: Option<NodeId>,
    /// Highest heartbeat sequence of the master that the sender knows.
    pub heartbeat: u32,
    /// By how many heartbeats the sender's route is older than `heartbeat`. Routes are compared by their age.
    pub lag: u32,
    /// Number of the newest order that the sender knows; 0 before the first.
    pub sequence: u32,
    /// The ids that the sets below cover, if not all fit one datagram. What was reported of other ids stays valid, and
    /// the next packet covers the ids from the end of this span. `None` if the sets cover all ids.
    pub span: Option<Range<u32>>,
    /// Drones of `alive` that have carried that order out.
    pub acknowledged: NodeSet,
    /// The sender's subtree with the sender, unless that is a pure relay.
    pub alive: NodeSet,
    /// Drones of `alive` that are going to land.
    pub landing: NodeSet,
    /// Neighbours that the sender hears; in heartbeats only.
    pub hears: Option<NodeSet>,
    /// Neighbours of `hears` over lossy links, lowest id first. The sender receives the others without noticeable loss.
    pub weak: Vec<Reception>,
    /// Neighbours that the sender asks for their state.
    pub requests: NodeSet,
    /// Receiver of a unicast; `None` for a broadcast. Other drones may hear a unicast, too.
    pub to: Option<NodeId>,
    /// Number of unicasts since the sender's last broadcast, this one included; 0 in a broadcast.
    pub unicasts: u32,
    /// Members whose acknowledgement of that order the master lacks; named by the master, forwarded outwards.
    pub pending: NodeSet,
    /// The newest order; from the master and from drones with children only.
    pub order: Option<Bytes>,
}

/// One expected transmission in [`Tree::cost`].
pub const ETX_UNIT: u16 = 32;

/// How well a neighbour is received.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reception {
    /// The neighbour.
    pub id: NodeId,
    /// Share of its broadcasts that is received, in sixteenths: 1 to 15.
    pub sixteenths: u8,
}

impl Tree {
    /// The same packet with its sets limited to some ids.
    pub(crate) fn cut_to(&self, span: Range<u32>) -> Self {
        let ids = NodeSet::from(span.clone());
        Self {
            span: Some(span),
            acknowledged: self.acknowledged.intersection(&ids),
            alive: self.alive.intersection(&ids),
            landing: self.landing.intersection(&ids),
            hears: self.hears.as_ref().map(|hears| hears.intersection(&ids)),
            weak: self
                .weak
                .iter()
                .filter(|it| ids.contains(it.id))
                .copied()
                .collect(),
            requests: self.requests.intersection(&ids),
            pending: self.pending.intersection(&ids),
            ..self.clone()
        }
    }
}
