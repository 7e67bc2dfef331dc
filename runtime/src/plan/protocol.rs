//! Parameters of the swarm's protocol.

use std::time::Duration;

use muster_machines::formation::PhaseKind;
use muster_machines::mission::{Barrier, Liveness, Succession};

use super::Policy;

/// Parameters of the swarm's protocol.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Protocol {
    /// How orders and acknowledgements spread.
    pub policy: Policy,
    /// Which drones a master waits for at a waypoint.
    pub barrier: Barrier,
    /// When a silent drone counts as lost.
    pub liveness: Liveness,
    /// What drones do when the master is lost.
    pub succession: Succession,
    /// Period of a drone's frames.
    pub period: Duration,
    /// Period of a landing drone's frames.
    pub keep_alive: Duration,
    /// Period of hellos during neighbour discovery.
    pub hello_period: Duration,
    /// Duration of neighbour discovery.
    pub discovery: Duration,
    /// The longest gap between two consecutive hellos.
    pub hello_gap: Duration,
    /// Number of consecutive hellos that make a neighbour stable.
    pub stable_after: u32,
    /// Silence after which a drone counts as lost.
    pub time_to_live: Duration,
    /// Period of the master's heartbeat; policy `tree` only.
    pub heartbeat: Duration,
    /// Retransmission timeout on each hop; policy `tree` only.
    pub repair: Duration,
}

impl Protocol {
    /// Additional tolerance for a silent master while routes change.
    pub(super) fn spreading_grace(&self) -> Duration {
        match self.succession {
            Succession::Elect => self.time_to_live * 3,
            Succession::Land => self.time_to_live,
        }
    }

    /// For how long a drone may be out of the master's reach in a phase by plan: half of what the two put up with, because a
    /// plan knows when drones arrive only roughly.
    #[must_use]
    pub fn tolerated(&self, kind: PhaseKind) -> Duration {
        let grace = match (kind, self.succession) {
            (PhaseKind::Leg { .. } | PhaseKind::Land { .. }, _) | (_, Succession::Land) => {
                Duration::ZERO
            }
            _ => self.spreading_grace(),
        };
        (self.time_to_live + grace) / 2
    }
}
