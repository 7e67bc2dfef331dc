use bytes::Bytes;
use serde::{Deserialize, Serialize};

use crate::identity::Ballot;
use crate::routing::Beats;
use crate::time::Timestamp;

/// What outlives a routing of policy `tree`; who is near is learnt anew.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Checkpoint {
    /// Whom this drone obeys.
    pub ballot: Option<Ballot>,
    /// The number of the newest order; 0 before the first.
    pub sequence: u32,
    /// The newest order.
    pub order: Option<Bytes>,
    /// The newest order that the drone has carried out.
    pub acknowledged: u32,
    /// Since when the drone is going to land.
    pub landing: Option<Timestamp>,
    /// Whether the protocol asked for routes.
    pub discovered: bool,
    /// Whether the drone is done.
    pub stopped: bool,
    /// The signs of life.
    pub beats: Beats,
}
