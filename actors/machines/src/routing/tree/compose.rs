//! Composes packets of a drone's state that fit a datagram.

use super::aggregation::pending;
use super::link::Neighbour;
use super::link_table::LinkTable;
use super::parent::ParentSelection;
use crate::identity::{NodeId, NodeSet};
use crate::routing::Tree;
use crate::routing::shared::SharedState;
use crate::wire;

/// Counts packets, and cuts those that exceed a datagram.
#[derive(Debug, Default)]
pub(super) struct Composer {
    /// First id that the next packet covers, if not all fit one.
    next_span: u32,
    /// Number of unicasts since the last broadcast.
    unicasts: u32,
}

impl Composer {
    /// Counts a packet; returns whether it is a broadcast, which raises the packet number.
    pub(super) const fn count(&mut self, to: Option<NodeId>) -> bool {
        self.unicasts = if to.is_some() { self.unicasts + 1 } else { 0 };
        to.is_none()
    }

    /// The packet of this drone's current state.
    pub(super) fn state(
        &self,
        shared: &SharedState,
        links: &LinkTable,
        route: &ParentSelection,
        to: Option<NodeId>,
    ) -> Tree {
        let sequence = shared.sequence();
        let subtree = links.subtree(sequence);
        let mut acknowledged = subtree.acknowledged.clone();
        if shared.durable.epoch.is_carried_out() {
            acknowledged.insert(shared.id);
        }
        let landing = landing_members(shared, &subtree.landing);
        let mut alive = subtree.alive.clone();
        if !shared.is_relay() {
            alive.insert(shared.id);
        }
        let parent = route.parent();
        let all = NodeSet::from(0..shared.drones);
        let pending = if shared.is_master() {
            // From the first order on the ground on, including members that were never heard of.
            all.difference(&acknowledged).difference(&landing)
        } else {
            let parent = parent.and_then(|parent| links.get(parent));
            let named = parent.and_then(|parent| pending(parent, sequence));
            named.cloned().unwrap_or(all)
        };
        let lacks_order = |link: &Neighbour| link.report.sequence < sequence;
        let receiver_lacks_order = to.and_then(|to| links.get(to)).is_some_and(lacks_order);
        let carries_order =
            shared.is_master() || route.routes().relay || parent.is_none() || receiver_lacks_order;
        let heartbeat = shared.durable.heartbeats.master;
        Tree {
            number: shared.durable.heartbeats.own,
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
            requests: NodeSet::default(),
            to,
            unicasts: self.unicasts,
            pending,
            order: shared
                .durable
                .epoch
                .order()
                .cloned()
                .filter(|_| carries_order),
        }
    }

    /// Encodes a packet. If it exceeds a datagram, it covers as many of the `nodes` ids as fit, starting where the
    /// packet before ended.
    pub(super) fn encode(&mut self, state: &Tree, nodes: u32) -> Vec<u8> {
        let payload = wire::encode_tree(state);
        if payload.len() <= wire::PAYLOAD_MAX {
            return payload;
        }
        let begin = self.next_span % nodes;
        let cut = |end| wire::encode_tree(&state.cut_to(begin..end));
        let (mut fits, mut exceeds) = (begin + 1, nodes + 1);
        while fits + 1 < exceeds {
            let middle = u32::midpoint(fits, exceeds);
            if cut(middle).len() <= wire::PAYLOAD_MAX {
                fits = middle;
            } else {
                exceeds = middle;
            }
        }
        self.next_span = fits;
        cut(fits)
    }
}

/// The drones of the subtree that are going to land, with this drone. Receivers relate a landing to the packet's order,
/// so the master is included only if it lands with that order.
fn landing_members(shared: &SharedState, subtree: &NodeSet) -> NodeSet {
    let mut landing = subtree.clone();
    if let Some(master) = shared.master()
        && landing.contains(master)
        && !shared.master_lands()
    {
        landing = landing.difference(&NodeSet::from_iter([master]));
    }
    if shared.durable.landing.is_some() {
        landing.insert(shared.id);
    }
    landing
}
