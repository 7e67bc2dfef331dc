//! What a link is told.

use std::time::Duration;

use muster_msp::{FlowReading, Identity, Telemetry as Told};

use super::config::Stage;
use crate::geometry::Ned;
use crate::msp::autopilot;

/// What a link is told: by the port of its controller, or by a sensor beside it.
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
    /// The controller told something.
    Told(Told),
    /// A sensor beside the controller measured where the vehicle is.
    Pose(Pose),
    /// An optical flow module beside the controller measured something.
    Flow(FlowReading),
    /// An autopilot told something.
    Autopilot(autopilot::Told),
}

/// Where a vehicle is, as measured from outside: by motion capture, beacons or a localisation of its own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// In the drone's local frame.
    pub position: Ned,
    /// Standard deviation on each axis, in metres.
    pub sigma_m: f64,
    /// Time since it was measured.
    pub age: Duration,
}
