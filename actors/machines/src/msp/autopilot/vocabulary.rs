//! Reports of an autopilot, and orders of its link to it, whatever bytes they travel in.

use crate::geodetic::Geodetic;
use crate::geometry::{Ned, Velocity};

/// Report of an autopilot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum AutopilotReport {
    /// It is alive. Expected once a second.
    Heartbeat {
        /// The motors are armed.
        armed: bool,
        /// What it flies by.
        mode: Mode,
    },
    /// Whether it stands or flies.
    Landed(Landed),
    /// Where its local frame begins.
    Origin(Geodetic),
    /// Where it is, in its local frame.
    Place {
        /// Position.
        position: Ned,
        /// Velocity.
        velocity: Velocity,
    },
    /// Battery charge, as a fraction of a full one.
    Charge(f64),
    /// It flies a simulation, and no motor. Expected once a second from one that does.
    Simulated,
}

/// What an autopilot flies by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// It takes orders.
    Guided,
    /// It lands.
    Landing,
    /// A pilot's sticks, a mission of its own, or a failsafe.
    Other,
}

/// Whether an autopilot stands or flies, as it sees it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Landed {
    /// It stands on the ground.
    Ground,
    /// It is on its way to the height of [`Order::TakeOff`].
    TakingOff,
    /// It flies.
    Air,
    /// It lands.
    Landing,
}

/// Order to an autopilot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Order {
    /// Its link is alive. While these stop, the autopilot's own failsafe is to act.
    Heartbeat,
    /// Send every [`AutopilotReport`], from now on.
    RequestTelemetry,
    /// Take orders.
    Guide,
    /// Arm, on the ground.
    Arm,
    /// Climb from the ground.
    TakeOff {
        /// Height above the place of the take-off, in metres.
        height_m: f64,
    },
    /// Maximum speeds from now on, in m/s; 0: as before.
    Speed {
        /// Over ground.
        over_ground_mps: f64,
        /// Up and down.
        vertical_mps: f64,
    },
    /// Fly straight to a place; repeated while it holds.
    Fly {
        /// In the autopilot's local frame.
        to: Ned,
        /// Velocity of the place; zero to come to rest there.
        velocity: Velocity,
    },
    /// Land on the spot and disarm.
    Land,
}
