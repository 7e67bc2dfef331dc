//! Configuration of a link to a flight controller.

use std::time::Duration;

use crate::geodetic::Geodetic;
use crate::motion::Landing;

/// What a drone may do, lowest first. A drone does nothing above its stage. Stages above `bench` need a grant and a pilot's
/// receiver.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// Arms a simulated controller only.
    Sim,
    /// Telemetry. Never arms, and no motor turns.
    Bench,
    /// Flies what the pilot arms, with height, radius, tilt and throttle capped.
    Tethered,
    /// Flies what the pilot arms.
    Flight,
}

/// Who else commands the flight controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Receiver {
    /// Nobody: MSP is the only receiver (`feature RX_MSP`). For bench and simulation, since no pilot can take over.
    Sole,
    /// A pilot: the controller's own receiver arms, and gives MSP the sticks by a switch (`MSP OVERRIDE`).
    Override,
}

/// What measures where the vehicle is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PlaceSensor {
    /// The controller's GPS; its own height.
    Gps,
    /// A sensor beside the controller, whose poses the link is told. What GPS says is not used.
    Pose,
}

/// An optical flow module that looks down, its x axis forward and its y axis to the right.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FlowModule {
    /// Whether the floor is level wherever the vehicle flies, so that the distance to it tells the height.
    pub level_floor: bool,
}

/// Standard deviations and delays of a vehicle's sensors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Of a GPS position on each axis, in metres.
    pub position_m: f64,
    /// Of a GPS velocity on each axis, in m/s.
    pub velocity_mps: f64,
    /// Age of a GPS fix when it arrives.
    pub gps_delay: Duration,
    /// Of the controller's height, in metres.
    pub height_m: f64,
    /// Of the controller's climb rate, in m/s.
    pub climb_mps: f64,
    /// Of what the attitude doesn't say of the horizontal acceleration: drag and wind, in m/s² per √Hz.
    pub acceleration_mps2: f64,
    /// Of the vertical acceleration, in m/s² per √Hz.
    pub vertical_acceleration_mps2: f64,
}

impl Noise {
    /// A receiver of the u-blox M8 or M10 series with a barometer. Velocity: 0.05 m/s at half the readings (data sheet
    /// UBX-15031086). Position between fixes drifts by decimetres; its error to the map of 1.5 m is common to a flight.
    pub const GPS: Self = Self {
        position_m: 0.3,
        velocity_mps: 0.1,
        gps_delay: Duration::from_millis(100),
        height_m: 0.2,
        climb_mps: 0.3,
        acceleration_mps2: 0.5,
        vertical_acceleration_mps2: 1.0,
    };
}

/// Gains and limits of the flight by sticks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gains {
    /// Velocity per horizontal distance from the reference, in 1/s.
    pub position_per_s: f64,
    /// Acceleration per error of the horizontal velocity, in 1/s.
    pub velocity_per_s: f64,
    /// Growth of the acceleration per error of the horizontal velocity, in 1/s².
    pub integral_per_s2: f64,
    /// Climb per vertical distance from the reference, in 1/s.
    pub height_per_s: f64,
    /// Acceleration per error of the climb, in 1/s.
    pub climb_per_s: f64,
    /// Growth of the acceleration per error of the climb, in 1/s².
    pub climb_integral_per_s2: f64,
    /// Largest tilt, in radians.
    pub tilt_max_rad: f64,
    /// Deceleration per horizontal velocity in still air, in 1/s.
    pub drag_per_s: f64,
    /// Throttle at which the vehicle hovers, 0 to 1, until it is known better.
    pub hover_throttle: f64,
}

impl Gains {
    /// For a quadcopter that leans within 0.15 s: with that delay the horizontal loops, (2 s + 1)(s + 1) / s³, have a phase
    /// margin of 34° at 2.3 rad/s. Drag of rotors: 0.39 to 0.54 1/s (Faessler, Franchi, Scaramuzza, *Differential Flatness of
    /// Quadrotor Dynamics Subject to Rotor Drag*, RA-L 3(2), 2018).
    pub const QUADCOPTER: Self = Self {
        position_per_s: 1.0,
        velocity_per_s: 2.0,
        integral_per_s2: 1.0,
        height_per_s: 1.0,
        climb_per_s: 2.0,
        climb_integral_per_s2: 0.6,
        tilt_max_rad: 0.611,
        drag_per_s: 0.45,
        hover_throttle: 0.3,
    };
}

/// Configuration of a link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Config {
    /// What the drone may do.
    pub stage: Stage,
    /// Who else commands the controller.
    pub receiver: Receiver,
    /// Home of the drone's local frame.
    pub home: Geodetic,
    /// How the drone comes down.
    pub landing: Landing,
    /// What measures where the vehicle is.
    pub place: PlaceSensor,
    /// What measures its velocity over ground beside it. `None` without a module; then its measurements are ignored.
    pub flow: Option<FlowModule>,
    /// Sensors.
    pub noise: Noise,
    /// Flight by sticks.
    pub gains: Gains,
}
