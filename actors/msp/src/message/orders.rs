//! Orders to the controller.

use super::{code, message};

message! {
    /// Keeps the settings over a restart. Refused while it is armed.
    EepromWrite = 250 as "MSP_EEPROM_WRITE" {}
}

message! {
    /// Calibrates the accelerometer: the craft must lie level. Ignored while it is armed.
    AccCalibration = 205 as "MSP_ACC_CALIBRATION" {}
}

code! {
    /// What it restarts into.
    RebootMode {
        Firmware = 0 "firmware",
        RomBootloader = 1 "ROM boot loader",
        MassStorage = 2 "mass storage",
        MassStorageUtc = 3 "mass storage, UTC",
        FlashBootloader = 4 "flash boot loader",
    }
}

message! {
    /// Restarts the controller, armed or not. The reply repeats the mode.
    Reboot = 68 as "MSP_REBOOT" {
        /// The firmware if absent.
        mode: Option<RebootMode>,
    }
}
