//! A simulated flight controller with its aircraft: MSP bytes in, MSP bytes out.
//!
//! A pure library: it is told the time, and draws its random numbers from a seed. What it models, with sources, is in the
//! book: "How it works", "The simulated controller".

mod aircraft;
mod airframe;
mod battery;
mod body;
mod controller;
mod firmware;
mod flow;
mod ground;
mod in_loop;
mod noise;
mod pose;
mod rc_frames;
mod sensors;
mod serial;
mod telemetry;
mod wind;

pub use airframe::{Airframe, GRAVITY_MPS2, Motor, Pack};
pub use controller::{Config, Controller, Fault, Sticks, Truth};
pub use firmware::arming::Refusal;
pub use firmware::settings::{
    CHANNELS, CellLimits, FailsafeSettings, Gains, ModeRange, Procedure, ReceiverMode, RxFail,
    Settings, Tuning, Version,
};
pub use flow::{FlowErrors, FlowSensor};
pub use ground::{Contact, Landing};
pub use in_loop::{InLoop, MOTORS_BYTES, STATE_BYTES};
pub use pose::{PoseErrors, PoseSensor};
pub use rc_frames::RcFrames;
pub use sensors::SensorNoise;
pub use serial::Dropped;
pub use wind::Wind;
