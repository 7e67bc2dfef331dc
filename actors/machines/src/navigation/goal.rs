use std::collections::VecDeque;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::geometry::{Ned, Velocity};

/// Distance to the end of a leg at which a drone at rest has arrived, in metres; the predecessor's arrival radius.
pub(super) const ARRIVAL_RADIUS_M: f64 = 1.0;

/// Goal of a drone, as set by its mission.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Goal {
    /// Arm, climb vertically, fly level to above `to`, descend to `to`.
    TakeOff {
        /// Slot.
        to: Ned,
        /// Altitude of the level leg, in metres above home.
        transit_altitude_m: f64,
        /// Whether to arm; otherwise a disarmed vehicle stays on the ground.
        arm: bool,
    },
    /// Fly straight to `to`.
    FlyTo {
        /// Destination.
        to: Ned,
        /// Hold altitude if the leg is interrupted, in metres above home.
        hold_altitude_m: f64,
    },
    /// Climb or descend to the altitude of `to`, then fly level.
    TransitTo {
        /// Destination.
        to: Ned,
    },
    /// Follow a moving place.
    Track {
        /// Current position of the place.
        to: Ned,
        /// As in [`Self::FlyTo`].
        hold_altitude_m: f64,
        /// Velocity of the place.
        velocity: Velocity,
        /// How long the velocity is valid. After that the drone comes to rest unless it gets a new goal; after twice as
        /// long it climbs or descends to its hold altitude, at which it returns.
        hold: Duration,
    },
    /// Come to rest.
    Hold,
    /// Leave the vehicle to the pilot.
    Yield,
    /// Land on the spot and disarm.
    Land,
}

impl Goal {
    /// Hold altitude, in metres above home; `None` if the goal has none.
    pub(super) fn hold_altitude_m(self) -> Option<f64> {
        match self {
            Self::FlyTo {
                hold_altitude_m, ..
            }
            | Self::Track {
                hold_altitude_m, ..
            } => Some(hold_altitude_m),
            Self::TakeOff {
                transit_altitude_m, ..
            } => Some(transit_altitude_m),
            Self::TransitTo { to } => Some(to.altitude_m()),
            Self::Hold | Self::Yield | Self::Land => None,
        }
    }

    /// Whether the drone may leave its path for another drone.
    pub(super) const fn may_make_room(self) -> bool {
        match self {
            Self::TakeOff { .. } | Self::FlyTo { .. } | Self::TransitTo { .. } | Self::Hold => true,
            Self::Track { .. } | Self::Yield | Self::Land => false,
        }
    }

    /// Corners of the path from `start`; empty for goals without legs.
    pub(super) fn corners(self, start: Ned) -> VecDeque<Ned> {
        let corners = match self {
            Self::TakeOff {
                to,
                transit_altitude_m,
                ..
            } => vec![
                start.at_altitude(transit_altitude_m),
                to.at_altitude(transit_altitude_m),
                to,
            ],
            Self::FlyTo {
                to,
                hold_altitude_m,
            } => corners_from_hold_altitude(start, to, hold_altitude_m),
            Self::TransitTo { to } => vec![start.at_altitude(to.altitude_m()), to],
            Self::Hold => vec![start],
            Self::Land | Self::Track { .. } | Self::Yield => Vec::new(),
        };
        corners.into()
    }
}

/// Persistent state of a navigation.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Checkpoint {
    /// Current goal.
    pub goal: Option<Goal>,
    /// Progress towards the goal.
    pub progress: Progress,
}

/// Progress towards a goal.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub enum Progress {
    /// Waiting for telemetry to plan the legs.
    #[default]
    Planning,
    /// Remaining corners, next one first; empty while landing, tracking or yielding. One that has left a tracked place has a corner
    /// at the altitude at which it returns.
    Flying(VecDeque<Ned>),
    /// Reached.
    Done,
}

/// Corners of the path to a slot. From its hold altitude a drone descends only once it is above the slot.
fn corners_from_hold_altitude(start: Ned, to: Ned, hold_altitude_m: f64) -> Vec<Ned> {
    let height_m = start.altitude_m();
    let is_at_hold_altitude = (height_m - hold_altitude_m).abs() < ARRIVAL_RADIUS_M
        && height_m > to.altitude_m() + ARRIVAL_RADIUS_M;
    if is_at_hold_altitude {
        vec![to.at_altitude(height_m), to]
    } else {
        vec![to]
    }
}
