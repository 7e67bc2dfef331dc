use std::time::Duration;

use crate::identity::NodeId;

/// Configuration of policy `tree`.
#[derive(Debug, Clone)]
pub struct Config {
    /// This drone.
    pub id: NodeId,
    /// Number of drones in the swarm; their ids are 0 to `drones - 1`.
    pub drones: u32,
    /// Number of pure relays, whose ids follow the drones'. They forward frames, run no mission and are not awaited.
    pub relays: u32,
    /// Period of the master's heartbeat.
    pub heartbeat_period: Duration,
    /// Heartbeat period of a drone that has been going to land for `time_to_live`: others no longer depend on it.
    pub landing_period: Duration,
    /// Repair interval: how long a drone waits for an acknowledgement of a hop before it sends again.
    pub repair: Duration,
    /// Longest repair interval after back-off.
    pub repair_max: Duration,
    /// Link timeout: a neighbour that is silent for longer is removed, later if its link loses frames.
    pub link_time_to_live: Duration,
    /// The master reports a member as silent after this time without a route to it.
    pub time_to_live: Duration,
    /// A drone reports the master as silent after this time without a route to it.
    pub route_timeout: Duration,
}

impl Config {
    /// Time until a change reaches a neighbour, without the time in the air: each repair makes up for a loss, and at 40
    /// % loss the mean is less than one repair.
    #[must_use]
    pub fn hop_latency(&self) -> Duration {
        self.repair * 2
    }
}
