//! What a drone says, as a packet that fits a datagram.

use super::aggregation::pending;
use super::link::Link;
use super::link_table::LinkTable;
use super::parent::ParentSelection;
use crate::identity::{NodeId, NodeSet};
use crate::routing::Tree;
use crate::routing::core::Core;
use crate::wire;

/// Numbers packets, and cuts those that are too long.
#[derive(Debug, Default)]
pub(super) struct Composer {
    /// From which id on the next packet tells of others, where not all fit one.
    next_span: u32,
    /// How many packets were said to one drone since the last one for all.
    unicasts: u32,
}

impl Composer {
    /// Counts a packet for all, or for one; whether it is for all, so that its sender's heartbeat rises.
    pub(super) const fn count(&mut self, to: Option<NodeId>) -> bool {
        self.unicasts = if to.is_some() { self.unicasts + 1 } else { 0 };
        to.is_none()
    }

    /// What the drone knows.
    pub(super) fn state(
        &self,
        core: &Core,
        links: &LinkTable,
        route: &ParentSelection,
        to: Option<NodeId>,
    ) -> Tree {
        let sequence = core.sequence();
        let below = links.below(sequence);
        let mut acknowledged = below.acknowledged.clone();
        if core.durable.epoch.is_carried_out() {
            acknowledged.insert(core.id);
        }
        let mut landing = below.landing.clone();
        if let Some(master) = core.master()
            && landing.contains(master)
            && !core.master_lands()
        {
            // Others take it to be said beside the order that this drone knows, which may not be the last.
            landing = landing.difference(&NodeSet::from_iter([master]));
        }
        if core.durable.landing.is_some() {
            landing.insert(core.id);
        }
        let mut alive = below.alive.clone();
        if !core.is_relay() {
            alive.insert(core.id);
        }
        let parent = route.parent();
        let all = NodeSet::from(0..core.drones);
        let pending = if core.is_master() {
            // All that there are, heard of or not, from the first order on the ground on.
            all.difference(&acknowledged).difference(&landing)
        } else {
            let parent = parent.and_then(|parent| links.get(parent));
            let named = parent.and_then(|parent| pending(parent, sequence));
            named.cloned().unwrap_or(all)
        };
        let is_behind = |link: &Link| link.said.sequence < sequence;
        let lacks_order = to.and_then(|to| links.get(to)).is_some_and(is_behind);
        let passes_on = core.is_master() || route.routes().relay || parent.is_none() || lacks_order;
        let heartbeat = core.durable.heartbeats.master;
        Tree {
            number: core.durable.heartbeats.own,
            hops: route.routes().hops,
            cost: route.cost(),
            parent,
            heartbeat,
            lag: route.lag(heartbeat),
            sequence,
            span: None,
            acknowledged,
            alive,
            landing,
            hears: None,
            weak: Vec::new(),
            asks: NodeSet::default(),
            to,
            unicasts: self.unicasts,
            pending,
            order: core.durable.epoch.order().cloned().filter(|_| passes_on),
        }
    }

    /// A packet's bytes; where they outgrow a datagram, of as many of the `nodes` that there are as fit, from those on whom
    /// the packet before left out.
    pub(super) fn encode(&mut self, state: &Tree, nodes: u32) -> Vec<u8> {
        let payload = wire::encode_tree(state);
        if payload.len() <= wire::PAYLOAD_MAX {
            return payload;
        }
        let begin = self.next_span % nodes;
        let cut = |end| wire::encode_tree(&state.cut_to(begin..end));
        let (mut fits, mut too_far) = (begin + 1, nodes + 1);
        while fits + 1 < too_far {
            let middle = u32::midpoint(fits, too_far);
            if cut(middle).len() <= wire::PAYLOAD_MAX {
                fits = middle;
            } else {
                too_far = middle;
            }
        }
        self.next_span = fits;
        cut(fits)
    }
}
