//! What vehicles are told to do and what comes of it: their paths, their rest, and where their radios are.

use std::time::Duration;

use muster_machines::geometry::Velocity;
use muster_machines::identity::NodeId;
use muster_machines::msp::{self, FlightCommand, Setpoint};
use muster_machines::node::Envelope;

use super::trace::Kind;
use super::{Planned, World};
use crate::scenario::Trigger;

/// How often the medium is told where the radios are while drones fly: at 10 m/s they are a metre off at most.
const PLACE_RADIOS_EVERY: Duration = Duration::from_millis(100);

impl World {
    pub(super) fn command(&mut self, drone: NodeId, command: FlightCommand) {
        self.trace.value(self.now, drone, Kind::Commanded, &command);
        let found = self.arming.commands(self.now, drone, command);
        self.find(found);
        let index = drone.0 as usize;
        if !matches!(command, FlightCommand::Report) {
            self.path_ends(drone);
        }
        let vehicle = &mut self.vehicles[index];
        let was_armed = vehicle.is_armed();
        let moves = vehicle.obey(self.now, command);
        let is_armed = vehicle.is_armed();
        if !matches!(command, FlightCommand::Report) {
            self.path_begins(drone);
        }
        if is_armed && !was_armed {
            self.armed(drone);
        }
        if moves {
            let settle = self.swarm(drone).settle;
            if matches!(command, FlightCommand::Fly(Setpoint::Leg { .. }))
                && let Some(time) = self.drones[index].draw_settling(settle)
            {
                self.vehicles[index].settle(time);
            }
            self.plan_rest(drone);
        } else {
            self.report_telemetry(drone);
        }
    }

    pub(super) fn armed(&mut self, drone: NodeId) {
        let now = self.now;
        self.recorder(drone).armed(drone, now);
        self.separation.takes_off(drone);
        self.whereabouts.forget(drone);
        if self.airborne == 0 {
            self.heap.plan(self.now, Planned::PlaceRadios);
        }
        self.airborne += 1;
        self.watch_battery(drone);
        self.occurs(drone, Trigger::TakingOff);
    }

    /// Plans the end of the motion that a vehicle has just begun.
    pub(super) fn plan_rest(&mut self, drone: NodeId) {
        let motion = self.vehicles[drone.0 as usize].motion();
        let end = motion.end_time().unwrap_or(self.now);
        self.whereabouts.forget(drone);
        let generation = self.drone(drone).next_motion();
        self.heap
            .plan(end, Planned::ComeToRest { drone, generation });
    }

    /// A master is followed from now on: its pilot takes over, if it has one.
    pub(super) fn follow_begins(&mut self, master: NodeId) {
        let Some(follow) = &self.swarms[self.index_of_swarm(master)].follow else {
            return;
        };
        for sticks in &follow.pilot {
            let at = self.now + sticks.after;
            self.heap.plan(at, Planned::Steer(master, sticks.velocity));
        }
        if let Some(after) = follow.land_after {
            self.heap.plan(self.now + after, Planned::Land(master));
        }
    }

    pub(super) fn steer(&mut self, master: NodeId, velocity: Velocity) {
        let follow = self.swarm(master).follow.as_ref();
        let acceleration_mps2 = follow.map_or(0.0, |follow| follow.master.acceleration_mps2);
        self.trace
            .value(self.now, master, Kind::Steered, &velocity.0);
        self.path_ends(master);
        let vehicle = &mut self.vehicles[master.0 as usize];
        let moves = vehicle.steer(self.now, velocity, acceleration_mps2);
        self.path_begins(master);
        if moves {
            self.plan_rest(master);
        }
    }

    /// A drone's path is about to change, or to end.
    pub(super) fn path_ends(&mut self, drone: NodeId) {
        if self.checks {
            let found = self.separation.path_ends(self.now, drone, &self.vehicles);
            self.find(found);
        }
    }

    /// It has changed.
    pub(super) fn path_begins(&mut self, drone: NodeId) {
        if self.checks {
            let vehicle = &self.vehicles[drone.0 as usize];
            self.separation.path_begins(self.now, drone, vehicle);
        }
    }

    pub(super) fn report_telemetry(&mut self, drone: NodeId) {
        let telemetry = self.vehicles[drone.0 as usize].telemetry(self.now);
        self.post(
            drone,
            Envelope::Msp(Box::new(msp::Input::Telemetry(telemetry))),
        );
    }

    pub(super) fn come_to_rest(&mut self, drone: NodeId, generation: u32) {
        if !self.drone(drone).is_current_motion(generation) {
            return;
        }
        self.path_ends(drone);
        let lands = self.vehicles[drone.0 as usize].come_to_rest();
        self.path_begins(drone);
        let vehicle = &self.vehicles[drone.0 as usize];
        let position = vehicle.motion().position(self.now);
        if lands {
            self.airborne -= 1;
            self.medium.place(drone, position);
            self.whereabouts.forget(drone);
            let now = self.now;
            self.recorder(drone).disarmed(drone, now);
            if !self.recorder(drone).of(drone).landed_with_the_swarm() {
                self.separation.strays(drone);
            }
        }
        self.trace
            .value(self.now, drone, Kind::CameToRest, &position);
        self.report_telemetry(drone);
    }

    pub(super) fn place_radios(&mut self) {
        if self.airborne == 0 {
            return;
        }
        let (now, medium) = (self.now, &mut self.medium);
        self.whereabouts
            .each_that_moved(now, &self.vehicles, |id, place| medium.place(id, place));
        self.watch_links();
        let next = self.now + PLACE_RADIOS_EVERY;
        self.heap.plan(next, Planned::PlaceRadios);
    }
}
