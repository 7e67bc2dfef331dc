//! Battery monitor: cells, voltage, warnings.
//!
//! Behaviour: Betaflight 4.5, `sensors/battery.c` and `sensors/voltage.c`.

use muster_msp::BatteryLevel;

use super::altitude::share;
use super::settings::CellLimits;

/// Time constant of the voltage that is shown, in seconds: 1/3 Hz (`vbat_display_lpf_period` 30).
const LAG_S: f64 = 0.48;

/// Voltage below which there is no battery, in volts for a cell (`vbat_notpresent` 300).
const PRESENT_V: f64 = 3.0;

/// How far a voltage must go back before a warning ends, in volts (`vbat_hysteresis` 1).
const HYSTERESIS_V: f64 = 0.01;

/// Most cells that are looked for.
const CELLS_MAX: u8 = 8;

#[derive(Debug, Clone)]
pub(crate) struct PowerMonitor {
    limits: CellLimits,
    cells: u8,
    volts: f64,
    level: BatteryLevel,
}

impl PowerMonitor {
    pub(crate) fn new(limits: CellLimits) -> Self {
        Self {
            limits,
            cells: 0,
            volts: 0.0,
            level: BatteryLevel::Init,
        }
    }

    /// Moves on by `span_s` seconds at a voltage.
    pub(crate) fn update(&mut self, volts: f64, span_s: f64) {
        if self.cells == 0 {
            self.detect(volts);
            return;
        }
        self.volts += (volts - self.volts) * share(span_s, LAG_S);
        let warning_v = self.limit_v(self.limits.warning_cv);
        let min_v = self.limit_v(self.limits.min_cv);
        self.level = match self.level {
            BatteryLevel::Ok if self.volts <= warning_v - HYSTERESIS_V => BatteryLevel::Warning,
            BatteryLevel::Warning if self.volts <= min_v - HYSTERESIS_V => BatteryLevel::Critical,
            BatteryLevel::Warning if self.volts > warning_v => BatteryLevel::Ok,
            BatteryLevel::Critical if self.volts > min_v => BatteryLevel::Warning,
            same => same,
        };
    }

    /// Counts the cells, once, when a battery is connected.
    fn detect(&mut self, volts: f64) {
        if volts <= 2.0 * PRESENT_V {
            self.level = BatteryLevel::NotPresent;
            return;
        }
        let max_v = f64::from(self.limits.max_cv) / 100.0;
        self.cells = (1..CELLS_MAX)
            .find(|cells| volts < f64::from(*cells) * max_v)
            .unwrap_or(CELLS_MAX);
        self.volts = volts;
        self.level = BatteryLevel::Ok;
    }

    fn limit_v(&self, cell_cv: u16) -> f64 {
        f64::from(self.cells) * f64::from(cell_cv) / 100.0
    }

    /// Cells in series; 0 without a battery.
    pub(crate) fn cells(&self) -> u8 {
        self.cells
    }

    /// Voltage as shown.
    pub(crate) fn volts(&self) -> f64 {
        self.volts
    }

    pub(crate) fn level(&self) -> BatteryLevel {
        self.level
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn monitor(volts: f64) -> PowerMonitor {
        let mut monitor = PowerMonitor::new(CellLimits {
            min_cv: 330,
            warning_cv: 350,
            max_cv: 430,
        });
        monitor.update(volts, 0.01);
        monitor
    }

    #[test]
    fn cells_are_counted_once_from_the_first_voltage() {
        assert_eq!(monitor(16.8).cells(), 4);
        assert_eq!(monitor(14.0).cells(), 4);
        assert_eq!(monitor(12.6).cells(), 3);
        assert_eq!(monitor(25.2).cells(), 6);
        let mut falling = monitor(16.8);
        falling.update(11.0, 10.0);
        assert_eq!(falling.cells(), 4);
        assert_eq!(monitor(5.0).cells(), 0);
    }

    #[test]
    fn warnings_follow_the_limits_of_a_cell_with_hysteresis() {
        let mut monitor = monitor(16.0);
        let mut level = |volts| {
            for _ in 0..1_000 {
                monitor.update(volts, 0.01);
            }
            monitor.level()
        };
        assert_eq!(level(14.1), BatteryLevel::Ok);
        assert_eq!(level(13.9), BatteryLevel::Warning);
        assert_eq!(level(13.999), BatteryLevel::Warning);
        assert_eq!(level(13.1), BatteryLevel::Critical);
        assert_eq!(level(13.3), BatteryLevel::Warning);
        assert_eq!(level(14.1), BatteryLevel::Ok);
    }
}
