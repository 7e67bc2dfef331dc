//! Range sensors as models: what sonars, time-of-flight rangefinders and lasers measure in a place, and when sonars fire.

mod laser;
mod schedule;
mod sonar;
#[cfg(test)]
mod tests;

use std::time::Duration;

pub use laser::{LaserModel, TofModel};
pub use schedule::{ECHO_MAX, Schedule, ScheduleError, Turns};
pub use sonar::{Disc, Ping, Reflector, Room, SonarModel, Surfaces};

use crate::reading::Reading;

/// Speed of sound in dry air of 20 °C, m/s.
pub const SOUND_MPS: f64 = 343.2;

/// Where readings come from: a simulation or hardware.
pub trait Source {
    /// Why nothing can be read any more.
    type Error: std::error::Error;

    /// Appends the readings that are there at `now`, a time since the origin of the drone's clock. Waits at most a
    /// millisecond.
    ///
    /// # Errors
    /// If the sensor is gone. What it measured wrong is a reading that failed, and no error.
    fn read(&mut self, now: Duration, readings: &mut Vec<Reading>) -> Result<(), Self::Error>;
}
