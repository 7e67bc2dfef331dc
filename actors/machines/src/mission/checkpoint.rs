//! State of a mission that survives a restart.

use std::fmt;

use bytes::Bytes;
use serde::{Deserialize, Serialize};

use super::Step;
use super::hold::{Hold, Holds};
use super::{Barrier, LandingReason};
use crate::flaw::{self, Flaw};
use crate::geometry::Ned;
use crate::identity::{NodeId, NodeSet};
use crate::leader::CurrentLeader;
use crate::time::Timestamp;
use crate::wire::PLAN_PART_MAX;

/// What a drone does: the states of the thesis (figures 3 and 17), with the two of the hop update merged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
pub enum State {
    /// On the ground, without orders.
    #[default]
    Start,
    /// On the ground, receiving the mission.
    SetUp,
    /// Flies to its slot.
    TakingOff,
    /// In its slot, discovers neighbours.
    NeighbourDiscovery,
    /// In its slot, finds a route to the master.
    HopUpdate,
    /// At a waypoint, waits for the swarm.
    WaypointReached {
        /// Number of the waypoint, from 0.
        waypoint: u16,
    },
    /// Flies to a waypoint.
    MovingToWaypoint {
        /// Number of the waypoint, from 0.
        waypoint: u16,
    },
    /// At a waypoint, changes formation with the swarm.
    ChangingFormation {
        /// Number of the change, from 0.
        change: u16,
        /// Step of the change.
        step: Step,
    },
    /// Keeps formation on a moving master; a master: moves and is followed.
    Following,
    /// In its slot around a master that has stopped, or on the way there.
    Assembling,
    /// Flies to its landing place.
    MovingToLand,
    /// Descends.
    Landing,
    /// On the ground, disarmed.
    Finished,
    /// In the air; the drone's agent decides where it flies.
    OnTask,
    /// On task, and out of the swarm: it follows nobody and leads nobody.
    Independent,
}

impl State {
    /// Whether the drone is in the air and takes part in the mission.
    #[must_use]
    pub const fn is_on_mission(self) -> bool {
        match self {
            Self::TakingOff
            | Self::NeighbourDiscovery
            | Self::HopUpdate
            | Self::WaypointReached { .. }
            | Self::MovingToWaypoint { .. }
            | Self::ChangingFormation { .. }
            | Self::Following
            | Self::Assembling
            | Self::OnTask
            | Self::Independent => true,
            Self::Start | Self::SetUp | Self::MovingToLand | Self::Landing | Self::Finished => {
                false
            }
        }
    }

    /// Whether the swarm takes off or changes formation, during which routes change.
    #[must_use]
    pub const fn is_spreading(self) -> bool {
        matches!(
            self,
            Self::TakingOff
                | Self::NeighbourDiscovery
                | Self::HopUpdate
                | Self::ChangingFormation { .. }
        )
    }

    /// Whether the drone waits in the air for its next order, or will once it is in its slot.
    #[must_use]
    pub const fn is_waiting(self) -> bool {
        matches!(
            self,
            Self::TakingOff
                | Self::NeighbourDiscovery
                | Self::HopUpdate
                | Self::WaypointReached { .. }
                | Self::ChangingFormation { .. }
                | Self::Following
                | Self::Assembling
                | Self::OnTask
        )
    }
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Start => f.write_str("start"),
            Self::SetUp => f.write_str("set-up"),
            Self::TakingOff => f.write_str("taking off"),
            Self::NeighbourDiscovery => f.write_str("neighbour discovery"),
            Self::HopUpdate => f.write_str("hop update"),
            Self::WaypointReached { waypoint } => write!(f, "waypoint {waypoint} reached"),
            Self::MovingToWaypoint { waypoint } => write!(f, "moving to waypoint {waypoint}"),
            Self::ChangingFormation { step, .. } => f.write_str(match step {
                Step::Climb => "changing formation: climbing",
                Step::Cross => "changing formation: crossing",
                Step::Descend => "changing formation: descending",
            }),
            Self::Following => f.write_str("following"),
            Self::Assembling => f.write_str("assembling"),
            Self::MovingToLand => f.write_str("moving to land"),
            Self::Landing => f.write_str("landing"),
            Self::Finished => f.write_str("finished"),
            Self::OnTask => f.write_str("on task"),
            Self::Independent => f.write_str("independent"),
        }
    }
}

/// State of a mission that survives a restart. postcard writes its fields in this order.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Checkpoint {
    /// The current leader.
    pub leader: CurrentLeader,
    /// What the drone does.
    pub state: State,
    /// The mission as far as it is known.
    pub plan: KnownPlan,
    /// Progress of the routing.
    pub routes: RoutesPhase,
    /// Progress of the swarm along the mission.
    pub progress: Progress,
    /// The orders of the current leader.
    pub orders: Orders,
    /// Whether the drone flies in step with the others.
    pub lockstep: Lockstep,
    /// Why and where the drone lands.
    pub landing: Landing,
    /// Time limits.
    pub deadlines: Deadlines,
    /// State of a master. `None` for members.
    pub lead: Option<Lead>,
    /// Whether the process restarted after it received its first order. The drone does not arm any more.
    pub restarted: bool,
    /// Holds at waypoints, as far as the mission is known.
    pub holds: Holds,
}

/// A mission, which arrives in parts.
///
/// Invariant: the waypoints are the first ones of the mission, without gaps; they change on the ground only.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct KnownPlan {
    /// The known waypoints.
    pub waypoints: Vec<Ned>,
    /// Whether all parts have arrived.
    pub is_complete: bool,
}

impl KnownPlan {
    /// A waypoint by number. `None` if it is unknown.
    pub(super) fn waypoint(&self, number: u16) -> Option<Ned> {
        self.waypoints.get(usize::from(number)).copied()
    }

    /// Appends part `index` of `count`. Returns `false` and changes nothing if it is not the next one or holds too much.
    pub(super) fn append(&mut self, (index, count): (u16, u16), part: &[Ned], max: usize) -> bool {
        let known = self.waypoints.len();
        let is_next = known == usize::from(index) * PLAN_PART_MAX;
        if !is_next || part.len() > PLAN_PART_MAX || known + part.len() > max {
            return false;
        }
        self.waypoints.extend_from_slice(part);
        self.is_complete = index + 1 >= count;
        true
    }
}

/// Progress of the swarm along the mission.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
pub struct Progress {
    /// The highest open waypoint.
    pub opened: Option<u16>,
    /// Completed changes of formation.
    pub changes: u16,
    /// The last ordered wave of the take-off, of a crossing or of the landing. `None` before the first.
    pub wave: Option<u16>,
}

/// The orders of the current leader, by sequence number.
///
/// Invariant: `acknowledged` never falls within a leader epoch.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
pub struct Orders {
    /// The order that is being executed; it is acknowledged once it is done.
    pub pending: Option<u32>,
    /// The newest order that is done; 0 before the first.
    pub acknowledged: u32,
}

impl Orders {
    /// Whether an order is done or being executed.
    pub(super) fn is_known(&self, sequence: u32) -> bool {
        sequence <= self.acknowledged || self.pending == Some(sequence)
    }

    /// Marks an order as done. Returns whether it is newer than all that were.
    pub(super) const fn acknowledge(&mut self, sequence: u32) -> bool {
        let is_newer = sequence > self.acknowledged;
        if is_newer {
            self.acknowledged = sequence;
        }
        is_newer
    }

    /// A new leader: no earlier order is acknowledged any more, but one that is being executed still is.
    pub(super) fn start_epoch(&mut self) {
        self.acknowledged = 0;
        self.pending = self.pending.map(|_| 0);
    }
}

/// Whether the drone flies in step with the others.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
pub struct Lockstep {
    /// Whether the drone flies in its own altitude layer, as some drones may not be in lockstep with it.
    pub in_layer: bool,
    /// Whether it has yet to climb there, above its slot at the waypoint that it is at or flies to.
    pub climbs: bool,
    /// Whether it is on its way to catch up with the others.
    pub catches_up: bool,
}

/// Why and where the drone lands.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Landing {
    /// Why the drone lands by itself, as soon as it is in its slot or already.
    pub reason: Option<LandingReason>,
    /// Where the centre of the formation lands.
    pub at: Ned,
    /// Where the swarm assembled around its master after following it.
    pub assembled_at: Option<Ned>,
}

/// Time limits of the mission.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
pub struct Deadlines {
    /// When the drone stops waiting for what it waits for.
    pub limit: Option<Timestamp>,
    /// End of the flight time. `None` before the take-off.
    pub flight_ends_at: Option<Timestamp>,
}

impl Checkpoint {
    /// Whether state has changed since `before` that must never fall back: the leader, the state, progress, and the
    /// sequence numbers that orders may have used.
    pub(crate) fn has_advanced_since(&self, before: &Self) -> bool {
        let sequence = |it: &Self| it.lead.as_ref().map(|lead| lead.sequence);
        self.leader != before.leader
            || self.state != before.state
            || self.progress != before.progress
            || self.landing.reason != before.landing.reason
            || self.plan.is_complete != before.plan.is_complete
            || sequence(self) != sequence(before)
    }

    /// The drone's process has restarted.
    pub(crate) fn begin_incarnation(&mut self) {
        self.restarted |= !matches!(self.state, State::Start | State::Finished);
    }
}

/// Progress of the routing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize)]
pub enum RoutesPhase {
    /// Not started.
    #[default]
    None,
    /// Neighbour discovery.
    Discovery,
    /// Hop update.
    HopUpdate,
    /// Routes are ready.
    Ready,
}

/// State of a master.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Lead {
    /// Sequence number of the newest order.
    pub sequence: u32,
    /// The newest order, encoded.
    pub order: Bytes,
    /// The other drones of the swarm.
    pub members: NodeSet,
    /// Members that have executed the newest order.
    pub acknowledged: NodeSet,
    /// Members that were not heard for their time to live.
    pub silent: NodeSet,
    /// Until when the master waits for silent members nevertheless.
    pub silence_tolerated_until: Option<Timestamp>,
    /// Members that are landing or on the ground.
    pub landing: NodeSet,
    /// Members that were not ready in time: the swarm flies without them.
    pub left_out: NodeSet,
    /// Members that the master hears itself.
    pub neighbours: NodeSet,
    /// State of a master that is followed. `None` in missions with waypoints.
    pub followed: Option<Followed>,
    /// The last hold that began.
    pub hold: Option<Hold>,
    /// `None` in the first epoch.
    pub elected: Option<Elected>,
}

/// How an elected master came to lead.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Elected {
    /// When it claimed to lead.
    pub at: Timestamp,
    /// The master that it missed.
    pub replaced: Option<NodeId>,
}

/// State of a master that is followed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Followed {
    /// The waypoint that it flies to, unless a pilot flies it.
    pub destination_waypoint: u16,
    /// When it next announces its position.
    pub next_fix: Timestamp,
    /// The position that it announced last.
    pub at: Ned,
    /// Whether it stops, so that all can land.
    pub is_ending: bool,
}

impl Lead {
    /// The state of master `own` at the start of its epoch.
    pub(super) fn new(drones: u32, own: NodeId, elected: Option<Elected>) -> Self {
        Self {
            members: NodeSet::from(0..drones).difference(&own.into()),
            elected,
            ..Self::default()
        }
    }

    /// The members that the newest order still waits for.
    pub(super) fn awaited(&self, barrier: Barrier) -> NodeSet {
        let silent = match self.silence_tolerated_until {
            Some(_) => &NodeSet::default(),
            None => &self.silent,
        };
        let excluded = [&self.acknowledged, silent, &self.landing, &self.left_out];
        let awaited = match barrier {
            Barrier::Strict => self.members.clone(),
            Barrier::Neighbours => self.members.intersection(&self.neighbours),
        };
        let skipped = if flaw::has(Flaw::IgnoresLastMember) {
            self.members.iter().last().into_iter().collect()
        } else {
            NodeSet::default()
        };
        excluded
            .into_iter()
            .chain([&skipped])
            .fold(awaited, |left, out| left.difference(out))
    }

    /// Records that members have executed order `sequence`, or land.
    pub(super) fn record_progress(
        &mut self,
        sequence: u32,
        acknowledged: &NodeSet,
        landing: &NodeSet,
    ) {
        if sequence >= self.sequence {
            self.acknowledged.extend_from(acknowledged);
        }
        self.landing.extend_from(landing);
    }

    /// Records that members were not heard for their time to live. Until `waits_until` the master waits for them
    /// nevertheless.
    pub(super) fn mark_silent(&mut self, members: &NodeSet, waits_until: Option<Timestamp>) {
        self.silent
            .extend_from(&members.intersection(&self.members));
        if waits_until.is_some() {
            self.silence_tolerated_until = waits_until;
        }
    }

    /// When it was elected, if it misses others among `members` than the master that it replaced.
    pub(super) fn elected_without(&self, members: &NodeSet) -> Option<Timestamp> {
        let elected = self.elected?;
        let mut others = members.iter().filter(|id| Some(*id) != elected.replaced);
        others.next().map(|_| elected.at)
    }

    /// Records that members were heard.
    pub(super) fn mark_heard(&mut self, members: &NodeSet) {
        self.silent = self.silent.difference(members);
    }

    /// Whether some members may fly elsewhere: they are silent or left out, and have not announced that they land.
    pub(super) fn has_strays(&self) -> bool {
        let mut missed = self.silent.clone();
        missed.extend_from(&self.left_out);
        !missed.difference(&self.landing).is_empty()
    }

    /// Whether no member flies with the master any more, though some fell silent in the air.
    pub(super) fn is_alone(&self) -> bool {
        let heard = self.members.difference(&self.silent);
        let flying = heard.difference(&self.landing);
        !self.silent.is_empty() && flying.difference(&self.left_out).is_empty()
    }
}
