//! What a stick asks for. Layouts: `MSP_RC_TUNING` and `MSP_PID_ADVANCED` in Betaflight's `src/main/msp/msp.c`, 4.4 (API 1.45)
//! to 2025.12 (API 1.47).

use super::{code, message};
use crate::field::Unused;

code! {
    /// How rates are shaped (`fc/controlrate_profile.h`).
    RatesType {
        Betaflight = 0 "BETAFLIGHT",
        RaceFlight = 1 "RACEFLIGHT",
        Kiss = 2 "KISS",
        Actual = 3 "ACTUAL",
        Quick = 4 "QUICK",
    }
}

code! {
    /// How the throttle is limited (`fc/controlrate_profile.h`).
    ThrottleLimit {
        Off = 0 "OFF",
        Scale = 1 "SCALE",
        Clip = 2 "CLIP",
    }
}

message! {
    /// Rates of the active rate profile. The unit of rates depends on their type; 10 °/s for ACTUAL.
    RcTuning = 111 as "MSP_RC_TUNING" {
        /// `roll_rc_rate`; ACTUAL: the rate at small deflections, extended to a full one.
        roll_rc_rate: u8,
        /// `roll_expo`, in %.
        roll_expo: u8,
        /// `roll_srate`, `pitch_srate`, `yaw_srate`; ACTUAL: the rate at full deflection.
        srates: [u8; 3],
        /// Has no meaning any more: throttle PID attenuation.
        unused_attenuation: Unused<1>,
        /// `thr_mid`: the stick at the middle of the throttle's curve, in %.
        throttle_mid: u8,
        /// `thr_expo`, in %.
        throttle_expo: u8,
        /// Has no meaning any more: breakpoint of the attenuation.
        unused_breakpoint: Unused<2>,
        /// `yaw_expo`, in %.
        yaw_expo: u8,
        /// `yaw_rc_rate`.
        yaw_rc_rate: u8,
        /// `pitch_rc_rate`; absent before Betaflight 4.0.
        pitch_rc_rate: Option<u8>,
        /// `pitch_expo`, in %; absent before Betaflight 4.0.
        pitch_expo: Option<u8>,
        /// `throttle_limit_type`; from API 1.41 on.
        throttle_limit: Option<ThrottleLimit>,
        /// `throttle_limit_percent`; from API 1.41 on.
        throttle_limit_percent: Option<u8>,
        /// `roll_rate_limit`, `pitch_rate_limit`, `yaw_rate_limit`, in °/s; from API 1.42 on.
        rate_limits_dps: Option<[u16; 3]>,
        /// `rates_type`; from API 1.43 on.
        rates_type: Option<RatesType>,
        /// `thr_hover`: the throttle at the middle of its curve, in %; from API 1.47 on.
        throttle_hover: Option<u8>,
    }
}

message! {
    /// The active PID profile, but its gains.
    PidAdvanced = 94 as "MSP_PID_ADVANCED" {
        /// What precedes has no meaning here.
        before: [u8; 17],
        /// `angle_limit`: tilt at full stick in the mode ANGLE, in °.
        angle_limit_deg: u8,
        /// What follows has no meaning here.
        rest: Vec<u8>,
    }
}
