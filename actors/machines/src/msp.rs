//! Flight-controller link: commands to the vehicle and telemetry from it.
//!
//! The machine behind it is the link to a flight controller ([`ControllerLink`]), to an autopilot ([`AutopilotLink`]), or that
//! of a closed-form vehicle in the scenario runner.

pub mod autopilot;
pub mod controller;
mod introduction;
mod outputs;
mod silence;

use std::time::Duration;

use muster_msp::SetRawRc;
use serde::{Deserialize, Serialize};

pub use self::autopilot::AutopilotLink;
pub use self::controller::{ControllerLink, PortEvent, Pose};
pub use self::introduction::Introduction;

use crate::geometry::{Ned, Velocity};
use crate::machine::Machine;

/// Command to the flight controller.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum FlightCommand {
    /// Report telemetry.
    Report,
    /// Arm, on the ground.
    Arm,
    /// Return control to the pilot after a [`Setpoint::Hold`].
    Yield,
    /// Fly to a setpoint.
    Fly(Setpoint),
    /// Land on the spot and disarm.
    Land,
}

/// Setpoint of a vehicle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Setpoint {
    /// For vehicles that fly legs: fly straight, from rest to rest.
    Leg {
        /// End of the leg.
        to: Ned,
        /// Maximum speed along the leg, in m/s.
        speed_mps: f64,
        /// Acceleration along the leg, in m/s².
        acceleration_mps2: f64,
    },
    /// For vehicles that accept moving targets: reach a moving place and follow it.
    Track {
        /// Current position of the place.
        to: Ned,
        /// Velocity of the place.
        velocity: Velocity,
        /// Maximum speed, in m/s.
        speed_mps: f64,
        /// Maximum acceleration, in m/s².
        acceleration_mps2: f64,
        /// How long the velocity is valid; then the vehicle comes to rest unless it gets a new setpoint.
        hold: Duration,
    },
    /// Come to rest, also in manual control, and climb or descend to an altitude. Needs no horizontal position.
    Hold {
        /// Altitude, in metres above home.
        altitude_m: f64,
        /// Maximum vertical speed, in m/s.
        vertical_mps: f64,
        /// Horizontal and vertical acceleration each, in m/s².
        acceleration_mps2: f64,
    },
}

/// State of a vehicle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Telemetry {
    /// Position; without a horizontal one by dead reckoning, or the last known one of a link that has none.
    pub position: Ned,
    /// Time without a horizontal position; `None` if it is known.
    pub position_lost_for: Option<Duration>,
    /// Velocity.
    pub velocity: Velocity,
    /// Position at rest if it braked now; equal to `position` at rest.
    pub stop: Ned,
    /// Whether it is stationary.
    pub at_rest: bool,
    /// Whether the motors are armed.
    pub armed: bool,
    /// Whether it is landing, or somebody else flies it.
    pub landing: bool,
    /// Why it lands without an order. `None` if it doesn't, or if its flight controller doesn't say.
    pub landing_cause: Option<LandingCause>,
    /// End of the current leg.
    pub target: Option<Ned>,
    /// Battery charge, as a fraction of a full one.
    pub charge: f64,
}

/// Why a vehicle lands without an order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum LandingCause {
    /// Its pilot took it over.
    Pilot,
    /// It leant too far.
    Tilt,
    /// Its throttle had no effect.
    Thrust,
    /// A motor was at its limit, or all of them trembled.
    Motors,
    /// The voltage under load was too low.
    Volts,
}

/// Share of charge that is news.
const CHARGE_STEP: f64 = 0.01;

impl Telemetry {
    /// Whether the navigation must know it at once. `last`: what it was told last.
    fn is_news(&self, last: Option<Self>) -> bool {
        last.is_none_or(|last| {
            (last.armed, last.landing, last.at_rest) != (self.armed, self.landing, self.at_rest)
                || last.position_lost_for.is_some() != self.position_lost_for.is_some()
                || (last.charge - self.charge).abs() >= CHARGE_STEP
        })
    }
}

/// Input of a link.
#[derive(Debug, Clone, PartialEq)]
pub enum Input {
    /// From the navigation.
    FlightCommand(FlightCommand),
    /// From a closed-form vehicle.
    Telemetry(Telemetry),
    /// From the port of a flight controller or an autopilot.
    Port(PortEvent),
    /// From the supervisor: an actor can't be kept alive, so land and ignore all commands.
    GiveUp,
}

/// Output of a link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Transmit {
    /// To a closed-form vehicle.
    Command(FlightCommand),
    /// To the port of a flight controller: the newest RC frame, to be repeated for a bounded time. `None` stops RC.
    Rc(Option<SetRawRc>),
    /// To the port of an autopilot.
    Order(autopilot::Order),
    /// To the navigation.
    Telemetry(Telemetry),
    /// To the navigation: this link restarted, repeat the command.
    Resync,
}

/// Event of a link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Event {
    /// Checkpoint for a restart.
    Checkpoint(Checkpoint),
}

/// Persistent state of a link.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Checkpoint {
    /// Whether the supervisor has made it land and ignore all commands.
    pub gave_up: bool,
    /// What a vehicle with a flight controller or an autopilot was flying.
    pub flight: Option<controller::Flight>,
}

impl Checkpoint {
    /// Whether nothing has changed that a checkpoint is written for.
    fn is_same(&self, other: &Self) -> bool {
        let is_same_flight = match (&self.flight, &other.flight) {
            (Some(flight), Some(other)) => flight.is_same(other),
            (flight, other) => flight == other,
        };
        self.gave_up == other.gave_up && is_same_flight
    }
}

/// A machine that can be a drone's flight-controller link.
pub trait Link: Machine<Input = Input, Transmit = Transmit, Event = Event> + Send {}

impl<T> Link for T where T: Machine<Input = Input, Transmit = Transmit, Event = Event> + Send {}
