//! Position and velocity from the controller's telemetry: a Kalman filter of two states for each axis.
//!
//! Attitude predicts, GPS, poses, barometer and optical flow correct. A measurement too far from the prediction is rejected; if
//! all are for a while, or some in a row agree with each other, the filter begins anew from the next one. Source of the filter:
//! Bar-Shalom, Li, Kirubarajan, *Estimation with Applications to Tracking and Navigation*, sections 5.2 and 6.3 (white noise
//! acceleration).

mod attitude;
mod axis;
mod doubt;
mod flow;
mod height;
mod horizontal;
mod innovations;
mod past;
#[cfg(test)]
mod tests;

use std::time::Duration;

use muster_msp::{Altitude, Attitude, FlowReading, RawGps};

use self::attitude::Attitudes;
pub(super) use self::attitude::Tilt;
use self::axis::Axis;
use self::doubt::Doubt;
use self::flow::Flow;
use self::height::Height;
use self::horizontal::Horizontal;
pub use self::innovations::{Agreement, Innovations};
use super::Pose;
use super::config::{Config, Noise};
use crate::geodetic::{Geodetic, local_ned};
use crate::geometry::{Ned, Velocity};
use crate::time::Timestamp;

/// Standard gravity, in m/s².
pub(super) const GRAVITY_MPS2: f64 = 9.806_65;
/// Time of rejected or missing positions after which the position is lost.
pub(super) const LOST_AFTER: Duration = Duration::from_millis(1_000);
/// Fewest satellites of a usable fix: Betaflight's own `gps_rescue_min_sats`.
const SATELLITES_MIN: u8 = 8;
/// Age of a measurement up to which it is compared with where the vehicle was; an older one is rejected.
const AGE_MAX: Duration = Duration::from_millis(500);
/// Noise of the acceleration of a vehicle whose motors are off, in m/s² per √Hz. One that is carried begins anew.
const STANDING_MPS2: f64 = 0.02;
/// Longest prediction in one step, in seconds: beyond it the attitude is stale.
const STEP_MAX_S: f64 = 0.5;

/// What is known of a vehicle's motion, in its drone's local frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Estimate {
    pub(super) position: Ned,
    pub(super) velocity: Velocity,
}

/// Estimates a vehicle's motion.
#[derive(Debug)]
pub(super) struct Estimator {
    home: Geodetic,
    noise: Noise,
    at: Timestamp,
    /// Whether it stands still.
    stands: bool,
    attitudes: Attitudes,
    height: Height,
    horizontal: Horizontal,
    /// Poses that agree with each other, but not with the estimate.
    doubted: Option<Doubt<3>>,
    flow: Option<Flow>,
    innovations: Innovations,
}

impl Estimator {
    /// Without any measurement yet. `ground_m`: the barometer's altitude on the ground, if it is known from before.
    pub(super) fn new(config: &Config, now: Timestamp, ground_m: Option<f64>) -> Self {
        Self {
            home: config.home,
            noise: config.noise,
            at: now,
            stands: false,
            attitudes: Attitudes::default(),
            height: Height::new(now, ground_m),
            horizontal: Horizontal::new(now, config.gains.drag_per_s),
            doubted: None,
            flow: config.flow.map(Flow::new),
            innovations: Innovations::default(),
        }
    }

    pub(super) const fn innovations(&self) -> Innovations {
        self.innovations
    }

    /// What accepted measurements count in; `None` while it stands.
    const fn counted(&mut self) -> Option<&mut Innovations> {
        match self.stands {
            true => None,
            false => Some(&mut self.innovations),
        }
    }

    /// The newest attitude; level before the first.
    pub(super) fn tilt(&self) -> Tilt {
        self.attitudes.tilt()
    }

    pub(super) const fn ground_m(&self) -> Option<f64> {
        self.height.ground_m()
    }

    /// The present height becomes height zero, unless it is known from before.
    pub(super) fn set_ground(&mut self) {
        self.height.set_ground();
    }

    /// Height zero becomes where it was armed, from where Betaflight counts, unless the ground is known.
    pub(super) fn set_ground_where_armed(&mut self) {
        self.height.set_ground_where_armed();
    }

    /// Whether its motors are off: then it stands still. It flies until it is told.
    pub(super) const fn stand(&mut self, now: Timestamp, stands: bool) {
        self.stands = stands;
        if stands {
            self.height.stand(now);
        }
    }

    /// Forgets the barometer's height: Betaflight counts it from where it was armed.
    pub(super) const fn forget_height(&mut self, now: Timestamp) {
        self.height.forget(now);
    }

    /// The motion now. `None` before the first height. Before the first position it is home's.
    pub(super) fn estimate(&self) -> Option<Estimate> {
        let up = self.height.axis?;
        let [north, east] = (self.horizontal.axes()).unwrap_or([Axis::at(0.0, 1.0); 2]);
        let ground_m = self.height.ground_m().unwrap_or(up.position_m);
        Some(Estimate {
            position: Ned::new(north.position_m, east.position_m, ground_m - up.position_m),
            velocity: Velocity::new(north.velocity_mps, east.velocity_mps, -up.velocity_mps),
        })
    }

    /// How long the horizontal position has been unknown; `None` if it is known.
    pub(super) fn lost_for(&self, now: Timestamp) -> Option<Duration> {
        self.horizontal.lost_for(now)
    }

    /// Age of the newest height.
    pub(super) fn height_age(&self, now: Timestamp) -> Duration {
        self.height.age(now)
    }

    /// Whether so many heights did not come that the height is only predicted.
    pub(super) fn is_blind(&self, now: Timestamp) -> bool {
        self.height.is_blind(now)
    }

    /// The acceleration upwards that the newest sticks ask for, in m/s². It counts while the height is only predicted.
    pub(super) const fn expect_up(&mut self, up_mps2: f64) {
        self.height.expect_up(up_mps2);
    }

    /// Predicts the motion at `now`.
    pub(super) fn predict(&mut self, now: Timestamp) {
        let seconds = now.since(self.at).as_secs_f64().min(STEP_MAX_S);
        self.at = self.at.max(now);
        if seconds <= 0.0 {
            return;
        }
        let (acceleration, noise_mps2, vertical_noise_mps2) = match self.stands {
            true => ([0.0; 2], STANDING_MPS2, STANDING_MPS2),
            false => (
                self.acceleration_mps2(now),
                self.noise.acceleration_mps2,
                self.noise.vertical_acceleration_mps2,
            ),
        };
        (self.height).predict(now, seconds, self.stands, vertical_noise_mps2);
        let up_m = self.height.axis.map_or(0.0, |it| it.position_m);
        (self.horizontal).predict(now, seconds, acceleration, noise_mps2, up_m);
    }

    /// Takes in an attitude. One that no vehicle can have, or can't have turned to, is rejected.
    /// What the ground did since the one before, as optical flow, is the vehicle's motion.
    pub(super) fn measure_attitude(&mut self, now: Timestamp, attitude: &Attitude) {
        if self.attitudes.measure(now, attitude) {
            self.measure_motion(now);
        }
    }

    /// Takes in what an optical flow module says; without one in the configuration nothing happens.
    pub(super) fn measure_flow(&mut self, now: Timestamp, reading: &FlowReading) {
        let tilt = self.tilt();
        let Some(flow) = &mut self.flow else { return };
        if let Some(height_m) = flow.measure(now, tilt, reading)
            && !self.stands
        {
            self.height.measure_range(now, height_m);
        }
    }

    /// Takes in the motion that optical flow saw, once there was a position.
    fn measure_motion(&mut self, now: Timestamp) {
        let (tilt, acceleration_mps2) = (self.tilt(), self.acceleration_mps2(now));
        let climb_mps = self.height.axis.map_or(0.0, |it| it.velocity_mps);
        let (Some(flow), Some(_)) = (&mut self.flow, self.horizontal.axes()) else {
            return;
        };
        let Some(seen) = flow.moved(now, tilt, climb_mps).filter(|_| !self.stands) else {
            return;
        };
        let innovations = (self.horizontal).measure_motion(now, &seen, acceleration_mps2);
        if let Some(innovations_mps) = innovations {
            flow.learn_push(now, innovations_mps, seen.seconds);
        }
    }

    /// Acceleration north and east of a vehicle that flies, without its drag, in m/s².
    fn acceleration_mps2(&self, now: Timestamp) -> [f64; 2] {
        let leans_mps2 = self.tilt().acceleration_mps2();
        match &self.flow {
            Some(flow) => {
                let push_mps2 = flow.push_mps2(now);
                std::array::from_fn(|axis| leans_mps2[axis] + push_mps2[axis])
            }
            None => leans_mps2,
        }
    }

    /// Takes in the controller's own height and climb. What no vehicle can have is rejected. While poses or ranges tell the
    /// height it only notes how far its own is off, to count on from there.
    pub(super) fn measure_altitude(&mut self, now: Timestamp, altitude: &Altitude) {
        let corrected = self.height.measure(now, altitude, &self.noise);
        if let Some(counted) = self.counted() {
            counted.height.count(corrected);
        }
    }

    /// Takes in a fix. One without enough satellites, off the Earth or far from home is rejected.
    pub(super) fn measure_gps(&mut self, now: Timestamp, gps: &RawGps) {
        let place = fix_place(self.home, gps);
        let Some(place) = place.filter(|_| gps.fix > 0 && gps.satellites >= SATELLITES_MIN) else {
            return;
        };
        let speed_mps = f64::from(gps.speed_cmps) / 100.0;
        let course_rad = (f64::from(gps.course_ddeg) / 10.0).to_radians();
        let velocity = [
            speed_mps * libm::cos(course_rad),
            speed_mps * libm::sin(course_rad),
        ];
        let Noise {
            position_m,
            velocity_mps,
            gps_delay,
            ..
        } = self.noise;
        let place = [place.north_m(), place.east_m()];
        let error = (position_m, gps_delay);
        let Some(by_place) = self.horizontal.measure_fix(now, place, error) else {
            return;
        };
        let by_velocity = (self.horizontal).measure_velocity(velocity, velocity_mps);
        if let Some(counted) = self.counted() {
            counted.position.count(by_place);
            counted.velocity.count(by_velocity.into_iter().flatten());
        }
    }

    /// Takes in a pose. One that is too old, too uncertain or no number is rejected. The estimate begins with some that agree.
    pub(super) fn measure_pose(&mut self, now: Timestamp, pose: &Pose) {
        let Pose {
            position,
            sigma_m,
            age,
        } = *pose;
        let is_finite = position.0.iter().all(|it| it.is_finite());
        if !is_finite || !Pose::SIGMA_M.contains(&sigma_m) || age > AGE_MAX {
            return;
        }
        let up_m = position.altitude_m() + self.height.set_ground_where_armed();
        let place = [position.north_m(), position.east_m(), up_m];
        let error = (sigma_m, age);
        let is_known = self.height.is_posed(now) && self.lost_for(now).is_none();
        if is_known
            && let Some(up) = &mut self.height.axis
            && let Some([north, east, up]) = self.horizontal.measure_pose(now, up, place, error)
        {
            if let Some(counted) = self.counted() {
                counted.position.count([north, east]);
                counted.height.count([up]);
            }
            self.height.pose(now);
            self.doubted = None;
        } else if let Some([north, east, up]) = doubt::begin(&mut self.doubted, now, place, error) {
            self.horizontal.begin(now, [north, east]);
            self.height.begin(now, up);
        }
    }
}

/// Place of a fix on the tangent plane of `home`, at its altitude. `None` if it is off the Earth or too far from home.
#[must_use]
pub fn fix_place(home: Geodetic, gps: &RawGps) -> Option<Ned> {
    let degrees = |e7: i32| f64::from(e7) / 1e7;
    let (latitude, longitude) = (degrees(gps.latitude_e7), degrees(gps.longitude_e7));
    let place = Geodetic::new(latitude, longitude, home.altitude_m()).ok()?;
    local_ned(home, place).ok()
}
