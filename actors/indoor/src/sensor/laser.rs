//! Sensors by light: scanning lasers, and time-of-flight rangefinders with a narrow cone.

use std::time::Duration;

use rand_chacha::ChaCha8Rng;

use crate::frames::MapPose;
use crate::map::Map;
use crate::random::normal;
use crate::reading::{Echo, Mounting, Reading};

/// A scanning laser.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LaserModel {
    /// The laser; its direction is that of the middle beam.
    pub mounting: Mounting,
    /// Angle from the first beam to the last, radians.
    pub view_rad: f64,
    /// Beams of a scan.
    pub beams: usize,
    /// Standard deviation of a range, metres. LD19: 1 cm, *LD19 manual*, section 1.
    pub sigma_m: f64,
    /// How long a scan is to be used.
    pub expiry: Duration,
}

/// A time-of-flight rangefinder on a chip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TofModel {
    /// The sensor; its aperture is the field of view. VL53L1X: 27°, 4 m.
    pub mounting: Mounting,
    /// Standard deviation of a range as a share of it. VL53L1X: 1 % in the dark.
    pub sigma: f64,
    /// How long a reading is to be used.
    pub expiry: Duration,
}

impl LaserModel {
    /// A scan of the map, from right to left.
    pub fn scan<'a>(
        &'a self,
        map: &'a Map,
        drone: MapPose,
        now: Duration,
        rng: &'a mut ChaCha8Rng,
    ) -> impl Iterator<Item = Reading> + 'a {
        let at = drone.place(self.mounting.at);
        (0..self.beams).map(move |beam| {
            let share = beam as f64 / (self.beams - 1).max(1) as f64 - 0.5;
            let mounting = Mounting {
                bearing_rad: self.mounting.bearing_rad + share * self.view_rad,
                ..self.mounting
            };
            let angle_rad = drone.heading_rad + mounting.bearing_rad;
            let range_m = map.cast(at, angle_rad, mounting.range_max_m);
            let noise_m = self.sigma_m * normal(rng);
            reading(mounting, range_m.map(|it| it + noise_m), now, self.expiry)
        })
    }
}

impl TofModel {
    /// What the sensor measures: light from all of its view is averaged, so it is the mean of what its rays hit.
    pub fn measure(
        &self,
        map: &Map,
        drone: MapPose,
        now: Duration,
        rng: &mut ChaCha8Rng,
    ) -> Reading {
        const RAYS: usize = 5;
        let at = drone.place(self.mounting.at);
        let axis_rad = drone.heading_rad + self.mounting.bearing_rad;
        let mut sum_m = 0.0;
        let mut hits = 0.0;
        for ray in 0..RAYS {
            let share = ray as f64 / (RAYS - 1) as f64 - 0.5;
            let angle_rad = axis_rad + share * self.mounting.aperture_rad;
            if let Some(range_m) = map.cast(at, angle_rad, self.mounting.range_max_m) {
                sum_m += range_m;
                hits += 1.0;
            }
        }
        let factor = 1.0 + self.sigma * normal(rng);
        let range_m = (hits > 0.0).then(|| sum_m / hits * factor);
        reading(self.mounting, range_m, now, self.expiry)
    }
}

fn reading(mounting: Mounting, range_m: Option<f64>, now: Duration, expiry: Duration) -> Reading {
    Reading {
        mounting,
        echo: match range_m {
            Some(range_m) if range_m <= mounting.range_max_m => {
                Echo::At(range_m.max(mounting.range_min_m))
            }
            _ => Echo::Silence,
        },
        taken: now,
        expires: now + expiry,
    }
}
