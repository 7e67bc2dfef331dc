use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::geometry::{Ned, Velocity};

/// What a master tells its swarm to do, one order after the other.
#[derive(Debug, Clone, PartialEq)]
pub enum Order {
    /// A part of the mission; carried out once the part is stored.
    Plan {
        /// Which part.
        index: u16,
        /// How many parts there are.
        count: u16,
        /// Its waypoints, for the centre of the formation.
        waypoints: Vec<Ned>,
        /// How long the swarm waits at each of them once all have arrived, in whole milliseconds, at most
        /// [`Holds::MAX`](super::Holds::MAX); empty if it waits at none.
        holds: Vec<Duration>,
    },
    /// Take off; carried out once in the slot at waypoint 0, by drones of later waves at once.
    TakeOff {
        /// Which wave takes off, the first being 0.
        wave: u16,
    },
    /// Go to a waypoint; carried out once there.
    Move {
        /// The waypoint that is opened, 0 being where the take-off ends.
        waypoint: u16,
        /// Whether some of the swarm may be elsewhere, so that all fly in their layers from now on.
        apart: bool,
    },
    /// Gather beside the master and land; carried out once on the ground.
    Land {
        /// Where the centre of the formation lands, at the height of the last waypoint.
        at: Ned,
        /// How many changes of formation have been made: which formation's places are landed on.
        changes: u16,
        /// Which wave lands, the first being 0; drones of later waves have carried it out at once.
        wave: u16,
        /// As for [`Self::Move`].
        apart: bool,
    },
    /// Take a step of a change of formation; carried out once it is taken.
    Reform {
        /// Which change, the first one being 0.
        change: u16,
        /// Which step of it.
        step: Step,
        /// Which wave crosses, the first being 0; 0 in the other steps.
        wave: u16,
        /// As for [`Self::Move`].
        apart: bool,
    },
    /// Keep formation on a centre that moves; replaced by the next such order, and never acknowledged.
    Follow {
        /// Where the centre of the formation is.
        at: Ned,
        /// How it moves.
        velocity: Velocity,
    },
    /// End the following: be in the slot around a centre at rest; carried out once there.
    Assemble {
        /// Where the centre of the formation is.
        at: Ned,
    },
}

/// A step of a change of formation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Step {
    /// Climb into the sector.
    Climb,
    /// Fly level to above the new slot.
    Cross,
    /// Descend into the new slot.
    Descend,
}

impl Step {
    /// The step after this one.
    #[must_use]
    pub const fn next(self) -> Option<Self> {
        match self {
            Self::Climb => Some(Self::Cross),
            Self::Cross => Some(Self::Descend),
            Self::Descend => None,
        }
    }
}
