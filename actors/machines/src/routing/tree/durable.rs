use serde::{Deserialize, Serialize};

use crate::routing::{Beats, Reign};
use crate::time::Timestamp;

/// What outlives a routing of policy `tree`; who is near is learnt anew.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Checkpoint {
    /// Whom this drone obeys, and what it was ordered.
    pub reign: Reign,
    /// Since when the drone is going to land.
    pub landing: Option<Timestamp>,
    /// Whether the protocol asked for routes.
    pub discovered: bool,
    /// Whether the drone is done.
    pub stopped: bool,
    /// The signs of life.
    pub beats: Beats,
}
