//! The flight controller's link, as the drone sees it: what it is asked for and what it tells.
//!
//! The machine behind it is either the link to a real flight controller or a simulated one, which only the scenario
//! runner has.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::geometry::{Ned, Velocity};
use crate::machine::Machine;

/// What a link is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum FlightCommand {
    /// Tell how the vehicle is.
    Report,
    /// Arm, on the ground.
    Arm,
    /// Leave the vehicle to the pilot again, from whom a [`Setpoint::Hold`] has taken it.
    Yield,
    /// Fly so.
    Fly(Setpoint),
    /// Come down on the spot and disarm there.
    Land,
}

/// How a vehicle is to fly.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Setpoint {
    /// For vehicles that fly legs: straight there, from rest to rest.
    Leg {
        /// The end of the leg.
        to: Ned,
        /// The highest speed along it, in m/s.
        speed_mps: f64,
        /// Along the leg, in m/s².
        acceleration_mps2: f64,
    },
    /// For vehicles that take moving targets: get to a place that moves, and move along with it.
    Track {
        /// Where the place is now.
        to: Ned,
        /// How it moves.
        velocity: Velocity,
        /// The highest speed, in m/s.
        speed_mps: f64,
        /// The highest acceleration, in m/s².
        acceleration_mps2: f64,
        /// For how long it may be thought to move so; the vehicle comes to rest then unless it is told more.
        hold: Duration,
    },
    /// Come to rest, whoever flies it, and climb or descend to a height meanwhile. It takes no position over ground.
    Hold {
        /// In metres above home.
        altitude_m: f64,
        /// The highest speed upwards or downwards, in m/s.
        vertical_mps: f64,
        /// Over ground and in height, each, in m/s².
        acceleration_mps2: f64,
    },
}

/// How a vehicle is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Telemetry {
    /// Where it is; over ground, where it last knew that it was.
    pub position: Ned,
    /// For how long it has not known where it is over ground; nothing while it knows.
    pub position_lost_for: Option<Duration>,
    /// How it moves.
    pub velocity: Velocity,
    /// Where it would be at rest if it braked now; its position when it is at rest.
    pub stop: Ned,
    /// Whether it stands still.
    pub at_rest: bool,
    /// Whether its motors are armed.
    pub armed: bool,
    /// Whether it is coming down to land.
    pub landing: bool,
    /// The end of the leg that it flies.
    pub target: Option<Ned>,
    /// What is left in its battery, as a share of a full one.
    pub charge: f64,
}

/// What a link is told.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Input {
    /// By the navigation.
    FlightCommand(FlightCommand),
    /// By the vehicle.
    Telemetry(Telemetry),
    /// By the supervisor: an actor can't be kept alive, so land and obey nobody any more.
    GiveUp,
}

/// What a link sends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Transmit {
    /// To the vehicle.
    Command(FlightCommand),
    /// To the navigation.
    Telemetry(Telemetry),
    /// To the navigation: this link restarted, tell it again what it should do.
    Resync,
}

/// What can be seen of a link.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event {
    /// What a restarted link is built from.
    Checkpoint(Checkpoint),
}

/// What outlives a link.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Checkpoint {
    /// Whether the supervisor has told it to land and to obey nobody.
    pub gave_up: bool,
}

/// Any machine that can hold a drone's link.
pub trait Link:
    Machine<Input = Input, Transmit = Transmit, Event = Event, Rejection = std::convert::Infallible>
    + Send
{
}

impl<T> Link for T where
    T: Machine<
            Input = Input,
            Transmit = Transmit,
            Event = Event,
            Rejection = std::convert::Infallible,
        > + Send
{
}
