use std::time::Duration;

use smallvec::SmallVec;

use crate::identity::{NodeId, NodeSet};
use crate::routing::SharedState;
use crate::time::Timestamp;

/// What a policy knows of routes, for messages.
pub(in crate::routing) trait Neighbourhood {
    /// Number of drones and pure relays.
    fn nodes(&self) -> u32;

    /// First wait for a neighbour's acknowledgement of a frame.
    fn repair(&self) -> Duration;

    /// Time without news after which others no longer depend on a drone.
    fn time_to_live(&self) -> Duration;

    /// Whether routes to the leader come back by themselves, so that it is worth to wait for one.
    fn restores_routes(&self) -> bool;

    /// Neighbours that hear this drone and that it hears well enough.
    fn neighbours(&self, now: Timestamp) -> NodeSet;

    /// Next hops towards the leader, the best first.
    fn inwards(&self, now: Timestamp) -> SmallVec<[NodeId; 4]>;

    /// The next hop away from the leader to a drone; `None` if it is not known.
    fn outwards(&self, to: NodeId) -> Option<NodeId>;

    /// The neighbours along which a message to all reaches every drone; `None` without routes.
    fn branches(&self) -> Option<NodeSet>;

    /// The medium reports whether it delivered a message to a neighbour.
    fn record_message(
        &mut self,
        _shared: &mut SharedState,
        _now: Timestamp,
        _to: NodeId,
        _is_delivered: bool,
    ) {
    }
}

/// Of a drone that has left the swarm: it has no routes, and its neighbours are those of which it hears messages.
#[derive(Debug, Clone, Copy)]
pub(in crate::routing) struct NoRoutes {
    nodes: u32,
    repair: Duration,
    time_to_live: Duration,
}

impl NoRoutes {
    /// In the swarm that the drone leaves.
    pub(in crate::routing) fn of(left: &impl Neighbourhood) -> Self {
        Self {
            nodes: left.nodes(),
            repair: left.repair(),
            time_to_live: left.time_to_live(),
        }
    }
}

impl Neighbourhood for NoRoutes {
    fn nodes(&self) -> u32 {
        self.nodes
    }

    fn repair(&self) -> Duration {
        self.repair
    }

    fn time_to_live(&self) -> Duration {
        self.time_to_live
    }

    fn restores_routes(&self) -> bool {
        false
    }

    fn neighbours(&self, _now: Timestamp) -> NodeSet {
        NodeSet::new()
    }

    fn inwards(&self, _now: Timestamp) -> SmallVec<[NodeId; 4]> {
        SmallVec::new()
    }

    fn outwards(&self, _to: NodeId) -> Option<NodeId> {
        None
    }

    fn branches(&self) -> Option<NodeSet> {
        None
    }
}
