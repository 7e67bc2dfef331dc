use std::fmt;

use bytes::Bytes;
use serde::{Deserialize, Serialize};

use super::hold::{Hold, Holds};
use super::order::Step;
use super::{Barrier, LandingReason};
use crate::flaw::{self, Flaw};
use crate::geometry::Ned;
use crate::identity::{NodeId, NodeSet};
use crate::leader::CurrentLeader;
use crate::time::Timestamp;

/// What a drone is doing: the thesis's states (its figures 3 and 17), the hop update's two made one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
pub enum State {
    /// On the ground, told nothing yet.
    #[default]
    Start,
    /// On the ground, sharing the mission.
    SetUp,
    /// On the way to its slot.
    TakingOff,
    /// In its slot, learning who is near.
    NeighbourDiscovery,
    /// In its slot, learning the way to the master.
    HopUpdate,
    /// At a waypoint, waiting for the swarm.
    WaypointReached {
        /// Which one.
        waypoint: u16,
    },
    /// On the way to a waypoint.
    MovingToWaypoint {
        /// Which one.
        waypoint: u16,
    },
    /// At a waypoint, changing formation with the swarm.
    ChangingFormation {
        /// Which change, the first one being 0.
        change: u16,
        /// Which step of it.
        step: Step,
    },
    /// Keeping formation on the master as it moves; the master: moving, and followed.
    Following,
    /// On the way to its slot around a master that has stopped, or there.
    Assembling,
    /// On the way to its landing place.
    MovingToLand,
    /// Descending.
    Landing,
    /// On the ground, disarmed.
    Finished,
}

impl State {
    /// Whether the drone is in the air and still takes part in the mission.
    #[must_use]
    pub const fn is_following(self) -> bool {
        match self {
            Self::TakingOff
            | Self::NeighbourDiscovery
            | Self::HopUpdate
            | Self::WaypointReached { .. }
            | Self::MovingToWaypoint { .. }
            | Self::ChangingFormation { .. }
            | Self::Following
            | Self::Assembling => true,
            Self::Start | Self::SetUp | Self::MovingToLand | Self::Landing | Self::Finished => {
                false
            }
        }
    }

    /// Whether the swarm is taking off or changing formation, so that ways are lost and found again meanwhile.
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

    /// Whether the drone is in the air with nothing to do until somebody tells it more, once it is in its slot.
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
        }
    }
}

/// What outlives a mission.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Checkpoint {
    /// Whom the drone obeys.
    pub leader: CurrentLeader,
    /// What the drone is doing.
    pub state: State,
    /// The mission, as far as it is known.
    pub plan: Vec<Ned>,
    /// Whether all of it is.
    pub plan_complete: bool,
    /// How far the routing has got.
    pub routes: RoutesPhase,
    /// The highest waypoint that was opened.
    pub opened: Option<u16>,
    /// How many changes of formation have been made.
    pub changes: u16,
    /// Which wave of the take-off, of a crossing or of the landing was ordered last; `None` before its first.
    pub wave: Option<u16>,
    /// The order that is being carried out; acknowledged once it is.
    pub pending: Option<u32>,
    /// The newest order that is carried out; 0 before the first.
    pub acknowledged: u32,
    /// Whether the drone flies in its own altitude layer, because there may be some it is not in lockstep with.
    pub in_layer: bool,
    /// Whether it is on its way to where it can do what the others were told.
    pub catches_up: bool,
    /// Why the drone goes to land by itself: as soon as it is in its slot, or on its way already.
    pub leaving: Option<LandingReason>,
    /// Where the centre of the formation lands.
    pub land_at: Ned,
    /// Where the swarm assembled around its master after following it.
    pub assembled_at: Option<Ned>,
    /// By when what the drone waits for must have happened.
    pub limit: Option<Timestamp>,
    /// Until when it may fly; nothing before it takes off.
    pub flies_until: Option<Timestamp>,
    /// What only a master has.
    pub lead: Option<Lead>,
    /// Whether the drone's process started anew since it was first told something: the drone does not arm any more.
    pub restarted: bool,
    /// How long the swarm waits at waypoints, as far as the mission is known.
    pub holds: Holds,
}

impl Checkpoint {
    /// Whether what must never fall back has changed since `before`: whom the drone obeys, what it is doing, which
    /// numbers its orders may have used.
    pub(crate) fn is_news(&self, before: &Self) -> bool {
        let order = |it: &Self| it.lead.as_ref().map(|lead| lead.sequence);
        self.leader != before.leader
            || self.state != before.state
            || self.opened != before.opened
            || self.changes != before.changes
            || self.wave != before.wave
            || self.leaving != before.leaving
            || self.plan_complete != before.plan_complete
            || order(self) != order(before)
    }

    /// The drone's process has started anew.
    pub(crate) fn begin_incarnation(&mut self) {
        self.restarted |= !matches!(self.state, State::Start | State::Finished);
    }
}

/// How far the routing has got.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize)]
pub enum RoutesPhase {
    /// Not begun.
    #[default]
    None,
    /// Neighbour discovery.
    Discovery,
    /// Hop update.
    HopUpdate,
    /// Routes are up.
    Ready,
}

/// A master's own state.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Lead {
    /// The number of its newest order.
    pub sequence: u32,
    /// That order, encoded.
    pub order: Bytes,
    /// The other drones of the swarm.
    pub members: NodeSet,
    /// Who has carried the newest order out.
    pub acknowledged: NodeSet,
    /// Who has not been heard of for its time to live.
    pub silent: NodeSet,
    /// Until when it waits for these all the same.
    pub bears_silence_until: Option<Timestamp>,
    /// Who is on its way to the ground, or there already.
    pub landing: NodeSet,
    /// Who did not get ready in time: the swarm flies without them.
    pub left_out: NodeSet,
    /// Whom it hears itself.
    pub neighbours: NodeSet,
    /// What only a master has that is followed.
    pub followed: Option<Followed>,
    /// The hold that began last.
    pub hold: Option<Hold>,
}

/// What a master knows that is followed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Followed {
    /// Which waypoint it makes for, where nobody flies it by hand.
    pub bound_for: u16,
    /// When it next tells the others where it is.
    pub next_fix: Timestamp,
    /// Where it was when it last did.
    pub at: Ned,
    /// Whether it is to stop, so that all can land.
    pub is_ending: bool,
}

impl Lead {
    /// A leader epoch of `own` over a swarm of so many drones that begins.
    pub(super) fn over(drones: u32, own: NodeId) -> Self {
        Self {
            members: NodeSet::from(0..drones).difference(&own.into()),
            ..Self::default()
        }
    }

    /// The members that hold up the newest order: any, or only those that the master hears itself.
    pub(super) fn awaited(&self, barrier: Barrier) -> NodeSet {
        let silent = match self.bears_silence_until {
            Some(_) => &NodeSet::default(),
            None => &self.silent,
        };
        let out_of_it = [&self.acknowledged, silent, &self.landing, &self.left_out];
        let awaited = match barrier {
            Barrier::Strict => self.members.clone(),
            Barrier::Neighbours => self.members.intersection(&self.neighbours),
        };
        let forgotten = if flaw::has(Flaw::ForgetsOneMember) {
            self.members.iter().last().into_iter().collect()
        } else {
            NodeSet::default()
        };
        out_of_it
            .into_iter()
            .chain([&forgotten])
            .fold(awaited, |left, out| left.difference(out))
    }

    /// Whether there is nobody left who flies along, though somebody who did has fallen silent.
    pub(super) fn is_alone(&self) -> bool {
        let there = self.members.difference(&self.silent);
        let flying = there.difference(&self.landing);
        !self.silent.is_empty() && flying.difference(&self.left_out).is_empty()
    }
}
