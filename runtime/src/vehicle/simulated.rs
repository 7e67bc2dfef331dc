//! A vehicle in closed form that is asked and woken, for whoever runs one drone outside a world.

use std::time::Duration;

use muster_machines::msp::{FlightCommand, Setpoint, Telemetry};
use muster_machines::time::Timestamp;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::Vehicle;

/// What a vehicle in closed form is doing, for whoever goes on with it: times count from the start of the flight.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct VehicleState(pub Vehicle);

/// One vehicle in closed form, with what it does by itself: it comes to rest, and its battery drains. It owns no clock:
/// whoever runs it says what time it is, and wakes it when it asks for that.
#[derive(Debug)]
pub struct SimulatedVehicle {
    vehicle: Vehicle,
    /// When the vehicle's time began.
    epoch: Timestamp,
    /// How long it takes at most to come to rest at the end of a leg.
    settle: Duration,
    rng: ChaCha8Rng,
    /// When the motion that it was told to make last ends.
    rests_at: Option<Timestamp>,
    /// When its battery next says that there is less in it.
    drained_at: Option<Timestamp>,
}

impl SimulatedVehicle {
    /// A vehicle that stands where it takes off, and settles within so long at the end of a leg; how long is drawn from
    /// `seed`.
    pub fn new(vehicle: Vehicle, settle: Duration, seed: u64) -> Self {
        Self {
            vehicle,
            epoch: Timestamp::ZERO,
            settle,
            rng: ChaCha8Rng::seed_from_u64(seed),
            rests_at: None,
            drained_at: None,
        }
    }

    /// Goes on with what another was doing, whose flight began at `epoch`; what it was doing itself is forgotten.
    pub fn resume(&mut self, state: VehicleState, epoch: Timestamp, now: Timestamp) {
        (self.vehicle, self.epoch) = (state.0, epoch);
        let now = self.own_time(now);
        self.rests_at = self.vehicle.motion().end_time();
        self.drained_at = self.vehicle.battery().next_step(now);
    }

    /// By the vehicle's time.
    const fn own_time(&self, at: Timestamp) -> Timestamp {
        Timestamp::from_nanos(at.as_nanos().saturating_sub(self.epoch.as_nanos()))
    }

    /// Obeys a demand; what it says of itself then, unless it moves and says so at the end.
    pub fn obey(&mut self, now: Timestamp, command: FlightCommand) -> Option<Telemetry> {
        let now = self.own_time(now);
        let was_armed = self.vehicle.is_armed();
        let moves = self.vehicle.obey(now, command);
        if self.vehicle.is_armed() && !was_armed {
            self.drained_at = self.vehicle.battery().next_step(now);
        }
        if !moves {
            return Some(self.vehicle.telemetry(now));
        }
        if matches!(command, FlightCommand::Fly(Setpoint::Leg { .. })) && !self.settle.is_zero() {
            let time = self.rng.random_range(Duration::ZERO..=self.settle);
            self.vehicle.settle(time);
        }
        self.rests_at = Some(self.vehicle.motion().end_time().unwrap_or(now));
        None
    }

    /// When [`Self::handle_timeout`] is to be called next.
    #[must_use]
    pub fn next_timeout(&self) -> Option<Timestamp> {
        let next = self.rests_at.into_iter().chain(self.drained_at).min();
        next.map(|at| self.epoch + at.since(Timestamp::ZERO))
    }

    /// Does what is due; what it says of itself if anything was. With an empty battery it comes down on the spot.
    pub fn handle_timeout(&mut self, now: Timestamp) -> Option<Telemetry> {
        let (at, now) = (now, self.own_time(now));
        let is_due = |at: &mut Option<Timestamp>| at.take_if(|at| *at <= now).is_some();
        let rests = is_due(&mut self.rests_at);
        let drains = is_due(&mut self.drained_at);
        if rests {
            self.vehicle.come_to_rest();
        }
        if drains && self.vehicle.is_armed() {
            self.drained_at = self.vehicle.battery().next_step(now);
            if self.vehicle.battery().charge(now) <= 0.0 {
                self.obey(at, FlightCommand::Land);
            }
        }
        (rests || drains).then(|| self.vehicle.telemetry(now))
    }

    /// How it is.
    #[must_use]
    pub fn telemetry(&self, now: Timestamp) -> Telemetry {
        self.vehicle.telemetry(now)
    }

    /// Whether its motors are armed.
    #[must_use]
    pub const fn is_armed(&self) -> bool {
        self.vehicle.is_armed()
    }
}

#[cfg(test)]
mod tests {
    use muster_machines::geometry::Ned;

    use super::super::Landing;
    use super::*;

    const LANDING: Landing = Landing {
        descent_mps: 2.0,
        final_mps: 1.0,
        final_altitude_m: 5.0,
        acceleration_mps2: 1.0,
    };

    fn vehicle(endurance: Option<Duration>) -> SimulatedVehicle {
        let vehicle = Vehicle::new(LANDING, Ned::HOME).lasting(endurance);
        SimulatedVehicle::new(vehicle, Duration::ZERO, 1)
    }

    fn leg(altitude_m: f64) -> FlightCommand {
        FlightCommand::Fly(Setpoint::Leg {
            to: Ned::HOME.at_altitude(altitude_m),
            speed_mps: 2.0,
            acceleration_mps2: 1.0,
        })
    }

    /// Lets it do what it does by itself until it waits for nothing.
    fn run_out(vehicle: &mut SimulatedVehicle) -> (Timestamp, Vec<Telemetry>) {
        let (mut now, mut said) = (Timestamp::ZERO, Vec::new());
        while let Some(next) = vehicle.next_timeout() {
            now = next;
            said.extend(vehicle.handle_timeout(now));
        }
        (now, said)
    }

    #[test]
    fn it_says_that_it_is_at_rest_once_it_is_and_that_it_has_landed() {
        let mut vehicle = vehicle(None);
        let now = Timestamp::from_secs_f64(1.0);
        assert!(
            vehicle
                .obey(now, FlightCommand::Arm)
                .is_some_and(|it| it.armed)
        );
        assert_eq!(vehicle.obey(now, leg(10.0)), None);
        let (up_at, said) = run_out(&mut vehicle);
        assert!(said.len() == 1 && said[0].at_rest && said[0].armed);
        assert!((said[0].position.altitude_m() - 10.0).abs() < 1e-6);
        assert_eq!(vehicle.obey(up_at, FlightCommand::Land), None);
        let (down_at, said) = run_out(&mut vehicle);
        assert!(down_at > up_at && said.len() == 1 && !said[0].armed);
        assert!(!vehicle.is_armed());
    }

    #[test]
    fn it_does_nothing_before_its_time_has_come() {
        let mut vehicle = vehicle(None);
        vehicle.obey(Timestamp::ZERO, FlightCommand::Arm);
        vehicle.obey(Timestamp::ZERO, leg(10.0));
        assert_eq!(vehicle.handle_timeout(Timestamp::from_secs_f64(0.5)), None);
        assert!(vehicle.next_timeout().is_some());
    }

    #[test]
    fn with_an_empty_battery_it_comes_down() {
        let mut vehicle = vehicle(Some(Duration::from_secs(20)));
        vehicle.obey(Timestamp::ZERO, FlightCommand::Arm);
        vehicle.obey(Timestamp::ZERO, leg(10.0));
        let (_, said) = run_out(&mut vehicle);
        let charges: Vec<_> = said.iter().map(|it| it.charge).collect();
        assert!(charges.is_sorted_by(|a, b| a >= b), "{charges:?}");
        assert!(said.iter().any(|it| it.landing));
        assert!(!vehicle.is_armed());
    }

    #[test]
    fn whoever_goes_on_with_it_flies_the_same_way_by_a_clock_of_its_own() {
        let mut first = vehicle(Some(Duration::from_secs(100)));
        first.obey(Timestamp::ZERO, FlightCommand::Arm);
        first.obey(Timestamp::ZERO, leg(10.0));
        let written = serde_json::to_string(&VehicleState(first.vehicle.clone())).unwrap();
        let state = serde_json::from_str(&written).unwrap();
        let epoch = Timestamp::from_secs_f64(1_000.0);
        let mut second = vehicle(None);
        second.resume(state, epoch, epoch + Duration::from_secs(1));
        let (up_at, said) = run_out(&mut first);
        let (also_at, also_said) = run_out(&mut second);
        assert_eq!(also_at.since(epoch), up_at.since(Timestamp::ZERO));
        assert_eq!(also_said.last(), said.last());
        assert!(!second.is_armed() && said.len() > 1);
    }
}
