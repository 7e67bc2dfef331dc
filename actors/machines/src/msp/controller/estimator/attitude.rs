//! The attitude that the controller says.

use std::f64::consts::TAU;
use std::time::Duration;

use muster_msp::Attitude;

use super::GRAVITY_MPS2;
use crate::time::Timestamp;

/// Fastest turn about any axis that is believed at once, in rad/s: 400 °/s. Betaflight leans with less in the mode ANGLE.
const TURN_MAX_RADPS: f64 = 6.98;
/// Largest tilt that accelerates as it says, in radians: beyond 60°, Betaflight's `angle_limit`, height is not held.
pub(super) const LEAN_MAX_RAD: f64 = 1.047;
/// From one attitude to the next; they may arrive together.
const ATTITUDE_PERIOD: Duration = Duration::from_millis(80);

/// An attitude, in radians: roll to the right, nose down, clockwise from north.
#[derive(Debug, Clone, Copy, Default)]
pub(in super::super) struct Tilt {
    pub(in super::super) roll_rad: f64,
    pub(in super::super) nose_down_rad: f64,
    pub(in super::super) yaw_rad: f64,
}

impl Tilt {
    /// Cosine of the angle between the thrust and the vertical.
    pub(in super::super) fn vertical_share(self) -> f64 {
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
    pub(super) fn acceleration_mps2(self) -> [f64; 2] {
        let (sin, cos) = (libm::sin(self.yaw_rad), libm::cos(self.yaw_rad));
        let limited = |it: f64| it.clamp(-LEAN_MAX_RAD, LEAN_MAX_RAD);
        let (nose_down_rad, roll_rad) = (limited(self.nose_down_rad), limited(self.roll_rad));
        let ahead = GRAVITY_MPS2 * libm::tan(nose_down_rad);
        let right = GRAVITY_MPS2 * libm::tan(roll_rad) / libm::cos(nose_down_rad);
        [ahead * cos - right * sin, ahead * sin + right * cos]
    }
}

/// Attitudes that are believed.
#[derive(Debug, Default)]
pub(super) struct Attitudes {
    newest: Option<(Timestamp, Tilt)>,
    /// One that came too suddenly. The next one confirms it, or is believed itself.
    doubted: Option<(Timestamp, Tilt)>,
}

impl Attitudes {
    /// The newest attitude; level before the first.
    pub(super) fn tilt(&self) -> Tilt {
        self.newest.map(|(_, tilt)| tilt).unwrap_or_default()
    }

    /// Takes in an attitude. One that no vehicle can have, or can't have turned to, is rejected. Returns whether it is believed.
    pub(super) fn measure(&mut self, now: Timestamp, attitude: &Attitude) -> bool {
        let Attitude {
            roll_ddeg,
            pitch_ddeg,
            yaw_deg,
        } = *attitude;
        if !(-1_800..=1_800).contains(&roll_ddeg)
            || !(-900..=900).contains(&pitch_ddeg)
            || !(-360..=360).contains(&yaw_deg)
        {
            return false;
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
        let is_believed = self.newest.is_none_or(is_near) || self.doubted.is_some_and(is_near);
        self.doubted = (!is_believed).then_some((now, tilt));
        if is_believed {
            self.newest = Some((now, tilt));
        }
        is_believed
    }
}
