use serde::{Deserialize, Serialize};

use crate::identity::NodeId;
use crate::routing::Routes;
use crate::time::Timestamp;

/// What outlives a routing of policy `flood`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Checkpoint {
    /// What it is doing.
    pub phase: Phase,
    /// The way to the master.
    pub routes: Routes,
    /// The stable neighbours, lowest first.
    pub stable: Vec<NodeId>,
}

/// What a routing is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Phase {
    /// There are no routes yet: everyone repeats all it knows.
    #[default]
    Gossip,
    /// Everyone says hello.
    Discovery {
        /// When it ends.
        until: Timestamp,
    },
    /// Hops and routing lists spread from the master.
    HopUpdate {
        /// When it began.
        since: Timestamp,
    },
    /// Routes are up.
    Following,
    /// Routes were up and don't hold any more: everyone repeats all it knows.
    Scattered,
}
