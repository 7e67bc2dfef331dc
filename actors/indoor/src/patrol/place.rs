//! Where the drone is: by odometry, and on the map.

use std::sync::Arc;
use std::time::Duration;

use muster_machines::indoor::Checkpoint;
use muster_machines::time::Timestamp;
use nalgebra::{Matrix3, Vector3};

use super::config::Config;
use crate::avoidance::Limits;
use crate::filter::{self, Filter, Moved, OdomModel};
use crate::frames::{MapPose, Motion, OdometryPose};
use crate::reading::Reading;

/// Standard deviation of the pose that a patrol starts with: metres, metres, radians.
const START: Vector3<f64> = Vector3::new(0.1, 0.1, 0.05);
/// Steps in a row that the filter must be lost before the drone stops for it: people before the sonars pass.
const LOST_STEPS: u32 = 30;

/// Parameters of the filter for a drone with five sonars of 8 Hz each and an optical flow's odometry.
#[must_use]
pub(super) fn filter_config() -> filter::Config {
    filter::Config {
        min_particles: 200,
        max_particles: 1_000,
        // Ten steps a second: a turn of 180° errs by 3°, a metre by 5 cm.
        odom_model: OdomModel::Omni,
        alpha1: 0.01,
        alpha2: 0.02,
        alpha3: 0.05,
        alpha4: 0.005,
        alpha5: 0.05,
        // People stand before sonars.
        fit_found: 0.4,
        fit_regained: 0.4,
        // No particles from elsewhere: one that fits five sonars by chance is taken for the drone. It starts at a known pose.
        recovery_alpha_slow: 0.05,
        recovery_alpha_fast: 0.05,
        ..filter::Config::default()
    }
}

/// The covariance of independent x, y and heading, from their standard deviations.
fn diagonal(deviations: Vector3<f64>) -> Matrix3<f64> {
    Matrix3::from_diagonal(&deviations.component_mul(&deviations))
}

/// A checkpoint's pose, and its covariance with what the drone may have moved and turned since.
fn since(now: Timestamp, config: &Config, checkpoint: &Checkpoint) -> (MapPose, Matrix3<f64>) {
    let Limits {
        speed_max_mps,
        turn_rate_max_rps,
        ..
    } = config.limits;
    let age_s = now.since(checkpoint.at).as_secs_f64();
    let moved = Vector3::new(speed_max_mps, speed_max_mps, turn_rate_max_rps) * age_s;
    let covariance = Matrix3::from(checkpoint.covariance) + diagonal(moved);
    (checkpoint.pose, covariance)
}

/// The drone's pose.
#[derive(Debug)]
pub(super) struct Place {
    odometry: OdometryPose,
    /// The odometry's pose at the last step of the filter.
    stepped: OdometryPose,
    filter: Filter,
    /// As of that step.
    pose: MapPose,
    covariance: Matrix3<f64>,
    lost_steps: u32,
}

impl Place {
    pub(super) fn new(
        config: &Config,
        seed: u64,
        now: Timestamp,
        checkpoint: Option<&Checkpoint>,
    ) -> Self {
        let (pose, covariance) = match checkpoint {
            Some(checkpoint) => since(now, config, checkpoint),
            None => (config.start, diagonal(START)),
        };
        let mut filter = Filter::new(Arc::clone(&config.tables), filter_config(), seed);
        filter.start_at(pose, covariance);
        Self {
            odometry: OdometryPose::new(0.0, 0.0, 0.0),
            stepped: OdometryPose::new(0.0, 0.0, 0.0),
            filter,
            pose,
            covariance,
            lost_steps: 0,
        }
    }

    pub(super) fn moved(&mut self, motion: Motion) {
        self.odometry = self.odometry.moved(motion);
    }

    /// Takes in the readings since the last step.
    pub(super) fn step(&mut self, now: Timestamp, readings: &[Reading]) {
        let motion = self.stepped.motion_to(self.odometry);
        self.stepped = self.odometry;
        let now = Duration::from_nanos(now.as_nanos());
        let estimate = self.filter.step(Moved::Odometry(motion), readings, now);
        self.pose = estimate.pose;
        self.covariance = estimate.covariance;
        self.lost_steps = if estimate.is_lost {
            self.lost_steps.saturating_add(1)
        } else {
            0
        };
    }

    pub(super) const fn odometry(&self) -> OdometryPose {
        self.odometry
    }

    pub(super) fn pose(&self) -> MapPose {
        self.pose.moved(self.stepped.motion_to(self.odometry))
    }

    pub(super) const fn covariance(&self) -> Matrix3<f64> {
        self.covariance
    }

    pub(super) const fn is_lost(&self) -> bool {
        self.lost_steps >= LOST_STEPS
    }
}
