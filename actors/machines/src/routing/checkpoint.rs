//! The state of a routing that outlives a restart.

use serde::{Deserialize, Serialize};

use super::{Heartbeats, LeaderEpoch, flood, tree};
use crate::identity::Ballot;
use crate::time::Timestamp;

/// State from which a restarted routing resumes: the part of both policies, and the part of one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    /// The part of both policies.
    pub common: Durable,
    /// The part of one policy.
    pub policy: PolicyCheckpoint,
}

/// The durable state that both policies share.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Durable {
    /// The current leader and its newest order.
    pub epoch: LeaderEpoch,
    /// When the drone started to land; `None` if it is not going to land.
    pub landing: Option<Timestamp>,
    /// Whether the drone is done, and sends nothing more.
    pub stopped: bool,
    /// Heartbeat sequences.
    pub heartbeats: Heartbeats,
}

/// The durable state of one policy.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum PolicyCheckpoint {
    /// Of policy `flood`.
    Flood(flood::Checkpoint),
    /// Of policy `tree`.
    Tree(tree::Checkpoint),
}

impl Checkpoint {
    /// The current leader; `None` before the first.
    #[must_use]
    pub const fn ballot(&self) -> Option<Ballot> {
        self.common.epoch.ballot()
    }

    /// Whether state that must never fall back differs from `before`: the leader, reserved sequences, landing, stopped,
    /// and the phase of policy `flood`.
    pub(crate) fn has_advanced_since(&self, before: &Self) -> bool {
        let (own, was) = (&self.common, &before.common);
        let phases = match (&self.policy, &before.policy) {
            (PolicyCheckpoint::Flood(own), PolicyCheckpoint::Flood(was)) => own.phase != was.phase,
            (PolicyCheckpoint::Tree(_), PolicyCheckpoint::Tree(_)) => false,
            _ => true,
        };
        phases
            || (own.landing, own.stopped) != (was.landing, was.stopped)
            || own.epoch.has_advanced_since(&was.epoch)
            || own.heartbeats.reserved() != was.heartbeats.reserved()
    }
}
