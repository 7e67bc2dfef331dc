use serde::{Deserialize, Serialize};

use crate::identity::NodeId;
use crate::routing::{Beats, Reign, Routes};
use crate::time::Timestamp;

/// What outlives a routing.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Checkpoint {
    /// Whom this drone obeys, and what it was ordered.
    pub reign: Reign,
    /// What its routing is doing.
    pub phase: Phase,
    /// Since when the drone is going to land.
    pub landing: Option<Timestamp>,
    /// The way to the master.
    pub routes: Routes,
    /// The stable neighbours, lowest first.
    pub stable: Vec<NodeId>,
    /// The signs of life.
    pub beats: Beats,
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
    /// On the ground, done.
    Stopped,
}
