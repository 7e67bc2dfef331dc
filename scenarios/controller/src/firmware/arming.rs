//! Arming: which conditions refuse it, and when it is done and ended.
//!
//! Behaviour: Betaflight 4.5, `fc/core.c` and `fc/runtime_config.h`. Times are milliseconds since boot.

/// Why arming is refused, by the bit in `STATUS`. `ARM_SWITCH` is the last flag there, which depends on the version.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Refusal {
    /// `FAILSAFE`: stage 2 has disarmed and hasn't ended.
    Failsafe = 1,
    /// `RXLOSS`: frames are missing or were until a moment ago.
    RxLoss = 2,
    /// `NOT_DISARMED`: the arm switch was on when the signal came back.
    NotDisarmed = 3,
    /// `THROTTLE`: the throttle isn't low.
    Throttle = 7,
    /// `ANGLE`: the aircraft isn't level.
    Angle = 8,
    /// `BOOT_GRACE_TIME`: just started.
    BootGraceTime = 9,
    /// `CALIBRATING`: the gyro is being calibrated.
    Calibrating = 12,
    /// `ARM_SWITCH`: the arm switch was on while something else refused arming.
    ArmSwitch = 31,
}

/// Time after boot in which arming is refused (`powerOnArmingGraceTime`).
const GRACE_MS: u64 = 5_000;

/// Time after boot that the gyro's calibration takes (`gyro_calib_duration`, 1.25 s).
const CALIBRATION_MS: u64 = 1_250;

/// Frames with the arm switch off that disarm: one more than Betaflight ignores.
const FRAMES_TO_DISARM: u8 = 4;

/// What arming depends on.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Conditions {
    pub(crate) is_receiving: bool,
    pub(crate) is_switch_on: bool,
    pub(crate) is_throttle_low: bool,
    pub(crate) is_level: bool,
    pub(crate) is_signal_lost: bool,
    pub(crate) is_failsafe_active: bool,
    pub(crate) has_failsafe_disarmed: bool,
}

#[derive(Debug, Clone, Default)]
pub(crate) struct Arming {
    is_armed: bool,
    /// A bit for each [`Refusal`].
    refusals: u32,
    was_receiving: bool,
    frames_off: u8,
}

impl Arming {
    pub(crate) fn is_armed(&self) -> bool {
        self.is_armed
    }

    pub(crate) fn disarm(&mut self) {
        self.is_armed = false;
    }

    /// Bits by [`Refusal`].
    pub(crate) fn refusals(&self) -> u32 {
        self.refusals
    }

    fn set(&mut self, refusal: Refusal, is_set: bool) {
        let bit = 1 << refusal as u8;
        self.refusals = if is_set {
            self.refusals | bit
        } else {
            self.refusals & !bit
        };
    }

    fn has(&self, refusal: Refusal) -> bool {
        self.refusals >> refusal as u8 & 1 == 1
    }

    /// Every 10 ms. `has_frame` is whether channels were computed from a new frame.
    pub(crate) fn update(&mut self, now: u64, conditions: &Conditions, has_frame: bool) {
        self.set(Refusal::RxLoss, conditions.is_signal_lost);
        self.set(Refusal::Failsafe, conditions.has_failsafe_disarmed);
        if self.is_armed {
            self.disarm_by_switch(conditions, has_frame);
            return;
        }
        self.refuse(now, conditions);
        if conditions.is_switch_on && conditions.is_receiving && self.refusals == 0 {
            self.is_armed = true;
            self.frames_off = 0;
        }
    }

    fn disarm_by_switch(&mut self, conditions: &Conditions, has_frame: bool) {
        if conditions.is_switch_on {
            self.frames_off = 0;
        } else if has_frame && conditions.is_receiving && !conditions.is_failsafe_active {
            self.frames_off += 1;
            if self.frames_off >= FRAMES_TO_DISARM {
                self.disarm();
            }
        }
    }

    fn refuse(&mut self, now: u64, conditions: &Conditions) {
        let is_back = conditions.is_receiving && !self.was_receiving;
        self.was_receiving = conditions.is_receiving;
        if is_back && conditions.is_switch_on {
            self.set(Refusal::NotDisarmed, true);
        } else if conditions.is_receiving && !conditions.is_switch_on {
            self.set(Refusal::NotDisarmed, false);
        }
        self.set(Refusal::Throttle, !conditions.is_throttle_low);
        self.set(Refusal::Angle, !conditions.is_level);
        self.set(Refusal::BootGraceTime, now < GRACE_MS);
        self.set(Refusal::Calibrating, now < CALIBRATION_MS);
        let was_refused = self.refusals != 0;
        self.set(
            Refusal::ArmSwitch,
            conditions.is_switch_on && (was_refused || self.has(Refusal::ArmSwitch)),
        );
    }
}
