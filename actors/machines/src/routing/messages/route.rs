//! Next hops: where a frame goes from here.

use super::limits::{FLOOD_AFTER, ROUTE_WAIT, TRIES_MAX};
use super::queue::{FrameId, Place, Reach};
use super::{Context, Messages};
use crate::identity::{NodeId, NodeSet};
use crate::wire::Destination;

/// What to do with a frame whose next hop is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Hop {
    /// Send it to this neighbour.
    To(NodeId),
    /// Ask again later.
    Later,
    /// Send it to all, who pass it on.
    Flood,
}

impl Messages {
    /// The next hop of a frame that has not arrived yet.
    pub(super) fn next_hop(&mut self, cx: &Context<'_>, place: Place) -> Hop {
        let Some(entry) = self.queue.get_mut(place) else {
            return Hop::Later;
        };
        if entry.tries >= TRIES_MAX {
            entry.avoided.extend_from(&entry.awaited);
        }
        let (to, avoided, since) = (entry.frame.to, entry.avoided.clone(), entry.since);
        let mut unreliable = self.sending.losses.unreliable(cx.now);
        unreliable.extend_from(&avoided);
        let next = self.candidate(cx, to, &unreliable);
        if let Some(next) = next.or_else(|| self.candidate(cx, to, &avoided)) {
            return Hop::To(next);
        }
        let has_waited = cx.now.since(since) >= FLOOD_AFTER;
        let is_lost = match to {
            // The leader itself knows no way, or the drone is not where it was.
            Destination::Drone(_) => cx.shared.is_master() || has_waited,
            _ => has_waited,
        };
        if is_lost || !cx.neighbourhood.restores_routes() {
            return Hop::Flood;
        }
        if let Some(entry) = self.queue.get_mut(place) {
            entry.avoided = NodeSet::new();
            entry.awaited = NodeSet::new();
            entry.tries = 0;
            entry.due = cx.now + ROUTE_WAIT;
        }
        Hop::Later
    }

    /// The best next hop that is not avoided.
    fn candidate(&self, cx: &Context<'_>, to: Destination, avoided: &NodeSet) -> Option<NodeId> {
        let neighbourhood = cx.neighbourhood;
        let is_free = |id: &NodeId| !avoided.contains(*id);
        let leader = cx.shared.master();
        let target = match to {
            Destination::Drone(id) => Some(id),
            _ => leader,
        };
        let is_inwards = to == Destination::Leader || target == leader;
        let inwards = || neighbourhood.inwards(cx.now).into_iter().find(is_free);
        let known = || {
            let target = target?;
            let neighbour = Some(target).filter(|id| self.neighbours(cx).contains(*id));
            let branch = neighbourhood.outwards(target);
            let learned = self.nodes.route(target, cx.now);
            [neighbour, branch, learned]
                .into_iter()
                .flatten()
                .find(is_free)
        };
        if is_inwards {
            inwards().or_else(known)
        } else {
            known().or_else(inwards)
        }
    }

    /// Neighbours by the policy; without any, those that have sent messages.
    pub(super) fn neighbours(&self, cx: &Context<'_>) -> NodeSet {
        let neighbours = cx.neighbourhood.neighbours(cx.now);
        if neighbours.is_empty() {
            self.nodes.heard(cx.now)
        } else {
            neighbours
        }
    }

    /// The neighbours that a frame for all goes to from here, but for those that it came from. Without routes these are
    /// all that this drone hears.
    pub(super) fn branches(&self, cx: &Context<'_>, from: Option<NodeId>) -> NodeSet {
        let mut branches = cx.neighbourhood.branches().unwrap_or_else(|| {
            let mut heard = cx.neighbourhood.neighbours(cx.now);
            heard.extend_from(&self.nodes.heard(cx.now));
            heard
        });
        let own = NodeSet::from_iter(from.into_iter().chain([self.id]));
        branches = branches.difference(&own);
        branches
    }

    /// Makes a frame without a route one that all drones pass on.
    pub(super) fn flood(&mut self, cx: &Context<'_>, place: Place) {
        let awaited = self.branches(cx, None);
        let (by, session) = (self.id, self.session);
        self.last_frame = self.last_frame.wrapping_add(1);
        let id = FrameId {
            by,
            session,
            number: self.last_frame,
        };
        self.remember_own(cx.now, id);
        if let Some(entry) = self.queue.get_mut(place) {
            entry.id = id;
            entry.frame.number = id.number;
            entry.frame.flood = Some((by, session));
            entry.reach = Reach::Flood;
            entry.awaited = awaited;
            entry.tries = 0;
        }
    }
}
