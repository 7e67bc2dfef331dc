//! What is shown of a run in several places.

use muster_machines::mission::State;
use muster_runtime::text::figure;
use muster_scenarios::report::{DroneReport, Report, Role};

/// A drone's part in the radio network; sets its colour and mark.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Kind {
    /// Led the swarm.
    Master,
    /// Relayed orders for other drones.
    Relay,
    /// Relayed nothing.
    Leaf,
}

impl Kind {
    /// All kinds, in the order of the legend.
    pub(super) const ALL: [Self; 3] = [Self::Master, Self::Relay, Self::Leaf];

    /// That of a drone.
    pub(super) const fn of(drone: &DroneReport) -> Self {
        match (drone.role, drone.relay) {
            (Role::Master, _) => Self::Master,
            (Role::Member, true) => Self::Relay,
            (Role::Member, false) => Self::Leaf,
        }
    }

    /// Name in texts and in CSS classes.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Master => "master",
            Self::Relay => "relay",
            Self::Leaf => "leaf",
        }
    }
}

/// The mission state at the end for people: a drone that landed early did not finish.
pub(super) fn final_state(drone: &DroneReport) -> &str {
    if drone.landed_because.is_some() && drone.state == State::Finished.to_string() {
        "landed early"
    } else {
        &drone.state
    }
}

/// The speed-up in words; `None` if the run took no measurable time.
pub(super) fn speedup_text(report: &Report) -> Option<String> {
    let speedup = report.speedup()?;
    Some(if speedup >= 10.0 {
        format!("{} times faster than real time", figure(speedup, 0))
    } else {
        format!("{} times real time", figure(speedup, 1))
    })
}
