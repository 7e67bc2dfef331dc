//! Vehicles: what they are commanded, how they move, and how near they come to each other.

use std::time::Duration;

use muster_controller::Truth;
use muster_machines::formation::Separation;
use muster_machines::geometry::Velocity;
use muster_machines::identity::NodeId;
use muster_machines::msp::{self, FlightCommand, Setpoint};
use muster_machines::node::Envelope;
use muster_machines::time::Timestamp;
use muster_runtime::vehicle::Vehicle;

use super::air::Air;
use super::core::Core;
use super::drone::Drone;
use super::event::Event;
use super::positions::Positions;
use super::trace::Kind;
use crate::checkers::SeparationChecker;
use crate::scenario::Trigger;

/// Interval at which the medium gets the positions of radios in flight: at 10 m/s they are off by 1 m at most.
pub(super) const PLACE_RADIOS_EVERY: Duration = Duration::from_millis(100);

/// All vehicles, by the numbers of their drones.
///
/// Invariant: `airborne` counts the armed vehicles. Every change of a path passes through [`Airspace::change_path`], so that
/// the separation of the path before was checked up to then; every motion that ends has its end scheduled.
#[derive(Debug)]
pub(super) struct Airspace {
    vehicles: Vec<Vehicle>,
    positions: Positions,
    /// The number of each vehicle's current motion; the end of an earlier one is void.
    motions: Vec<u32>,
    airborne: usize,
    /// `None` if rules are not checked.
    separation: Option<SeparationChecker>,
}

impl Airspace {
    /// Vehicles before take-off.
    pub(super) fn new(vehicles: Vec<Vehicle>, separation: Separation, is_checked: bool) -> Self {
        Self {
            positions: Positions::new(vehicles.len()),
            motions: vec![0; vehicles.len()],
            airborne: 0,
            separation: is_checked.then(|| SeparationChecker::new(separation, &vehicles)),
            vehicles,
        }
    }

    pub(super) fn vehicle(&self, drone: NodeId) -> &Vehicle {
        &self.vehicles[drone.0 as usize]
    }

    /// Whether no vehicle is armed.
    pub(super) const fn is_clear(&self) -> bool {
        self.airborne == 0
    }

    /// Executes a command of a drone to its flight controller.
    pub(super) fn command(
        &mut self,
        core: &mut Core,
        (id, drone): (NodeId, &mut Drone),
        command: FlightCommand,
    ) {
        core.trace(id, Kind::Commanded, &command);
        core.checkers.command(core.timeline.now(), id, command);
        let was_armed = self.vehicle(id).is_armed();
        let now = core.now();
        let moves = if matches!(command, FlightCommand::Report) {
            self.vehicles[id.0 as usize].execute(now, command)
        } else {
            self.change_path(core, id, |vehicle| vehicle.execute(now, command))
        };
        if self.vehicle(id).is_armed() && !was_armed {
            self.armed(core, id);
        }
        if moves {
            let settle = core.swarms.of(id).settle;
            if matches!(command, FlightCommand::Fly(Setpoint::Leg { .. }))
                && let Some(time) = drone.draw_settling(settle)
            {
                self.vehicles[id.0 as usize].settle(time);
            }
            self.schedule_rest(core, id);
        } else {
            self.report_telemetry(core, id);
        }
    }

    fn armed(&mut self, core: &mut Core, drone: NodeId) {
        let now = core.now();
        core.recorder(drone).armed(drone, now);
        if let Some(separation) = &mut self.separation {
            separation.takes_off(drone);
        }
        self.positions.invalidate(drone);
        if self.airborne == 0 {
            core.schedule(now, Event::PlaceRadios);
        }
        self.airborne += 1;
        self.watch_battery(core, drone);
        core.trigger(drone, Trigger::TakingOff);
    }

    /// Schedules the end of the motion that a vehicle has just begun.
    fn schedule_rest(&mut self, core: &mut Core, drone: NodeId) {
        let end = self.vehicle(drone).motion().end_time();
        self.positions.invalidate(drone);
        let motion = &mut self.motions[drone.0 as usize];
        *motion = motion.wrapping_add(1);
        let generation = *motion;
        let rest = Event::ComeToRest { drone, generation };
        core.schedule(end.unwrap_or(core.now()), rest);
    }

    /// The pilot of a master moves the sticks.
    pub(super) fn steer(&mut self, core: &mut Core, master: NodeId, velocity: Velocity) {
        let follow = core.swarms.of(master).follow.as_ref();
        let acceleration_mps2 = follow.map_or(0.0, |follow| follow.master.acceleration_mps2);
        core.trace(master, Kind::Steered, &velocity.0);
        let now = core.now();
        let steer = |vehicle: &mut Vehicle| vehicle.steer(now, velocity, acceleration_mps2);
        if self.change_path(core, master, steer) {
            self.schedule_rest(core, master);
        }
    }

    /// An aircraft falls.
    pub(super) fn fall(&mut self, core: &mut Core, drone: NodeId) {
        let now = core.now();
        self.end_path(core, drone);
        if self.vehicle(drone).is_armed() {
            self.airborne -= 1;
            core.recorder(drone).disarmed(drone, now);
        }
        self.vehicles[drone.0 as usize].fall(now);
        self.begin_path(core, drone);
        self.schedule_rest(core, drone);
    }

    /// A motion ends, unless it has been replaced.
    pub(super) fn come_to_rest(
        &mut self,
        core: &mut Core,
        air: &mut Air,
        drone: NodeId,
        generation: u32,
    ) {
        if self.motions[drone.0 as usize] != generation {
            return;
        }
        let lands = self.change_path(core, drone, Vehicle::come_to_rest);
        let now = core.now();
        let position = self.vehicle(drone).motion().position(now);
        if lands {
            self.disarmed(core, air, drone);
        }
        core.trace(drone, Kind::CameToRest, &position);
        self.report_telemetry(core, drone);
    }

    /// A vehicle has landed.
    fn disarmed(&mut self, core: &mut Core, air: &mut Air, drone: NodeId) {
        let now = core.now();
        self.airborne -= 1;
        air.place(drone, self.vehicle(drone).motion().position(now));
        self.positions.invalidate(drone);
        let recorder = core.recorder(drone);
        recorder.disarmed(drone, now);
        if !recorder.of(drone).landed_with_swarm()
            && let Some(separation) = &mut self.separation
        {
            separation.strays(drone);
        }
    }

    /// An aircraft with a flight controller is seen to fly like this, until then.
    pub(super) fn observe(
        &mut self,
        core: &mut Core,
        air: &mut Air,
        drone: NodeId,
        truth: &Truth,
        until: Timestamp,
    ) {
        let (now, was_armed) = (core.now(), self.vehicle(drone).is_armed());
        if self.vehicle(drone).is_wreck() {
            return;
        }
        let motion = (truth.position, truth.velocity);
        self.change_path(core, drone, |vehicle| {
            vehicle.observe(now, motion, truth.is_armed, until);
        });
        core.trace(drone, Kind::Flew, &truth.position);
        self.positions.invalidate(drone);
        if truth.is_armed && !was_armed {
            core.checkers.command(now, drone, FlightCommand::Arm);
            self.armed(core, drone);
        } else if was_armed && !truth.is_armed {
            self.disarmed(core, air, drone);
        }
    }

    /// Tells the medium the positions of all radios that have moved; `false` if no vehicle is in the air.
    pub(super) fn place_radios(&mut self, core: &mut Core, air: &mut Air) -> bool {
        if self.is_clear() {
            return false;
        }
        self.positions
            .visit_moved(core.now(), &self.vehicles, |id, place| air.place(id, place));
        true
    }

    /// Sends a drone its vehicle's telemetry.
    pub(super) fn report_telemetry(&self, core: &mut Core, drone: NodeId) {
        let telemetry = self.vehicle(drone).telemetry(core.now());
        let telemetry = Envelope::Msp(Box::new(msp::Input::Telemetry(telemetry)));
        core.post(drone, telemetry);
    }

    /// Schedules the next step of a battery's charge.
    fn watch_battery(&mut self, core: &mut Core, drone: NodeId) {
        let battery = self.vehicles[drone.0 as usize].battery();
        if let Some(next) = battery.next_step(core.now()) {
            core.schedule(next, Event::Drained(drone));
        }
    }

    /// A battery's charge may have fallen by a step. Returns whether it is empty.
    pub(super) fn check_battery(&mut self, core: &mut Core, drone: NodeId) -> bool {
        let vehicle = &mut self.vehicles[drone.0 as usize];
        let is_due = vehicle.is_armed() && vehicle.battery().is_due(core.now());
        is_due && self.is_empty(core, drone)
    }

    /// Drains a battery to this share of its charge. Returns whether it is empty.
    pub(super) fn drain(&mut self, core: &mut Core, drone: NodeId, to: f64) -> bool {
        core.trace(drone, Kind::Drained, &to);
        let battery = self.vehicles[drone.0 as usize].battery();
        battery.drain(core.now(), to);
        self.is_empty(core, drone)
    }

    /// Whether a battery is empty; reports its charge if not.
    fn is_empty(&mut self, core: &mut Core, drone: NodeId) -> bool {
        let battery = self.vehicles[drone.0 as usize].battery();
        if battery.charge(core.now()) > 0.0 {
            self.watch_battery(core, drone);
            self.report_telemetry(core, drone);
            return false;
        }
        let now = core.now();
        core.recorder(drone).ran_empty(drone, now);
        true
    }

    /// A vehicle loses its position over ground, for so long or for good.
    pub(super) fn lose_position(
        &mut self,
        core: &mut Core,
        drone: NodeId,
        lasts: Option<Duration>,
    ) {
        core.trace(drone, Kind::PositionLost, &lasts);
        let until = core.now() + lasts.unwrap_or(Duration::MAX);
        self.vehicles[drone.0 as usize].lose_position(core.now(), until);
        core.schedule(until, Event::PositionFound(drone));
        self.report_telemetry(core, drone);
    }

    /// A vehicle regains its position, unless another loss lasts longer.
    pub(super) fn recover_position(&mut self, core: &mut Core, drone: NodeId) {
        self.vehicles[drone.0 as usize].recover_position(core.now());
        self.report_telemetry(core, drone);
    }

    /// Changes a vehicle's path: checks the one before up to now, and takes in the new one.
    fn change_path<T>(
        &mut self,
        core: &mut Core,
        drone: NodeId,
        change: impl FnOnce(&mut Vehicle) -> T,
    ) -> T {
        self.end_path(core, drone);
        let changed = change(&mut self.vehicles[drone.0 as usize]);
        self.begin_path(core, drone);
        changed
    }

    fn end_path(&mut self, core: &mut Core, drone: NodeId) {
        if let Some(separation) = &mut self.separation {
            let found = separation.path_ends(core.now(), drone, &self.vehicles);
            core.checkers.report(found);
        }
    }

    fn begin_path(&mut self, core: &Core, drone: NodeId) {
        if let Some(separation) = &mut self.separation {
            let vehicle = &self.vehicles[drone.0 as usize];
            separation.path_begins(core.now(), drone, vehicle);
        }
    }

    /// Ends all paths. `may_be_armed`: these break no rule if they are still armed. Returns the vehicles, and how close two of
    /// them came in flight, in metres.
    pub(super) fn finish(
        mut self,
        core: &mut Core,
        may_be_armed: impl Fn(NodeId) -> bool,
    ) -> (Vec<Vehicle>, Option<f64>) {
        for id in (0..).map(NodeId).take(self.vehicles.len()) {
            self.end_path(core, id);
        }
        let armed = (0..)
            .map(NodeId)
            .zip(&self.vehicles)
            .filter(|(id, vehicle)| vehicle.is_armed() && !may_be_armed(*id))
            .map(|(id, _)| id);
        core.checkers.landed(core.timeline.now(), armed);
        let closest_m = self.separation.and_then(|it| it.closest_m());
        (self.vehicles, closest_m)
    }
}
