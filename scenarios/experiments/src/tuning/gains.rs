//! From a response to gains, and what the loops are worth.

use std::f64::consts::PI;
use std::fmt;

use muster_machines::msp::controller::Gains;

use super::{Response, TuneError};

/// Lag for which [`Gains::QUADCOPTER`] are made, in seconds.
const LAG_S: f64 = 0.15;
/// How much faster than those loops others are at most, in a share: beyond it they follow the errors of the position.
const FASTER_MAX: f64 = 1.0;
/// How much slower at least: slower ones do not hold against a wind.
const SLOWER_MAX: f64 = 0.4;
/// Highest throttle at which an aircraft may hover: above it too little is left to climb and to lean.
pub(super) const HOVER_THROTTLE_MAX: f64 = 0.65;

/// Scales [`Gains::QUADCOPTER`] to the measured lag; phase margins stay the same. Limits are the scenario's.
pub(super) fn gains(own: Gains, response: &Response) -> Result<Gains, TuneError> {
    if response.hover_throttle > HOVER_THROTTLE_MAX {
        return Err(TuneError::Weak(response.hover_throttle));
    }
    let base = Gains::QUADCOPTER;
    let speed = |lag_s: f64| (LAG_S / lag_s).clamp(SLOWER_MAX, FASTER_MAX);
    let (level, vertical) = (speed(response.attitude_lag_s), speed(response.thrust_lag_s));
    let thrust = 1.0 / response.thrust_gain;
    Ok(Gains {
        position_per_s: round(base.position_per_s * level),
        velocity_per_s: round(base.velocity_per_s * level),
        integral_per_s2: round(base.integral_per_s2 * level * level),
        height_per_s: round(base.height_per_s * vertical),
        climb_per_s: round(base.climb_per_s * vertical * thrust),
        climb_integral_per_s2: round(base.climb_integral_per_s2 * vertical * vertical * thrust),
        drag_per_s: round(response.drag_per_s.max(0.0)),
        hover_throttle: round(response.hover_throttle),
        tilt_max_rad: own.tilt_max_rad,
    })
}

/// Three decimals: as they are printed, so they fly.
fn round(value: f64) -> f64 {
    (value * 1e3).round() / 1e3
}

/// What both loops are worth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Loops {
    /// Horizontal.
    pub level: Loop,
    /// Vertical.
    pub vertical: Loop,
}

/// A loop from the place back to the place, opened.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Loop {
    /// Where its gain is one, in rad/s.
    pub crossover_rad_s: f64,
    /// How far its phase is from -180° there, in degrees.
    pub phase_margin_deg: f64,
}

impl Loops {
    pub(super) fn of(gains: &Gains, response: &Response) -> Self {
        Self {
            level: Loop::of(
                [
                    gains.position_per_s,
                    gains.velocity_per_s,
                    gains.integral_per_s2,
                ],
                1.0,
                response.attitude_lag_s,
            ),
            vertical: Loop::of(
                [
                    gains.height_per_s,
                    gains.climb_per_s,
                    gains.climb_integral_per_s2,
                ],
                response.thrust_gain,
                response.thrust_lag_s,
            ),
        }
    }
}

impl Loop {
    /// Of (velocity · s + integral) (s + position) / s³ with a gain and a delay.
    fn of([position, velocity, integral]: [f64; 3], gain: f64, delay_s: f64) -> Self {
        let magnitude =
            |at: f64| gain * (velocity * at).hypot(integral) * at.hypot(position) / (at * at * at);
        // It falls with the frequency.
        let (mut low, mut high) = (0.01_f64, 100.0_f64);
        for _ in 0..60 {
            let middle = (low * high).sqrt();
            match magnitude(middle) > 1.0 {
                true => low = middle,
                false => high = middle,
            }
        }
        let phase_rad =
            (velocity * low).atan2(integral) + low.atan2(position) - 1.5 * PI - low * delay_s;
        Self {
            crossover_rad_s: low,
            phase_margin_deg: (phase_rad + PI).to_degrees(),
        }
    }
}

impl fmt::Display for Loop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            crossover_rad_s,
            phase_margin_deg,
        } = self;
        write!(
            f,
            "{crossover_rad_s:.1} rad/s, phase margin {phase_margin_deg:.0}°"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const QUADCOPTER: Response = Response {
        hover_throttle: 0.3,
        attitude_lag_s: LAG_S,
        drag_per_s: 0.45,
        thrust_gain: 1.0,
        thrust_lag_s: 0.05,
    };

    #[test]
    fn loops_of_the_default_gains_have_the_margin_that_they_were_made_for() {
        let Loop {
            crossover_rad_s,
            phase_margin_deg,
        } = Loops::of(&Gains::QUADCOPTER, &QUADCOPTER).level;
        assert!((crossover_rad_s - 2.3).abs() < 0.1, "{crossover_rad_s}");
        assert!((phase_margin_deg - 34.0).abs() < 1.0, "{phase_margin_deg}");
    }

    #[test]
    fn aircraft_that_lags_more_gets_slower_loops_with_the_same_margin() {
        let own = Gains::QUADCOPTER;
        let before = Loops::of(&own, &QUADCOPTER);
        let lags = Response {
            attitude_lag_s: 0.3,
            ..QUADCOPTER
        };
        let slow = gains(own, &lags).unwrap();
        let after = Loops::of(&slow, &lags);
        assert!(after.level.crossover_rad_s < 0.6 * before.level.crossover_rad_s);
        let change = after.level.phase_margin_deg - before.level.phase_margin_deg;
        assert!(change.abs() < 1.0, "{after:?}");
        assert_eq!(after.vertical, before.vertical);
    }

    #[test]
    fn stronger_thrust_gets_smaller_gains() {
        let strong = Response {
            thrust_gain: 1.6,
            ..QUADCOPTER
        };
        let tuned = gains(Gains::QUADCOPTER, &strong).unwrap();
        let crossover = |response| Loops::of(&tuned, response).vertical.crossover_rad_s;
        let expected = Loops::of(&Gains::QUADCOPTER, &QUADCOPTER)
            .vertical
            .crossover_rad_s;
        assert!((crossover(&strong) - expected).abs() < 0.01);
    }

    #[test]
    fn aircraft_that_hovers_near_full_throttle_is_refused() {
        let heavy = Response {
            hover_throttle: 0.7,
            ..QUADCOPTER
        };
        let refused = gains(Gains::QUADCOPTER, &heavy).unwrap_err();
        assert!(refused.to_string().contains("hovers at 70 %"), "{refused}");
    }
}
