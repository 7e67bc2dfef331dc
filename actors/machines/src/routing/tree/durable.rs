use serde::{Deserialize, Serialize};

/// Durable state of policy `tree`. Neighbours are discovered again after a restart.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Checkpoint {
    /// Whether the protocol has requested routes.
    pub discovered: bool,
}
