use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::Seen;
use super::frames::{MapPose, MapXy, Motion};
use super::reading::Reading;
use crate::time::Timestamp;

/// Input of an indoor machine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Input {
    /// How the drone moved since the last such input.
    Odometry(Motion),
    /// A sensor's measurement.
    Range(Reading),
}

/// Output of an indoor machine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Transmit {
    /// The velocity to fly until the next one comes.
    Velocity(Velocity),
}

/// A velocity in the body frame.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Velocity {
    /// Forward, in m/s.
    pub forward_mps: f64,
    /// To the left, in m/s.
    pub left_mps: f64,
    /// Turn rate counter-clockwise, in rad/s.
    pub turn_rps: f64,
}

impl Velocity {
    /// Speed over the floor, in m/s.
    #[must_use]
    pub fn speed_mps(self) -> f64 {
        libm::hypot(self.forward_mps, self.left_mps)
    }
}

/// Event of an indoor machine.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Event {
    /// Where the drone is, and from where a restarted machine goes on.
    Checkpoint(Box<Checkpoint>),
    /// What remains to be seen.
    Remaining(Remaining),
    /// A sonar began to fail, or works again.
    Sonar(SonarChange),
    /// A stop can't be reached.
    GivenUp(MapXy),
    /// The drone ends the patrol early and lands where it is.
    Landing(EarlyLanding),
}

/// Why a drone can't go on with its patrol.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum EarlyLanding {
    /// No sonar works any more.
    NoSonar,
    /// It lost its pose, and did not find it again.
    PoseLost,
    /// No odometry came any more.
    NoOdometry,
    /// The patrol took longer than it may.
    TimeOver,
}

/// From where a restarted machine goes on. It has no particles: they are drawn again around the pose.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    /// When the drone was there.
    pub at: Timestamp,
    /// Pose on the map.
    pub pose: MapPose,
    /// Covariance of x, y and heading, row by row: m², m rad and rad².
    pub covariance: [[f64; 3]; 3],
    /// Whether the pose is not to be believed.
    pub is_lost: bool,
    /// What was seen.
    pub seen: Seen,
    /// The targets that it is a set of.
    pub targets: Targets,
    /// Whether the patrol has ended; a drone that has landed stays where it is.
    pub has_ended: bool,
    /// For how long no sonar has led the drone.
    pub unheard: Duration,
    /// For how long the pose has been lost.
    pub lost: Duration,
    /// For how long no odometry has come.
    pub unmoved: Duration,
    /// For how long the patrol has lasted, without the time between processes.
    pub lasted: Duration,
}

/// Of what map and camera targets are: numbers of other targets mean other places.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Targets {
    /// Number of targets.
    pub number: usize,
    /// Digest of the map's cells and zones, of where they lie, and of the camera's view.
    pub digest: u64,
}

/// What remains to be seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Remaining {
    /// Targets that can be seen and were not.
    pub unseen: usize,
    /// Targets that can be seen.
    pub visible: usize,
    /// Whether the patrol has ended.
    pub is_done: bool,
}

/// What is wrong with a sonar.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Fault {
    /// It doesn't answer.
    Dead,
    /// It reports something right before it, where nothing can be.
    Stuck,
    /// It hears nothing where the map has a wall: glass, or cloth.
    Deaf,
}

/// A sonar began to fail, or works again.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct SonarChange {
    /// Its place among the configured.
    pub sonar: usize,
    /// `None` if it works again.
    pub fault: Option<Fault>,
}
