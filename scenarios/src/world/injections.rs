//! What each fault of a plan met when it befell.

use muster_machines::identity::NodeId;
use muster_machines::mission::State;

use super::World;
use crate::scenario::{FaultKind, Target};

/// A fault that befell, and what it met.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Injection {
    /// Which of the plan's faults.
    pub(crate) fault: usize,
    /// What the drone was doing that it befell; of a fault that befalls no one drone, the master.
    pub(crate) phase: Phase,
    /// Whether that was a master.
    pub(crate) leads: bool,
    /// Whether some of the swarm had no master, or several.
    pub(crate) electing: bool,
    /// Whether the swarm was in several parts.
    pub(crate) apart: bool,
}

/// What a drone is doing, as far as faults are concerned.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Phase {
    /// It waits on the ground to take off.
    Ground,
    /// It is on the way to its slot, or there, until the first waypoint is reached.
    TakingOff,
    /// It waits at a waypoint.
    Waiting,
    /// It is on its way to a waypoint.
    Flying,
    /// It changes its place in the formation.
    Changing,
    /// It keeps its place around a master that moves, or has stopped.
    Following,
    /// It comes down.
    Landing,
    /// It is done, or dead.
    Down,
}

impl Phase {
    /// All of them, in the order of a flight.
    pub(crate) const ALL: [Self; 8] = [
        Self::Ground,
        Self::TakingOff,
        Self::Waiting,
        Self::Flying,
        Self::Changing,
        Self::Following,
        Self::Landing,
        Self::Down,
    ];

    const fn of(state: State) -> Self {
        match state {
            State::Start | State::SetUp => Self::Ground,
            State::TakingOff | State::NeighbourDiscovery | State::HopUpdate => Self::TakingOff,
            State::WaypointReached { .. } => Self::Waiting,
            State::MovingToWaypoint { .. } => Self::Flying,
            State::ChangingFormation { .. } => Self::Changing,
            State::Following | State::Assembling => Self::Following,
            State::MovingToLand | State::Landing => Self::Landing,
            State::Finished => Self::Down,
        }
    }
}

impl World {
    /// Writes down that a fault befalls, and what it meets.
    pub(super) fn record_injection(&mut self, fault: usize) {
        let target = match self.plan.kind(fault) {
            FaultKind::Drone(Target::Drone(drone), _) => Some(*drone),
            _ => self.find_target(Target::Master),
        };
        let own = self.own_swarm();
        let record = target.map(|id| own.recorder.of(id));
        let is_dead = record.is_none_or(|it| it.killed.is_some());
        let phase = match target {
            Some(id) if !is_dead => Phase::of(own.recorder.state(id)),
            _ => Phase::Down,
        };
        let leads = |id: NodeId| self.election.leader(id).is_some_and(|it| it.master == id);
        self.struck.push(Injection {
            fault,
            phase,
            leads: target.is_some_and(leads),
            electing: own.recorder.is_electing(),
            apart: own.segments.iter().count() > 1,
        });
    }
}
