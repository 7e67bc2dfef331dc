//! Attitude, throttle stick and RC gaps of an aircraft with a flight controller, over a flight.

use std::collections::BTreeMap;
use std::time::Duration;

use muster_controller::{Sticks, Truth};
use muster_machines::time::Timestamp;

/// Maximum number of stretches. Beyond it they become twice as long, two by two: a longer flight is drawn coarser, and no
/// extreme is lost.
const STRETCHES_MAX: usize = 300;
/// Length of the first stretches: each holds several looks at the aircraft.
const SHORTEST: Duration = Duration::from_millis(500);

/// How an aircraft was flown while it was armed, in stretches of equal length.
#[derive(Debug, Clone, PartialEq)]
pub struct ControlSeries {
    length: Duration,
    /// By their numbers since the start of the run.
    stretches: BTreeMap<u64, Stretch>,
    was_armed: bool,
}

/// The extremes of a stretch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stretch {
    /// Roll in degrees; to the right is positive.
    pub roll_deg: Extremes,
    /// Pitch in degrees; nose up is positive.
    pub pitch_deg: Extremes,
    /// Throttle stick in µs. `None` if the controller doesn't tell.
    pub throttle_us: Option<Extremes>,
    /// Longest time between two RC frames, in ms. `None` likewise.
    pub rc_gap_ms: Option<f64>,
}

/// The least and the greatest of some values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extremes {
    /// The least.
    pub least: f64,
    /// The greatest.
    pub greatest: f64,
}

impl Default for ControlSeries {
    fn default() -> Self {
        Self {
            length: SHORTEST,
            stretches: BTreeMap::new(),
            was_armed: false,
        }
    }
}

impl ControlSeries {
    /// Takes a look at the aircraft and, if the controller tells them, its sticks since the last look. Ignored while it is
    /// disarmed; so is what RC did before it was armed.
    pub fn look(&mut self, at: Timestamp, truth: &Truth, sticks: Option<Sticks>) {
        let was_armed = std::mem::replace(&mut self.was_armed, truth.is_armed);
        if !truth.is_armed {
            return;
        }
        let (roll, pitch, _) = truth.attitude.euler_angles();
        let gap = sticks.and_then(|it| it.rc_gap).filter(|_| was_armed);
        let seen = Stretch {
            roll_deg: Extremes::of(roll.to_degrees()),
            pitch_deg: Extremes::of(pitch.to_degrees()),
            throttle_us: sticks.map(|it| Extremes::of(it.throttle_us.into())),
            rc_gap_ms: gap.map(|it| it.as_secs_f64() * 1e3),
        };
        self.add(self.number(at), seen);
        while self.stretches.len() > STRETCHES_MAX {
            self.length *= 2;
            for (number, stretch) in std::mem::take(&mut self.stretches) {
                self.add(number / 2, stretch);
            }
        }
    }

    fn number(&self, at: Timestamp) -> u64 {
        let number = at.since(Timestamp::ZERO).as_nanos() / self.length.as_nanos();
        u64::try_from(number).unwrap_or(u64::MAX)
    }

    fn add(&mut self, number: u64, stretch: Stretch) {
        let own = self.stretches.entry(number).or_insert(stretch);
        *own = own.joined(stretch);
    }

    /// Whether the aircraft was never armed.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.stretches.is_empty()
    }

    /// The stretches with the seconds from the start of the run to their middles, in runs without a pause.
    #[must_use]
    pub fn runs(&self) -> Vec<Vec<(f64, Stretch)>> {
        let mut runs: Vec<Vec<(f64, Stretch)>> = Vec::new();
        let mut next = None;
        for (&number, &stretch) in &self.stretches {
            let from = Timestamp::from_nanos(number * self.length_nanos());
            let middle_s = (from + self.length / 2).as_secs_f64();
            match runs.last_mut().filter(|_| next == Some(number)) {
                Some(run) => run.push((middle_s, stretch)),
                None => runs.push(vec![(middle_s, stretch)]),
            }
            next = Some(number + 1);
        }
        runs
    }

    fn length_nanos(&self) -> u64 {
        u64::try_from(self.length.as_nanos()).unwrap_or(u64::MAX)
    }
}

impl Stretch {
    fn joined(self, other: Self) -> Self {
        let throttles = self.throttle_us.zip(other.throttle_us);
        Self {
            roll_deg: self.roll_deg.joined(other.roll_deg),
            pitch_deg: self.pitch_deg.joined(other.pitch_deg),
            throttle_us: (throttles.map(|(own, other)| own.joined(other)))
                .or(self.throttle_us)
                .or(other.throttle_us),
            rc_gap_ms: [self.rc_gap_ms, other.rc_gap_ms]
                .into_iter()
                .flatten()
                .reduce(f64::max),
        }
    }
}

impl Extremes {
    const fn of(value: f64) -> Self {
        Self {
            least: value,
            greatest: value,
        }
    }

    /// The extremes of both.
    #[must_use]
    pub const fn joined(self, other: Self) -> Self {
        Self {
            least: self.least.min(other.least),
            greatest: self.greatest.max(other.greatest),
        }
    }
}

#[cfg(test)]
mod tests {
    use muster_controller::{Config, Controller, Settings};
    use muster_machines::geodetic::Geodetic;
    use nalgebra::UnitQuaternion;

    use super::*;

    fn at(seconds: f64) -> Timestamp {
        Timestamp::from_secs_f64(seconds)
    }

    fn truth(roll_deg: f64, is_armed: bool) -> Truth {
        let home = Geodetic::new(39.48, -0.34, 20.0).unwrap();
        let config = Config::new(home, Settings::fit());
        let level = Controller::new(config, 1, Timestamp::ZERO).aircraft(Timestamp::ZERO);
        Truth {
            attitude: UnitQuaternion::from_euler_angles(roll_deg.to_radians(), -0.1, 2.0),
            is_armed,
            ..level
        }
    }

    /// A flight from second 10 on for so long, with a look ten times a second. The aircraft leans by 40° at second 12 only.
    fn flown(seconds: u32, rc_gap: Duration) -> ControlSeries {
        let mut series = ControlSeries::default();
        let (level, leans) = (truth(0.0, true), truth(40.0, true));
        for look in 0..seconds * 10 {
            let now = at(10.0 + f64::from(look) / 10.0);
            let sticks = Sticks {
                throttle_us: 1_300,
                rc_gap: Some(rc_gap),
            };
            let truth = if look == 20 { &leans } else { &level };
            series.look(now, truth, Some(sticks));
        }
        series
    }

    #[test]
    fn a_long_flight_has_no_more_stretches_and_keeps_its_extremes() {
        for seconds in [20, 1_000, 20_000] {
            let runs = flown(seconds, Duration::from_millis(20)).runs();
            assert_eq!(runs.len(), 1);
            assert!(runs[0].len() <= STRETCHES_MAX);
            let all = runs[0].iter().map(|(_, it)| it.roll_deg);
            let all = all.reduce(Extremes::joined).unwrap();
            assert!((all.greatest - 40.0).abs() < 1e-9 && all.least.abs() < 1e-9);
        }
    }

    #[test]
    fn time_on_the_ground_is_no_part_of_it() {
        let mut series = flown(5, Duration::from_millis(20));
        let waited = Sticks {
            throttle_us: 885,
            rc_gap: Some(Duration::from_secs(60)),
        };
        series.look(at(15.0), &truth(0.0, false), Some(waited));
        series.look(at(80.0), &truth(0.0, true), Some(waited));
        let runs = series.runs();
        assert_eq!(runs.len(), 2);
        assert_eq!(runs[1][0].1.rc_gap_ms, None);
    }
}
