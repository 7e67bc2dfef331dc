//! Who the controller is.

use std::fmt;

use super::message;
use crate::field::{Letters, ShortText, Text, Unused};

message! {
    /// Version of the protocol.
    ApiVersion = 1 as "MSP_API_VERSION" {
        /// 0.
        protocol: u8,
        /// 1.
        major: u8,
        /// 47 in Betaflight 4.6.
        minor: u8,
    }
}

message! {
    /// The firmware's name.
    FcVariant = 2 as "MSP_FC_VARIANT" {
        /// `BTFL` for Betaflight.
        variant: Letters<4>,
    }
}

message! {
    /// The firmware's version. Betaflight counts years and months since 2025.12: 25, 12.
    FcVersion = 3 as "MSP_FC_VERSION" {
        /// Major version, or year.
        major: u8,
        /// Minor version, or month.
        minor: u8,
        /// Patch.
        patch: u8,
        /// As text; from 2026.6 on.
        text: Option<ShortText>,
    }
}

impl FcVersion {
    /// Major and minor version, to compare. 4.6 comes before 2025.12.
    #[must_use]
    pub fn release(&self) -> (u8, u8) {
        (self.major, self.minor)
    }
}

impl fmt::Display for FcVersion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            major,
            minor,
            patch,
            ..
        } = self;
        let century = if *major >= 25 { "20" } else { "" };
        write!(f, "{century}{major}.{minor}.{patch}")
    }
}

message! {
    /// The board.
    BoardInfo = 4 as "MSP_BOARD_INFO" {
        /// `SITL` for a simulation, `S405` and the like for hardware.
        board: Letters<4>,
        /// Revision of the hardware.
        revision: u16,
        /// 2 with a MAX7456, else 0.
        kind: Option<u8>,
        /// Bit 0: USB; 1: software serial; 3: boot loader; 6: can bind a receiver.
        capabilities: Option<u8>,
        /// What the firmware was built for.
        target: Option<ShortText>,
        /// Name of the board.
        name: Option<ShortText>,
        /// Its maker.
        manufacturer: Option<ShortText>,
        /// The maker's signature.
        signature: Option<Unused<32>>,
        /// Processor.
        mcu: Option<u8>,
        /// State of the configuration; from API 1.42 on.
        configuration: Option<u8>,
        /// Rate of the gyroscope, in Hz; from API 1.43 on.
        gyro_hz: Option<u16>,
        /// Bit 0: the accelerometer isn't calibrated; 1: the motor protocol is disabled. From API 1.43 on.
        problems: Option<u32>,
        /// Devices on SPI and on I²C; from API 1.44 on.
        devices: Option<[u8; 2]>,
    }
}

impl BoardInfo {
    /// Whether the controller is Betaflight's simulation on a computer: no motor can turn.
    #[must_use]
    pub fn is_simulation(&self) -> bool {
        self.board.0 == *b"SITL"
    }
}

message! {
    /// The processor's serial number.
    Uid = 160 as "MSP_UID" {
        /// 96 bits.
        uid: [u32; 3],
    }
}

message! {
    /// The craft's name.
    Name = 10 as "MSP_NAME" {
        /// Up to 16 characters.
        name: Text,
    }
}
