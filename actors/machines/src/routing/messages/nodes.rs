//! What a drone remembers of others: the numbers it has seen, the budget that is left, and the route of their messages.

use std::collections::BTreeMap;

use super::limits::{FORGET_AFTER, FORWARD_BUDGET, HEARD_FOR, NODES_MAX, ROUTE_LIFETIME};
use super::window::Seen;
use crate::identity::{NodeId, NodeSet};
use crate::radio::TokenBucket;
use crate::time::Timestamp;

/// A drone that has numbered frames or messages.
#[derive(Debug)]
pub(super) struct Node {
    /// Numbers of its frames that were accepted.
    pub(super) frames: Seen,
    /// Numbers of its whole messages that were delivered to this drone's protocol.
    pub(super) whole: Seen,
    /// The same of its large messages. They live far longer, while many whole ones are numbered.
    pub(super) large: Seen,
    budget: TokenBucket,
    /// The neighbour that last passed on a frame of it, and when.
    route: Option<(NodeId, Timestamp)>,
    /// When it last sent a frame itself.
    heard_at: Option<Timestamp>,
    used_at: Timestamp,
}

/// All such drones.
///
/// Invariant: at most [`NODES_MAX`]; one that was used within [`FORGET_AFTER`] is not forgotten.
#[derive(Debug, Default)]
pub(super) struct Nodes(BTreeMap<NodeId, Node>);

impl Nodes {
    /// A drone's entry; `None` if there is no room.
    pub(super) fn entry(&mut self, id: NodeId, now: Timestamp) -> Option<&mut Node> {
        if !self.0.contains_key(&id) && !self.makes_room(now) {
            return None;
        }
        let node = self.0.entry(id).or_insert_with(|| Node {
            frames: Seen::default(),
            whole: Seen::default(),
            large: Seen::default(),
            budget: TokenBucket::FULL,
            route: None,
            heard_at: None,
            used_at: now,
        });
        node.used_at = now;
        Some(node)
    }

    pub(super) fn get(&self, id: NodeId) -> Option<&Node> {
        self.0.get(&id)
    }

    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    fn makes_room(&mut self, now: Timestamp) -> bool {
        if self.0.len() < NODES_MAX {
            return true;
        }
        let oldest = self.0.iter().min_by_key(|(_, node)| node.used_at);
        let unused = oldest.filter(|(_, node)| now.since(node.used_at) > FORGET_AFTER);
        unused
            .map(|(id, _)| *id)
            .is_some_and(|id| self.0.remove(&id).is_some())
    }

    /// The neighbour through which a drone's messages came, if that is not long ago.
    pub(super) fn route(&self, to: NodeId, now: Timestamp) -> Option<NodeId> {
        let (via, at) = self.get(to)?.route?;
        (now.since(at) <= ROUTE_LIFETIME).then_some(via)
    }

    /// The neighbours that have sent a message frame themselves not long ago.
    pub(super) fn heard(&self, now: Timestamp) -> NodeSet {
        let is_recent = |at: Timestamp| now.since(at) <= HEARD_FOR;
        let heard = self.0.iter();
        heard
            .filter(|(_, node)| node.heard_at.is_some_and(is_recent))
            .map(|(id, _)| *id)
            .collect()
    }
}

impl Node {
    pub(super) const fn record_heard(&mut self, now: Timestamp) {
        self.heard_at = Some(now);
    }

    pub(super) const fn learn_route(&mut self, via: NodeId, now: Timestamp) {
        self.route = Some((via, now));
    }

    /// Takes a token for a frame of this origin; returns whether there was one.
    pub(super) fn take_token(&mut self, now: Timestamp) -> bool {
        let has_tokens = self.budget.has_tokens(now, &FORWARD_BUDGET);
        if has_tokens {
            self.budget.charge(now, &FORWARD_BUDGET);
        }
        has_tokens
    }
}
