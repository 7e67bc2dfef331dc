//! A sensor beside the controller that measures where the aircraft is.

use std::collections::VecDeque;
use std::time::Duration;

use muster_machines::geometry::Ned;
use muster_machines::msp::Pose;
use muster_machines::time::Timestamp;
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::noise::Noise;

/// What a pose sensor measures, and how well.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseErrors {
    /// Standard deviation on each axis, in metres.
    pub sigma_m: f64,
    /// From one measurement to the next; more than zero.
    pub period: Duration,
    /// From a measurement to its arrival.
    pub delay: Duration,
    /// Share of measurements that are wrong by up to 5 m on each axis.
    pub outliers: f64,
}

/// Most that an outlier is wrong by on each axis, in metres.
const OUTLIER_MAX_M: f64 = 5.0;

/// A pose sensor: motion capture, beacons.
#[derive(Debug, Clone)]
pub struct PoseSensor {
    errors: PoseErrors,
    noise: Noise<3>,
    outliers: ChaCha8Rng,
    number: u64,
    due: Timestamp,
    is_lost: bool,
    /// Measured, and not arrived yet; oldest first.
    waiting: VecDeque<(Timestamp, Ned)>,
}

impl PoseSensor {
    /// A sensor that measures from now on. `seed` draws its errors.
    #[must_use]
    pub fn new(errors: PoseErrors, seed: u64, now: Timestamp) -> Self {
        Self {
            errors,
            noise: Noise::new(seed, 9),
            outliers: outliers(seed),
            number: 0,
            due: now,
            is_lost: false,
            waiting: VecDeque::new(),
        }
    }

    /// When it measures next, or a measurement arrives.
    #[must_use]
    pub fn next_event(&self) -> Timestamp {
        let arrival = self.waiting.front().map(|(at, _)| *at + self.errors.delay);
        arrival.map_or(self.due, |arrival| arrival.min(self.due))
    }

    /// Whether it measures nothing from now on.
    pub const fn lose(&mut self, is_lost: bool) {
        self.is_lost = is_lost;
    }

    /// Measures an aircraft's position, if that is due.
    pub fn measure(&mut self, now: Timestamp, position: Ned) {
        if now < self.due {
            return;
        }
        if self.is_lost {
            self.due = now + self.errors.period;
            return;
        }
        let mut error = Vector3::from(self.noise.at(self.number)) * self.errors.sigma_m;
        if self.outliers.random_bool(self.errors.outliers) {
            let by = -OUTLIER_MAX_M..=OUTLIER_MAX_M;
            error = Vector3::from_fn(|_, _| self.outliers.random_range(by.clone()));
        }
        self.number += 1;
        self.waiting.push_back((now, Ned(position.0 + error)));
        // A sensor that was not asked in time leaves measurements out.
        self.due = (self.due + self.errors.period).max(now);
    }

    /// The next measurement that has arrived.
    pub fn arrived(&mut self, now: Timestamp) -> Option<Pose> {
        let (at, position) = *self.waiting.front()?;
        let age = now.since(at);
        if age < self.errors.delay {
            return None;
        }
        self.waiting.pop_front();
        Some(Pose {
            position,
            sigma_m: self.errors.sigma_m,
            age,
        })
    }
}

fn outliers(seed: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(10);
    rng
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(milliseconds: u64) -> Timestamp {
        Timestamp::from_nanos(milliseconds * 1_000_000)
    }

    #[test]
    fn measurements_arrive_late_and_err_by_their_standard_deviation() {
        let errors = PoseErrors {
            sigma_m: 0.05,
            period: Duration::from_millis(100),
            delay: Duration::from_millis(90),
            outliers: 0.0,
        };
        let mut sensor = PoseSensor::new(errors, 3, at(0));
        let place = Ned::new(4.0, -2.0, -1.5);
        let mut squares_m2 = 0.0;
        let mut poses = 0;
        for tick in 0..10_000 {
            let now = at(tick * 10);
            sensor.measure(now, place);
            while let Some(pose) = sensor.arrived(now) {
                assert_eq!(pose.age, errors.delay);
                squares_m2 += (pose.position - place).0.norm_squared();
                poses += 1;
            }
        }
        assert_eq!(poses, 1_000);
        let sigma_m = (squares_m2 / f64::from(3 * poses)).sqrt();
        assert!((sigma_m - 0.05).abs() < 0.003, "{sigma_m}");
    }
}
