//! A point robot: it takes a velocity within its limits, and measures its motion with errors.

use muster_indoor::frames::{MapPose, Motion};
use muster_indoor::patrol::Velocity;
use muster_indoor::random::normal;
use rand_chacha::ChaCha8Rng;

/// Highest change of the turn rate, in rad/s².
const TURN_ACCELERATION_RPS2: f64 = 8.0;
/// Standard deviation of the scale of distances that the odometry measures, drawn once a run: optical flow at a wrong height.
const SCALE: f64 = 0.03;
/// Standard deviation of the rate at which its heading drifts, in rad/s, drawn once a run: a gyro's bias of 0.1°/s.
const DRIFT_RPS: f64 = 0.001_7;
/// Standard deviation of its distances, in metres for the square root of a metre.
const DISTANCE_M: f64 = 0.03;
/// Standard deviation of its turns, in radians for the square root of a radian.
const TURN_RAD: f64 = 0.02;

#[derive(Debug, Clone)]
pub(crate) struct Robot {
    pub(crate) pose: MapPose,
    /// In the body frame.
    pub(crate) velocity: Velocity,
    pub(crate) wanted: Velocity,
    acceleration_mps2: f64,
    /// Pose at the last measurement of the odometry.
    measured: MapPose,
    odometry: Option<Odometry>,
}

#[derive(Debug, Clone)]
struct Odometry {
    rng: ChaCha8Rng,
    scale: f64,
    drift_rps: f64,
}

impl Robot {
    /// At rest; its odometry errs if `noise` is given.
    pub(crate) fn new(pose: MapPose, acceleration_mps2: f64, noise: Option<ChaCha8Rng>) -> Self {
        let odometry = noise.map(|mut rng| Odometry {
            scale: 1.0 + SCALE * normal(&mut rng),
            drift_rps: DRIFT_RPS * normal(&mut rng),
            rng,
        });
        Self {
            pose,
            velocity: Velocity::default(),
            wanted: Velocity::default(),
            acceleration_mps2,
            measured: pose,
            odometry,
        }
    }

    /// Moves for `dt_s` seconds.
    pub(crate) fn step(&mut self, dt_s: f64) {
        let (forward, left) = (
            self.wanted.forward_mps - self.velocity.forward_mps,
            self.wanted.left_mps - self.velocity.left_mps,
        );
        let change = libm::hypot(forward, left);
        let share = (self.acceleration_mps2 * dt_s / change.max(1e-12)).min(1.0);
        let turn = self.wanted.turn_rps - self.velocity.turn_rps;
        let turn_max = TURN_ACCELERATION_RPS2 * dt_s;
        self.velocity = Velocity {
            forward_mps: self.velocity.forward_mps + forward * share,
            left_mps: self.velocity.left_mps + left * share,
            turn_rps: self.velocity.turn_rps + turn.clamp(-turn_max, turn_max),
        };
        let turn_rad = self.velocity.turn_rps * dt_s;
        self.pose = self.pose.moved(Motion {
            forward_m: self.velocity.forward_mps * dt_s,
            left_m: self.velocity.left_mps * dt_s,
            turn_rad,
        });
        // The body turned below a velocity that the room keeps.
        let (sin, cos) = (libm::sin(turn_rad), libm::cos(turn_rad));
        let Velocity {
            forward_mps,
            left_mps,
            ..
        } = self.velocity;
        self.velocity.forward_mps = cos * forward_mps + sin * left_mps;
        self.velocity.left_mps = cos * left_mps - sin * forward_mps;
    }

    /// The motion since the last measurement, as the odometry has it after `since_s` seconds.
    pub(crate) fn odometry(&mut self, since_s: f64) -> Motion {
        let motion = self.measured.motion_to(self.pose);
        self.measured = self.pose;
        let Some(odometry) = &mut self.odometry else {
            return motion;
        };
        let distance_m = libm::hypot(motion.forward_m, motion.left_m);
        let spread_m = DISTANCE_M * libm::sqrt(distance_m);
        let turn_rad = TURN_RAD * libm::sqrt(motion.turn_rad.abs());
        Motion {
            forward_m: motion.forward_m * odometry.scale + spread_m * normal(&mut odometry.rng),
            left_m: motion.left_m * odometry.scale + spread_m * normal(&mut odometry.rng),
            turn_rad: motion.turn_rad
                + odometry.drift_rps * since_s
                + turn_rad * normal(&mut odometry.rng),
        }
    }
}
