//! State of the controller.

use super::modes::Modes;
use super::{fields, message};
use crate::field::{Counted, Field, Payload, Reader, Short, Unused};

/// Sensors that the controller has found, as bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Sensors(pub u16);

impl Sensors {
    /// Names of those found.
    pub fn names(self) -> impl Iterator<Item = &'static str> {
        const NAMES: [&str; 7] = [
            "accelerometer",
            "barometer",
            "magnetometer",
            "GPS",
            "rangefinder",
            "gyroscope",
            "optical flow",
        ];
        (0..)
            .zip(NAMES)
            .filter_map(move |(bit, name)| (self.0 >> bit & 1 == 1).then_some(name))
    }
}

impl Field for Sensors {
    const SHORTEST: usize = 2;

    fn read(from: &mut Reader<'_>) -> Result<Self, Short> {
        u16::read(from).map(Self)
    }

    fn write(&self, to: &mut Payload) {
        self.0.write(to);
    }
}

fields! {
    /// What [`Status`] and [`StatusEx`] start with.
    StatusHead {
        /// Period of the control loop, in µs.
        cycle_us: u16,
        /// Errors on the I²C bus since the start.
        i2c_errors: u16,
        /// Sensors found.
        sensors: Sensors,
        /// The first 32 modes, in the order of [`BoxIds`](super::BoxIds).
        modes: u32,
        /// Selected PID profile, from 0.
        pid_profile: u8,
        /// Load of the processor, in %.
        load_percent: u16,
    }
}

fields! {
    /// What [`Status`] and [`StatusEx`] end with.
    StatusFlags {
        /// Further modes, 8 a byte.
        further_modes: Counted,
        /// Reasons not to arm.
        arming: ArmingFlags,
        /// Bit 0: a restart is needed for the settings to count.
        state: Option<u8>,
        /// Temperature of the processor, in °C; from API 1.46 on.
        core_celsius: Option<i16>,
        /// Number of rate profiles; from API 1.47 on.
        rate_profiles: Option<u8>,
    }
}

message! {
    /// State of the controller.
    Status = 101 as "MSP_STATUS" {
        /// Common to both.
        head: StatusHead,
        /// Was the gyroscope's cycle.
        unused: Unused<2>,
        /// Common to both.
        flags: StatusFlags,
    }
}

message! {
    /// State of the controller and its profiles.
    StatusEx = 150 as "MSP_STATUS_EX" {
        /// Common to both.
        head: StatusHead,
        /// Number of PID profiles.
        pid_profiles: u8,
        /// Selected rate profile, from 0.
        rate_profile: u8,
        /// Common to both.
        flags: StatusFlags,
    }
}

impl Status {
    /// The active modes.
    #[must_use]
    pub fn modes(&self) -> Modes {
        modes(&self.head, &self.flags)
    }
}

impl StatusEx {
    /// The active modes.
    #[must_use]
    pub fn modes(&self) -> Modes {
        modes(&self.head, &self.flags)
    }
}

fn modes(head: &StatusHead, flags: &StatusFlags) -> Modes {
    let mut bytes = [0; 16];
    bytes[..4].copy_from_slice(&head.modes.to_le_bytes());
    for (place, byte) in bytes[4..].iter_mut().zip(&flags.further_modes.0) {
        *place = *byte;
    }
    Modes(u128::from_le_bytes(bytes))
}

/// Why the controller would not arm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ArmingFlags {
    /// How many flags this firmware knows. The last one says that the arm switch was on when another one was set.
    pub count: u8,
    /// The flags as bits.
    pub bits: u32,
}

/// Names of the flags in Betaflight 4.6 (`armingDisableFlagNames`), but for the last one.
const ARMING: [&str; 28] = [
    "NOGYRO",
    "FAILSAFE",
    "RXLOSS",
    "NOT_DISARMED",
    "BOXFAILSAFE",
    "RUNAWAY",
    "CRASH",
    "THROTTLE",
    "ANGLE",
    "BOOTGRACE",
    "NOPREARM",
    "LOAD",
    "CALIB",
    "CLI",
    "CMS",
    "BST",
    "MSP",
    "PARALYZE",
    "GPS",
    "RESCUE_SW",
    "DSHOT_TELEM",
    "REBOOT_REQD",
    "DSHOT_BBANG",
    "NO_ACC_CAL",
    "MOTOR_PROTO",
    "FLIP_SWITCH",
    "ALT_HOLD_SW",
    "POS_HOLD_SW",
];

impl ArmingFlags {
    /// Whether it receives no RC.
    #[must_use]
    pub fn is_receiver_lost(self) -> bool {
        self.bits & (1 << 2) != 0
    }

    /// Whether its failsafe is active.
    #[must_use]
    pub fn is_failsafe(self) -> bool {
        self.bits & (1 << 1) != 0
    }

    /// Names of those set, as Betaflight's command line calls them.
    pub fn names(self) -> impl Iterator<Item = &'static str> {
        (0..self.count.min(32))
            .filter(move |bit| self.bits >> bit & 1 == 1)
            .map(move |bit| {
                let known = ARMING.get(usize::from(bit)).copied();
                if bit + 1 == self.count {
                    "ARM_SWITCH"
                } else {
                    known.unwrap_or("UNKNOWN")
                }
            })
    }
}

impl Field for ArmingFlags {
    const SHORTEST: usize = 5;

    fn read(from: &mut Reader<'_>) -> Result<Self, Short> {
        Ok(Self {
            count: u8::read(from)?,
            bits: u32::read(from)?,
        })
    }

    fn write(&self, to: &mut Payload) {
        self.count.write(to);
        self.bits.write(to);
    }
}
