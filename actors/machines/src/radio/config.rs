use super::Budget;
use crate::identity::{NodeId, SwarmId};

/// What a radio is built with.
#[derive(Debug, Clone)]
pub struct Config {
    /// Whose radio this is.
    pub id: NodeId,
    /// The swarm it belongs to.
    pub swarm: SwarmId,
    /// How much of each sender is let in.
    pub budget: Budget,
    /// How many members the swarm has, relays included; ids run from 0 to one below.
    pub members: u32,
    /// How lives are numbered, and which one this is.
    pub incarnations: Incarnations,
}

/// How the lives of drones' processes are numbered, so that what was said in an earlier one does not count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Incarnations {
    /// By each drone's journal, where none is ever lost: whoever is known is believed in a later life than before, and in no
    /// earlier one. Only a radio that has lived before itself asks those whom it does not know to prove themselves.
    Counted,
    /// By numbers that each start draws, this life's being the one here: of two nobody can tell which is the later. A radio
    /// believes a sender in the life in which it has signed the radio's nonce and in no other, whoever may have recorded
    /// what, and whatever journal was lost.
    Drawn(u32),
}
