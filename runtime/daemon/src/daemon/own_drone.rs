//! Which drone the process flies.

use muster_machines::identity::{Ballot, NodeId, SwarmId};

use crate::status::Role;

/// The drone of this process, from its configuration.
#[derive(Debug, Clone, Copy)]
pub(super) struct OwnDrone {
    pub(super) id: NodeId,
    pub(super) swarm: SwarmId,
    /// Whether it flies no mission and only forwards frames.
    pub(super) is_relay: bool,
}

impl OwnDrone {
    /// Its role under the ballot that it follows; `None` before it follows any.
    pub(super) fn role(self, ballot: Option<Ballot>) -> Role {
        match ballot {
            _ if self.is_relay => Role::Relay,
            None => Role::None,
            Some(ballot) if ballot.master == self.id => Role::Master,
            Some(_) => Role::Member,
        }
    }
}
