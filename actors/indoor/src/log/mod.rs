//! Recorded drives: odometry and laser scans.

mod carmen;
mod malaga;
#[cfg(test)]
mod tests;
mod tokens;

use std::time::Duration;

use crate::frames::{MapPose, Motion};
use crate::reading::{Echo, Mounting, Reading};
use crate::refusal::Refusal;

/// Most steps of a log.
pub const STEPS_MAX: usize = 100_000;
/// Most beams of a scan.
pub const BEAMS_MAX: usize = 4_096;
/// Farthest range, in metres.
const RANGE_MAX_M: f64 = 1_000.0;
/// Largest motion from scan to scan, metres and radians.
const MOTION_MAX: (f64, f64) = (-100.0, 100.0);

/// One scan, and the odometry since the scan before it.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// The odometry since the step before, or since the start.
    pub motion: Motion,
    /// Equally spaced beams, from right to left.
    pub scan: Scan,
    /// Where the robot was on the map, if the log says so.
    pub truth: Option<MapPose>,
}

/// Ranges of equally spaced beams.
#[derive(Debug, Clone, PartialEq)]
pub struct Scan {
    /// The direction of the first beam, radians from forward.
    pub first_rad: f64,
    /// Radians from beam to beam, counter-clockwise.
    pub between_rad: f64,
    /// Metres; `None` without return.
    pub ranges_m: Vec<Option<f32>>,
}

impl Scan {
    /// The readings of a scan that was taken at `taken` by a laser that is mounted as `laser` is.
    pub fn readings(&self, laser: Mounting, taken: Duration) -> impl Iterator<Item = Reading> {
        let mounting = move |beam: usize| Mounting {
            bearing_rad: laser.bearing_rad + self.first_rad + self.between_rad * beam as f64,
            ..laser
        };
        let ranges = self.ranges_m.iter().enumerate();
        ranges.map(move |(beam, range_m)| Reading {
            mounting: mounting(beam),
            echo: range_m.map_or(Echo::Silence, |range_m| Echo::At(f64::from(range_m))),
            taken,
            expires: taken + Duration::from_secs(1),
        })
    }
}

/// Parses a log: one of CARMEN if it begins with a letter or a comment, or else lines as the Málaga data set has them.
///
/// # Errors
/// If it can't be used, with the place.
pub fn parse(text: &str) -> Result<Vec<Step>, Refusal> {
    let first = text.trim_start().chars().next();
    let steps = match first.is_some_and(|it| it.is_alphabetic() || it == '#') {
        true => carmen::parse(text)?,
        false => malaga::parse(text)?,
    };
    if steps.is_empty() {
        return Err(Refusal::new(
            text.len()..text.len(),
            "the log has no scan",
            "lines of numbers as in the Málaga data set, or FLASER and ROBOTLASER1 messages of CARMEN",
        ));
    }
    Ok(steps)
}

/// A range, if a beam returned: many lasers give 0 where none did.
fn returned(range_m: f64) -> Option<f32> {
    (range_m > 0.0).then_some(range_m as f32)
}
