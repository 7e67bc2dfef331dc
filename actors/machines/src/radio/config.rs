use super::Budget;
use crate::identity::{NodeId, SwarmId};

/// Configuration of a radio.
#[derive(Debug, Clone)]
pub struct Config {
    /// Own drone.
    pub id: NodeId,
    /// Own swarm.
    pub swarm: SwarmId,
    /// Budget of admitted frames per sender.
    pub budget: Budget,
    /// Number of members, relays included; ids run from 0 to one below.
    pub members: u32,
    /// Numbering of incarnations.
    pub incarnations: Incarnations,
}

/// How incarnations are numbered, so that frames of an earlier one are not accepted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Incarnations {
    /// Counted by the drone's journal, which is never lost. A known sender is accepted in a later incarnation and in no
    /// earlier one. Only a radio with earlier incarnations asks unknown senders for a freshness proof.
    Counted,
    /// Drawn at each start, with this incarnation's number; their order is unknown. A radio accepts a sender only in an
    /// incarnation that has signed the radio's nonce. So recorded frames and lost journals do no harm.
    Drawn(u32),
}
