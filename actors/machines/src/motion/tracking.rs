//! Motions that track a moving target, follow a pilot's sticks, or hold at another height.

use std::time::Duration;

use nalgebra::Vector3;

use super::Motion;
use crate::geometry::{Ned, Velocity};
use crate::time::Timestamp;

/// A vehicle's limits of speed and acceleration.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    pub(super) speed_mps: f64,
    pub(super) acceleration_mps2: f64,
}

/// The shortest duration of a correction: two periods of setpoints at 5 Hz.
const CORRECTION_MIN_S: f64 = 0.4;
/// Factor to the next duration that is tried if a correction exceeds the limits.
const CORRECTION_GROWTH: f64 = 1.1;
/// The most durations that are tried.
const CORRECTIONS_MAX: u32 = 100;

/// Shares of a correction's duration for acceleration, and the same for braking; it coasts in between. A smaller share takes
/// less speed.
const SHARES: [f64; 4] = [1.0 / 2.0, 1.0 / 4.0, 1.0 / 8.0, 1.0 / 16.0];

/// The motion that brings a vehicle to a moving target with the target's velocity: accelerate, coast, brake.
#[derive(Debug, Clone, Copy)]
struct Correction {
    /// Duration in seconds and acceleration in m/s² of each piece.
    pieces: [(f64, Vector3<f64>); 3],
    /// Velocity relative to the target while coasting, in m/s.
    coasting: Vector3<f64>,
}

impl Correction {
    /// Removes, within T = `seconds`, the displacement e and the velocity w relative to the target. It coasts at u, except for
    /// the `share` σ of T at either end: e + (w + u) σT / 2 + u (1 − 2σ) T + u σT / 2 = 0.
    fn within(
        seconds: f64,
        share: f64,
        displacement: Vector3<f64>,
        velocity: Vector3<f64>,
    ) -> Self {
        let end_s = seconds * share;
        let coasting = (displacement + velocity * (end_s / 2.0)) / (-seconds * (1.0 - share));
        Self {
            pieces: [
                (end_s, (coasting - velocity) / end_s),
                (seconds - 2.0 * end_s, Vector3::zeros()),
                (end_s, -coasting / end_s),
            ],
            coasting,
        }
    }

    /// Removes the velocity relative to the target, but not the displacement.
    fn of_velocity(velocity: Vector3<f64>, acceleration_mps2: f64) -> Self {
        let seconds = velocity.norm() / acceleration_mps2;
        let pieces = match velocity.try_normalize(0.0) {
            Some(direction) => [(seconds, direction * -acceleration_mps2), REST, REST],
            None => [REST; 3],
        };
        Self {
            pieces,
            coasting: Vector3::zeros(),
        }
    }

    /// The quickest correction within limits, for a target that moves at `target_velocity`. A target at the vehicle's highest
    /// speed can't be reached: the distance is kept.
    fn quickest(
        displacement: Vector3<f64>,
        velocity: Vector3<f64>,
        target_velocity: Vector3<f64>,
        limits: Limits,
    ) -> Self {
        let is_within_limits = |it: &Self| {
            let fits = |(_, by): &(f64, Vector3<f64>)| by.norm() <= limits.acceleration_mps2;
            it.pieces.iter().all(fits) && (target_velocity + it.coasting).norm() <= limits.speed_mps
        };
        let mut seconds = CORRECTION_MIN_S;
        for _ in 0..CORRECTIONS_MAX {
            let candidates =
                SHARES.map(|share| Self::within(seconds, share, displacement, velocity));
            if let Some(correction) = candidates.into_iter().find(is_within_limits) {
                return correction;
            }
            seconds *= CORRECTION_GROWTH;
        }
        Self::of_velocity(velocity, limits.acceleration_mps2)
    }
}

/// The fastest trapezoid to rest at `distance_m`, from `velocity_mps` and with at most `speed_mps`: each piece's duration in
/// seconds and acceleration in m/s².
fn trapezoid(
    distance_m: f64,
    velocity_mps: f64,
    speed_mps: f64,
    acceleration_mps2: f64,
) -> [(f64, f64); 3] {
    let stop_m = velocity_mps * velocity_mps.abs() / (2.0 * acceleration_mps2);
    let ahead = if distance_m < stop_m { -1.0 } else { 1.0 };
    let square = acceleration_mps2 * ahead * distance_m + velocity_mps * velocity_mps / 2.0;
    let peak_mps = ahead * square.max(0.0).sqrt().min(speed_mps);
    let to_peak_s = (peak_mps - velocity_mps).abs() / acceleration_mps2;
    let to_rest_s = peak_mps.abs() / acceleration_mps2;
    let ends_m = (velocity_mps + peak_mps) / 2.0 * to_peak_s + peak_mps / 2.0 * to_rest_s;
    let cruise_s = if to_rest_s > 0.0 {
        ((distance_m - ends_m) / peak_mps).max(0.0)
    } else {
        0.0
    };
    let towards_peak = (peak_mps - velocity_mps).signum() * acceleration_mps2;
    [
        (to_peak_s, towards_peak),
        (cruise_s, 0.0),
        (to_rest_s, -ahead * acceleration_mps2),
    ]
}

const REST: (f64, Vector3<f64>) = (0.0, Vector3::new(0.0, 0.0, 0.0));

impl Motion {
    /// Tracks a moving target until `hold` after `at`, then comes to rest.
    pub(super) fn track(
        &mut self,
        at: Timestamp,
        (to, velocity): (Ned, Velocity),
        limits: Limits,
        hold: Duration,
    ) {
        let own = self.velocity(at).unwrap_or_default();
        let from = self.position(at).0;
        let target = velocity.0.cap_magnitude(limits.speed_mps);
        let correction = Correction::quickest(from - to.0, own - target, target, limits);
        self.braking_mps2 = limits.acceleration_mps2;
        self.cut(at);
        let mut now = (at, from, own);
        let mut left_s = hold.as_secs_f64();
        for (seconds, acceleration) in correction.pieces {
            let seconds = left_s.min(seconds);
            if seconds > 0.0 {
                now = self.accelerate(now, acceleration, seconds);
                left_s -= seconds;
            }
        }
        now = self.accelerate(now, Vector3::zeros(), left_s);
        self.come_to_rest_from(now);
    }

    /// Accelerates to a velocity, keeps it for `hold`, then comes to rest.
    pub fn steer(
        &mut self,
        at: Timestamp,
        velocity: Velocity,
        acceleration_mps2: f64,
        hold: Duration,
    ) {
        let own = self.velocity(at).unwrap_or_default();
        let from = self.position(at).0;
        let change = velocity.0 - own;
        self.braking_mps2 = acceleration_mps2;
        self.cut(at);
        let seconds = change.norm() / acceleration_mps2;
        let mut now = (at, from, own);
        if seconds > 0.0 {
            now = self.accelerate(now, change / seconds, seconds);
        }
        if velocity != Velocity::ZERO {
            now = self.accelerate(now, Vector3::zeros(), hold.as_secs_f64());
        }
        self.come_to_rest_from(now);
    }

    /// Brakes horizontally while climbing or descending to `altitude_m`, each as fast as the limits allow.
    pub(super) fn hold(
        &mut self,
        at: Timestamp,
        altitude_m: f64,
        vertical_mps: f64,
        acceleration_mps2: f64,
    ) {
        let own = self.velocity(at).unwrap_or_default();
        let from = self.position(at).0;
        self.braking_mps2 = acceleration_mps2;
        self.cut(at);
        let horizontal = Vector3::new(own.x, own.y, 0.0);
        let braking_s = horizontal.norm() / acceleration_mps2;
        let braking = horizontal
            .try_normalize(0.0)
            .map_or_else(Vector3::zeros, |ahead| ahead * -acceleration_mps2);
        let mut vertical = (0.0, 0.0);
        let vertical = trapezoid(-altitude_m - from.z, own.z, vertical_mps, acceleration_mps2).map(
            |(seconds, down_mps2)| {
                vertical = (vertical.0 + seconds, down_mps2);
                vertical
            },
        );
        let mut ends: Vec<f64> = vertical.iter().map(|(end_s, _)| *end_s).collect();
        ends.push(braking_s);
        ends.sort_by(f64::total_cmp);
        let (mut now, mut start_s) = ((at, from, own), 0.0);
        for end_s in ends.into_iter().filter(|end_s| *end_s > 0.0) {
            let current = vertical.iter().find(|(until_s, _)| start_s < *until_s);
            let down_mps2 = current.map_or(0.0, |(_, down_mps2)| *down_mps2);
            let level = if start_s < braking_s {
                braking
            } else {
                Vector3::zeros()
            };
            let acceleration = level + Vector3::new(0.0, 0.0, down_mps2);
            now = self.accelerate(now, acceleration, end_s - start_s);
            start_s = end_s;
        }
        // A rest at exactly this altitude, without rounding error.
        let end = Vector3::new(now.1.x, now.1.y, -altitude_m);
        self.push(now.0, end, Vector3::zeros(), Vector3::zeros(), 0.0);
    }

    /// Plans a piece. Returns its end: time, position and velocity.
    fn accelerate(
        &mut self,
        (start, from, velocity): (Timestamp, Vector3<f64>, Vector3<f64>),
        acceleration: Vector3<f64>,
        seconds: f64,
    ) -> (Timestamp, Vector3<f64>, Vector3<f64>) {
        let end = self.push(start, from, velocity, acceleration, seconds);
        // The duration between whole nanoseconds, so that pieces meet.
        let seconds = end.since(start).as_secs_f64();
        (
            end,
            from + velocity * seconds + acceleration * (seconds * seconds / 2.0),
            velocity + acceleration * seconds,
        )
    }

    fn come_to_rest_from(&mut self, now: (Timestamp, Vector3<f64>, Vector3<f64>)) {
        let speed = now.2.norm();
        let (mut end, mut place) = (now.0, now.1);
        if speed > 0.0 {
            let braking = now.2 * (-self.braking_mps2 / speed);
            (end, place, _) = self.accelerate(now, braking, speed / self.braking_mps2);
        }
        self.push(end, place, Vector3::zeros(), Vector3::zeros(), 0.0);
    }
}
