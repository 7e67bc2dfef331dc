//! A simulated vehicle for a single drone outside of a simulation.

use std::time::Duration;

use muster_machines::msp::{FlightCommand, Setpoint, Telemetry};
use muster_machines::time::Timestamp;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::Vehicle;

/// State of a simulated vehicle, to resume it in another process. Times count from the start of the flight.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct VehicleState(pub Vehicle);

/// A simulated vehicle with its timed events: coming to rest, and its battery's charge. It reads no clock: the caller passes
/// the time, and calls [`Self::handle_timeout`] at [`Self::next_timeout`].
#[derive(Debug)]
pub struct SimulatedVehicle {
    vehicle: Vehicle,
    /// Time zero of the vehicle's own clock.
    epoch: Timestamp,
    /// The longest time to come to rest at the end of a leg.
    settle: Duration,
    rng: ChaCha8Rng,
    /// When the last commanded motion ends.
    rests_at: Option<Timestamp>,
    /// When the battery's next hundredth is drained.
    drained_at: Option<Timestamp>,
}

impl SimulatedVehicle {
    /// Wraps a vehicle on the ground. At the end of each leg it settles for a random time up to `settle`, drawn from `seed`.
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

    /// Resumes the state of another vehicle, with a flight that began at `epoch`. The own state is dropped.
    pub fn resume(&mut self, state: VehicleState, epoch: Timestamp, now: Timestamp) {
        (self.vehicle, self.epoch) = (state.0, epoch);
        let now = self.own_time(now);
        self.rests_at = self.vehicle.motion().end_time();
        self.drained_at = self.vehicle.battery().next_step(now);
    }

    /// Converts to the vehicle's own clock.
    const fn own_time(&self, at: Timestamp) -> Timestamp {
        Timestamp::from_nanos(at.as_nanos().saturating_sub(self.epoch.as_nanos()))
    }

    /// Executes a command. Returns telemetry, or `None` if the vehicle moves: then it reports at the end of the motion.
    pub fn execute(&mut self, now: Timestamp, command: FlightCommand) -> Option<Telemetry> {
        let now = self.own_time(now);
        let was_armed = self.vehicle.is_armed();
        let moves = self.vehicle.execute(now, command);
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

    /// When [`Self::handle_timeout`] must be called next. `None` if no event is due.
    #[must_use]
    pub fn next_timeout(&self) -> Option<Timestamp> {
        let next = self.rests_at.into_iter().chain(self.drained_at).min();
        next.map(|at| self.epoch + at.since(Timestamp::ZERO))
    }

    /// Handles due events. Returns telemetry if there was one. With an empty battery the vehicle lands on the spot.
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
                self.execute(at, FlightCommand::Land);
            }
        }
        (rests || drains).then(|| self.vehicle.telemetry(now))
    }

    /// The vehicle's telemetry, in its drone's local frame.
    #[must_use]
    pub fn telemetry(&self, now: Timestamp) -> Telemetry {
        self.vehicle.telemetry(now)
    }

    /// Whether the motors are armed.
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
        let vehicle = Vehicle::new(LANDING, Ned::HOME).with_endurance(endurance);
        SimulatedVehicle::new(vehicle, Duration::ZERO, 1)
    }

    fn leg(altitude_m: f64) -> FlightCommand {
        FlightCommand::Fly(Setpoint::Leg {
            to: Ned::HOME.at_altitude(altitude_m),
            speed_mps: 2.0,
            acceleration_mps2: 1.0,
        })
    }

    /// Handles all events until none is due. Returns the time of the last one and all telemetry.
    fn run_out(vehicle: &mut SimulatedVehicle) -> (Timestamp, Vec<Telemetry>) {
        let (mut now, mut reports) = (Timestamp::ZERO, Vec::new());
        while let Some(next) = vehicle.next_timeout() {
            now = next;
            reports.extend(vehicle.handle_timeout(now));
        }
        (now, reports)
    }

    #[test]
    fn vehicle_reports_the_end_of_a_leg_and_of_a_landing() {
        let mut vehicle = vehicle(None);
        let now = Timestamp::from_secs_f64(1.0);
        assert!(
            vehicle
                .execute(now, FlightCommand::Arm)
                .is_some_and(|it| it.armed)
        );
        assert_eq!(vehicle.execute(now, leg(10.0)), None);
        let (up_at, reports) = run_out(&mut vehicle);
        assert!(reports.len() == 1 && reports[0].at_rest && reports[0].armed);
        assert!((reports[0].position.altitude_m() - 10.0).abs() < 1e-6);
        assert_eq!(vehicle.execute(up_at, FlightCommand::Land), None);
        let (down_at, reports) = run_out(&mut vehicle);
        assert!(down_at > up_at && reports.len() == 1 && !reports[0].armed);
        assert!(!vehicle.is_armed());
    }

    #[test]
    fn early_timeouts_do_nothing() {
        let mut vehicle = vehicle(None);
        vehicle.execute(Timestamp::ZERO, FlightCommand::Arm);
        vehicle.execute(Timestamp::ZERO, leg(10.0));
        assert_eq!(vehicle.handle_timeout(Timestamp::from_secs_f64(0.5)), None);
        assert!(vehicle.next_timeout().is_some());
    }

    #[test]
    fn vehicle_with_empty_battery_lands() {
        let mut vehicle = vehicle(Some(Duration::from_secs(20)));
        vehicle.execute(Timestamp::ZERO, FlightCommand::Arm);
        vehicle.execute(Timestamp::ZERO, leg(10.0));
        let (_, reports) = run_out(&mut vehicle);
        let charges: Vec<_> = reports.iter().map(|it| it.charge).collect();
        assert!(charges.is_sorted_by(|a, b| a >= b), "{charges:?}");
        assert!(reports.iter().any(|it| it.landing));
        assert!(!vehicle.is_armed());
    }

    #[test]
    fn resumed_vehicle_flies_on_by_another_clock() {
        let mut first = vehicle(Some(Duration::from_secs(100)));
        first.execute(Timestamp::ZERO, FlightCommand::Arm);
        first.execute(Timestamp::ZERO, leg(10.0));
        let written = serde_json::to_string(&VehicleState(first.vehicle.clone())).unwrap();
        let state = serde_json::from_str(&written).unwrap();
        let epoch = Timestamp::from_secs_f64(1_000.0);
        let mut second = vehicle(None);
        second.resume(state, epoch, epoch + Duration::from_secs(1));
        let (first_at, reports) = run_out(&mut first);
        let (second_at, second_reports) = run_out(&mut second);
        assert_eq!(second_at.since(epoch), first_at.since(Timestamp::ZERO));
        assert_eq!(second_reports.last(), reports.last());
        assert!(!second.is_armed() && reports.len() > 1);
    }
}
