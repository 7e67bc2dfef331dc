//! Where the drone is: by odometry, and on the map.

use std::f64::consts::TAU;
use std::sync::Arc;
use std::time::Duration;

use muster_machines::indoor::Checkpoint;
use muster_machines::time::Timestamp;
use nalgebra::{Matrix3, Vector3};

use super::config::{Config, PERIOD};
use crate::avoidance::Limits;
use crate::filter::{self, Filter, Moved, OdomModel};
use crate::frames::{MapPose, Motion, OdometryPose};
use crate::reading::Reading;

/// Standard deviation of the pose that a patrol starts with: metres, metres, radians.
const START: Vector3<f64> = Vector3::new(0.1, 0.1, 0.05);
/// Steps in a row that the filter must be lost before the drone stops for it: people before the sonars pass.
const LOST_STEPS: u32 = 30;
/// Steps in a row that the filter must know the pose before the drone flies by it again.
const FOUND_STEPS: u32 = 20;
/// Steps that the pose is lost before it is looked for on the whole map, each time: two thirds of a turn.
const SEARCH_STEPS: u32 = 100;
/// Steps after which a lost pose is given up.
const LOST_FOR_GOOD_STEPS: u32 = 600;
/// Variance of a restart's position above which its pose is lost, in m²: a standard deviation of 1 m, as of poses that no
/// vehicle takes. Particles spread wider settle at a wrong place that happens to fit.
const VARIANCE_MAX_M2: f64 = 1.0;
/// Largest motion of one input that is believed: of 20 s at the highest speed, or of two turns. An input comes 20 times a second.
const MOVED_MAX_M: f64 = 10.0;
const TURNED_MAX_RAD: f64 = 2.0 * TAU;

/// Parameters of the filter for a drone with five sonars of 8 Hz each and an optical flow's odometry.
#[must_use]
pub(super) fn filter_config() -> filter::Config {
    filter::Config {
        min_particles: 200,
        // For a pose that is looked for on the whole map; once it is known, some hundreds are drawn.
        max_particles: 5_000,
        // Ten steps a second: a turn of 180° errs by 3°, a metre by 5 cm.
        odom_model: OdomModel::Omni,
        alpha1: 0.01,
        alpha2: 0.02,
        alpha3: 0.05,
        alpha4: 0.005,
        alpha5: 0.05,
        // People stand before sonars: at 0.7 they make more than half of all patrols lose the pose.
        fit_found: 0.6,
        fit_regained: 0.6,
        // One particle from elsewhere that fits five sonars by chance would be taken for the drone, which starts at a known pose.
        recovery_alpha: None,
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

/// For how long the pose of a checkpoint, with this covariance now, has been lost; `None` if it is known. A checkpoint from later
/// than now has no known age: the clock went back over a reboot.
fn lost_since(
    now: Timestamp,
    checkpoint: &Checkpoint,
    covariance: &Matrix3<f64>,
) -> Option<Duration> {
    if checkpoint.is_lost {
        return Some(checkpoint.lost);
    }
    let is_certain = covariance[(0, 0)].max(covariance[(1, 1)]) <= VARIANCE_MAX_M2;
    let is_known = is_certain && checkpoint.at <= now;
    (!is_known).then_some(Duration::ZERO)
}

/// Steps in a time.
fn steps_in(time: Duration) -> u32 {
    u32::try_from(time.as_nanos() / PERIOD.as_nanos()).unwrap_or(u32::MAX)
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
    is_lost: bool,
    /// Steps in a row in which the filter says otherwise.
    otherwise: u32,
    /// Steps since the pose was lost.
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
        let lost = checkpoint.and_then(|it| lost_since(now, it, &covariance));
        let is_lost = lost.is_some();
        // A new filter's particles are anywhere.
        let mut filter = Filter::new(Arc::clone(&config.tables), filter_config(), seed);
        if !is_lost {
            filter.start_at(pose, covariance);
        }
        Self {
            odometry: OdometryPose::new(0.0, 0.0, 0.0),
            stepped: OdometryPose::new(0.0, 0.0, 0.0),
            filter,
            pose,
            covariance,
            is_lost,
            otherwise: 0,
            lost_steps: lost.map_or(0, steps_in),
        }
    }

    /// Adds a motion to the odometry. One that is no number, or beyond what a drone can do between two inputs, would spoil the
    /// pose for good; it is ignored. Whether it was added.
    pub(super) fn moved(&mut self, motion: Motion) -> bool {
        let Motion {
            forward_m,
            left_m,
            turn_rad,
        } = motion;
        // A comparison with no number is false.
        let is_possible =
            libm::hypot(forward_m, left_m) <= MOVED_MAX_M && turn_rad.abs() <= TURNED_MAX_RAD;
        if is_possible {
            self.odometry = self.odometry.moved(motion);
        }
        is_possible
    }

    /// Takes in the readings since the last step.
    pub(super) fn step(&mut self, now: Timestamp, readings: &[Reading]) {
        let motion = self.stepped.motion_to(self.odometry);
        self.stepped = self.odometry;
        let now = Duration::from_nanos(now.as_nanos());
        let estimate = self.filter.step(Moved::Odometry(motion), readings, now);
        self.pose = estimate.pose;
        self.covariance = estimate.covariance;
        self.judge(estimate.is_lost);
    }

    /// Whether the pose is lost, from what the filter says of it; looks for a lost one on the whole map.
    fn judge(&mut self, filter_is_lost: bool) {
        let steps = if self.is_lost {
            FOUND_STEPS
        } else {
            LOST_STEPS
        };
        self.otherwise = if filter_is_lost == self.is_lost {
            0
        } else {
            self.otherwise + 1
        };
        if self.otherwise >= steps {
            self.is_lost = filter_is_lost;
            self.otherwise = 0;
            self.lost_steps = 0;
        }
        if self.is_lost {
            self.lost_steps = self.lost_steps.saturating_add(1);
            if self.otherwise == 0 && self.lost_steps.is_multiple_of(SEARCH_STEPS) {
                self.filter.start_anywhere();
            }
        }
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
        self.is_lost
    }

    /// For how long the pose has been lost.
    pub(super) fn lost(&self) -> Duration {
        PERIOD.saturating_mul(self.lost_steps)
    }

    /// Whether the pose has been lost for so long that it will hardly be found.
    pub(super) const fn is_lost_for_good(&self) -> bool {
        self.lost_steps >= LOST_FOR_GOOD_STEPS
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::patrol::tests::config;

    #[test]
    fn motions_that_no_drone_makes_change_no_pose() {
        let mut place = Place::new(&config(), 1, Timestamp::ZERO, None);
        let motion = |forward_m, left_m, turn_rad| Motion {
            forward_m,
            left_m,
            turn_rad,
        };
        place.moved(motion(0.1, 0.0, 0.1));
        let before = place.odometry();
        for absurd in [1e18, -1e18, 100.0, f64::MAX, f64::INFINITY, f64::NAN] {
            place.moved(motion(absurd, 0.0, 0.0));
            place.moved(motion(0.0, absurd, 0.0));
            place.moved(motion(0.0, 0.0, absurd));
        }
        assert_eq!(place.odometry(), before);
        place.step(Timestamp::ZERO, &[]);
        assert!(place.pose().at.distance_m(config().start.at) < 0.2);
    }
}
