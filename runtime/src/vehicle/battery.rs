use std::time::Duration;

use muster_machines::time::Timestamp;
use serde::{Deserialize, Serialize};

/// How many times a battery reports a lower charge until it is empty: at each hundredth.
const STEPS: f64 = 100.0;
/// Delay of a report after its hundredth is drained, against rounding.
const ROUNDING: Duration = Duration::from_micros(1);

/// A battery in closed form: its charge falls linearly once the motors are armed.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Battery {
    /// How long a full battery lasts. `None`: it does not drain by itself.
    endurance: Option<Duration>,
    /// Charge at `since`, from 0 to 1.
    charge: f64,
    since: Timestamp,
    is_drawn: bool,
    /// When the next hundredth is drained.
    due: Option<Timestamp>,
}

impl Battery {
    pub(super) const fn full() -> Self {
        Self {
            endurance: None,
            charge: 1.0,
            since: Timestamp::ZERO,
            is_drawn: false,
            due: None,
        }
    }

    pub(super) const fn set_endurance(&mut self, endurance: Option<Duration>) {
        self.endurance = endurance;
    }

    /// The charge, from 0 to 1.
    pub fn charge(&self, now: Timestamp) -> f64 {
        let drawn = match self.endurance.filter(|_| self.is_drawn) {
            Some(endurance) => now.since(self.since).as_secs_f64() / endurance.as_secs_f64(),
            None => 0.0,
        };
        (self.charge - drawn).max(0.0)
    }

    /// Starts to drain the battery.
    pub(super) fn draw(&mut self, now: Timestamp) {
        self.set(now, self.charge(now));
        self.is_drawn = true;
    }

    /// Lowers the charge to `to` at once, if it is higher.
    pub fn drain(&mut self, now: Timestamp, to: f64) {
        self.set(now, self.charge(now).min(to));
    }

    const fn set(&mut self, now: Timestamp, charge: f64) {
        self.charge = charge;
        self.since = now;
    }

    /// When the next hundredth is drained. `None` if the battery does not drain or is empty.
    pub fn next_step(&mut self, now: Timestamp) -> Option<Timestamp> {
        let (left, endurance) = (self.charge(now), self.endurance.filter(|_| self.is_drawn));
        let below = ((left * STEPS).ceil() - 1.0) / STEPS;
        self.due = endurance
            .filter(|_| left > 0.0)
            .map(|endurance| now + endurance.mul_f64(left - below) + ROUNDING);
        self.due
    }

    /// Whether the time that [`Self::next_step`] returned last is `now`.
    pub fn is_due(&self, now: Timestamp) -> bool {
        self.due == Some(now)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(seconds: f64) -> Timestamp {
        Timestamp::from_secs_f64(seconds)
    }

    #[test]
    fn battery_drains_linearly_and_reports_a_hundred_steps() {
        let mut battery = Battery::full();
        battery.set_endurance(Some(Duration::from_secs(1_000)));
        assert_eq!(battery.next_step(at(500.0)), None);
        battery.draw(at(500.0));
        assert!((battery.charge(at(1_000.0)) - 0.5).abs() < 1e-12);
        let (mut now, mut steps) = (at(500.0), 0);
        while let Some(next) = battery.next_step(now) {
            assert!(battery.is_due(next) && !battery.is_due(now));
            now = next;
            steps += 1;
        }
        assert_eq!((steps, battery.charge(now)), (100, 0.0));
        assert!(now.since(at(1_500.0)) < Duration::from_millis(1));
    }

    #[test]
    fn drained_charge_never_returns() {
        let mut battery = Battery::full();
        battery.drain(at(1.0), 0.2);
        assert!((battery.charge(at(100.0)) - 0.2).abs() < f64::EPSILON);
        battery.drain(at(2.0), 0.8);
        assert!((battery.charge(at(100.0)) - 0.2).abs() < f64::EPSILON);
    }
}
