use serde::{Deserialize, Serialize};

use super::{Checkpoint, Failure, Goal};
use crate::geometry::{Ned, Velocity};
use crate::identity::{NodeId, NodeSet};
use crate::indoor;
use crate::msp::{FlightCommand, LandingCause, Telemetry};
use crate::time::Timestamp;
use crate::traffic::Intent;

/// Input of a navigation.
#[derive(Debug, Clone, PartialEq)]
pub enum Input {
    /// From the mission: a new goal. The same goal again only asks whether it is reached.
    Goal(Goal),
    /// From the mission: report the position once.
    Locate,
    /// From the flight-controller link.
    Telemetry(Telemetry),
    /// From the radio: intent of another drone.
    Traffic {
        /// The other drone.
        sender: NodeId,
        /// Its intent; `None` if it no longer announces one.
        intent: Option<Intent>,
        /// When the radio heard it.
        heard_at: Timestamp,
    },
    /// From the routing: neighbours that are heard, and that may not hear this drone.
    Deaf(NodeSet),
    /// From the drone's range sensors and odometry; ignored without a map.
    Indoor(indoor::Input),
    /// From the link after a restart: repeat the command.
    Resync,
    /// From the radio after a restart: repeat the intent.
    ResendIntent,
}

/// Output of a navigation.
#[derive(Debug, Clone, PartialEq)]
pub enum Transmit {
    /// To the flight-controller link.
    FlightCommand(FlightCommand),
    /// To the mission.
    Inform(Notice),
    /// To the radio: the own intent.
    AnnounceIntent {
        /// The intent; `None` if the path is unknown.
        intent: Option<Intent>,
        /// Whether to send it immediately in a frame of its own.
        immediately: bool,
    },
    /// To the radio after a restart: repeat the intents of others.
    Resync,
}

/// Notice to the mission.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Notice {
    /// This goal is reached and the drone is at rest. The mission may have set another one meanwhile.
    Arrived(Goal),
    /// Answer to [`Input::Locate`].
    Position {
        /// Position.
        position: Ned,
        /// Velocity.
        velocity: Velocity,
    },
    /// The vehicle is landing without a command to land, for this reason if it is known.
    UncommandedLanding(Option<LandingCause>),
    /// The drone is on the ground and disarmed.
    Landed,
    /// A failure that was not reported before. On a lost position or a fence breach the drone holds until it gets
    /// another goal.
    Failing {
        /// The failure.
        failure: Failure,
        /// Position at rest if the drone braked now.
        stop: Ned,
        /// Whether the motors are armed.
        is_airborne: bool,
    },
    /// This navigation restarted: repeat the goal.
    Resync,
}

/// Event of a navigation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Event {
    /// Checkpoint for a restart.
    Checkpoint(Box<Checkpoint>),
    /// From the indoor machine.
    Indoor(indoor::Event),
    /// The velocity that the indoor machine takes for safe until the next one. No link flies it.
    Velocity(indoor::Velocity),
}
