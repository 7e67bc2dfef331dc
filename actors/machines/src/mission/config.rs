//! Configuration of a mission.

use std::sync::Arc;
use std::time::Duration;

use super::{Following, Holds};
use crate::formation::{Change, Layout};
use crate::geometry::Ned;
use crate::identity::NodeId;

/// Configuration of a mission.
#[derive(Debug, Clone)]
pub struct Config {
    /// The drone.
    pub id: NodeId,
    /// Slots, landing places and altitude layers at take-off.
    pub layout: Arc<Layout>,
    /// The waypoints of the mission; empty for a drone without a mission file.
    pub mission: Arc<[Ned]>,
    /// The swarm's holds at the waypoints.
    pub holds: Holds,
    /// Changes of formation, in order.
    pub changes: Arc<[Change]>,
    /// What the swarm does once all drones are in their slots.
    pub conduct: Conduct,
    /// Which members a master waits for at a waypoint.
    pub barrier: Barrier,
    /// When a silent master or member counts as lost.
    pub liveness: Liveness,
    /// What a drone in the air does once its master counts as lost.
    pub succession: Succession,
    /// What a master in the air does that hears no other drone.
    pub alone: Alone,
    /// Additional tolerance while routes change: for a silent master during take-off and changes of formation (with
    /// elections only), for silent members during take-off.
    pub spreading_grace: Duration,
    /// Back-off before claiming leadership, for each drone of better rank except the lost master.
    pub candidacy_back_off: Duration,
    /// How long the master waits for members to get ready on the ground.
    pub set_up_limit: Duration,
    /// How long the master waits for the members of a wave to reach their slots.
    pub take_off_limit: Duration,
    /// How long the master waits for the members of a wave to land.
    pub landing_limit: Duration,
    /// How long drones out of lockstep climb into their altitude layers at most.
    pub climb_limit: Duration,
    /// Time limit of a leg. A drone that takes longer lands.
    pub leg_limit: Duration,
    /// Maximum flight time. After it the drone lands as soon as it is in its slot, or on the spot if that takes longer
    /// than [`Self::leg_limit`].
    pub flight_time: Duration,
    /// Maximum number of waypoints of a mission.
    pub waypoints_max: usize,
}

/// What a swarm does once all drones are in their slots.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Conduct {
    /// It flies from waypoint to waypoint; each is opened once all drones have reached the one before.
    Waypoints,
    /// It keeps formation on a moving master.
    Following(Following),
    /// Each drone's agent decides.
    Task,
}

/// Which members a master waits for at a waypoint. On the ground and during take-off it always waits for all.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Barrier {
    /// All members.
    Strict,
    /// The members that the master hears directly, as in the thesis's figures.
    Neighbours,
}

/// When a silent master or member counts as lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Liveness {
    /// Its heartbeat sequence has not risen for the time to live. Checked at any time.
    Heartbeat,
    /// Likewise, but checked only while waiting at a waypoint, as in the thesis.
    Thesis,
}

/// What a drone in the air does once its master counts as lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Succession {
    /// It claims leadership, unless it hears a better ballot.
    Elect,
    /// It lands at the end of its leg.
    Land,
}

/// What a master in the air does that has not heard any other drone for the time to live.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Alone {
    /// It flies on, as a swarm of one.
    CarryOn,
    /// It lands from its current or next waypoint.
    Land,
}

impl Config {
    /// How members follow a moving master. `None` in other flights.
    pub(super) const fn following(&self) -> Option<Following> {
        match self.conduct {
            Conduct::Following(following) => Some(following),
            Conduct::Waypoints | Conduct::Task => None,
        }
    }
}
