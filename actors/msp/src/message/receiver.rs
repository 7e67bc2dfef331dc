//! Receiver, failsafe and features.

use super::{code, fields, message};
use crate::field::{Letters, Unused};

message! {
    /// Which of a receiver's channels is which of the controller's.
    RxMap = 64 as "MSP_RX_MAP" {
        /// The receiver's channel for roll, pitch, yaw, throttle, AUX1 to AUX4, from 0. `map AETR1234` is 0 1 3 2 4 5 6 7.
        map: [u8; 8],
    }
}

impl RxMap {
    /// `map AETR1234`: the receiver's order is roll, pitch, throttle, yaw, aux.
    pub const AETR: Self = Self {
        map: [0, 1, 3, 2, 4, 5, 6, 7],
    };

    /// As Betaflight's command `map` writes it.
    #[must_use]
    pub fn letters(&self) -> Letters<8> {
        let mut letters = [b'?'; 8];
        for (letter, place) in b"AERT1234".iter().zip(self.map) {
            if let Some(it) = letters.get_mut(usize::from(place)) {
                *it = *letter;
            }
        }
        Letters(letters)
    }
}

message! {
    /// Receiver.
    RxConfig = 44 as "MSP_RX_CONFIG" {
        /// Protocol of a serial receiver.
        serial_provider: u8,
        /// Stick at its upper end, in µs.
        max_check_us: u16,
        /// Stick centred, in µs.
        centre_us: u16,
        /// Throttle closed below this, in µs.
        min_check_us: u16,
        /// Spektrum.
        spektrum: u8,
        /// Shortest valid pulse, in µs.
        rx_min_us: u16,
        /// Longest valid pulse, in µs.
        rx_max_us: u16,
        /// What follows has no meaning here.
        rest: Vec<u8>,
    }
}

code! {
    /// What a lost receiver ends in, after `failsafe_delay`.
    FailsafeProcedure {
        AutoLand = 0 "AUTO-LAND",
        Drop = 1 "DROP",
        GpsRescue = 2 "GPS-RESCUE",
    }
}

code! {
    /// What the mode FAILSAFE does.
    FailsafeSwitch {
        Stage1 = 0 "STAGE1",
        Kill = 1 "KILL",
        Stage2 = 2 "STAGE2",
    }
}

message! {
    /// What a lost receiver leads to.
    FailsafeConfig = 75 as "MSP_FAILSAFE_CONFIG" {
        /// From the loss to the procedure, in 0.1 s.
        delay_ds: u8,
        /// How long it lands before it disarms, in s.
        landing_s: u8,
        /// Throttle while it lands, in µs.
        throttle_us: u16,
        /// What the mode FAILSAFE does.
        switch: FailsafeSwitch,
        /// Closed for that long before the loss, the throttle makes it disarm at once; in 0.1 s, 0 never.
        throttle_low_delay_ds: u16,
        /// What happens in the end.
        procedure: FailsafeProcedure,
    }
}

code! {
    /// What a channel's value is while the receiver is lost, before `failsafe_delay` is over.
    RxFailMode {
        Auto = 0 "AUTO",
        Hold = 1 "HOLD",
        Set = 2 "SET",
    }
}

fields! {
    /// A channel without a receiver.
    RxFail {
        /// Sticks: AUTO centres them and closes the throttle. Others: AUTO holds.
        mode: RxFailMode,
        /// Value for SET, in µs.
        value_us: u16,
    }
}

message! {
    /// Channels without a receiver, in the controller's order: roll, pitch, yaw, throttle, aux.
    RxFailConfig = 77 as "MSP_RXFAIL_CONFIG" {
        /// As many as the receiver has.
        channels: Vec<RxFail>,
    }
}

message! {
    /// Features as bits.
    FeatureConfig = 36 as "MSP_FEATURE_CONFIG" {
        /// See the constants.
        features: u32,
    }
}

impl FeatureConfig {
    /// A receiver on pulses.
    pub const RX_PPM: u32 = 1 << 0;
    /// A receiver on a serial port.
    pub const RX_SERIAL: u32 = 1 << 3;
    /// Motors stand still while the throttle is closed.
    pub const MOTOR_STOP: u32 = 1 << 4;
    /// GPS.
    pub const GPS: u32 = 1 << 7;
    /// Motors turn both ways.
    pub const REVERSIBLE: u32 = 1 << 12;
    /// A receiver on parallel pulses.
    pub const RX_PARALLEL_PWM: u32 = 1 << 13;
    /// MSP is the receiver.
    pub const RX_MSP: u32 = 1 << 14;
    /// A receiver on the board.
    pub const RX_SPI: u32 = 1 << 25;

    /// Whether all of `features` are on.
    #[must_use]
    pub fn has(&self, features: u32) -> bool {
        self.features & features == features
    }
}

message! {
    /// Arming.
    ArmingConfig = 61 as "MSP_ARMING_CONFIG" {
        /// Disarms after that long with the throttle closed, in s; 0 never.
        auto_disarm_s: u8,
        /// Has no meaning any more.
        unused: Unused<1>,
        /// Largest tilt at which it arms, in °; 180 is any.
        small_angle_deg: u8,
        /// Calibrates the gyroscope when it is armed for the first time.
        gyro_calibration: Option<u8>,
    }
}
