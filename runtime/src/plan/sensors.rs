//! Sensors beside the flight controller.

use std::time::Duration;

use muster_machines::msp::controller::FlowModule;

/// An optical flow module beside the flight controller.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlowSensor {
    /// What the drone does with it.
    pub module: FlowModule,
    /// Standard deviation of a simulated one's rates about each axis, in rad/s.
    pub sigma_radps: f64,
    /// Greatest distance to the ground that a simulated one measures, in metres.
    pub range_max_m: f64,
    /// From one measurement of a simulated one to the next.
    pub period: Duration,
}

/// A sensor beside the flight controller that measures where the vehicle is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseSensor {
    /// Standard deviation on each axis, in metres.
    pub sigma_m: f64,
    /// From one measurement to the next.
    pub period: Duration,
    /// From a measurement to its arrival.
    pub delay: Duration,
    /// Share of measurements that are wrong by metres.
    pub outliers: f64,
}
