//! The height above the ground.

use std::time::Duration;

use muster_msp::Altitude;

use super::LOST_AFTER;
use super::axis::{Axis, Correction};
use super::doubt::{self, Doubt};
use crate::msp::controller::config::Noise;
use crate::time::Timestamp;

/// Age of the newest height from which on it is predicted by what the sticks ask for, and a landing goes on slowly: four did not
/// come.
const BLIND_AFTER: Duration = Duration::from_millis(400);

/// Greatest height above or below where the controller counts from, in metres. No copter has been higher above the sea.
const HEIGHT_MAX_M: f64 = 9_000.0;
/// Fastest climb or descent, in m/s: twice a racing copter's. Ours.
const CLIMB_MAX_MPS: f64 = 100.0;

/// Largest step of a height above a level floor, in metres: more is something that stands on the floor, or an edge. Ours.
const RANGE_STEP_MAX_M: f64 = 0.3;
/// Standard deviation of a height above a level floor, in metres: of a time-of-flight sensor and of the floor. Ours.
const RANGE_SIGMA_M: f64 = 0.05;

/// The height. Poses tell it; without them a range to a level floor does; without both the controller does.
///
/// Invariant: where poses and ranges end, the controller's own height goes on from the last one.
#[derive(Debug)]
pub(super) struct Height {
    /// Up, from where the barometer counts. `None` before the first height.
    pub(super) axis: Option<Axis>,
    /// Heights of the controller that agree with each other, but not with the estimate.
    doubted: Option<Doubt<1>>,
    /// The barometer's altitude on the ground, in metres.
    ground_m: Option<f64>,
    /// The newest accepted height of the controller.
    measured_at: Timestamp,
    /// The newest accepted height of a pose.
    posed_at: Option<Timestamp>,
    /// The newest accepted height above a level floor.
    ranged_at: Option<Timestamp>,
    /// What is added to the controller's own height, in metres.
    offset_m: f64,
    /// What the newest sticks ask for, upwards, in m/s².
    expected_up_mps2: f64,
}

impl Height {
    /// Before the first height. `ground_m`: the barometer's altitude on the ground, if it is known from before.
    pub(super) const fn new(now: Timestamp, ground_m: Option<f64>) -> Self {
        Self {
            axis: None,
            doubted: None,
            ground_m,
            measured_at: now,
            posed_at: None,
            ranged_at: None,
            offset_m: 0.0,
            expected_up_mps2: 0.0,
        }
    }

    pub(super) const fn ground_m(&self) -> Option<f64> {
        self.ground_m
    }

    /// The present height becomes height zero, unless it is known from before.
    pub(super) fn set_ground(&mut self) {
        let here = self.axis.map(|it| it.position_m);
        self.ground_m = self.ground_m.or(here);
    }

    /// Height zero becomes where it was armed, from where Betaflight counts, unless the ground is known. Returns it.
    pub(super) fn set_ground_where_armed(&mut self) -> f64 {
        *self.ground_m.get_or_insert(0.0)
    }

    /// Forgets the barometer's height: Betaflight counts it from where it was armed. The next one counts as missing
    /// from now.
    pub(super) const fn forget(&mut self, now: Timestamp) {
        self.measured_at = now;
        if self.posed_at.is_none() {
            self.axis = None;
            self.ground_m = None;
            self.ranged_at = None;
            self.offset_m = 0.0;
        }
    }

    /// It stands: a height counts as missing from when it flies.
    pub(super) const fn stand(&mut self, now: Timestamp) {
        self.measured_at = now;
    }

    /// Age of the newest height, or time since it stood.
    pub(super) fn age(&self, now: Timestamp) -> Duration {
        let others = [self.posed_at, self.ranged_at].into_iter().flatten();
        let newest = others.fold(self.measured_at, Timestamp::max);
        now.since(newest)
    }

    /// Whether so many heights did not come that the height is only predicted.
    pub(super) fn is_blind(&self, now: Timestamp) -> bool {
        self.age(now) > BLIND_AFTER
    }

    /// Whether poses tell the height.
    pub(super) fn is_posed(&self, now: Timestamp) -> bool {
        is_fresh(now, self.posed_at)
    }

    /// The acceleration upwards that the newest sticks ask for, in m/s². It counts while the height is only predicted.
    pub(super) const fn expect_up(&mut self, up_mps2: f64) {
        self.expected_up_mps2 = up_mps2;
    }

    /// Predicts it `seconds` later. `stands`: the motors are off.
    pub(super) fn predict(&mut self, now: Timestamp, seconds: f64, stands: bool, noise_mps2: f64) {
        let up_mps2 = match self.is_blind(now) && !stands {
            true => self.expected_up_mps2,
            false => 0.0,
        };
        if let Some(axis) = &mut self.axis {
            axis.predict(seconds, up_mps2, noise_mps2);
        }
    }

    /// Takes in the controller's own height and climb. What no vehicle can have is rejected. While poses or ranges tell the
    /// height it only notes how far its own is off, to count on from there. Returns what an accepted height changed.
    pub(super) fn measure(
        &mut self,
        now: Timestamp,
        altitude: &Altitude,
        noise: &Noise,
    ) -> Option<Correction> {
        let height_m = f64::from(altitude.altitude_cm) / 100.0;
        let climb_mps = f64::from(altitude.climb_cmps) / 100.0;
        if height_m.abs() > HEIGHT_MAX_M || climb_mps.abs() > CLIMB_MAX_MPS {
            return None;
        }
        if self.is_posed(now) || is_fresh(now, self.ranged_at) {
            let here_m = self.axis.map_or(height_m, |it| it.position_m);
            self.offset_m = here_m - height_m;
            return None;
        }
        let height_m = height_m + self.offset_m;
        let sigma_m = noise.height_m;
        let axis = match &mut self.axis {
            Some(axis) => axis,
            none => none.insert(Axis::at(height_m, sigma_m * sigma_m)),
        };
        if let Some(correction) = axis.measure_position(height_m, sigma_m) {
            let _ = axis.measure_velocity(climb_mps, noise.climb_mps);
            self.doubted = None;
            self.measured_at = now;
            return Some(correction);
        }
        let error = (sigma_m, Duration::ZERO);
        let [begun] = doubt::begin(&mut self.doubted, now, [height_m], error)?;
        *axis = begun;
        self.measured_at = now;
        None
    }

    /// Takes in a height above a level floor, in metres, unless poses tell the height. One that is too far away is rejected, and
    /// the controller's own height goes on.
    pub(super) fn measure_range(&mut self, now: Timestamp, height_m: f64) {
        let (Some(axis), Some(ground_m), false) =
            (&mut self.axis, self.ground_m, is_fresh(now, self.posed_at))
        else {
            return;
        };
        let up_m = ground_m + height_m;
        let is_floor = (up_m - axis.position_m).abs() <= RANGE_STEP_MAX_M
            && axis.measure_position(up_m, RANGE_SIGMA_M).is_some();
        self.ranged_at = is_floor.then_some(now);
    }

    /// A pose corrected the height.
    pub(super) const fn pose(&mut self, now: Timestamp) {
        self.posed_at = Some(now);
    }

    /// Begins anew where poses say.
    pub(super) const fn begin(&mut self, now: Timestamp, up: Axis) {
        self.axis = Some(up);
        self.posed_at = Some(now);
    }
}

/// Whether the newest height of a kind still tells it.
fn is_fresh(now: Timestamp, newest: Option<Timestamp>) -> bool {
    newest.is_some_and(|at| now.since(at) <= LOST_AFTER)
}
