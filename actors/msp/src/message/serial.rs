//! Serial ports of the controller.

use super::{fields, message};

fields! {
    /// A serial port of the controller.
    SerialPort {
        /// 20: USB; 30 and up: software; 50 or 51 and up: UARTs (0 and up before API 1.47).
        identifier: u8,
        /// Bit 0: MSP; bit 6: receiver.
        functions: u16,
        /// Speed for MSP, as an index.
        msp_speed: u8,
        /// Speed for a GPS receiver, as an index.
        gps_speed: u8,
        /// Speed for telemetry, as an index; 0: any.
        telemetry_speed: u8,
        /// Speed for a log, as an index.
        blackbox_speed: u8,
    }
}

impl SerialPort {
    /// The port of USB, which has no speed.
    pub const USB: u8 = 20;
    /// MSP among the functions.
    pub const MSP: u16 = 1;
    /// A receiver among the functions.
    pub const RECEIVER: u16 = 1 << 6;

    /// Speed for MSP, in Bd; `None` if it isn't known here, or automatic.
    #[must_use]
    pub fn msp_baud(&self) -> Option<u32> {
        /// Betaflight, `src/main/io/serial.c`.
        const SPEEDS: [u32; 16] = [
            0, 9_600, 19_200, 38_400, 57_600, 115_200, 230_400, 250_000, 400_000, 460_800, 500_000,
            921_600, 1_000_000, 1_500_000, 2_000_000, 2_470_000,
        ];
        SPEEDS
            .get(usize::from(self.msp_speed))
            .copied()
            .filter(|it| *it > 0)
    }

    /// Whether it speaks MSP.
    #[must_use]
    pub fn is_msp(&self) -> bool {
        self.functions & Self::MSP != 0
    }
}

message! {
    /// Serial ports of the controller.
    CfSerialConfig = 54 as "MSP_CF_SERIAL_CONFIG" {
        /// All that the board has.
        ports: Vec<SerialPort>,
    }
}
