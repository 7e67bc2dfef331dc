use std::collections::BTreeSet;
use std::ops::Range;
use std::time::Duration;

use muster_machines::identity::NodeId;
use muster_machines::mission::{LandingReason, State};
use muster_machines::routing::Routes;
use muster_machines::time::Timestamp;

/// The record of a drone or relay.
#[derive(Debug, Clone)]
pub(crate) struct Record {
    /// Its states, and when it entered each; never empty.
    pub(crate) states: Vec<(Timestamp, State)>,
    /// The drone that it follows; `None` before it follows any.
    pub(crate) leader: Option<NodeId>,
    /// The leader that it followed when it went to land; `None` before.
    pub(crate) landed_under: Option<NodeId>,
    /// Its routes, as they were until its leader went to land.
    pub(crate) routes: Routes,
    pub(crate) reason: Option<LandingReason>,
    pub(crate) given_up: bool,
    /// When its companion computer died, or the aircraft fell.
    pub(crate) killed: Option<Timestamp>,
    /// Whether its battery is empty.
    pub(crate) ran_empty: bool,
    pub(crate) fell: bool,
    /// Whether its routing has left the swarm.
    pub(crate) has_left: bool,
    /// Restarts of its actors.
    pub(crate) restarts: u32,
    /// Restarts of its process.
    pub(crate) reboots: u32,
    pub(crate) armed: Option<Timestamp>,
    pub(crate) disarmed: Option<Timestamp>,
}

impl Record {
    /// The record of a node at the start of a run.
    pub(super) fn new() -> Self {
        Self {
            states: vec![(Timestamp::ZERO, State::Start)],
            leader: None,
            landed_under: None,
            routes: Routes::default(),
            reason: None,
            given_up: false,
            killed: None,
            ran_empty: false,
            fell: false,
            has_left: false,
            restarts: 0,
            reboots: 0,
            armed: None,
            disarmed: None,
        }
    }

    /// Its present state.
    pub(crate) fn state(&self) -> State {
        let last = self.states.last();
        last.map(|(_, state)| *state).unwrap_or_default()
    }

    /// When neighbour discovery began.
    pub(crate) fn discovery(&self) -> Option<Timestamp> {
        self.states
            .iter()
            .find(|(_, state)| is_in_discovery_or_beyond(*state))
            .map(|(at, _)| *at)
    }

    /// Whether it landed where the swarm lands.
    pub(crate) fn landed_with_swarm(&self) -> bool {
        self.reason == Some(LandingReason::MissionOver) && self.killed.is_none()
    }

    /// Whether it took off and came down again, by itself or with its controller's failsafe. One that fell did not land.
    pub(crate) fn has_landed(&self) -> bool {
        let flown = self.armed.zip(self.disarmed);
        !self.fell && flown.is_some_and(|(armed, disarmed)| disarmed >= armed)
    }

    /// Whether it never took off, though it was not lost: it was neither killed nor restarted, and no actor was given up.
    pub(crate) fn stayed_behind(&self) -> bool {
        let was_lost = self.killed.is_some() || self.ran_empty || self.given_up;
        self.armed.is_none() && !was_lost && self.reboots == 0
    }

    /// Whether its agent flew it.
    pub(crate) fn was_on_task(&self) -> bool {
        self.states.iter().any(|(_, state)| *state == State::OnTask)
    }

    /// Whether it landed because its task was over. A dead drone counts, too: nobody waits for it.
    pub(crate) fn ended_its_task(&self) -> bool {
        self.killed.is_some() || self.landed_with_swarm()
    }

    /// From when until when it kept formation on a master that it followed, or was that master.
    pub(crate) fn following(&self, ended: Timestamp) -> Option<Range<Timestamp>> {
        let begins = self
            .states
            .iter()
            .position(|(_, state)| *state == State::Following)?;
        let until = self.states.get(begins + 1).map_or(ended, |(at, _)| *at);
        Some(self.states[begins].0..until)
    }

    /// How many different waypoints it has reached.
    pub(crate) fn waypoints(&self) -> usize {
        let reached = self.states.iter().filter_map(|(_, state)| match state {
            State::WaypointReached { waypoint } => Some(*waypoint),
            _ => None,
        });
        reached.collect::<BTreeSet<_>>().len()
    }

    /// Its stays at waypoints, from arrival to departure, holds included.
    pub(crate) fn stays(&self) -> impl Iterator<Item = (u16, Duration)> + '_ {
        self.states.windows(2).filter_map(|pair| match pair[0].1 {
            State::WaypointReached { waypoint } => Some((waypoint, pair[1].0 - pair[0].0)),
            _ => None,
        })
    }
}

/// Whether a drone in this state has begun neighbour discovery and has yet to land.
pub(super) const fn is_in_discovery_or_beyond(state: State) -> bool {
    matches!(
        state,
        State::NeighbourDiscovery
            | State::HopUpdate
            | State::MovingToWaypoint { .. }
            | State::WaypointReached { .. }
            | State::ChangingFormation { .. }
            | State::Following
            | State::Assembling
            | State::OnTask
            | State::Independent
    )
}
