//! What policy `flood` knows of routes, for messages.

use std::time::Duration;

use smallvec::SmallVec;

use super::{FloodPolicy, Phase};
use crate::identity::{NodeId, NodeSet};
use crate::routing::messages::Neighbourhood;
use crate::time::Timestamp;

/// Wait for a neighbour's acknowledgement: a tenth of the usual period of 200 ms.
const REPAIR: Duration = Duration::from_millis(20);
/// A neighbour that was not heard in so many periods is not counted on.
const PERIODS_HEARD: u32 = 3;

impl Neighbourhood for FloodPolicy {
    fn nodes(&self) -> u32 {
        self.config.drones
    }

    fn repair(&self) -> Duration {
        REPAIR
    }

    /// Routes are found once; a lost one does not come back.
    fn time_to_live(&self) -> Duration {
        self.config.time_to_live
    }

    fn restores_routes(&self) -> bool {
        false
    }

    fn neighbours(&self, now: Timestamp) -> NodeSet {
        let heard_for = self.config.period * PERIODS_HEARD;
        let is_recent = |at: &Timestamp| now.since(*at) <= heard_for;
        let heard = self.heard_at.iter().filter(|(_, at)| is_recent(at));
        heard.map(|(id, _)| *id).collect()
    }

    fn inwards(&self, _now: Timestamp) -> SmallVec<[NodeId; 4]> {
        let is_current = self.durable.phase == Phase::Following;
        let parent = self.durable.routes.parent.filter(|_| is_current);
        parent.into_iter().collect()
    }

    fn outwards(&self, _to: NodeId) -> Option<NodeId> {
        None
    }

    fn branches(&self) -> Option<NodeSet> {
        None
    }
}
