//! What policy `tree` knows of routes, for messages.

use std::time::Duration;

use smallvec::SmallVec;

use super::TreePolicy;
use super::link::Neighbour;
use crate::identity::{NodeId, NodeSet};
use crate::routing::SharedState;
use crate::routing::messages::Neighbourhood;
use crate::time::Timestamp;

impl TreePolicy {
    /// Whether a neighbour is worth a frame: both hear each other, and more than a few frames arrive.
    fn is_usable(&self, link: &Neighbour, now: Timestamp) -> bool {
        let time_to_live = self.topology.config.link_time_to_live;
        link.hearing().is_symmetric()
            && link.is_reachable()
            && !link.quality.is_poor()
            && self.topology.links.is_heard(link, now, time_to_live)
    }
}

impl Neighbourhood for TreePolicy {
    fn nodes(&self) -> u32 {
        self.topology.config.drones + self.topology.config.relays
    }

    fn repair(&self) -> Duration {
        self.topology.config.repair
    }

    fn time_to_live(&self) -> Duration {
        self.topology.config.time_to_live
    }

    fn restores_routes(&self) -> bool {
        true
    }

    fn neighbours(&self, now: Timestamp) -> NodeSet {
        let links = self.topology.links.iter();
        let usable = links.filter(|link| self.is_usable(link, now));
        usable.map(|link| link.id).collect()
    }

    /// The parent, then neighbours with a route that does not lead through this drone next, the cheapest first. A longer
    /// loop is possible while routes change; the number of hops ends it.
    fn inwards(&self, now: Timestamp) -> SmallVec<[NodeId; 4]> {
        let (route, own) = (&self.topology.route, self.topology.config.id);
        let mut next: SmallVec<[NodeId; 4]> = route.parent().into_iter().collect();
        if route.routes().hops == Some(0) {
            return next;
        }
        let is_other = |link: &&Neighbour| {
            Some(link.id) != route.parent() && link.has_route_past(own) && self.is_usable(link, now)
        };
        let mut others: SmallVec<[(u16, NodeId); 4]> = (self.topology.links.iter())
            .filter(is_other)
            .filter_map(|link| Some((link.cost_through()?, link.id)))
            .collect();
        others.sort_unstable();
        next.extend(others.into_iter().map(|(_, id)| id));
        next
    }

    fn outwards(&self, to: NodeId) -> Option<NodeId> {
        let mut children = self.topology.links.children();
        let via = children.find(|link| link.sets().alive.contains(to));
        via.map(|link| link.id)
    }

    fn branches(&self) -> Option<NodeSet> {
        self.topology.route.routes().hops?;
        let children = self.topology.links.children().map(|link| link.id);
        Some(children.chain(self.topology.route.parent()).collect())
    }

    fn record_message(
        &mut self,
        shared: &mut SharedState,
        now: Timestamp,
        to: NodeId,
        is_delivered: bool,
    ) {
        if is_delivered {
            self.topology
                .links
                .update_link(to, |link| link.deliveries.record_delivery());
        } else {
            self.topology.record_failure(shared, now, to);
        }
    }
}
