//! Volts and cells to charge.

use muster_msp::BatteryState;

/// Voltage of a resting cell of lithium polymer at tenths of its charge, from empty to full, in volts. Betaflight's own limits
/// are 3.3 and 4.2 V; between them the curve of a common cell (Chen, Rincón-Mora, *Accurate Electrical Battery Model*, IEEE
/// Transactions on Energy Conversion 21(2), 2006, figure 3, equation 7).
const CELL_V: [f64; 11] = [
    3.30, 3.62, 3.69, 3.73, 3.76, 3.80, 3.85, 3.91, 3.98, 4.07, 4.18,
];
/// Resistance of a cell, in ohms: 4 to 12 mΩ for cells of 1.5 to 5 Ah.
const CELL_OHM: f64 = 0.008;

/// Largest voltage of a cell, in volts: lithium polymer for high voltage, 4.35 V, and an error of a seventh.
const CELL_MAX_V: f64 = 5.0;

/// Voltage of a battery, in volts.
pub(super) fn volts(state: &BatteryState) -> f64 {
    match state.voltage_cv {
        Some(cv) => f64::from(cv) / 100.0,
        None => f64::from(state.voltage_dv) / 10.0,
    }
}

/// Whether a battery can be so.
pub(super) fn is_possible(state: &BatteryState) -> bool {
    volts(state) <= CELL_MAX_V * f64::from(state.cells)
}

/// Charge of a battery.
///
/// The higher of the last two readings counts: a single low one may be a frame that was altered on its way.
#[derive(Debug, Default)]
pub(super) struct Gauge {
    newest: Option<f64>,
    before: Option<f64>,
}

impl Gauge {
    /// Takes in a state.
    pub(super) fn measure(&mut self, state: &BatteryState) {
        if let Some(charge) = charge(state) {
            self.before = self.newest.replace(charge);
        }
    }

    /// Charge, 0 to 1. `None` if the controller measures no battery.
    pub(super) fn charge(&self) -> Option<f64> {
        let before = self.before.or(self.newest)?;
        self.newest.map(|newest| newest.max(before))
    }
}

/// Charge of a battery, 0 to 1: the lower of what its voltage says, without the sag of the present current, and of what has
/// been drawn of its configured capacity. `None` if the controller measures no battery.
fn charge(state: &BatteryState) -> Option<f64> {
    if state.cells == 0 {
        return None;
    }
    let amperes = f64::from(state.current_ca.max(0)) / 100.0;
    let cell = volts(state) / f64::from(state.cells) + amperes * CELL_OHM;
    let by_volts = of_cell(cell);
    let by_charge = match state.capacity_mah {
        0 => 1.0,
        capacity => 1.0 - f64::from(state.drawn_mah) / f64::from(capacity),
    };
    Some(by_volts.min(by_charge).clamp(0.0, 1.0))
}

fn of_cell(volts: f64) -> f64 {
    let above = CELL_V.partition_point(|it| *it <= volts);
    match above {
        0 => 0.0,
        above if above == CELL_V.len() => 1.0,
        above => {
            let (low, high) = (CELL_V[above - 1], CELL_V[above]);
            ((above - 1) as f64 + (volts - low) / (high - low)) / 10.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(cells: u8, voltage_cv: u16) -> BatteryState {
        BatteryState {
            cells,
            voltage_cv: Some(voltage_cv),
            ..BatteryState::default()
        }
    }

    #[test]
    fn cells_and_volts_become_charge() {
        assert_eq!(charge(&state(4, 1_680)), Some(1.0));
        assert_eq!(charge(&state(4, 1_320)), Some(0.0));
        let half = charge(&state(3, 1_140)).unwrap();
        assert!((half - 0.5).abs() < 1e-9, "{half}");
        assert_eq!(charge(&state(0, 1_600)), None);
        assert!(is_possible(&state(4, 1_740)) && !is_possible(&state(4, 2_100)));
        assert!(is_possible(&state(0, 0)) && !is_possible(&state(0, 1_600)));
    }

    #[test]
    fn one_low_reading_empties_no_battery() {
        let mut gauge = Gauge::default();
        assert_eq!(gauge.charge(), None);
        for cv in [1_680, 1_320, 1_680] {
            gauge.measure(&state(4, cv));
            assert_eq!(gauge.charge(), Some(1.0));
        }
        gauge.measure(&state(0, 0));
        gauge.measure(&state(4, 1_320));
        gauge.measure(&state(4, 1_320));
        assert_eq!(gauge.charge(), Some(0.0));
    }

    #[test]
    fn sag_is_no_loss_and_what_was_drawn_is() {
        let sagging = BatteryState {
            current_ca: 2_000,
            ..state(4, 1_456)
        };
        let resting = state(4, 1_520);
        let (sagging, resting) = (charge(&sagging).unwrap(), charge(&resting).unwrap());
        assert!((sagging - resting).abs() < 1e-9, "{sagging} {resting}");
        let drawn = BatteryState {
            capacity_mah: 1_500,
            drawn_mah: 1_200,
            ..state(4, 1_680)
        };
        assert!((charge(&drawn).unwrap() - 0.2).abs() < 1e-9);
    }
}
