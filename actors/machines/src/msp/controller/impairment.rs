//! Whether an aircraft that flies still does what it is told: its tilt, its thrust, its motors, its voltage.

use std::time::Duration;

use muster_msp::{BatteryState, Motor};

use super::battery::volts;
use crate::msp::LandingCause;
use crate::time::Timestamp;

/// Tilt that no order asks for, in radians: 60°, PX4's `FD_FAIL_R` and `FD_FAIL_P`.
const TILT_MAX_RAD: f64 = 1.047;
/// How long it must last: PX4's `FD_FAIL_R_TTRI`.
const TILTED_FOR: Duration = Duration::from_millis(300);
/// How long an aircraft may be so tilted before its motors stop: it has fallen 20 m, or lies on its side. Ours.
const TIPPED_FOR: Duration = Duration::from_secs(2);
/// Upward acceleration that counts as asking for thrust, in m/s². Ours: almost the most that the control loops ask for.
const THRUST_MPS2: f64 = 3.5;
/// How long thrust is asked for in the air: ArduPilot's `THRUST_LOSS_CHECK_TRIGGER_SEC`.
const THRUST_FOR: Duration = Duration::from_secs(1);
/// The same on the ground, where nothing falls. Ours: a heavy vehicle rises slowly, and its estimate follows later.
const RISES_WITHIN: Duration = Duration::from_secs(3);
/// Climb rate that it must gain meanwhile, in m/s. Ours: a seventh of what is asked for.
const GAIN_MIN_MPS: f64 = 0.5;
/// Sink rate beyond which thrust in flight had no effect, in m/s: ArduPilot's check needs a descent, too. A vehicle that holds
/// its height in sinking air asks for as much thrust all the time.
const SINKS_MPS: f64 = 0.5;
/// Climb rate from which a vehicle rises off the ground, in m/s. Ours: beyond the estimate's error.
const RISES_MPS: f64 = 0.25;
/// Output of a motor at its limit, in µs: 95 % of its range, where it has no share left to turn the aircraft with. Ours.
const MOTOR_MAX_US: u16 = 1_950;
/// Largest output that a motor can be told, in µs: 2,000, and a tenth of the range more.
const OUTPUT_MAX_US: u16 = 2_100;
/// Looks in a row at which some motor is at its limit: the second of ArduPilot's check of thrust, at two looks a second.
const SATURATED_LOOKS: u8 = 3;
/// Root mean square of the motors' changes from one look to the next, in µs: a tenth of their range. Ours: a simulated flight in
/// calm air has 5, a hard manoeuvre more for a moment.
const TREMBLE_US: f64 = 100.0;
/// By how many more looks motors tremble than not: 2 s at least. Ours.
const TREMBLING_LOOKS: u8 = 4;
/// Voltage of a cell under load, in volts: Betaflight's `vbat_min_cell_voltage`.
const CELL_MIN_V: f64 = 3.3;
/// Readings in a row that are so low: a single one may be a frame that was altered on its way.
const LOW_READINGS: u8 = 2;

/// What an armed aircraft does, and what it was told to.
#[derive(Debug, Clone, Copy)]
pub(super) struct Response {
    /// Angle between its axis down and the world's, in radians.
    pub(super) tilt_rad: f64,
    /// Upward acceleration that its sticks give at least, in m/s².
    pub(super) up_mps2: f64,
    /// Its climb rate, in m/s.
    pub(super) climb_mps: f64,
    /// It has left the ground.
    pub(super) is_in_air: bool,
}

/// What is to be done now.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Finding {
    /// It must come down, for this reason.
    Impaired(LandingCause),
    /// Its motors must stop.
    Tipped,
}

/// Looks at an aircraft in flight. On the ground it forgets.
#[derive(Debug, Default)]
pub(super) struct Watch {
    tilted_since: Option<Timestamp>,
    /// Since when thrust has been asked for, and the climb rate then.
    thrust_since: Option<(Timestamp, f64)>,
    outputs_us: Option<[u16; 8]>,
    saturated_looks: u8,
    trembling_looks: u8,
    low_readings: u8,
}

impl Watch {
    /// Whether it is tilted beyond what any order asks for.
    pub(super) const fn is_tilted(&self) -> bool {
        self.tilted_since.is_some()
    }

    /// Takes in what the motors are told. What no motor can be told is rejected.
    pub(super) fn measure_motors(&mut self, motors: &Motor) {
        let outputs_us = motors.outputs_us;
        if outputs_us.iter().any(|it| *it > OUTPUT_MAX_US) {
            return;
        }
        let is_saturated = outputs_us.iter().any(|it| *it >= MOTOR_MAX_US);
        count(&mut self.saturated_looks, is_saturated);
        let before = self.outputs_us.replace(outputs_us);
        let trembles = before.is_some_and(|before| change_us(before, outputs_us) > TREMBLE_US);
        self.trembling_looks = match trembles {
            true => (self.trembling_looks + 1).min(2 * TREMBLING_LOOKS),
            false => self.trembling_looks.saturating_sub(1),
        };
    }

    /// Whether its motors tremble: it is shaken.
    pub(super) const fn is_shaken(&self) -> bool {
        self.trembling_looks >= TREMBLING_LOOKS
    }

    /// Takes in a state of the battery.
    pub(super) fn measure_battery(&mut self, state: &BatteryState) {
        let is_low = state.cells > 0 && volts(state) <= CELL_MIN_V * f64::from(state.cells);
        count(&mut self.low_readings, is_low);
    }

    /// Looks at an armed aircraft; `None` while it is not.
    pub(super) fn look(&mut self, now: Timestamp, response: Option<Response>) -> Option<Finding> {
        let Some(response) = response else {
            *self = Self::default();
            return None;
        };
        let is_tilted = response.tilt_rad > TILT_MAX_RAD;
        let tilted_for = lasts(&mut self.tilted_since, is_tilted, now);
        let has_no_thrust = self.has_no_thrust(now, response);
        if tilted_for >= Some(TIPPED_FOR) {
            return Some(Finding::Tipped);
        }
        let cause = if tilted_for >= Some(TILTED_FOR) {
            LandingCause::Tilt
        } else if has_no_thrust {
            LandingCause::Thrust
        } else if self.saturated_looks >= SATURATED_LOOKS || self.is_shaken() {
            LandingCause::Motors
        } else if self.low_readings >= LOW_READINGS {
            LandingCause::Volts
        } else {
            return None;
        };
        Some(Finding::Impaired(cause))
    }

    /// Whether thrust was asked for in vain. It is asked for anew then.
    fn has_no_thrust(&mut self, now: Timestamp, response: Response) -> bool {
        if response.up_mps2 < THRUST_MPS2 || response.tilt_rad > TILT_MAX_RAD {
            self.thrust_since = None;
            return false;
        }
        let (since, climb_mps) = *self.thrust_since.get_or_insert((now, response.climb_mps));
        let (lasts, expected_mps) = match response.is_in_air {
            true => (THRUST_FOR, -SINKS_MPS),
            false => (RISES_WITHIN, RISES_MPS),
        };
        if now.since(since) < lasts {
            return false;
        }
        self.thrust_since = None;
        response.climb_mps < expected_mps && response.climb_mps - climb_mps < GAIN_MIN_MPS
    }
}

/// Counts how often in a row something is so.
const fn count(times: &mut u8, is_so: bool) {
    *times = match is_so {
        true => times.saturating_add(1),
        false => 0,
    };
}

/// Root mean square of what the motors that are there were changed by, in µs.
fn change_us(before: [u16; 8], now: [u16; 8]) -> f64 {
    let there = before.iter().zip(now).filter(|(_, now)| *now > 0);
    let squares = there.map(|(before, now)| f64::from(before.abs_diff(now)).powi(2));
    let (sum, motors) = squares.fold((0.0, 0.0), |(sum, motors), it| (sum + it, motors + 1.0_f64));
    libm::sqrt(sum / motors.max(1.0))
}

/// How long something has lasted; `None` if it doesn't.
fn lasts(since: &mut Option<Timestamp>, is_so: bool, now: Timestamp) -> Option<Duration> {
    if !is_so {
        *since = None;
        return None;
    }
    Some(now.since(*since.get_or_insert(now)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOVERS: Response = Response {
        tilt_rad: 0.1,
        up_mps2: 0.0,
        climb_mps: 0.0,
        is_in_air: true,
    };

    /// What is found first within 5 s, and after how many milliseconds. `at` yields the response after so many.
    fn found(watch: &mut Watch, at: impl Fn(u64) -> Response) -> Option<(u64, Finding)> {
        (0..5_000).step_by(20).find_map(|ms| {
            let now = Timestamp::from_nanos(ms * 1_000_000);
            watch.look(now, Some(at(ms))).map(|it| (ms, it))
        })
    }

    fn motors(us: [u16; 4]) -> Motor {
        let mut outputs_us = [0; 8];
        outputs_us[..4].copy_from_slice(&us);
        Motor { outputs_us }
    }

    #[test]
    fn tilt_beyond_60_degrees_counts_after_300_ms_and_stops_the_motors_after_2_s() {
        let leans = |deg: f64| Response {
            tilt_rad: deg.to_radians(),
            ..HOVERS
        };
        assert_eq!(found(&mut Watch::default(), |_| leans(59.0)), None);
        let shortly = |ms: u64| leans(if ms % 400 < 300 { 90.0 } else { 10.0 });
        assert_eq!(found(&mut Watch::default(), shortly), None);
        let mut watch = Watch::default();
        let tilt = Finding::Impaired(LandingCause::Tilt);
        assert_eq!(found(&mut watch, |_| leans(61.0)), Some((300, tilt)));
        let later = Timestamp::from_nanos(2_000_000_000);
        assert_eq!(watch.look(later, Some(leans(61.0))), Some(Finding::Tipped));
    }

    #[test]
    fn thrust_that_changes_no_climb_rate_within_a_second_has_no_effect() {
        let asks = Response {
            up_mps2: 4.0,
            climb_mps: -3.0,
            ..HOVERS
        };
        let thrust = Finding::Impaired(LandingCause::Thrust);
        assert_eq!(
            found(&mut Watch::default(), |_| asks),
            Some((1_000, thrust))
        );
        let gains = |ms: u64| Response {
            climb_mps: -5.0 + 1.0 * ms as f64 / 1_000.0,
            ..asks
        };
        assert_eq!(found(&mut Watch::default(), gains), None);
        let holds_its_height_in_sinking_air = Response {
            climb_mps: -0.2,
            ..asks
        };
        assert_eq!(
            found(&mut Watch::default(), |_| holds_its_height_in_sinking_air),
            None
        );
        let stays_on_the_ground = Response {
            climb_mps: 0.0,
            is_in_air: false,
            ..asks
        };
        assert_eq!(
            found(&mut Watch::default(), |_| stays_on_the_ground),
            Some((3_000, thrust))
        );
        let rises_slowly = Response {
            climb_mps: 0.3,
            ..stays_on_the_ground
        };
        assert_eq!(found(&mut Watch::default(), |_| rises_slowly), None);
        let hovers_with_little_charge = Response {
            up_mps2: 3.0,
            ..HOVERS
        };
        assert_eq!(
            found(&mut Watch::default(), |_| hovers_with_little_charge),
            None
        );
    }

    #[test]
    fn a_motor_at_its_limit_for_a_second_counts_and_a_peak_does_not() {
        let mut watch = Watch::default();
        let mut looks = |us: u16, count: u8| {
            (0..count).for_each(|_| watch.measure_motors(&motors([1_400, us, 1_400, 1_400])));
            watch.look(Timestamp::ZERO, Some(HOVERS))
        };
        assert_eq!(looks(1_960, 2), None);
        assert_eq!(looks(1_940, 1), None);
        let motors = Some(Finding::Impaired(LandingCause::Motors));
        assert_eq!(looks(1_960, 3), motors);
    }

    #[test]
    fn motors_that_tremble_count_and_a_manoeuvre_does_not() {
        let trembles = |by_us: u16, looks: u16| {
            let mut watch = Watch::default();
            for look in 0..=looks {
                let us = 1_400 + by_us * (look % 2);
                watch.measure_motors(&motors([us, 1_400, us, 1_400]));
            }
            watch.look(Timestamp::ZERO, Some(HOVERS))
        };
        assert_eq!(trembles(140, 40), None, "99 µs");
        assert_eq!(trembles(400, 3), None);
        let motors = Some(Finding::Impaired(LandingCause::Motors));
        assert_eq!(trembles(150, 4), motors);
    }

    #[test]
    fn two_readings_below_3_3_volts_a_cell_count_and_one_does_not() {
        let mut watch = Watch::default();
        let mut reads = |cells: u8, cv: u16| {
            watch.measure_battery(&BatteryState {
                cells,
                voltage_cv: Some(cv),
                // Without the sag of this current half of the charge would be left.
                current_ca: 6_000,
                ..BatteryState::default()
            });
            watch.look(Timestamp::ZERO, Some(HOVERS))
        };
        assert_eq!(reads(4, 1_320), None);
        assert_eq!(reads(4, 1_330), None);
        assert_eq!(reads(0, 0), None);
        assert_eq!(reads(4, 1_300), None);
        let volts = Some(Finding::Impaired(LandingCause::Volts));
        assert_eq!(reads(4, 1_300), volts);
    }

    #[test]
    fn disarmed_aircraft_has_no_past() {
        let mut watch = Watch::default();
        (0..9).for_each(|_| watch.measure_motors(&motors([2_000; 4])));
        assert_eq!(watch.look(Timestamp::ZERO, None), None);
        assert_eq!(watch.look(Timestamp::ZERO, Some(HOVERS)), None);
    }
}
