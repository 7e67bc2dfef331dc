//! Input of a link from its port and from sensors.

use std::ops::RangeInclusive;
use std::time::Duration;

use muster_msp::{FlowReading, Identity, Telemetry as MspTelemetry};

use super::config::Stage;
use crate::geometry::Ned;
use crate::msp::autopilot::AutopilotReport;

/// Event of the port of a controller, or of a sensor beside it.
#[derive(Debug, Clone, PartialEq)]
pub enum PortEvent {
    /// The controller said who it is. The port is open.
    Identified {
        /// Who it is.
        identity: Box<Identity>,
        /// The highest stage above `bench` that a grant allows with it; `Bench` without one.
        granted: Stage,
    },
    /// The port was closed.
    Closed,
    /// The controller reported something.
    Telemetry(MspTelemetry),
    /// A sensor beside the controller measured where the vehicle is.
    Pose(Pose),
    /// An optical flow module beside the controller measured something.
    Flow(FlowReading),
    /// An autopilot reported something.
    Autopilot(AutopilotReport),
}

/// Where a vehicle is, as measured from outside: by motion capture, beacons or a localisation of its own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// In the drone's local frame.
    pub position: Ned,
    /// Standard deviation on each axis, in metres; within [`Pose::SIGMA_M`].
    pub sigma_m: f64,
    /// Time since it was measured.
    pub age: Duration,
}

impl Pose {
    /// Standard deviations of usable poses, in metres: what says less is wrong, and what may be off by more tells no position.
    /// The greatest is that of optical flow. Ours.
    pub const SIGMA_M: RangeInclusive<f64> = 0.001..=1.0;
}
