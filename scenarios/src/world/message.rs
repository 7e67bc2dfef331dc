//! Messages to actors, and the tasks that an engine executes.

use muster_machines::identity::NodeId;
use muster_machines::machine::Stimulus;
use muster_machines::node::{Address, Envelope};

/// What an engine executes next.
#[derive(Debug)]
pub(crate) struct Task {
    pub(crate) drone: NodeId,
    pub(crate) address: Address,
    pub(crate) what: What,
}

impl Task {
    pub(super) const fn new(drone: NodeId, address: Address, what: What) -> Self {
        Self {
            drone,
            address,
            what,
        }
    }
}

#[derive(Debug)]
pub(crate) enum What {
    /// Step the machine.
    Step(Stimulus<Envelope>),
    /// Make the actor panic.
    Crash,
    /// Build the actor again.
    Restart,
    /// Build all five actors under a new supervisor.
    Boot,
}

/// A message for one of a drone's actors.
#[derive(Debug)]
pub(super) struct Message {
    pub(super) envelope: Envelope,
    pub(super) origin: Origin,
}

impl Message {
    /// A message that its sender meant for this actor.
    pub(super) const fn genuine(envelope: Envelope) -> Self {
        Self {
            envelope,
            origin: Origin::Genuine,
        }
    }
}

/// Whether a radio may admit a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Origin {
    /// The sender in its header sent it: it may be admitted.
    Genuine,
    /// A recorded frame that was sent again: a radio may admit it that has not admitted it before.
    Replayed,
    /// Altered, forged, or sent by another swarm: no radio may admit it.
    Spurious,
}

impl Origin {
    /// The same at a receiver that is of the sender's swarm, or not.
    pub(super) const fn within(self, is_own_swarm: bool) -> Self {
        if is_own_swarm { self } else { Self::Spurious }
    }
}
