//! What the faults of a plan met when they were injected.

use muster_machines::mission::State;

/// A fault that was injected, and the state that it met.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Injection {
    /// The index of the fault in its plan.
    pub fault: usize,
    /// The phase of the affected drone; the master's if the fault affects no single drone.
    pub phase: Phase,
    /// Whether that drone was a master.
    pub leads: bool,
    /// Whether some of the swarm had no master, or several.
    pub electing: bool,
    /// Whether the swarm had several segments.
    pub apart: bool,
}

/// The phase of a drone's flight, as far as faults are concerned.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Phase {
    /// It waits on the ground to take off.
    Ground,
    /// It takes off, or waits in its slot until the first waypoint is reached.
    TakingOff,
    /// It waits at a waypoint.
    Waiting,
    /// It flies to a waypoint.
    Flying,
    /// It changes its place in the formation.
    Changing,
    /// It keeps its place around a master that moves, or has stopped.
    Following,
    /// Its agent decides where it flies.
    OnTask,
    /// It comes down.
    Landing,
    /// It has finished, or is dead.
    Down,
}

impl Phase {
    /// All of them, in the order of a flight.
    pub const ALL: [Self; 9] = [
        Self::Ground,
        Self::TakingOff,
        Self::Waiting,
        Self::Flying,
        Self::Changing,
        Self::Following,
        Self::OnTask,
        Self::Landing,
        Self::Down,
    ];

    pub(super) const fn of(state: State) -> Self {
        match state {
            State::Start | State::SetUp => Self::Ground,
            State::TakingOff | State::NeighbourDiscovery | State::HopUpdate => Self::TakingOff,
            State::WaypointReached { .. } => Self::Waiting,
            State::MovingToWaypoint { .. } => Self::Flying,
            State::ChangingFormation { .. } => Self::Changing,
            State::Following | State::Assembling => Self::Following,
            State::OnTask | State::Independent => Self::OnTask,
            State::MovingToLand | State::Landing => Self::Landing,
            State::Finished => Self::Down,
        }
    }
}
