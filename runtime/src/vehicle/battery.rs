use std::time::Duration;

use muster_machines::time::Timestamp;
use serde::{Deserialize, Serialize};

/// How many times a full battery says of itself that there is less in it: each hundredth.
const STEPS: f64 = 100.0;
/// So much later than a hundredth is gone that rounding does not matter.
const ROUNDING: Duration = Duration::from_micros(1);

/// A battery in closed form: it drains evenly from when it is first drawn from.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Battery {
    /// How long a full one lasts; it does not drain by itself without.
    endurance: Option<Duration>,
    /// What was in it, as a share of a full one …
    charge: f64,
    /// … then.
    since: Timestamp,
    is_drawn: bool,
    /// When it next says that there is less in it.
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

    pub(super) const fn lasts(&mut self, endurance: Option<Duration>) {
        self.endurance = endurance;
    }

    /// What is left in it, as a share of a full one.
    pub fn charge(&self, now: Timestamp) -> f64 {
        let drawn = match self.endurance.filter(|_| self.is_drawn) {
            Some(endurance) => now.since(self.since).as_secs_f64() / endurance.as_secs_f64(),
            None => 0.0,
        };
        (self.charge - drawn).max(0.0)
    }

    /// From now on it drains.
    pub(super) fn draw(&mut self, now: Timestamp) {
        self.set(now, self.charge(now));
        self.is_drawn = true;
    }

    /// All but so much is gone at once.
    pub fn drain(&mut self, now: Timestamp, to: f64) {
        self.set(now, self.charge(now).min(to));
    }

    const fn set(&mut self, now: Timestamp, charge: f64) {
        self.charge = charge;
        self.since = now;
    }

    /// When another hundredth will be gone.
    pub fn next_step(&mut self, now: Timestamp) -> Option<Timestamp> {
        let (left, endurance) = (self.charge(now), self.endurance.filter(|_| self.is_drawn));
        let below = ((left * STEPS).ceil() - 1.0) / STEPS;
        self.due = endurance
            .filter(|_| left > 0.0)
            .map(|endurance| now + endurance.mul_f64(left - below) + ROUNDING);
        self.due
    }

    /// Whether that is now.
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
    fn a_battery_drains_evenly_once_it_is_drawn_from_and_says_so_a_hundred_times() {
        let mut battery = Battery::full();
        battery.lasts(Some(Duration::from_secs(1_000)));
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
    fn what_is_drained_at_once_is_gone_and_never_comes_back() {
        let mut battery = Battery::full();
        battery.drain(at(1.0), 0.2);
        assert!((battery.charge(at(100.0)) - 0.2).abs() < f64::EPSILON);
        battery.drain(at(2.0), 0.8);
        assert!((battery.charge(at(100.0)) - 0.2).abs() < f64::EPSILON);
    }
}
