//! What flies: its limits, sensors and gains, and the simulated aircraft.

use muster_machines::msp::controller;
use schemars::JsonSchema;
use serde::Deserialize;

use super::{
    Gain, Gusts, Height, IntegralGain, Lean, Payload, PoseSigma, Rate, ReceiverName, Seconds,
    Share, Sigma, Throttle, VehicleKindName, Wear, Whole, Wind,
};
use crate::schema::{Located, Or};

/// A multirotor with ArduCopter's usual limits.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[vehicle]`")]
pub struct Vehicle {
    /// What flies.
    #[serde(default)]
    pub kind: VehicleKindName,
    /// Who else commands the flight controllers.
    #[schemars(extend("x-default" = "\"sole\"", "x-condition" = "only with `kind` = \"msp\""))]
    pub receiver: Option<Located<ReceiverName>>,
    /// Speed over ground; 10 m/s as in ArduCopter's `WPNAV_SPEED` and the theses.
    #[serde(default)]
    pub speed_mps: Or<Rate, 10>,
    /// Acceleration on any leg; ArduCopter's `WPNAV_ACCEL`.
    #[serde(default)]
    pub acceleration_mps2: Or<Rate, 1>,
    /// Speed upwards; ArduCopter's `WPNAV_SPEED_UP`.
    #[serde(default)]
    pub climb_mps: Or<Rate, 5, 2>,
    /// Speed downwards; ArduCopter's `WPNAV_SPEED_DN`.
    #[serde(default)]
    pub descent_mps: Or<Rate, 3, 2>,
    /// Speed downwards close to the ground; ArduCopter's `LAND_SPEED`.
    #[serde(default)]
    pub landing_mps: Or<Rate, 1, 2>,
    /// Height below which `landing_mps` applies; ArduCopter's `LAND_ALT_LOW`.
    #[serde(default)]
    pub landing_altitude_m: Or<Height, 10>,
    /// Longest hover at the end of a leg, drawn evenly per leg; a landing is no leg.
    #[serde(default)]
    pub settle_ms: Or<Whole<0, 60_000>, 0>,
    /// How long a full battery lasts with the motors armed. An empty battery takes the drone down.
    #[schemars(extend("x-default" = "batteries do not drain"))]
    pub endurance_s: Option<Seconds>,
    /// A sensor beside the flight controller measures where the vehicle is, as motion capture does. Without this table GPS
    /// does. Only with `vehicle.kind = "msp"`.
    pub pose: Option<Located<PoseSensor>>,
    /// An optical flow module beside the flight controller looks down and measures velocity over ground. A position that is lost
    /// stays known by it for a while. Only with `vehicle.kind = "msp"`.
    pub flow: Option<Located<FlowSensor>>,
    /// Gains of the flight by sticks, as `muster fc tune` prints them. Only with `vehicle.kind = "msp"`.
    pub gains: Option<Located<Gains>>,
}

/// Gains and limits of the flight by sticks; by default those of a quadcopter that leans within 0.15 s.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[vehicle.gains]`")]
pub struct Gains {
    /// Velocity per horizontal distance from where the vehicle should be, in 1/s.
    #[serde(default)]
    pub position_per_s: Or<Gain, 1>,
    /// Acceleration per error of the horizontal velocity, in 1/s.
    #[serde(default)]
    pub velocity_per_s: Or<Gain, 2>,
    /// Growth of the acceleration per error of the horizontal velocity, in 1/s².
    #[serde(default)]
    pub integral_per_s2: Or<IntegralGain, 1>,
    /// Climb rate per distance in height, in 1/s.
    #[serde(default)]
    pub height_per_s: Or<Gain, 1>,
    /// Acceleration per error of the climb rate, in 1/s.
    #[serde(default)]
    pub climb_per_s: Or<Gain, 2>,
    /// Growth of the acceleration per error of the climb rate, in 1/s².
    #[serde(default)]
    pub climb_integral_per_s2: Or<IntegralGain, 6, 10>,
    /// Largest tilt; 35°.
    #[serde(default)]
    pub tilt_max_rad: Or<Lean, 611, 1_000>,
    /// Deceleration per horizontal velocity in still air, in 1/s.
    #[serde(default)]
    pub drag_per_s: Or<IntegralGain, 45, 100>,
    /// Throttle at which the vehicle hovers, until it is learnt in flight.
    #[serde(default)]
    pub hover_throttle: Or<Throttle, 3, 10>,
}

/// A pose sensor, by default as good as motion capture over a radio.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[vehicle.pose]`")]
pub struct PoseSensor {
    /// Standard deviation on each axis, in metres.
    #[serde(default)]
    pub sigma_m: Or<PoseSigma, 5, 100>,
    /// From one measurement to the next.
    #[serde(default)]
    pub period_ms: Or<Whole<10, 1_000>, 100>,
    /// From a measurement to its arrival.
    #[serde(default)]
    pub delay_ms: Or<Whole<0, 500>, 100>,
    /// Share of measurements that are wrong by up to 5 m on each axis.
    #[serde(default)]
    pub outliers: Or<Share, 0>,
}

/// An optical flow module with a range sensor, by default much like those of the PAW3902 class.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[vehicle.flow]`")]
pub struct FlowSensor {
    /// Standard deviation of a simulated module's rates about each axis.
    #[serde(default)]
    pub sigma_radps: Or<Sigma, 5, 100>,
    /// Greatest distance to the ground that a simulated module measures.
    #[serde(default)]
    pub range_max_m: Or<Height, 8>,
    /// From one measurement of a simulated module to the next.
    #[serde(default)]
    pub period_ms: Or<Whole<10, 1_000>, 20>,
    /// Whether the floor is level wherever the drones fly, so that the distance to it tells their height.
    #[serde(default)]
    pub level_floor: bool,
}

impl From<&Gains> for controller::Gains {
    fn from(raw: &Gains) -> Self {
        Self {
            position_per_s: raw.position_per_s.0,
            velocity_per_s: raw.velocity_per_s.0,
            integral_per_s2: raw.integral_per_s2.0,
            height_per_s: raw.height_per_s.0,
            climb_per_s: raw.climb_per_s.0,
            climb_integral_per_s2: raw.climb_integral_per_s2.0,
            tilt_max_rad: raw.tilt_max_rad.0,
            drag_per_s: raw.drag_per_s.0,
            hover_throttle: raw.hover_throttle.0,
        }
    }
}

/// The aircraft of simulated flight controllers, and the air that they fly in. Only with `vehicle.kind = "msp"`.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table, `[aircraft]`")]
pub struct Aircraft {
    /// Mass in addition to the aircraft's 0.752 kg.
    #[serde(default)]
    pub payload_kg: Or<Payload, 0>,
    /// Share of a new battery's capacity that is lost; its internal resistance rises as much.
    #[serde(default)]
    pub battery_wear: Or<Wear, 0>,
    /// Mean wind to the north.
    #[serde(default)]
    pub wind_north_mps: Or<Wind, 0>,
    /// Mean wind to the east.
    #[serde(default)]
    pub wind_east_mps: Or<Wind, 0>,
    /// Standard deviation of gusts on each level axis; near the ground, vertical ones are weaker (MIL-F-8785C).
    #[serde(default)]
    pub gusts_mps: Or<Gusts, 0>,
}
