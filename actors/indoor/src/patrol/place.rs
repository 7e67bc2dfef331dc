//! Where the drone is: by odometry, and on the map.

use muster_machines::time::Timestamp;
use nalgebra::Matrix3;

use super::config::Config;
use super::message::Checkpoint;
use crate::frames::{MapPose, Motion, OdometryPose};
use crate::reading::Reading;

/// The drone's pose.
#[derive(Debug)]
pub(super) struct Place {
    odometry: OdometryPose,
    pose: MapPose,
    covariance: Matrix3<f64>,
}

impl Place {
    pub(super) fn new(config: &Config, _seed: u64, checkpoint: Option<&Checkpoint>) -> Self {
        Self {
            odometry: OdometryPose::new(0.0, 0.0, 0.0),
            pose: checkpoint.map_or(config.start, |it| it.pose),
            covariance: Matrix3::zeros(),
        }
    }

    pub(super) fn moved(&mut self, motion: Motion) {
        self.odometry = self.odometry.moved(motion);
        self.pose = self.pose.moved(motion);
    }

    pub(super) fn step(&mut self, _now: Timestamp, _readings: &[Reading]) {}

    pub(super) const fn odometry(&self) -> OdometryPose {
        self.odometry
    }

    pub(super) const fn pose(&self) -> MapPose {
        self.pose
    }

    pub(super) const fn covariance(&self) -> Matrix3<f64> {
        self.covariance
    }

    pub(super) const fn is_lost(&self) -> bool {
        false
    }
}
