use std::ops::Range;
use std::time::Duration;

use bytes::Bytes;

use crate::identity::{NodeId, NodeSet};

/// What routings say to each other.
#[derive(Debug, Clone, PartialEq)]
pub enum Packet {
    /// Neighbour discovery: I am here.
    Hello {
        /// How long discovery still lasts, so that who hears of it late ends with the others.
        remaining: Duration,
    },
    /// Hop update: how far the master is from me, and who is reached on the way.
    HopUpdate {
        /// Hops from the sender to the master.
        hops: u16,
        /// Whoever the senders up to this one reach, in the order in which they were listed.
        routing_list: Vec<NodeId>,
    },
    /// What each drone repeats while the swarm follows orders.
    Flood(Flood),
    /// What each drone says, policy `tree`, when something has changed, was missed, or once a while.
    Tree(Tree),
}

/// A drone's state, repeated: the thesis's MOVE, WAYPOINT_REACHED and LAND in one.
#[derive(Debug, Clone, PartialEq)]
pub struct Flood {
    /// Hops from the sender to the master, once it knows.
    pub hops: Option<u16>,
    /// Whom the sender's acknowledgements are for; everyone while it knows no parent.
    pub parent: Option<NodeId>,
    /// The highest number of the master's own that the sender has heard of.
    pub heartbeat: u32,
    /// The newest order that the sender has heard of; 0 before the first.
    pub sequence: u32,
    /// Whom the sender has heard within the time to live.
    pub hears: NodeSet,
    /// The sender and those whose acknowledgements it passes on.
    pub members: Vec<Member>,
    /// The newest order, from the master and from whoever relays it.
    pub order: Option<Bytes>,
}

/// What a member lets the master know, passed on by the drones between.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Member {
    /// Who.
    pub id: NodeId,
    /// Rises with each frame that the member itself sends: proof that it lives.
    pub number: u32,
    /// The newest order that it has carried out; all before are too.
    pub acknowledged: u32,
    /// It does not hear the master itself.
    pub out_of_range: bool,
    /// It is on its way to the ground and acknowledges nothing more: nobody waits for it.
    pub landing: bool,
}

/// A drone's state and that of the drones below it, as policy `tree` spreads it.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Tree {
    /// Rises with each packet of this kind that the sender says to all.
    pub number: u32,
    /// Hops from the sender to the master, while it has a way there.
    pub hops: Option<u16>,
    /// Expected transmissions on the sender's route to the master, in [`ETX_UNIT`]s; 0 at the master and without a route.
    pub cost: u16,
    /// The neighbour on that route.
    pub parent: Option<NodeId>,
    /// The master's heartbeat sequence: the highest that the sender has heard of.
    pub heartbeat: u32,
    /// By how much the heartbeat sequence is older that came with the sender's route, by its parent. Routes are compared by
    /// the age of theirs.
    pub lag: u32,
    /// The newest order that the sender has heard of; 0 before the first.
    pub sequence: u32,
    /// Which ids the sets below tell of, where not all of them fit a datagram: what was said of others before still
    /// holds, and the next packet goes on where this one ends. Of all otherwise.
    pub span: Option<Range<u32>>,
    /// Who of the sender and the drones below it has carried that order out.
    pub acknowledged: NodeSet,
    /// The sender, unless it is a pure relay, and the drones below it.
    pub alive: NodeSet,
    /// Who of them is on its way to the ground.
    pub landing: NodeSet,
    /// Whom the sender has heard lately; in keep-alives only.
    pub hears: Option<NodeSet>,
    /// Those of them whose frames it misses noticeably, the lowest first; it hears the others well.
    pub weak: Vec<Reception>,
    /// Neighbours of whom the sender wants to hear what they know.
    pub asks: NodeSet,
    /// For whom it is, if for one drone only; others may hear it too.
    pub to: Option<NodeId>,
    /// How many packets the sender has said to one drone alone since it last spoke to all, with this one; of a packet for
    /// all none.
    pub unicasts: u32,
    /// By the master, passed on outwards: whose acknowledgement of that order is still missing.
    pub pending: NodeSet,
    /// The newest order, from the master and from whoever has drones below it.
    pub order: Option<Bytes>,
}

/// One expected transmission in [`Tree::cost`].
pub const ETX_UNIT: u16 = 32;

/// How well a neighbour is heard.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reception {
    /// The neighbour.
    pub id: NodeId,
    /// The share of its broadcasts that is heard, in sixteenths; 1 to 15.
    pub sixteenths: u8,
}

impl Tree {
    /// The same, telling of some ids only.
    pub(super) fn cut_to(&self, span: Range<u32>) -> Self {
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
            asks: self.asks.intersection(&ids),
            pending: self.pending.intersection(&ids),
            ..self.clone()
        }
    }
}
