//! Rate and angle controllers, and the mixer: from setpoint and gyro to duty cycles.
//!
//! Structure and scales: Betaflight 4.5, `flight/pid.c`, `flight/pid.h`, `fc/rc.c` and `flight/mixer.c`. Left out: feedforward,
//! smoothing of sticks, TPA, D boost, anti-gravity, notch filters.

use nalgebra::Vector3;

use super::THROTTLE_LOW_US;
use super::receiver::{CENTRE_US, PITCH, ROLL, THROTTLE, YAW};
use super::settings::{CHANNELS, Tuning};
use crate::aircraft::STEP_S;
use crate::body::ROTORS;

/// What a gain of 1 yields for an error of 1 °/s, 1 ° and 1 °/s² (`PTERM_SCALE`, `ITERM_SCALE`, `DTERM_SCALE`), in thousandths
/// of the motors' range.
const P_SCALE: f64 = 0.032_029;
const I_SCALE: f64 = 0.244_381;
const D_SCALE: f64 = 0.000_529;

/// Limits of the integral, of roll and pitch, and of yaw (`iterm_limit`, `pidsum_limit`, `pidsum_limit_yaw`), in thousandths of
/// the motors' range.
const INTEGRAL_MAX: f64 = 400.0;
const SUM_MAX: [f64; 3] = [500.0, 500.0, 400.0];

/// Time constant of the filter of the derivative, in seconds: 75 Hz (`dterm_lpf1_dyn_min_hz`).
const DERIVATIVE_LAG_S: f64 = 1.0 / (2.0 * std::f64::consts::PI * 75.0);

/// Time constant of the filter of goals that the integrals of roll and pitch are compared with, in seconds: 15 Hz
/// (`iterm_relax_cutoff`).
const RELAX_LAG_S: f64 = 1.0 / (2.0 * std::f64::consts::PI * 15.0);
/// How far a goal may be from its filtered one until the integral stands still, in angle mode: a fifth of 40 °/s
/// (`ITERM_RELAX_SETPOINT_THRESHOLD`).
const RELAX_ANGLE_DPS: f64 = 8.0;
/// The same without angle mode.
const RELAX_DPS: f64 = 40.0;

/// Share of the throttle from which the motors stabilise at low throttle, too (`airmode_start_throttle_percent`).
const AIRMODE_THROTTLE: f64 = 0.25;

/// Full throttle, in µs.
const THROTTLE_FULL_US: f64 = 2_000.0;

/// What the aircraft is to do, by the pilot, the companion or the failsafe.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Setpoint {
    /// From -1 to 1: roll to the right, pitch nose up, yaw clockwise.
    deflections: [f64; 3],
    /// From 0 to 1.
    throttle: f64,
    /// Whether angle mode is on: roll and pitch deflections are angles. Otherwise they are rates.
    is_angle_on: bool,
}

impl Setpoint {
    /// From channels in µs, roll, pitch, yaw and throttle first.
    pub(crate) fn of(channels: &[u16; CHANNELS], is_angle_on: bool) -> Self {
        let deflection = |channel: usize| {
            let from_centre = f64::from(channels[channel]) - f64::from(CENTRE_US);
            (from_centre / 500.0).clamp(-1.0, 1.0)
        };
        let low = f64::from(THROTTLE_LOW_US);
        let throttle = (f64::from(channels[THROTTLE]) - low) / (THROTTLE_FULL_US - low);
        Self {
            // The pitch stick up is nose down.
            deflections: [deflection(ROLL), -deflection(PITCH), deflection(YAW)],
            throttle: throttle.clamp(0.0, 1.0),
            is_angle_on,
        }
    }
}

#[derive(Debug, Clone)]
pub(crate) struct Stabiliser {
    tuning: Tuning,
    integral: Vector3<f64>,
    last_rates_dps: Vector3<f64>,
    derivative: Vector3<f64>,
    /// Goals of roll and pitch, filtered.
    relaxed_dps: [f64; 2],
    is_airborne_once: bool,
}

impl Stabiliser {
    pub(crate) fn new(tuning: Tuning) -> Self {
        Self {
            tuning,
            integral: Vector3::zeros(),
            last_rates_dps: Vector3::zeros(),
            derivative: Vector3::zeros(),
            relaxed_dps: [0.0; 2],
            is_airborne_once: false,
        }
    }

    /// Forgets the flight.
    pub(crate) fn reset(&mut self) {
        *self = Self::new(self.tuning);
    }

    /// Duty cycles of the motors for a step. `angles_rad` is roll and pitch, which count in angle mode only.
    #[inline]
    pub(crate) fn duties(
        &mut self,
        setpoint: &Setpoint,
        angles_rad: [f64; 2],
        rates_rad_s: Vector3<f64>,
    ) -> [f64; 4] {
        let rates_dps = rates_rad_s * (180.0 / std::f64::consts::PI);
        self.is_airborne_once |= setpoint.throttle >= AIRMODE_THROTTLE;
        let slope = (rates_dps - self.last_rates_dps) / STEP_S;
        self.last_rates_dps = rates_dps;
        self.derivative += (slope - self.derivative) * (STEP_S / (DERIVATIVE_LAG_S + STEP_S));
        if setpoint.throttle <= 0.0 && !self.is_airborne_once {
            self.integral = Vector3::zeros();
            return [self.tuning.idle; 4];
        }
        let goal_dps = self.goal_dps(setpoint, angles_rad);
        let relax_dps = if setpoint.is_angle_on {
            RELAX_ANGLE_DPS
        } else {
            RELAX_DPS
        };
        let shares = self.integrated_shares(goal_dps, relax_dps);
        let mut sums = [0.0; 3];
        for axis in 0..3 {
            let gains = &self.tuning.gains[axis];
            let error_dps = goal_dps[axis] - rates_dps[axis];
            let grows = I_SCALE * gains.i * error_dps * shares[axis] * STEP_S;
            let integral = self.integral[axis] + grows;
            self.integral[axis] = integral.clamp(-INTEGRAL_MAX, INTEGRAL_MAX);
            let sum = P_SCALE * gains.p * error_dps + self.integral[axis]
                - D_SCALE * gains.d * self.derivative[axis];
            sums[axis] = sum.clamp(-SUM_MAX[axis], SUM_MAX[axis]) / 1_000.0;
        }
        mix(sums, setpoint.throttle, self.tuning.idle)
    }

    /// Shares of the errors that are integrated: less while the goals of roll and pitch change fast (`iterm_relax = RP`).
    fn integrated_shares(&mut self, goal_dps: [f64; 3], relax_dps: f64) -> [f64; 3] {
        let mut shares = [1.0; 3];
        for (axis, relaxed_dps) in self.relaxed_dps.iter_mut().enumerate() {
            *relaxed_dps += (goal_dps[axis] - *relaxed_dps) * (STEP_S / (RELAX_LAG_S + STEP_S));
            let changes_dps = (goal_dps[axis] - *relaxed_dps).abs();
            shares[axis] = (1.0 - changes_dps / relax_dps).max(0.0);
        }
        shares
    }

    /// Rates to reach, in °/s. In angle mode: the error's share.
    fn goal_dps(&self, setpoint: &Setpoint, angles_rad: [f64; 2]) -> [f64; 3] {
        let tuning = &self.tuning;
        let mut goal_dps = setpoint.deflections.map(|it| tuning.rate_dps(it));
        if !setpoint.is_angle_on {
            return goal_dps;
        }
        for (axis, angle_rad) in angles_rad.into_iter().enumerate() {
            let angle_deg = tuning.angle_limit_deg * goal_dps[axis] / tuning.max_rate_dps;
            goal_dps[axis] = (angle_deg - angle_rad.to_degrees()) * tuning.angle_p / 10.0;
        }
        goal_dps
    }
}

impl Tuning {
    /// Rate for a deflection from -1 to 1, in °/s (rates type ACTUAL without expo).
    #[must_use]
    pub fn rate_dps(&self, deflection: f64) -> f64 {
        let beyond = (self.max_rate_dps - self.centre_rate_dps).max(0.0);
        deflection * self.centre_rate_dps + deflection * deflection.abs() * beyond
    }
}

/// Shares of the motors' range for roll, pitch and yaw about a throttle. If they don't fit, they are scaled to the range first;
/// then the throttle gives way.
#[inline]
fn mix(sums: [f64; 3], throttle: f64, idle: f64) -> [f64; 4] {
    let [roll, pitch, yaw] = sums;
    let mut shares =
        ROTORS.map(|[forward, right, turn]| forward * pitch - right * roll + turn * yaw);
    let highest = shares.iter().copied().fold(f64::MIN, f64::max);
    let lowest = shares.iter().copied().fold(f64::MAX, f64::min);
    let scale = 1.0 / (highest - lowest).max(1.0);
    shares = shares.map(|share| share * scale);
    let throttle = throttle.max(-lowest * scale).min(1.0 - highest * scale);
    shares.map(|share| (idle + (1.0 - idle) * (share + throttle)).clamp(idle, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn full_deflection_is_the_maximum_rate() {
        let tuning = Tuning::default();
        assert!((tuning.rate_dps(1.0) - 670.0).abs() < 1e-9);
        assert!((tuning.rate_dps(-1.0) + 670.0).abs() < 1e-9);
        assert!((tuning.rate_dps(0.01) - 0.76).abs() < 1e-9);
    }

    #[test]
    fn mixer_never_leaves_the_motors_range() {
        for throttle in [0.0, 0.3, 1.0] {
            for sums in [[0.5, 0.5, 0.4], [-0.5, 0.5, 0.0], [0.0, 0.0, -0.4]] {
                for duty in mix(sums, throttle, 0.055) {
                    assert!((0.055..=1.0).contains(&duty), "{duty}");
                }
            }
        }
    }

    #[test]
    fn mixer_keeps_the_throttle_where_it_fits() {
        let duties = mix([0.05, -0.02, 0.01], 0.4, 0.055);
        let mean = duties.iter().sum::<f64>() / 4.0;
        assert!((mean - (0.055 + 0.945 * 0.4)).abs() < 1e-12);
    }

    #[test]
    fn motors_idle_at_low_throttle_until_the_first_take_off() {
        let mut stabiliser = Stabiliser::new(Tuning::default());
        let rates = Vector3::new(1.0, 0.0, 0.0);
        let low = Setpoint::default();
        let idle = stabiliser.duties(&low, [0.0; 2], rates);
        assert!(idle.iter().all(|duty| (duty - 0.055).abs() < 1e-12));
        let high = Setpoint {
            throttle: 0.3,
            ..low
        };
        stabiliser.duties(&high, [0.0; 2], rates);
        let airmode = stabiliser.duties(&low, [0.0; 2], rates);
        // It turns to the right: the right rotors push against it.
        assert!(airmode[0] > airmode[2]);
    }
}
