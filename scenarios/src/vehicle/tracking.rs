//! Motions after a place that moves, and after a pilot's sticks.

use std::time::Duration;

use muster_machines::geometry::{Ned, Velocity};
use muster_machines::time::Timestamp;
use nalgebra::Vector3;

use super::Motion;

/// What a vehicle keeps to.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    pub(super) speed_mps: f64,
    pub(super) acceleration_mps2: f64,
}

/// The shortest time in which a vehicle corrects where it is: twice the 5 Hz at which it is told where to be.
const CORRECTION_MIN_S: f64 = 0.4;
/// By how much a longer time is tried where a shorter one asks for too much, and how often.
const CORRECTION_GROWTH: f64 = 1.25;
const CORRECTIONS_MAX: u32 = 60;

/// How a vehicle gets to a place that moves, and moves along with it from then on: one acceleration for half of the
/// time, another for the other half.
#[derive(Debug, Clone, Copy)]
struct Correction {
    seconds: f64,
    accelerations: [Vector3<f64>; 2],
}

impl Correction {
    /// The one that takes away, within `seconds`, the displacement and the velocity that a vehicle has beside its
    /// place: w T + 3/8 a₁ T² + 1/8 a₂ T² = −e and (a₁ + a₂) T / 2 = −w.
    fn within(seconds: f64, displacement: Vector3<f64>, velocity: Vector3<f64>) -> Self {
        let push = displacement * (4.0 / (seconds * seconds));
        let accelerations = [
            -push - velocity * (3.0 / seconds),
            push + velocity / seconds,
        ];
        Self {
            seconds,
            accelerations,
        }
    }

    /// The quickest within limits, for a vehicle beside a place that moves at `along`.
    fn quickest(
        displacement: Vector3<f64>,
        velocity: Vector3<f64>,
        along: Vector3<f64>,
        limits: Limits,
    ) -> Self {
        let speed_max = limits.speed_mps.max((along + velocity).norm());
        let keeps_to = |it: &Self| {
            let [first, second] = it.accelerations.map(|it| it.norm());
            let halfway = along + velocity + it.accelerations[0] * (it.seconds / 2.0);
            first.max(second) <= limits.acceleration_mps2 && halfway.norm() <= speed_max
        };
        let mut correction = Self::within(CORRECTION_MIN_S, displacement, velocity);
        for _ in 0..CORRECTIONS_MAX {
            if keeps_to(&correction) {
                break;
            }
            let seconds = correction.seconds * CORRECTION_GROWTH;
            correction = Self::within(seconds, displacement, velocity);
        }
        correction
    }
}

impl Motion {
    /// Gets to a place that moves, moves along with it until `hold` from now, and comes to rest.
    pub(super) fn track(
        &mut self,
        at: Timestamp,
        (to, velocity): (Ned, Velocity),
        limits: Limits,
        hold: Duration,
    ) {
        let own = self.velocity(at).unwrap_or_default();
        let from = self.position(at).0;
        let along = velocity.0.cap_magnitude(limits.speed_mps);
        let correction = Correction::quickest(from - to.0, own - along, along, limits);
        self.braking_mps2 = limits.acceleration_mps2;
        self.cut(at);
        let mut now = (at, from, own);
        let mut left_s = hold.as_secs_f64();
        for acceleration in correction.accelerations {
            let seconds = left_s.min(correction.seconds / 2.0);
            now = self.accelerate(now, acceleration, seconds);
            left_s -= seconds;
        }
        now = self.accelerate(now, Vector3::zeros(), left_s);
        self.come_to_rest_from(now);
    }

    /// Changes to a velocity, keeps to it for `hold`, and comes to rest.
    pub(super) fn steer(
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

    /// Plans a piece; when, where and how fast it ends.
    fn accelerate(
        &mut self,
        (start, from, velocity): (Timestamp, Vector3<f64>, Vector3<f64>),
        acceleration: Vector3<f64>,
        seconds: f64,
    ) -> (Timestamp, Vector3<f64>, Vector3<f64>) {
        let end = self.push(start, from, velocity, acceleration, seconds);
        // As long as the piece is once its ends are whole nanoseconds, so that pieces meet.
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
