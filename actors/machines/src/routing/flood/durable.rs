use serde::{Deserialize, Serialize};

use crate::identity::NodeId;
use crate::routing::Routes;
use crate::time::Timestamp;

/// Durable state of policy `flood`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Checkpoint {
    /// The current phase.
    pub phase: Phase,
    /// The route to the master.
    pub routes: Routes,
    /// Stable neighbours, lowest id first.
    pub stable: Vec<NodeId>,
}

/// Phase of policy `flood`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Phase {
    /// There are no routes yet; each drone repeats all it knows.
    #[default]
    Gossip,
    /// Each drone sends hellos.
    Discovery {
        /// End of discovery.
        until: Timestamp,
    },
    /// Hops and routing lists spread from the master.
    HopUpdate {
        /// Start of hop update.
        since: Timestamp,
    },
    /// Routes are up.
    Following,
    /// Routes have become invalid; each drone repeats all it knows.
    RoutesLost,
}
