//! Position and velocity from the controller's telemetry: a Kalman filter of two states for each axis.
//!
//! Attitude predicts, GPS and barometer correct. A measurement too far from the prediction is rejected; if all are for a
//! while, the filter begins anew from the next one. Source of the filter: Bar-Shalom, Li, Kirubarajan, *Estimation with
//! Applications to Tracking and Navigation*, sections 5.2 and 6.3 (white noise acceleration).

use std::collections::VecDeque;
use std::f64::consts::TAU;
use std::time::Duration;

use muster_msp::{Altitude, Attitude, RawGps};

use super::Pose;
use super::config::{Config, Noise};
use crate::geodetic::{Geodetic, local_ned};
use crate::geometry::{Ned, Velocity};
use crate::time::Timestamp;

/// Standard gravity, in m/s².
pub(super) const GRAVITY_MPS2: f64 = 9.806_65;
/// Innovations beyond this many standard deviations are rejected.
const GATE: f64 = 5.0;
/// Time of rejected or missing positions after which the position is lost.
pub(super) const LOST_AFTER: Duration = Duration::from_millis(1_000);
/// Fewest satellites of a usable fix: Betaflight's own `gps_rescue_min_sats`.
const SATELLITES_MIN: u8 = 8;
/// From one noted position to the next.
const PAST_STEP: Duration = Duration::from_millis(10);
/// Smallest standard deviation of a pose, in metres: what says less is wrong.
const SIGMA_MIN_M: f64 = 0.001;
/// Index of the height among the axes.
const UP: usize = 2;
/// Age of a measurement up to which it is compared with where the vehicle was; an older one is rejected.
const AGE_MAX: Duration = Duration::from_millis(500);
/// Fastest turn about any axis that is believed at once, in rad/s: 400 °/s. Betaflight leans with less in the mode ANGLE.
const TURN_MAX_RADPS: f64 = 6.98;
/// Largest tilt that accelerates as it says, in radians: beyond 60°, Betaflight's `angle_limit`, height is not held.
const LEAN_MAX_RAD: f64 = 1.047;
/// From one attitude to the next; they may arrive together.
const ATTITUDE_PERIOD: Duration = Duration::from_millis(80);
/// Longest prediction in one step, in seconds: beyond it the attitude is stale.
const STEP_MAX_S: f64 = 0.5;

/// Position and velocity along one axis, and their covariance.
#[derive(Debug, Clone, Copy)]
struct Axis {
    position_m: f64,
    velocity_mps: f64,
    /// Variance of the position, covariance, variance of the velocity.
    covariance: [f64; 3],
}

impl Axis {
    const fn at(position_m: f64, variance_m2: f64) -> Self {
        Self {
            position_m,
            velocity_mps: 0.0,
            covariance: [variance_m2, 0.0, 1.0],
        }
    }

    fn predict(&mut self, seconds: f64, acceleration_mps2: f64, noise_mps2: f64) {
        self.position_m += (self.velocity_mps + acceleration_mps2 * seconds / 2.0) * seconds;
        self.velocity_mps += acceleration_mps2 * seconds;
        let [pp, pv, vv] = self.covariance;
        let noise = noise_mps2 * noise_mps2;
        self.covariance = [
            pp + 2.0 * pv * seconds
                + vv * seconds * seconds
                + noise * seconds * seconds * seconds / 3.0,
            pv + vv * seconds + noise * seconds * seconds / 2.0,
            vv + noise * seconds,
        ];
    }

    /// Takes in a measured position. Returns whether it was near enough.
    fn measure_position(&mut self, measured_m: f64, sigma_m: f64) -> bool {
        let innovation_m = measured_m - self.position_m;
        self.correct_position(innovation_m, sigma_m).is_some()
    }

    /// Corrects the position by what a measurement differs from the prediction. Returns by how much; `None` if the
    /// measurement is too far away.
    fn correct_position(&mut self, innovation_m: f64, sigma_m: f64) -> Option<f64> {
        let [pp, pv, vv] = self.covariance;
        let variance = pp + sigma_m * sigma_m;
        if innovation_m * innovation_m > GATE * GATE * variance {
            return None;
        }
        let (gain_p, gain_v) = (pp / variance, pv / variance);
        self.position_m += gain_p * innovation_m;
        self.velocity_mps += gain_v * innovation_m;
        self.covariance = [pp - gain_p * pp, pv - gain_p * pv, vv - gain_v * pv];
        Some(gain_p * innovation_m)
    }

    /// Takes in a measured velocity, unless it is too far away.
    fn measure_velocity(&mut self, measured_mps: f64, sigma_mps: f64) {
        let [pp, pv, vv] = self.covariance;
        let variance = vv + sigma_mps * sigma_mps;
        let innovation = measured_mps - self.velocity_mps;
        if innovation * innovation > GATE * GATE * variance {
            return;
        }
        let (gain_p, gain_v) = (pv / variance, vv / variance);
        self.position_m += gain_p * innovation;
        self.velocity_mps += gain_v * innovation;
        self.covariance = [pp - gain_p * pv, pv - gain_p * vv, vv - gain_v * vv];
    }
}

/// Where the vehicle was a moment ago, as it is known now. A measurement that took time is compared with it.
#[derive(Debug, Default)]
struct Past {
    /// Oldest first; north, east and up, in metres.
    positions: VecDeque<(Timestamp, [f64; 3])>,
}

impl Past {
    fn note(&mut self, now: Timestamp, position: [f64; 3]) {
        let last = self.positions.back().map(|(at, _)| *at);
        if last.is_some_and(|last| now.since(last) < PAST_STEP) {
            return;
        }
        while self
            .positions
            .front()
            .is_some_and(|(at, _)| now.since(*at) > AGE_MAX)
        {
            self.positions.pop_front();
        }
        self.positions.push_back((now, position));
    }

    /// The position `age` ago, between the two that are noted around it. `None` if none is.
    fn before(&self, now: Timestamp, age: Duration) -> Option<[f64; 3]> {
        let after = self
            .positions
            .partition_point(|(at, _)| now.since(*at) > age);
        let (later, to) = self.positions.get(after).or(self.positions.back())?;
        let Some((earlier, from)) = after.checked_sub(1).and_then(|it| self.positions.get(it))
        else {
            return Some(*to);
        };
        let span_s = later.since(*earlier).as_secs_f64();
        let passed_s = now.since(*earlier).saturating_sub(age).as_secs_f64();
        let share = if span_s > 0.0 {
            (passed_s / span_s).min(1.0)
        } else {
            1.0
        };
        Some(std::array::from_fn(|axis| {
            from[axis] + (to[axis] - from[axis]) * share
        }))
    }

    fn set(&mut self, axis: usize, to_m: f64) {
        for (_, position) in &mut self.positions {
            position[axis] = to_m;
        }
    }

    fn shift(&mut self, axis: usize, by_m: f64) {
        for (_, position) in &mut self.positions {
            position[axis] += by_m;
        }
    }
}

/// An attitude, in radians: roll to the right, nose down, clockwise from north.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Tilt {
    pub(super) roll_rad: f64,
    pub(super) nose_down_rad: f64,
    pub(super) yaw_rad: f64,
}

impl Tilt {
    /// Cosine of the angle between the thrust and the vertical.
    pub(super) fn vertical_share(self) -> f64 {
        libm::cos(self.roll_rad) * libm::cos(self.nose_down_rad)
    }

    /// The largest angle about one axis to another attitude, in radians.
    fn turn_rad(self, other: Self) -> f64 {
        let about = |from: f64, to: f64| {
            let angle = (to - from).abs() % TAU;
            angle.min(TAU - angle)
        };
        about(self.roll_rad, other.roll_rad)
            .max(about(self.nose_down_rad, other.nose_down_rad))
            .max(about(self.yaw_rad, other.yaw_rad))
    }

    /// Acceleration north and east of a vehicle that holds its height, in m/s².
    fn acceleration_mps2(self) -> [f64; 2] {
        let (sin, cos) = (libm::sin(self.yaw_rad), libm::cos(self.yaw_rad));
        let limited = |it: f64| it.clamp(-LEAN_MAX_RAD, LEAN_MAX_RAD);
        let (nose_down_rad, roll_rad) = (limited(self.nose_down_rad), limited(self.roll_rad));
        let ahead = GRAVITY_MPS2 * libm::tan(nose_down_rad);
        let right = GRAVITY_MPS2 * libm::tan(roll_rad) / libm::cos(nose_down_rad);
        [ahead * cos - right * sin, ahead * sin + right * cos]
    }
}

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
    drag_per_s: f64,
    at: Timestamp,
    /// The newest attitude that is believed.
    tilt: Option<(Timestamp, Tilt)>,
    /// One that came too suddenly. The next one confirms it, or is believed itself.
    doubted_tilt: Option<(Timestamp, Tilt)>,
    /// North and east.
    horizontal: Option<[Axis; 2]>,
    /// Up, from where the barometer counts.
    vertical: Option<Axis>,
    past: Past,
    /// The barometer's altitude on the ground, in metres.
    ground_m: Option<f64>,
    /// The newest accepted position.
    fixed_at: Timestamp,
    /// The newest accepted height.
    height_at: Timestamp,
    /// The newest accepted height of a pose.
    posed_at: Option<Timestamp>,
    /// What is added to the controller's own height, in metres.
    offset_m: f64,
}

impl Estimator {
    /// Without any measurement yet. `ground_m`: the barometer's altitude on the ground, if it is known from before.
    pub(super) fn new(config: &Config, now: Timestamp, ground_m: Option<f64>) -> Self {
        Self {
            home: config.home,
            noise: config.noise,
            drag_per_s: config.gains.drag_per_s,
            at: now,
            tilt: None,
            doubted_tilt: None,
            horizontal: None,
            vertical: None,
            past: Past::default(),
            ground_m,
            fixed_at: now,
            height_at: now,
            posed_at: None,
            offset_m: 0.0,
        }
    }

    /// The newest attitude; level before the first.
    pub(super) fn tilt(&self) -> Tilt {
        self.tilt.map(|(_, tilt)| tilt).unwrap_or_default()
    }

    pub(super) const fn ground_m(&self) -> Option<f64> {
        self.ground_m
    }

    /// The present height becomes height zero, unless it is known from before.
    pub(super) fn set_ground(&mut self) {
        let here = self.vertical.map(|it| it.position_m);
        self.ground_m = self.ground_m.or(here);
    }

    /// Forgets the height: Betaflight counts it from where it was armed.
    pub(super) const fn forget_height(&mut self) {
        self.vertical = None;
        self.ground_m = None;
        self.offset_m = 0.0;
        self.posed_at = None;
    }

    /// The motion now. `None` before the first height. Before the first position it is home's.
    pub(super) fn estimate(&self) -> Option<Estimate> {
        let up = self.vertical?;
        let [north, east] = self.horizontal.unwrap_or([Axis::at(0.0, 1.0); 2]);
        let ground_m = self.ground_m.unwrap_or(up.position_m);
        Some(Estimate {
            position: Ned::new(north.position_m, east.position_m, ground_m - up.position_m),
            velocity: Velocity::new(north.velocity_mps, east.velocity_mps, -up.velocity_mps),
        })
    }

    /// How long the horizontal position has been unknown; `None` if it is known.
    pub(super) fn lost_for(&self, now: Timestamp) -> Option<Duration> {
        let since = now.since(self.fixed_at);
        (self.horizontal.is_none() || since > LOST_AFTER).then_some(since)
    }

    /// Predicts the motion at `now`.
    pub(super) fn predict(&mut self, now: Timestamp) {
        let seconds = now.since(self.at).as_secs_f64().min(STEP_MAX_S);
        self.at = self.at.max(now);
        if seconds <= 0.0 {
            return;
        }
        let acceleration = self.tilt().acceleration_mps2();
        for (axis, by) in self.horizontal.iter_mut().flatten().zip(acceleration) {
            let by = by - self.drag_per_s * axis.velocity_mps;
            axis.predict(seconds, by, self.noise.acceleration_mps2);
        }
        if let Some(axis) = &mut self.vertical {
            axis.predict(seconds, 0.0, self.noise.vertical_acceleration_mps2);
        }
        if let Some([north, east]) = self.horizontal {
            let up_m = self.vertical.map_or(0.0, |it| it.position_m);
            self.past
                .note(now, [north.position_m, east.position_m, up_m]);
        }
    }

    /// Takes in an attitude. One that no vehicle can have, or can't have turned to, is rejected.
    pub(super) fn measure_attitude(&mut self, now: Timestamp, attitude: &Attitude) {
        let Attitude {
            roll_ddeg,
            pitch_ddeg,
            yaw_deg,
        } = *attitude;
        if !(-1_800..=1_800).contains(&roll_ddeg)
            || !(-900..=900).contains(&pitch_ddeg)
            || !(-360..=360).contains(&yaw_deg)
        {
            return;
        }
        let tilt = Tilt {
            roll_rad: (f64::from(roll_ddeg) / 10.0).to_radians(),
            nose_down_rad: (f64::from(pitch_ddeg) / 10.0).to_radians(),
            yaw_rad: f64::from(yaw_deg).to_radians(),
        };
        let is_near = |(at, before): (Timestamp, Tilt)| {
            let seconds = now.since(at).max(ATTITUDE_PERIOD).as_secs_f64();
            tilt.turn_rad(before) <= TURN_MAX_RADPS * seconds
        };
        let is_believed = self.tilt.is_none_or(is_near) || self.doubted_tilt.is_some_and(is_near);
        self.doubted_tilt = (!is_believed).then_some((now, tilt));
        if is_believed {
            self.tilt = Some((now, tilt));
        }
    }

    /// Takes in the controller's own height and climb. While poses tell the height it only notes how far its own is off, to
    /// count on from there.
    pub(super) fn measure_altitude(&mut self, now: Timestamp, altitude: &Altitude) {
        let height_m = f64::from(altitude.altitude_cm) / 100.0;
        if self.is_posed(now) {
            let here_m = self.vertical.map_or(height_m, |it| it.position_m);
            self.offset_m = here_m - height_m;
            return;
        }
        let height_m = height_m + self.offset_m;
        let sigma_m = self.noise.height_m;
        let is_stale = now.since(self.height_at) > LOST_AFTER;
        let axis = match &mut self.vertical {
            Some(axis) if !is_stale => axis,
            lost => lost.insert(Axis::at(height_m, sigma_m * sigma_m)),
        };
        if axis.measure_position(height_m, sigma_m) {
            let climb_mps = f64::from(altitude.climb_cmps) / 100.0;
            axis.measure_velocity(climb_mps, self.noise.climb_mps);
            self.height_at = now;
        }
    }

    /// Takes in a fix. One without enough satellites, off the Earth or far from home is rejected.
    pub(super) fn measure_gps(&mut self, now: Timestamp, gps: &RawGps) {
        let degrees = |e7: i32| f64::from(e7) / 1e7;
        let place = Geodetic::new(
            degrees(gps.latitude_e7),
            degrees(gps.longitude_e7),
            self.home.altitude_m(),
        );
        let place = place
            .ok()
            .and_then(|place| local_ned(self.home, place).ok());
        let Some(place) = place.filter(|_| gps.fix > 0 && gps.satellites >= SATELLITES_MIN) else {
            return;
        };
        let speed_mps = f64::from(gps.speed_cmps) / 100.0;
        let course_rad = (f64::from(gps.course_ddeg) / 10.0).to_radians();
        let velocity = [
            speed_mps * libm::cos(course_rad),
            speed_mps * libm::sin(course_rad),
        ];
        let is_near = self.measure_place(
            now,
            [place.north_m(), place.east_m()],
            self.noise.position_m,
            self.noise.gps_delay,
        );
        if is_near {
            for (axis, velocity) in self.horizontal.iter_mut().flatten().zip(velocity) {
                axis.measure_velocity(velocity, self.noise.velocity_mps);
            }
        }
    }

    /// Takes in a pose. One that is too old, or not a number, is rejected.
    pub(super) fn measure_pose(&mut self, now: Timestamp, pose: &Pose) {
        let Pose {
            position,
            sigma_m,
            age,
        } = *pose;
        let is_finite = position.0.iter().chain([&sigma_m]).all(|it| it.is_finite());
        if !is_finite || sigma_m < SIGMA_MIN_M || age > AGE_MAX {
            return;
        }
        let place = [position.north_m(), position.east_m()];
        self.measure_place(now, place, sigma_m, age);
        let up_m = position.altitude_m() + *self.ground_m.get_or_insert(0.0);
        let past = self.past.before(now, age);
        let is_posed = self.is_posed(now);
        let (Some(axis), Some(past), true) = (&mut self.vertical, past, is_posed) else {
            self.vertical = Some(Axis::at(up_m, sigma_m * sigma_m));
            self.past.set(UP, up_m);
            self.posed_at = Some(now);
            return;
        };
        if let Some(by_m) = axis.correct_position(up_m - past[UP], sigma_m) {
            self.past.shift(UP, by_m);
            self.posed_at = Some(now);
        }
    }

    /// Whether poses tell the height.
    fn is_posed(&self, now: Timestamp) -> bool {
        let since = self.posed_at.map(|at| now.since(at));
        since.is_some_and(|since| since <= LOST_AFTER)
    }

    /// Takes in a place, north and east, that is `age` old. Returns whether it was near enough.
    fn measure_place(
        &mut self,
        now: Timestamp,
        place: [f64; 2],
        sigma_m: f64,
        age: Duration,
    ) -> bool {
        let past = self.past.before(now, age);
        let is_lost = now.since(self.fixed_at) > LOST_AFTER;
        let (Some(axes), Some(past), false) = (&mut self.horizontal, past, is_lost) else {
            self.horizontal = Some(place.map(|it| Axis::at(it, sigma_m * sigma_m)));
            self.past = Past::default();
            self.fixed_at = now;
            return false;
        };
        let mut is_near = true;
        for (index, axis) in axes.iter_mut().enumerate() {
            match axis.correct_position(place[index] - past[index], sigma_m) {
                Some(by_m) => self.past.shift(index, by_m),
                None => is_near = false,
            }
        }
        if is_near {
            self.fixed_at = now;
        }
        is_near
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOISE: Noise = Noise::GPS;

    fn at(seconds: f64) -> Timestamp {
        Timestamp::from_secs_f64(seconds)
    }

    /// A fix `north_m` north of home, where a degree is 111,200 m long, that moves north at `speed_mps`.
    fn fix(north_m: f64, speed_mps: f64) -> RawGps {
        RawGps {
            fix: 1,
            satellites: 12,
            latitude_e7: 490_000_000 + (north_m / 111_206.0 * 1e7) as i32,
            longitude_e7: 120_000_000,
            altitude_m: 400,
            speed_cmps: (speed_mps * 100.0) as u16,
            course_ddeg: 0,
            pdop_e2: None,
        }
    }

    fn estimator() -> Estimator {
        let config = super::super::tests::config();
        let mut estimator = Estimator::new(&config, at(0.0), None);
        estimator.measure_altitude(at(0.0), &Altitude::default());
        estimator.set_ground();
        estimator
    }

    #[test]
    fn moving_vehicle_is_where_the_delayed_fixes_say_it_was_and_has_moved_since() {
        let mut estimator = estimator();
        // It leans against the drag.
        let leaning = Attitude {
            pitch_ddeg: 129,
            ..Attitude::default()
        };
        estimator.measure_attitude(at(0.0), &leaning);
        for step in 0..100 {
            let seconds = f64::from(step) / 10.0;
            estimator.predict(at(seconds));
            let seen_m = 5.0 * (seconds - NOISE.gps_delay.as_secs_f64());
            estimator.measure_gps(at(seconds), &fix(seen_m, 5.0));
        }
        let estimate = estimator.estimate().unwrap();
        let north_m = estimate.position.north_m();
        assert!((north_m - 49.5).abs() < 0.3, "{north_m}");
        assert!((estimate.velocity.0.x - 5.0).abs() < 0.1);
    }

    #[test]
    fn an_accelerating_vehicle_is_where_late_poses_say_it_was_and_has_moved_since() {
        let mut estimator = estimator();
        // Without drag 5° of tilt accelerate by 0.858 m/s².
        estimator.drag_per_s = 0.0;
        let leaning = Attitude {
            pitch_ddeg: 50,
            ..Attitude::default()
        };
        estimator.measure_attitude(at(0.0), &leaning);
        let place_m = |seconds: f64| 0.5 * 0.858 * seconds * seconds;
        let age = Duration::from_millis(100);
        for step in 0..300_u32 {
            let now = at(f64::from(step) / 50.0);
            estimator.predict(now);
            if step % 5 == 0 {
                let seen_m = place_m((f64::from(step) / 50.0 - 0.1).max(0.0));
                let position = Ned::new(seen_m, 2.0, -1.5);
                let pose = Pose {
                    position,
                    sigma_m: 0.05,
                    age,
                };
                estimator.measure_pose(now, &pose);
            }
        }
        let estimate = estimator.estimate().unwrap();
        let north_m = estimate.position.north_m() - place_m(299.0 / 50.0);
        assert!(north_m.abs() < 0.03, "{north_m}");
        assert!((estimate.velocity.0.x - 0.858 * 5.98).abs() < 0.05);
        assert!((estimate.position.altitude_m() - 1.5).abs() < 0.05);
    }

    #[test]
    fn a_wrong_barometer_does_not_count_while_poses_tell_the_height() {
        let mut estimator = estimator();
        let pose = |altitude_m: f64| Pose {
            position: Ned::new(0.0, 0.0, -altitude_m),
            sigma_m: 0.05,
            age: Duration::from_millis(100),
        };
        let height_m = |estimator: &Estimator| estimator.estimate().unwrap().position.altitude_m();
        for step in 0..200_u32 {
            let now = at(f64::from(step) / 10.0);
            estimator.predict(now);
            // It stays at zero.
            estimator.measure_altitude(now, &Altitude::default());
            estimator.measure_pose(now, &pose(2.0));
        }
        assert!((height_m(&estimator) - 2.0).abs() < 0.05);
        // Without poses the barometer counts on from there.
        for step in 200..240_u32 {
            let now = at(f64::from(step) / 10.0);
            estimator.predict(now);
            estimator.measure_altitude(now, &Altitude::default());
        }
        assert!((height_m(&estimator) - 2.0).abs() < 0.1);
    }

    #[test]
    fn a_pose_that_is_old_or_no_number_is_rejected() {
        let mut estimator = estimator();
        let good = Pose {
            position: Ned::new(1.0, 2.0, 0.0),
            sigma_m: 0.05,
            age: Duration::from_millis(100),
        };
        let bad = [
            Pose {
                position: Ned::new(f64::NAN, 2.0, 0.0),
                ..good
            },
            Pose {
                sigma_m: 0.0,
                ..good
            },
            Pose {
                age: Duration::from_secs(2),
                ..good
            },
        ];
        for pose in bad {
            estimator.measure_pose(at(0.1), &pose);
            assert!(estimator.lost_for(at(0.1)).is_some());
        }
        estimator.measure_pose(at(0.1), &good);
        assert_eq!(estimator.lost_for(at(0.1)), None);
    }

    #[test]
    fn an_outlier_is_rejected_and_a_position_without_fixes_is_lost() {
        let mut estimator = estimator();
        for tenth in 0..20 {
            let now = at(f64::from(tenth) / 10.0);
            estimator.predict(now);
            estimator.measure_gps(now, &fix(0.0, 0.0));
        }
        estimator.measure_gps(at(2.0), &fix(500.0, 0.0));
        assert!(estimator.estimate().unwrap().position.north_m().abs() < 0.5);
        assert_eq!(estimator.lost_for(at(2.5)), None);
        assert!(estimator.lost_for(at(3.0)).is_some());
        let bad = RawGps {
            satellites: 4,
            ..fix(0.0, 0.0)
        };
        estimator.measure_gps(at(3.0), &bad);
        assert!(estimator.lost_for(at(3.0)).is_some(), "too few satellites");
    }

    #[test]
    fn an_attitude_that_no_vehicle_can_have_is_rejected() {
        let mut estimator = estimator();
        let turned = Attitude {
            roll_ddeg: 1_900,
            ..Attitude::default()
        };
        estimator.measure_attitude(at(0.0), &turned);
        assert!(estimator.tilt().roll_rad.abs() < f64::EPSILON);
    }

    #[test]
    fn a_turn_that_no_vehicle_can_make_is_believed_when_the_next_attitude_confirms_it() {
        let attitude = |yaw_deg| Attitude {
            yaw_deg,
            ..Attitude::default()
        };
        let mut estimator = estimator();
        let mut yaw_deg = |seconds, yaw_deg| {
            estimator.measure_attitude(at(seconds), &attitude(yaw_deg));
            estimator.tilt().yaw_rad.to_degrees().round() as i16
        };
        assert_eq!(yaw_deg(0.0, 359), 359);
        assert_eq!(yaw_deg(0.1, 10), 10, "11° in 0.1 s");
        assert_eq!(yaw_deg(0.2, 120), 10, "110° in 0.1 s");
        assert_eq!(yaw_deg(0.3, 12), 12);
        assert_eq!(yaw_deg(0.4, 120), 12);
        assert_eq!(yaw_deg(0.5, 121), 121);
    }

    #[test]
    fn vehicle_that_lies_on_its_side_is_not_taken_to_vanish() {
        let side = Tilt {
            roll_rad: TAU / 4.0,
            ..Tilt::default()
        };
        let [north, east] = side.acceleration_mps2();
        assert!(north.abs() < 1e-9 && (east - 16.98).abs() < 0.01);
    }

    #[test]
    fn tilt_accelerates_to_where_it_leans() {
        let tilt = |roll_deg: f64, nose_down_deg: f64, yaw_deg: f64| Tilt {
            roll_rad: roll_deg.to_radians(),
            nose_down_rad: nose_down_deg.to_radians(),
            yaw_rad: yaw_deg.to_radians(),
        };
        let [north, east] = tilt(0.0, 10.0, 0.0).acceleration_mps2();
        assert!((north - 1.729).abs() < 1e-3 && east.abs() < 1e-9);
        let [north, east] = tilt(0.0, 10.0, 90.0).acceleration_mps2();
        assert!(north.abs() < 1e-9 && (east - 1.729).abs() < 1e-3);
        let [north, east] = tilt(10.0, 0.0, 0.0).acceleration_mps2();
        assert!(north.abs() < 1e-9 && (east - 1.729).abs() < 1e-3);
    }
}
