//! Battery: charge, voltage, sag.

use crate::airframe::Pack;

/// Open-circuit voltage of a lithium-polymer cell at 0, 5, … 100 % of its charge.
///
/// Source: the voltage table at rest that makers and sellers of such cells print; the last 5 % are the least certain.
const OPEN_CIRCUIT_V: [f64; 21] = [
    3.27, 3.61, 3.69, 3.71, 3.73, 3.75, 3.77, 3.79, 3.80, 3.82, 3.84, 3.85, 3.87, 3.91, 3.95, 3.98,
    4.02, 4.08, 4.11, 4.15, 4.20,
];

/// Nanocoulombs in a milliampere-hour.
const NANOCOULOMBS_A_MAH: f64 = 3.6e9;

/// State of a battery. Charge is counted in whole nanocoulombs: a sum of steps doesn't depend on how they are grouped.
#[derive(Debug, Clone)]
pub(crate) struct Battery {
    pack: Pack,
    used_nc: u64,
    amps: f64,
    /// Voltage that a fault takes away.
    sag_v: f64,
}

impl Battery {
    pub(crate) fn new(pack: Pack) -> Self {
        let used_mah = pack.capacity_mah * (1.0 - pack.charge);
        Self {
            pack,
            used_nc: nanocoulombs(used_mah * NANOCOULOMBS_A_MAH),
            amps: pack.electronics_a,
            sag_v: 0.0,
        }
    }

    /// Takes a voltage away, in volts.
    pub(crate) fn sag(&mut self, volts: f64) {
        self.sag_v = volts;
    }

    /// Draws the motors' current and the electronics' for `steps` of `step_s` seconds.
    #[inline]
    pub(crate) fn draw(&mut self, motors_a: f64, steps: u64, step_s: f64) {
        self.amps = motors_a + self.pack.electronics_a;
        self.used_nc += nanocoulombs(self.amps * step_s * 1e9) * steps;
    }

    /// Current in amperes.
    pub(crate) fn amps(&self) -> f64 {
        self.amps
    }

    /// Charge used since the battery was full, in mAh.
    pub(crate) fn used_mah(&self) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "below 2^53 up to 2,500 Ah")]
        let used_nc = self.used_nc as f64;
        used_nc / NANOCOULOMBS_A_MAH
    }

    /// Charge as a fraction of a full one.
    #[inline]
    pub(crate) fn charge(&self) -> f64 {
        (1.0 - self.used_mah() / self.pack.capacity_mah).max(0.0)
    }

    /// Voltage under load. An empty battery has none.
    #[inline]
    pub(crate) fn volts(&self) -> f64 {
        let charge = self.charge();
        if charge <= 0.0 {
            return 0.0;
        }
        let open_v = f64::from(self.pack.cells) * open_circuit_v(charge);
        (open_v - self.amps * self.pack.resistance_ohm - self.sag_v).max(0.0)
    }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "charges are positive and far below 2^64 nC"
)]
fn nanocoulombs(charge_nc: f64) -> u64 {
    (charge_nc + 0.5) as u64
}

/// Open-circuit voltage of a cell, interpolated.
#[inline]
fn open_circuit_v(charge: f64) -> f64 {
    let place = charge.clamp(0.0, 1.0) * 20.0;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "from 0 to 20"
    )]
    let index = (place as usize).min(19);
    #[expect(clippy::cast_precision_loss, reason = "at most 19")]
    let share = place - index as f64;
    OPEN_CIRCUIT_V[index] * (1.0 - share) + OPEN_CIRCUIT_V[index + 1] * share
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::airframe::Airframe;

    fn battery() -> Battery {
        Battery::new(Airframe::agilicious().battery)
    }

    #[test]
    fn charge_falls_by_current_times_time() {
        let mut battery = battery();
        battery.draw(17.6, 100_000, 1e-3);
        assert!((battery.used_mah() - 18.0 * 100.0 / 3.6).abs() < 1e-3);
        assert!((battery.charge() - (1.0 - 500.0 / 1_800.0)).abs() < 1e-6);
    }

    #[test]
    fn voltage_sags_by_resistance_and_by_the_fault() {
        let mut battery = battery();
        assert!((battery.volts() - (16.8 - 0.4 * 0.012)).abs() < 1e-9);
        battery.draw(49.6, 1, 1e-3);
        assert!((battery.volts() - (16.8 - 50.0 * 0.012)).abs() < 1e-3);
        battery.sag(2.0);
        assert!((battery.volts() - (16.8 - 0.6 - 2.0)).abs() < 1e-3);
    }

    #[test]
    fn grouping_of_steps_changes_no_bit() {
        let (mut once, mut often) = (battery(), battery());
        once.draw(0.0, 1_000_000, 1e-3);
        for _ in 0..1_000 {
            often.draw(0.0, 1_000, 1e-3);
        }
        assert_eq!(once.volts().to_bits(), often.volts().to_bits());
    }

    #[test]
    fn empty_battery_gives_no_voltage() {
        let mut battery = battery();
        battery.draw(100.0, 100_000, 1e-3);
        assert!(battery.charge() <= 0.0);
        assert!(battery.volts() <= 0.0);
    }
}
