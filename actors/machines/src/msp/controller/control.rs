//! From a reference to sticks: position → velocity → acceleration → attitude and throttle.

use std::ops::RangeInclusive;

use muster_msp::{Channel, StickResponse, Sticks};
use nalgebra::{Vector2, Vector3};

use super::config::Gains;
use super::estimator::{Estimate, GRAVITY_MPS2, Tilt};
use crate::geometry::{Ned, Velocity};

/// Half the travel of a centred stick, and the travel of the throttle, in µs.
const STICK_US: f64 = 500.0;
const THROTTLE_US: f64 = 1_000.0;
/// Limits of the throttle in flight, 0 to 1: motors neither stop nor saturate.
const THROTTLE_MIN: f64 = 0.08;
const THROTTLE_MAX: f64 = 0.9;
/// Largest velocity that corrects a distance from the reference, in m/s.
const CORRECTION_MAX_MPS: f64 = 4.0;
/// Largest integrated acceleration on each axis, in m/s²: a wind, or a battery half empty.
const INTEGRAL_MAX_MPS2: f64 = 3.0;
/// Time constant of the wind that counts once the position is lost, in seconds.
const STEADY_S: f64 = 15.0;
/// Largest change of the horizontal acceleration, in m/s³: 220°/s of tilt where the vehicle neither climbs nor sinks, PX4's
/// default limit of roll and pitch rates (`MC_ROLLRATE_MAX`).
const SLEW_MAX_MPS3: f64 = 37.6;
/// Largest vertical acceleration either way, beside what is integrated, in m/s².
const CLIMB_MAX_MPS2: f64 = 4.0;

/// Largest acceleration upwards, and largest integrated one, of a vehicle whose thrust had no effect, in m/s²: three times its
/// weight, which is nearly full throttle for one that hovered at half of it. Ours.
const WEAK_UP_MAX_MPS2: f64 = 20.0;

/// Where a vehicle should be now.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reference {
    pub(super) position: Ned,
    pub(super) velocity: Velocity,
    /// m/s².
    pub(super) acceleration: Vector3<f64>,
}

/// How far a vehicle leans.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Lean {
    /// Not at all: leaning on the ground tips it over.
    Level,
    /// As it did on average: against the wind that it knows. Its position is lost.
    Steady,
    /// As its place asks for.
    Free,
}

/// The control loops.
#[derive(Debug)]
pub(super) struct Control {
    gains: Gains,
    /// Integrated acceleration, in m/s², north, east, down.
    integral: Vector3<f64>,
    /// Its horizontal part as it was for [`STEADY_S`], without what noise adds.
    steady: Vector2<f64>,
    /// The horizontal acceleration of the last sticks, in m/s².
    level_mps2: Vector2<f64>,
    /// The acceleration downwards of the last sticks, in m/s².
    down_mps2: f64,
    /// Whether thrust had no effect.
    is_weak: bool,
}

impl Control {
    pub(super) const fn new(gains: Gains) -> Self {
        Self {
            gains,
            integral: Vector3::new(0.0, 0.0, 0.0),
            steady: Vector2::new(0.0, 0.0),
            level_mps2: Vector2::new(0.0, 0.0),
            down_mps2: 0.0,
            is_weak: false,
        }
    }

    /// The throttle at which the vehicle hovers, 0 to 1, as learnt so far.
    pub(super) fn hover_throttle(&self) -> f64 {
        throttle(self.gains.hover_throttle, -self.integral.z, 1.0)
    }

    /// The acceleration downwards that the last sticks should have given, in m/s².
    pub(super) fn expected_down_mps2(&self) -> f64 {
        self.down_mps2 - self.integral.z
    }

    /// The same, whether or not what is integrated is what the vehicle hovers with: the nearer to 0 of both.
    pub(super) fn sure_down_mps2(&self) -> f64 {
        let (asked, expected) = (self.down_mps2, self.expected_down_mps2());
        0.0_f64.clamp(asked.min(expected), asked.max(expected))
    }

    /// Thrust had no effect: what was asked for counts as learnt, and from now on as much is asked for as the motors have.
    pub(super) fn expect_little_thrust(&mut self) {
        self.is_weak = true;
        self.integral.z = self.integral.z.min(self.down_mps2.max(-WEAK_UP_MAX_MPS2));
    }

    /// Limits of the acceleration downwards, in m/s². What is integrated comes on top: a heavy vehicle needs it to hover. If it is
    /// wrong, the limits still let the vehicle accelerate either way.
    fn down_limits_mps2(&self) -> RangeInclusive<f64> {
        let up_max = match self.is_weak {
            true => WEAK_UP_MAX_MPS2,
            false => CLIMB_MAX_MPS2 - self.integral.z.min(0.0),
        };
        -up_max..=CLIMB_MAX_MPS2 + self.integral.z.max(0.0)
    }

    /// Limits of the integrated acceleration downwards, in m/s².
    const fn integral_limits_mps2(&self) -> RangeInclusive<f64> {
        match self.is_weak {
            true => -WEAK_UP_MAX_MPS2..=INTEGRAL_MAX_MPS2,
            false => -INTEGRAL_MAX_MPS2..=INTEGRAL_MAX_MPS2,
        }
    }

    /// Sticks that level a vehicle that has tipped over: with the least throttle that motors follow, for its thrust points aside
    /// or down.
    pub(super) fn upright(&mut self) -> Sticks {
        self.level_mps2 = Vector2::zeros();
        Sticks {
            roll: Channel::CENTRE,
            pitch: Channel::CENTRE,
            throttle: channel(1_000.0 + THROTTLE_US * THROTTLE_MIN),
            yaw: Channel::CENTRE,
        }
    }

    /// Sticks of a level vehicle that neither climbs nor sinks by itself.
    pub(super) fn level(&mut self, tilt: Tilt) -> Sticks {
        self.level_mps2 = Vector2::zeros();
        self.sticks(Vector3::new(0.0, 0.0, self.integral.z), tilt)
    }

    /// Sticks that bring a vehicle to its reference, `seconds` after the last. `is_blind`: its height is only predicted, so
    /// nothing is to be learnt from it.
    pub(super) fn step(
        &mut self,
        seconds: f64,
        reference: &Reference,
        estimate: &Estimate,
        tilt: Tilt,
        (lean, is_blind): (Lean, bool),
    ) -> Sticks {
        let gains = &self.gains;
        let distance = (reference.position - estimate.position).0;
        let per_s = per_axis(gains.position_per_s, gains.height_per_s);
        let correction = distance
            .component_mul(&per_s)
            .cap_magnitude(CORRECTION_MAX_MPS);
        let error = reference.velocity.0 + correction - estimate.velocity.0;
        let per_s = per_axis(gains.velocity_per_s, gains.climb_per_s);
        let per_s2 = per_axis(gains.integral_per_s2, gains.climb_integral_per_s2);
        let drag = Vector3::new(reference.velocity.0.x, reference.velocity.0.y, 0.0);
        let asked = reference.acceleration
            + drag * gains.drag_per_s
            + error.component_mul(&per_s)
            + self.integral;
        if !asked.iter().all(|it| it.is_finite()) {
            return self.level(tilt);
        }
        let most = GRAVITY_MPS2 * libm::tan(gains.tilt_max_rad);
        let level = asked.xy().cap_magnitude(most);
        let is_level_beyond = level != asked.xy();
        let down = within(&self.down_limits_mps2(), asked.z);
        self.down_mps2 = down;
        let mut growth = error.component_mul(&per_s2) * seconds;
        // Nothing that makes it ask for still more.
        if (asked.z < down && growth.z < 0.0) || (asked.z > down && growth.z > 0.0) || is_blind {
            growth.z = 0.0;
        }
        self.integral.z = within(&self.integral_limits_mps2(), self.integral.z + growth.z);
        if lean == Lean::Free {
            self.steady += (self.integral.xy() - self.steady) * (seconds / STEADY_S).min(1.0);
            if !is_level_beyond {
                let integral = self.integral.xy() + growth.xy();
                let integral = integral.map(|it| it.clamp(-INTEGRAL_MAX_MPS2, INTEGRAL_MAX_MPS2));
                (self.integral.x, self.integral.y) = (integral.x, integral.y);
            }
        }
        self.level_mps2 = match lean {
            Lean::Level => Vector2::zeros(),
            Lean::Steady => self.slewed(self.steady, seconds),
            Lean::Free => self.slewed(level, seconds),
        };
        self.sticks(self.level_mps2.push(down), tilt)
    }

    /// The horizontal acceleration on its way to another, `seconds` after the last.
    fn slewed(&self, to: Vector2<f64>, seconds: f64) -> Vector2<f64> {
        let most = SLEW_MAX_MPS3 * seconds;
        self.level_mps2 + (to - self.level_mps2).cap_magnitude(most)
    }

    /// The attitude and the throttle of an acceleration, as sticks.
    fn sticks(&self, acceleration: Vector3<f64>, tilt: Tilt) -> Sticks {
        let up = GRAVITY_MPS2 - acceleration.z;
        let (sin, cos) = (libm::sin(tilt.yaw_rad), libm::cos(tilt.yaw_rad));
        let ahead = acceleration.x * cos + acceleration.y * sin;
        let right = acceleration.y * cos - acceleration.x * sin;
        let angle = |by: f64| {
            let most = self.gains.tilt_max_rad;
            deflection(libm::atan2(by, up).clamp(-most, most))
        };
        let hover = self.gains.hover_throttle;
        let throttle = throttle(hover, -acceleration.z, tilt.vertical_share());
        Sticks {
            roll: channel(1_500.0 + STICK_US * angle(right)),
            pitch: channel(1_500.0 + STICK_US * angle(ahead)),
            throttle: channel(1_000.0 + THROTTLE_US * throttle),
            yaw: Channel::CENTRE,
        }
    }
}

/// The deflection of a stick, -1 to 1, that asks for a tilt in radians: the inverse of [`StickResponse`].
pub(super) fn deflection(tilt_rad: f64) -> f64 {
    let StickResponse {
        rc_rate,
        srate,
        angle_limit_deg,
    } = StickResponse::ASSUMED;
    let (centre, max) = (f64::from(rc_rate), f64::from(srate));
    let beyond = max - centre;
    let share = tilt_rad.abs() / f64::from(angle_limit_deg).to_radians();
    let asked = max * share.min(1.0);
    let deflection = (libm::sqrt(centre * centre + 4.0 * beyond * asked) - centre) / (2.0 * beyond);
    deflection.copysign(tilt_rad)
}

/// The throttle for a vertical acceleration upwards, in m/s²: thrust grows with the square of the throttle.
fn throttle(hover: f64, up_mps2: f64, vertical_share: f64) -> f64 {
    let thrust = (GRAVITY_MPS2 + up_mps2) / GRAVITY_MPS2 / vertical_share.max(0.5);
    (hover * libm::sqrt(thrust.max(0.0))).clamp(THROTTLE_MIN, THROTTLE_MAX)
}

fn per_axis(level: f64, vertical: f64) -> Vector3<f64> {
    Vector3::new(level, level, vertical)
}

fn within(limits: &RangeInclusive<f64>, value: f64) -> f64 {
    value.clamp(*limits.start(), *limits.end())
}

fn channel(us: f64) -> Channel {
    let (low, high) = (Channel::LOW.us(), Channel::HIGH.us());
    let us = (libm::round(us) as u16).clamp(low, high);
    Channel::new(us).expect("1,000 to 2,000 µs are a channel's")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reference() -> Reference {
        Reference {
            position: Ned::HOME,
            velocity: Velocity::ZERO,
            acceleration: Vector3::zeros(),
        }
    }

    fn estimate(north_m: f64, east_m: f64, down_m: f64) -> Estimate {
        Estimate {
            position: Ned::new(north_m, east_m, down_m),
            velocity: Velocity::ZERO,
        }
    }

    /// Sticks after 0.3 s, when the slew limit no longer acts.
    fn sticks(estimate: &Estimate, yaw_deg: f64, lean: Lean) -> Sticks {
        let tilt = Tilt {
            yaw_rad: yaw_deg.to_radians(),
            ..Tilt::default()
        };
        let mut control = Control::new(Gains::QUADCOPTER);
        let mut step = || control.step(0.02, &reference(), estimate, tilt, (lean, false));
        for _ in 0..14 {
            step();
        }
        step()
    }

    #[test]
    fn vehicle_leans_to_where_it_should_be() {
        let south = estimate(-5.0, 0.0, 0.0);
        let ahead = sticks(&south, 0.0, Lean::Free);
        assert!(ahead.pitch > Channel::CENTRE && ahead.roll == Channel::CENTRE);
        // It heads east, so north is on the left.
        let left = sticks(&south, 90.0, Lean::Free);
        assert!(left.roll < Channel::CENTRE && left.pitch == Channel::CENTRE);
        let low = sticks(&estimate(0.0, 0.0, 3.0), 0.0, Lean::Free);
        let high = sticks(&estimate(0.0, 0.0, -3.0), 0.0, Lean::Free);
        assert!(low.throttle > high.throttle);
    }

    /// The tilt ahead that sticks ask for, in degrees.
    fn pitch_deg(sticks: &Sticks) -> f64 {
        let stick = (f64::from(sticks.pitch.us()) - 1_500.0) / 500.0;
        StickResponse::ASSUMED.tilt_rad(stick).to_degrees()
    }

    #[test]
    fn tilt_changes_by_no_more_than_220_degrees_a_second() {
        let mut control = Control::new(Gains::QUADCOPTER);
        let mut tilt_deg = |north_m| {
            let far = estimate(north_m, 0.0, 0.0);
            let free = (Lean::Free, false);
            pitch_deg(&control.step(0.02, &reference(), &far, Tilt::default(), free))
        };
        let places = [[-50.0; 12], [50.0; 12], [50.0; 12]];
        let tilts: Vec<_> = places.into_iter().flatten().map(&mut tilt_deg).collect();
        // A stick's whole µs are up to 0.1°.
        assert!(tilts[0] < 4.5, "{tilts:?}");
        let steps = tilts.windows(2).map(|it| (it[1] - it[0]).abs());
        assert!(steps.clone().all(|it| it < 4.6), "{tilts:?}");
        assert!((tilts[11] - 35.0).abs() < 0.2 && (tilts[35] + 35.0).abs() < 0.2);
    }

    #[test]
    fn vehicle_that_was_levelled_leans_from_there() {
        let far = estimate(-50.0, 0.0, 0.0);
        let lean = |control: &mut Control| {
            let free = (Lean::Free, false);
            pitch_deg(&control.step(0.02, &reference(), &far, Tilt::default(), free))
        };
        let mut control = Control::new(Gains::QUADCOPTER);
        let first_deg = lean(&mut control);
        let level: [fn(&mut Control) -> Sticks; 2] =
            [Control::upright, |it| it.level(Tilt::default())];
        for level in level {
            for _ in 0..12 {
                lean(&mut control);
            }
            level(&mut control);
            let again_deg = lean(&mut control);
            assert!((again_deg - first_deg).abs() < 0.2, "{again_deg}");
        }
    }

    /// A defect of the indoor thesis's code: the "derivative" gain acted on the previous error.
    #[test]
    fn damping_acts_on_the_motion_and_not_on_a_previous_error() {
        let south = estimate(-0.5, 0.0, 0.0);
        let moving = |north_mps: f64| Estimate {
            velocity: Velocity::new(north_mps, 0.0, 0.0),
            ..south
        };
        let pitch = |estimate: &Estimate| sticks(estimate, 0.0, Lean::Free).pitch;
        assert!(pitch(&moving(1.0)) < pitch(&moving(0.0)));
        assert!(pitch(&moving(0.0)) < pitch(&moving(-1.0)));
        // Where it was before doesn't matter.
        let after = |before: &Estimate| {
            let gains = Gains {
                integral_per_s2: 0.0,
                climb_integral_per_s2: 0.0,
                ..Gains::QUADCOPTER
            };
            let mut control = Control::new(gains);
            let mut step = |estimate| {
                let tilt = Tilt::default();
                control.step(0.02, &reference(), estimate, tilt, (Lean::Free, false))
            };
            // Until the slew limit no longer acts.
            for _ in 0..14 {
                step(before);
            }
            step(&south)
        };
        // So near that the slew limit doesn't act.
        assert_eq!(after(&south), after(&estimate(-0.45, 0.05, 1.0)));
    }

    #[test]
    fn without_a_position_it_leans_against_the_wind_that_it_knows() {
        let mut control = Control::new(Gains::QUADCOPTER);
        let south = estimate(-0.5, 0.0, 0.0);
        let mut step =
            |lean| control.step(0.02, &reference(), &south, Tilt::default(), (lean, false));
        for _ in 0..100 {
            step(Lean::Free);
        }
        let free = step(Lean::Free);
        for _ in 0..14 {
            step(Lean::Steady);
        }
        let steady = step(Lean::Steady);
        assert!(Channel::CENTRE < steady.pitch && steady.pitch < free.pitch);
        assert_eq!(step(Lean::Steady), steady);
    }

    #[test]
    fn on_the_ground_it_is_kept_level() {
        let level = sticks(&estimate(-50.0, 20.0, 0.0), 0.0, Lean::Level);
        assert_eq!(
            (level.roll, level.pitch),
            (Channel::CENTRE, Channel::CENTRE)
        );
    }

    #[test]
    fn a_stick_asks_for_the_angle_that_it_is_to() {
        for tilt_deg in [-60.0_f64, -10.0, -0.5, 0.0, 3.0, 35.0, 60.0] {
            let stick = deflection(tilt_deg.to_radians());
            let rate_dps = 70.0 * stick + 600.0 * stick * stick.abs();
            let tilt = 60.0 * rate_dps / 670.0;
            assert!((tilt - tilt_deg).abs() < 1e-9, "{tilt_deg} {stick}");
        }
        let most = deflection(std::f64::consts::PI);
        assert!((most - 1.0).abs() < 1e-9, "{most}");
    }

    #[test]
    fn tilt_and_throttle_stay_within_limits() {
        let far = sticks(&estimate(-1e6, 1e6, 1e6), 33.0, Lean::Free);
        let most = 1_500.0 + 500.0 * deflection(0.611);
        for stick in [far.roll, far.pitch] {
            assert!((f64::from(stick.us()) - 1_500.0).abs() <= most - 1_500.0 + 1.0);
        }
        assert!(far.throttle.us() <= 1_900);
    }

    #[test]
    fn what_is_no_number_levels_it_and_is_not_learnt() {
        let mut control = Control::new(Gains::QUADCOPTER);
        let mut step = |north_m| {
            let here = estimate(north_m, 0.0, 0.0);
            let free = (Lean::Free, false);
            control.step(0.02, &reference(), &here, Tilt::default(), free)
        };
        let before = step(-1.0);
        for wrong in [f64::NAN, f64::INFINITY] {
            let level = step(wrong);
            let hover_us = 1_000.0 + THROTTLE_US * Gains::QUADCOPTER.hover_throttle;
            assert_eq!(
                (level.roll, level.pitch),
                (Channel::CENTRE, Channel::CENTRE)
            );
            assert!(
                (f64::from(level.throttle.us()) - hover_us).abs() < 5.0,
                "{level:?}"
            );
        }
        assert_eq!(step(-1.0), before);
    }

    #[test]
    fn a_lasting_sink_is_learnt_as_hover_throttle() {
        let mut control = Control::new(Gains::QUADCOPTER);
        let low = estimate(0.0, 0.0, 0.5);
        let before = control.hover_throttle();
        for _ in 0..100 {
            control.step(
                0.02,
                &reference(),
                &low,
                Tilt::default(),
                (Lean::Free, false),
            );
        }
        assert!(control.hover_throttle() > before);
    }
}
