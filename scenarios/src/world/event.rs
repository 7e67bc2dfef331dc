//! Events that are scheduled to happen.

use std::time::Duration;

use bytes::Bytes;
use muster_machines::geometry::Velocity;
use muster_machines::identity::NodeId;
use muster_machines::node::Address;

use super::message::Origin;
use crate::scenario::DroneFault;

/// An event that is scheduled. An event that names a generation, an incarnation or a hang is void once that has changed.
#[derive(Debug)]
pub(super) enum Event {
    /// The operator tells a master to fly.
    Fly(NodeId),
    /// The medium's next timeout.
    Medium,
    /// A frame reaches a radio.
    Arrive {
        to: NodeId,
        datagram: Bytes,
        origin: Origin,
    },
    /// The medium reports whether a unicast frame was delivered.
    Outcome(muster_transport::Outcome),
    /// An actor's timer expires.
    Wake {
        drone: NodeId,
        address: Address,
        generation: u32,
    },
    /// A vehicle's motion ends.
    ComeToRest { drone: NodeId, generation: u32 },
    /// A tick of the port to a drone's flight controller.
    PortTick(NodeId),
    /// Periodic update of the radios' positions.
    PlaceRadios,
    /// A battery's charge falls by one step.
    Drained(NodeId),
    /// A vehicle regains its position.
    PositionFound(NodeId),
    /// An event of a drone's process.
    Process(NodeId, ProcessEvent),
    /// A fault of the plan is injected, for the `nth` time from 0.
    Fault { index: usize, nth: u32 },
    /// A fault of the plan ends.
    FaultOver { index: usize },
    /// In a mirror: a fault affects a drone, after its process.
    Affect {
        drone: NodeId,
        fault: DroneFault,
        lasts: Option<Duration>,
    },
    /// The pilot of a master moves the sticks.
    Steer(NodeId, Velocity),
    /// The operator ends the flight that a master leads.
    Land(NodeId),
}

/// An event of a drone's process.
#[derive(Debug, Clone, Copy)]
pub(super) enum ProcessEvent {
    /// A failed actor is built again.
    RestartActor { address: Address, incarnation: u32 },
    /// The process starts.
    Boot { incarnation: u32 },
    /// The flight controller's link timeout.
    LinkTimeout(Silence),
    /// The watchdog timeout of a hung actor, or of the hung process (`None`).
    Watchdog { actor: Option<Address>, hang: u32 },
    /// A hang ends.
    Resume { hang: u32 },
    /// Messages held back during a hang are queued.
    Backlog { incarnation: u32 },
    /// The clock's rate error changes to this, in parts per million.
    Skew { ppm: i32 },
}

/// Why a flight controller receives nothing from its companion computer.
#[derive(Debug, Clone, Copy)]
pub(super) enum Silence {
    /// The process has ended; the number is the incarnation that would follow.
    Ended { incarnation: u32 },
    /// The process hangs, since the hang of this number.
    Hung(u32),
}
