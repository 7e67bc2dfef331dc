//! The outcome of a run.

use std::time::Duration;

use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;
use muster_machines::mission::State;
use muster_machines::time::Timestamp;
use muster_runtime::vehicle::Vehicle;
use muster_transport::sim::Counters;

use super::injection::Injection;
use super::port::PortFigures;
use super::recorder::{Incident, Record, Recorder};
use crate::checkers::Violation;
use crate::report::{self, ControlSeries};
use crate::scenario::Scenario;

/// How a run ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Ending {
    /// The flight is over: all drones must have disarmed.
    Flown,
    /// The operator ended it; drones may be in the air.
    Interrupted,
}

/// The outcome of a run.
#[derive(Debug)]
pub struct Outcome {
    pub(crate) trace: String,
    /// When the run ended, in simulated time.
    pub ended: Timestamp,
    /// The closest approach of two drones, in metres. `None` if rules were not checked.
    pub(crate) closest_m: Option<f64>,
    pub(crate) violations: Vec<Violation>,
    /// What the faults of the plan met, in the order of their injection.
    pub injections: Vec<Injection>,
    /// The medium's counters, for all swarms together.
    pub(crate) medium: Counters,
    /// The scenario's own swarm first.
    pub(crate) swarms: Vec<SwarmOutcome>,
}

impl Outcome {
    /// The first violation of a rule.
    #[must_use]
    pub fn violation(&self) -> Option<report::Violation> {
        self.violations.first().map(report::Violation::from)
    }

    /// Whether a drone of the scenario's own swarm came down when the first rule was broken: it was landing, or its process did not
    /// run, so that its flight controller might bring it down.
    #[must_use]
    pub fn came_down(&self, drone: NodeId) -> bool {
        let Some(at) = self.violations.first().map(|it| it.at) else {
            return false;
        };
        let recorder = &self.swarms[0].recorder;
        let states = &recorder.of(drone).states;
        let state = states.iter().take_while(|(since, _)| *since <= at).last();
        let lands = state.is_some_and(|(_, state)| *state == State::Landing);
        let happenings = recorder.history().happenings().iter();
        let mut happened = happenings
            .rev()
            .filter(|it| it.node == drone && it.at <= at);
        let ended = happened.find_map(|it| it.what.ends_commands());
        lands || ended == Some(true)
    }

    /// Whether a drone of the scenario's own swarm had left lockstep when the first rule was broken.
    #[must_use]
    pub fn left_lockstep(&self, drone: NodeId) -> bool {
        let Some(at) = self.violations.first().map(|it| it.at) else {
            return false;
        };
        let happenings = self.swarms[0].recorder.history().happenings().iter();
        let mut earlier = happenings.take_while(|it| it.at <= at);
        earlier.any(|it| it.node == drone && it.what == Incident::LeavesLockstep)
    }

    /// Whether the remaining drones of the scenario's own swarm completed the mission.
    #[must_use]
    pub fn is_completed(&self, scenario: &Scenario) -> bool {
        report::is_completed(scenario, &self.swarms[0].recorder)
    }
}

/// The outcome of a swarm's flight.
#[derive(Debug)]
pub(crate) struct SwarmOutcome {
    pub(crate) recorder: Recorder,
    /// Of drones first, then of relays.
    pub(crate) vehicles: Vec<Vehicle>,
    /// Of drones first, then of relays; `None` without a flight controller.
    pub(crate) ports: Vec<Option<PortFigures>>,
    /// How each was flown, likewise.
    pub(crate) controls: Vec<Option<ControlSeries>>,
}

/// The positions of a vehicle from arming to disarming: each second, and at each turn.
pub(crate) fn track(vehicle: &Vehicle, record: &Record, ended: Timestamp) -> Vec<(Timestamp, Ned)> {
    let (Some(from), to) = (record.armed, record.disarmed.unwrap_or(ended)) else {
        return vec![(Timestamp::ZERO, vehicle.motion().position(Timestamp::ZERO))];
    };
    let second = Duration::from_secs(1);
    let each_second =
        std::iter::successors(Some(from), |at| Some(*at + second)).take_while(|at| *at < to);
    let turns = vehicle.motion().pieces().iter().map(|piece| piece.start);
    let mut instants: Vec<_> = each_second.chain(turns).chain([from, to]).collect();
    instants.sort_unstable();
    instants.dedup();
    instants
        .into_iter()
        .filter(|at| (from..=to).contains(at))
        .map(|at| (at, vehicle.motion().position(at)))
        .collect()
}
