//! Battery.

use super::{code, fields, message};

message! {
    /// Battery and radio.
    Analog = 110 as "MSP_ANALOG" {
        /// Voltage, in 0.1 V.
        voltage_dv: u8,
        /// Charge drawn, in mAh.
        drawn_mah: u16,
        /// Signal strength, 0 to 1023.
        rssi: u16,
        /// Current, in 0.01 A.
        current_ca: i16,
        /// Voltage, in 0.01 V; from API 1.41 on.
        voltage_cv: Option<u16>,
    }
}

code! {
    /// What the controller thinks of the battery.
    BatteryLevel {
        Ok = 0 "OK",
        Warning = 1 "WARNING",
        Critical = 2 "CRITICAL",
        NotPresent = 3 "NOT PRESENT",
        Init = 4 "INIT",
    }
}

message! {
    /// Battery.
    BatteryState = 130 as "MSP_BATTERY_STATE" {
        /// Cells in series; 0 if there is no battery.
        cells: u8,
        /// Capacity as configured, in mAh; 0 if it isn't.
        capacity_mah: u16,
        /// Voltage, in 0.1 V.
        voltage_dv: u8,
        /// Charge drawn, in mAh.
        drawn_mah: u16,
        /// Current, in 0.01 A.
        current_ca: i16,
        /// What the controller thinks of it.
        level: BatteryLevel,
        /// Voltage, in 0.01 V; from API 1.41 on.
        voltage_cv: Option<u16>,
    }
}

fields! {
    /// Limits of a cell, in 0.01 V.
    CellLimits {
        /// Empty: the battery is critical.
        min_cv: u16,
        /// Full: tells how many cells there are.
        max_cv: u16,
        /// Land soon.
        warning_cv: u16,
    }
}

message! {
    /// Limits of the battery.
    BatteryConfig = 32 as "MSP_BATTERY_CONFIG" {
        /// Empty cell, in 0.1 V.
        min_dv: u8,
        /// Full cell, in 0.1 V.
        max_dv: u8,
        /// Land soon, in 0.1 V.
        warning_dv: u8,
        /// Capacity, in mAh; 0 if not configured.
        capacity_mah: u16,
        /// Where the voltage comes from: 0 nowhere, 1 the board, 2 the motor controllers.
        voltage_source: u8,
        /// Where the current comes from: 0 nowhere.
        current_source: u8,
        /// The same limits, finer; from API 1.41 on.
        limits: Option<CellLimits>,
    }
}

impl BatteryConfig {
    /// Limits of a cell, as fine as they are known.
    #[must_use]
    pub fn cell(&self) -> CellLimits {
        self.limits.clone().unwrap_or(CellLimits {
            min_cv: 10 * u16::from(self.min_dv),
            max_cv: 10 * u16::from(self.max_dv),
            warning_cv: 10 * u16::from(self.warning_dv),
        })
    }
}
