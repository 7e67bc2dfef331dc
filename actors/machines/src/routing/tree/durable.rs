use serde::{Deserialize, Serialize};

/// What a routing of policy `tree` adds to a checkpoint; who is near is learnt anew.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Checkpoint {
    /// Whether the protocol asked for routes.
    pub discovered: bool,
}
