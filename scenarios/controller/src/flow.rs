//! An optical flow module beside the controller that looks down.

use std::time::Duration;

use muster_machines::time::Timestamp;
use muster_msp::{FlowReading, OpticalFlow, RangefinderSample};

use crate::controller::Truth;
use crate::noise::Noise;

/// What an optical flow module measures, and how well.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlowErrors {
    /// Standard deviation of a rate about each axis, in rad/s.
    pub sigma_radps: f64,
    /// Greatest distance to the ground that it measures, in metres.
    pub range_max_m: f64,
    /// From one measurement to the next; more than zero.
    pub period: Duration,
}

/// Standard deviation of a distance, in metres. Ours.
const RANGE_SIGMA_M: f64 = 0.02;
/// Least distance at which it sees the ground, in metres: the PAW3902 of the ARK Flow works from 80 mm.
const SEES_FROM_M: f64 = 0.08;
/// Fastest turn of the ground that it sees, in rad/s: that sensor's.
const RATE_MAX_RADPS: f64 = 7.4;
/// Quality of a good measurement.
const GOOD: u8 = 200;

/// An optical flow module above ground that is level, at altitude 0.
#[derive(Debug, Clone)]
pub struct FlowSensor {
    errors: FlowErrors,
    noise: Noise<3>,
    number: u64,
    due: Timestamp,
}

impl FlowSensor {
    /// A module that measures from now on. `seed` draws its errors.
    #[must_use]
    pub fn new(errors: FlowErrors, seed: u64, now: Timestamp) -> Self {
        Self {
            errors,
            noise: Noise::new(seed, 11),
            number: 0,
            due: now,
        }
    }

    /// When it measures next.
    #[must_use]
    pub const fn next_event(&self) -> Timestamp {
        self.due
    }

    /// Measures beneath an aircraft, if that is due: distance, and rates.
    pub fn measure(&mut self, now: Timestamp, truth: &Truth) -> Option<[FlowReading; 2]> {
        if now < self.due {
            return None;
        }
        // A module that was not asked in time leaves measurements out.
        self.due = (self.due + self.errors.period).max(now);
        let [error_x, error_y, error_m] = self.noise.at(self.number);
        self.number += 1;
        let distance_m = distance_m(truth);
        let measured_m = distance_m
            .map(|it| it + error_m * RANGE_SIGMA_M)
            .filter(|it| (0.0..=self.errors.range_max_m).contains(it));
        let range = RangefinderSample {
            quality: if measured_m.is_some() { GOOD } else { 0 },
            distance_mm: measured_m.map_or(-1, thousandths),
        };
        let seen_radps = distance_m
            .filter(|it| *it >= SEES_FROM_M)
            .map(|distance_m| {
                let velocity = truth.attitude.inverse_transform_vector(&truth.velocity.0);
                let rates = truth.rates_rad_s;
                let sigma = self.errors.sigma_radps;
                [
                    rates.x - velocity.y / distance_m + error_x * sigma,
                    rates.y + velocity.x / distance_m + error_y * sigma,
                ]
            });
        let seen_radps = seen_radps.filter(|it| it.iter().all(|rate| rate.abs() <= RATE_MAX_RADPS));
        let [x_mradps, y_mradps] = seen_radps.unwrap_or_default().map(thousandths);
        let rates = OpticalFlow {
            quality: if seen_radps.is_some() { GOOD } else { 0 },
            x_mradps,
            y_mradps,
        };
        Some([FlowReading::Range(range), FlowReading::Rates(rates)])
    }
}

/// The distance to the ground along the body's axis down, in metres. `None` if that axis points more than 60° away from it.
fn distance_m(truth: &Truth) -> Option<f64> {
    let down = truth.attitude * nalgebra::Vector3::z();
    (down.z >= 0.5).then(|| truth.position.altitude_m() / down.z)
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "metres and radians of an aircraft near the ground"
)]
fn thousandths(value: f64) -> i32 {
    libm::round(value * 1_000.0) as i32
}

#[cfg(test)]
mod tests {
    use muster_machines::geodetic::Geodetic;
    use muster_machines::geometry::{Ned, Velocity};
    use nalgebra::{UnitQuaternion, Vector3};

    use super::*;
    use crate::{Config, Controller, Settings};

    const PERFECT: FlowErrors = FlowErrors {
        sigma_radps: 0.0,
        range_max_m: 8.0,
        period: Duration::from_millis(20),
    };

    /// What is measured beneath an aircraft at this height that moves and turns so.
    fn measured(height_m: f64, velocity: [f64; 3], rates_rad_s: [f64; 3]) -> (i32, OpticalFlow) {
        let place = Geodetic::new(49.0, 12.0, 400.0).unwrap();
        let config = Config::new(place, Settings::fit());
        let mut truth = Controller::new(config, 1, Timestamp::ZERO).aircraft(Timestamp::ZERO);
        truth.position = Ned::new(3.0, 4.0, -height_m);
        truth.attitude = UnitQuaternion::identity();
        truth.velocity = Velocity(Vector3::from(velocity));
        truth.rates_rad_s = Vector3::from(rates_rad_s);
        let mut sensor = FlowSensor::new(PERFECT, 1, Timestamp::ZERO);
        let readings = sensor.measure(Timestamp::ZERO, &truth);
        let Some([FlowReading::Range(range), FlowReading::Rates(rates)]) = readings else {
            panic!("{readings:?}");
        };
        (range.distance_mm, rates)
    }

    #[test]
    fn ground_turns_as_the_aircraft_moves_and_turns() {
        let rates = |velocity, rates| {
            let (_, seen) = measured(2.0, velocity, rates);
            assert_eq!(seen.quality, GOOD);
            [seen.x_mradps, seen.y_mradps]
        };
        assert_eq!(rates([1.0, 0.0, 0.0], [0.0; 3]), [0, 500], "forward");
        assert_eq!(rates([0.0, 1.0, 0.0], [0.0; 3]), [-500, 0], "to the right");
        assert_eq!(rates([0.0; 3], [0.2, -0.3, 0.0]), [200, -300], "turning");
    }

    #[test]
    fn what_is_too_near_too_far_or_too_fast_is_not_seen() {
        let (near_mm, near) = measured(0.05, [0.0; 3], [0.0; 3]);
        assert!(near_mm <= 200 && near.quality == 0);
        let (far_mm, far) = measured(12.0, [0.0; 3], [0.0; 3]);
        assert_eq!((far_mm, far.quality), (-1, GOOD));
        let (_, fast) = measured(0.5, [6.0, 0.0, 0.0], [0.0; 3]);
        assert_eq!((fast.quality, fast.y_mradps), (0, 0));
    }
}
