//! The position and velocity over ground.

use std::time::Duration;

use super::LOST_AFTER;
use super::axis::{Axis, Correction, correct};
use super::doubt::{self, Doubt};
use super::flow::Motion;
use super::past::Past;
use crate::time::Timestamp;

/// Largest error of a position that optical flow alone still tells, in metres: a standard deviation, and what the scale is wrong
/// by. Ours.
const DRIFT_MAX_M: f64 = 1.0;
/// What the scale of optical flow may be wrong by, as a share of the way: the range's error and the lens's together. Ours.
const SCALE_ERROR: f64 = 0.1;

/// The motion north and east, and where the vehicle was a moment ago.
///
/// Invariant: `past` holds no position from before the axes began, or began anew. `flown_m` counts from the newest position that
/// was accepted.
#[derive(Debug)]
pub(super) struct Horizontal {
    drag_per_s: f64,
    /// North and east. `None` before the first position.
    axes: Option<[Axis; 2]>,
    past: Past,
    /// Fixes that agree with each other, but not with the estimate.
    doubted: Option<Doubt<2>>,
    /// Until when the position was known.
    known_at: Timestamp,
    /// The way since the newest accepted position, in metres.
    flown_m: f64,
}

impl Horizontal {
    /// Before the first position.
    pub(super) fn new(now: Timestamp, drag_per_s: f64) -> Self {
        Self {
            drag_per_s,
            axes: None,
            past: Past::default(),
            doubted: None,
            known_at: now,
            flown_m: 0.0,
        }
    }

    /// North and east. `None` before the first position.
    pub(super) const fn axes(&self) -> Option<[Axis; 2]> {
        self.axes
    }

    /// How long the position has been unknown; `None` if it is known.
    pub(super) fn lost_for(&self, now: Timestamp) -> Option<Duration> {
        let since = now.since(self.known_at);
        (self.axes.is_none() || since > LOST_AFTER).then_some(since)
    }

    /// Predicts it `seconds` later. `acceleration_mps2`: without the drag. `up_m`: the height then, for the past.
    pub(super) fn predict(
        &mut self,
        now: Timestamp,
        seconds: f64,
        acceleration_mps2: [f64; 2],
        noise_mps2: f64,
        up_m: f64,
    ) {
        let Some(axes) = &mut self.axes else { return };
        for (axis, by) in axes.iter_mut().zip(acceleration_mps2) {
            let by = by - self.drag_per_s * axis.velocity_mps;
            axis.predict(seconds, by, noise_mps2);
        }
        let [north, east] = axes;
        self.flown_m += libm::hypot(north.velocity_mps, east.velocity_mps) * seconds;
        self.past
            .note(now, [north.position_m, east.position_m, up_m]);
    }

    /// Takes in a fix's place, north and east, with its standard deviation and age. Returns what it changed if it was near
    /// enough. Before there is an estimate or a past to compare with, it begins the estimate; later, some that agree with each
    /// other do.
    pub(super) fn measure_fix(
        &mut self,
        now: Timestamp,
        place: [f64; 2],
        (sigma_m, age): (f64, Duration),
    ) -> Option<[Correction; 2]> {
        let (Some([north, east]), Some(past)) = (&mut self.axes, self.past.before(now, age)) else {
            self.begin(now, place.map(|it| Axis::at(it, sigma_m * sigma_m)));
            return None;
        };
        let innovations = [place[0] - past[0], place[1] - past[1]];
        if let Some(corrected) = correct([north, east], innovations, sigma_m) {
            self.past.shift(&corrected.map(|it| it.by_m));
            self.doubted = None;
            self.accept(now);
            return Some(corrected);
        }
        if let Some(axes) = doubt::begin(&mut self.doubted, now, place, (sigma_m, age)) {
            self.begin(now, axes);
        }
        None
    }

    /// Takes in a fix's velocity, north and east. Returns what it changed on each axis.
    pub(super) fn measure_velocity(
        &mut self,
        velocity_mps: [f64; 2],
        sigma_mps: f64,
    ) -> [Option<Correction>; 2] {
        let mut corrected = [None; 2];
        let measured = self.axes.iter_mut().flatten().zip(velocity_mps);
        for ((axis, velocity), corrected) in measured.zip(&mut corrected) {
            *corrected = axis.measure_velocity(velocity, sigma_mps);
        }
        corrected
    }

    /// Takes in a pose's place, north, east and up, with its standard deviation and age; it corrects the height `up`, too.
    /// Returns what it changed if it was near enough.
    pub(super) fn measure_pose(
        &mut self,
        now: Timestamp,
        up: &mut Axis,
        place: [f64; 3],
        (sigma_m, age): (f64, Duration),
    ) -> Option<[Correction; 3]> {
        let ([north, east], past) = (self.axes.as_mut()?, self.past.before(now, age)?);
        let innovations: [f64; 3] = std::array::from_fn(|axis| place[axis] - past[axis]);
        let corrected = correct([north, east, up], innovations, sigma_m)?;
        self.past.shift(&corrected.map(|it| it.by_m));
        self.accept(now);
        Some(corrected)
    }

    /// Takes in the motion that optical flow saw. A position that is known stays known by it, until it may have drifted too far.
    /// `acceleration_mps2`: without the drag. Returns what the velocity differed from the prediction by, if it was near enough on
    /// both axes.
    pub(super) fn measure_motion(
        &mut self,
        now: Timestamp,
        seen: &Motion,
        acceleration_mps2: [f64; 2],
    ) -> Option<[f64; 2]> {
        let is_known = self.lost_for(now).is_none();
        let axes = self.axes.as_mut()?;
        let mut taken = [None; 2];
        for (index, axis) in axes.iter_mut().enumerate() {
            let by_mps2 = acceleration_mps2[index] - self.drag_per_s * axis.velocity_mps;
            let measured_mps = seen.velocity_mps[index] + by_mps2 * seen.seconds / 2.0;
            let innovation_mps = measured_mps - axis.velocity_mps;
            let corrected = axis.measure_velocity(measured_mps, seen.sigma_mps);
            taken[index] = corrected.map(|it| (it.by_m, innovation_mps));
        }
        let [Some((north_m, north_mps)), Some((east_m, east_mps))] = taken else {
            return None;
        };
        self.past.shift(&[north_m, east_m]);
        let sigma_m = axes.map(|it| it.sigma_m()).into_iter().fold(0.0, f64::max);
        if is_known && sigma_m + SCALE_ERROR * self.flown_m <= DRIFT_MAX_M {
            self.known_at = now;
        }
        Some([north_mps, east_mps])
    }

    /// Begins anew where some positions say.
    pub(super) fn begin(&mut self, now: Timestamp, axes: [Axis; 2]) {
        self.axes = Some(axes);
        self.past = Past::default();
        self.accept(now);
    }

    /// A position was accepted.
    const fn accept(&mut self, now: Timestamp) {
        (self.known_at, self.flown_m) = (now, 0.0);
    }
}
