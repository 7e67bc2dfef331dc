//! Velocity over ground, and height above it, from an optical flow module that looks down.

use std::f64::consts::{PI, TAU};
use std::time::Duration;

use muster_msp::{FlowReading, OpticalFlow, RangefinderSample};

use super::attitude::LEAN_MAX_RAD;
use super::{LOST_AFTER, Tilt};
use crate::msp::controller::config::FlowModule;
use crate::time::Timestamp;

/// Least quality of an optical flow that counts: INAV's `OPFLOW_SQUAL_THRESHOLD_HIGH`.
const QUALITY_MIN: u8 = 35;
/// Fastest turn of the ground that a module sees, in rad/s: the PAW3902 of the ARK Flow tracks up to 7.4.
const RATE_MAX_RADPS: f64 = 7.0;
/// Standard deviation of the turn that is seen, in rad/s: PX4's `EKF2_OF_N_MIN`.
const SIGMA_RADPS: f64 = 0.15;
/// What a turn of the vehicle adds to it, as a share: attitude and optical flow are some 20 ms apart. Ours.
const TURN_SHARE: f64 = 0.3;
/// Shortest distance that a rate is multiplied with for its error, in metres: close to the ground the floor's texture blurs.
const DISTANCE_MIN_M: f64 = 0.1;
/// Age up to which a distance is multiplied with a rate.
const DISTANCE_AGE_MAX: Duration = Duration::from_millis(200);
/// Longest time between two attitudes of which the turn is told from the motion.
const WINDOW_MAX: Duration = Duration::from_millis(300);
/// How fast the acceleration that the attitude doesn't say, as by wind, is learnt, in 1/s²: within a second and a half. Ours.
const PUSH_PER_S2: f64 = 4.0;
/// Most of it, in m/s²: the drag of a wind of 9 m/s.
const PUSH_MAX_MPS2: f64 = 4.0;

/// What an optical flow module has said.
#[derive(Debug)]
pub(super) struct Flow {
    module: FlowModule,
    /// The newest distance to the ground along the module's axis, in metres.
    distance: Option<(Timestamp, f64)>,
    /// What it saw since the newest attitude. `None` if it saw badly.
    window: Option<Window>,
    /// What accelerates the vehicle north and east beside its tilt, in m/s², and when that was learnt last.
    push: Option<(Timestamp, [f64; 2])>,
}

/// Rates between two attitudes.
#[derive(Debug, Clone, Copy)]
struct Window {
    since: Timestamp,
    from: Tilt,
    sum_radps: [f64; 2],
    count: u32,
}

/// A vehicle's own motion over ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Motion {
    /// North and east, in the middle of the time that it was seen for, in m/s.
    pub(super) velocity_mps: [f64; 2],
    /// Standard deviation on each axis, in m/s.
    pub(super) sigma_mps: f64,
    /// How long it was seen for, in seconds.
    pub(super) seconds: f64,
}

impl Flow {
    pub(super) const fn new(module: FlowModule) -> Self {
        Self {
            module,
            distance: None,
            window: None,
            push: None,
        }
    }

    /// What accelerates the vehicle north and east beside its tilt, in m/s², as far as it was learnt lately.
    pub(super) fn push_mps2(&self, now: Timestamp) -> [f64; 2] {
        let recent = self.push.filter(|(at, _)| now.since(*at) <= LOST_AFTER);
        recent.map_or([0.0; 2], |(_, push_mps2)| push_mps2)
    }

    /// Learns it from what the velocity differed from the prediction by.
    pub(super) fn learn_push(&mut self, now: Timestamp, innovations_mps: [f64; 2], seconds: f64) {
        let mut push_mps2 = self.push_mps2(now);
        for (push, innovation) in push_mps2.iter_mut().zip(innovations_mps) {
            let learnt = *push + PUSH_PER_S2 * innovation * seconds;
            *push = learnt.clamp(-PUSH_MAX_MPS2, PUSH_MAX_MPS2);
        }
        self.push = Some((now, push_mps2));
    }

    /// Takes in a measurement. Returns the height above a level floor, in metres, if it tells one.
    pub(super) fn measure(
        &mut self,
        now: Timestamp,
        tilt: Tilt,
        reading: &FlowReading,
    ) -> Option<f64> {
        match reading {
            FlowReading::Rates(rates) => {
                self.measure_rates(rates);
                None
            }
            FlowReading::Range(range) => {
                let distance_m = distance_m(range);
                self.distance = distance_m.map(|it| (now, it));
                let height_m = distance_m? * tilt.vertical_share();
                self.module.level_floor.then_some(height_m)
            }
        }
    }

    fn measure_rates(&mut self, rates: &OpticalFlow) {
        let seen_radps = [rates.x_mradps, rates.y_mradps].map(|it| f64::from(it) / 1_000.0);
        let is_good =
            rates.quality >= QUALITY_MIN && seen_radps.iter().all(|it| it.abs() <= RATE_MAX_RADPS);
        if !is_good {
            self.window = None;
        } else if let Some(window) = &mut self.window {
            for (sum, rate) in window.sum_radps.iter_mut().zip(seen_radps) {
                *sum += rate;
            }
            window.count = window.count.saturating_add(1);
        }
    }

    /// The next attitude ends what was seen since the one before. Returns the motion that is left without the vehicle's own
    /// turn. `climb_mps`: upwards.
    pub(super) fn moved(&mut self, now: Timestamp, tilt: Tilt, climb_mps: f64) -> Option<Motion> {
        let next = Window {
            since: now,
            from: tilt,
            sum_radps: [0.0; 2],
            count: 0,
        };
        let window = self.window.replace(next)?;
        let (distance_at, distance_m) = self.distance?;
        let lasted = now.since(window.since);
        let is_usable = window.count > 0
            && !lasted.is_zero()
            && lasted <= WINDOW_MAX
            && now.since(distance_at) <= DISTANCE_AGE_MAX;
        if !is_usable {
            return None;
        }
        window.motion(tilt, lasted.as_secs_f64(), distance_m, climb_mps)
    }
}

/// The distance of a range that has one, in metres.
fn distance_m(range: &RangefinderSample) -> Option<f64> {
    let is_measured = range.quality > 0 && range.distance_mm > 0;
    is_measured.then(|| f64::from(range.distance_mm) / 1_000.0)
}

impl Window {
    /// Seen from a body that turns by (p, q), the ground at the distance d beneath it turns about its axes x and y by p − v_y/d
    /// and q + v_x/d. p and q are those of the attitude's change (Stevens, Lewis, *Aircraft Control and Simulation*, section
    /// 1.4).
    fn motion(&self, to: Tilt, seconds: f64, distance_m: f64, climb_mps: f64) -> Option<Motion> {
        let turned = |from: f64, to: f64| between_half_turns(to - from) / seconds;
        let middle = |from: f64, to: f64| from + between_half_turns(to - from) / 2.0;
        let roll_radps = turned(self.from.roll_rad, to.roll_rad);
        let pitch_radps = -turned(self.from.nose_down_rad, to.nose_down_rad);
        let yaw_radps = turned(self.from.yaw_rad, to.yaw_rad);
        let roll_rad = middle(self.from.roll_rad, to.roll_rad);
        let pitch_rad = -middle(self.from.nose_down_rad, to.nose_down_rad);
        let yaw_rad = middle(self.from.yaw_rad, to.yaw_rad);
        if roll_rad.abs().max(pitch_rad.abs()) > LEAN_MAX_RAD {
            return None;
        }
        let [
            (sin_roll, cos_roll),
            (sin_pitch, cos_pitch),
            (sin_yaw, cos_yaw),
        ] = [roll_rad, pitch_rad, yaw_rad].map(|it| (libm::sin(it), libm::cos(it)));
        let about_x_radps = roll_radps - yaw_radps * sin_pitch;
        let about_y_radps = pitch_radps * cos_roll + yaw_radps * cos_pitch * sin_roll;
        let [seen_x_radps, seen_y_radps] = self.sum_radps.map(|sum| sum / f64::from(self.count));
        let body_x_mps = distance_m * (seen_y_radps - about_y_radps);
        let body_y_mps = distance_m * (about_x_radps - seen_x_radps);
        // What the climb is of both is known; the rest is along the heading and to its right.
        let down_mps = -climb_mps;
        let ahead_mps = (body_x_mps + sin_pitch * down_mps) / cos_pitch;
        let right_mps =
            (body_y_mps - sin_roll * sin_pitch * ahead_mps - sin_roll * cos_pitch * down_mps)
                / cos_roll;
        let turn_radps = TURN_SHARE * libm::hypot(about_x_radps, about_y_radps);
        Some(Motion {
            velocity_mps: [
                ahead_mps * cos_yaw - right_mps * sin_yaw,
                ahead_mps * sin_yaw + right_mps * cos_yaw,
            ],
            sigma_mps: distance_m.max(DISTANCE_MIN_M) * libm::hypot(SIGMA_RADPS, turn_radps),
            seconds,
        })
    }
}

/// The same angle from −π to π, in radians.
fn between_half_turns(angle_rad: f64) -> f64 {
    (angle_rad + PI).rem_euclid(TAU) - PI
}

#[cfg(test)]
mod tests;
