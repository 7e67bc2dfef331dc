//! What befalls a vehicle in the air: its battery drains, it does not know where it is.

use std::time::Duration;

use muster_machines::identity::NodeId;

use super::trace::Kind;
use super::{Planned, World};

impl World {
    /// Plans when a battery next says that there is less in it.
    pub(super) fn watch_battery(&mut self, drone: NodeId) {
        let next = self.vehicles[drone.0 as usize]
            .battery()
            .next_step(self.now);
        if let Some(next) = next {
            self.heap.plan(next, Planned::Drained(drone));
        }
    }

    /// Another hundredth of a battery is gone; an empty one takes the drone down.
    pub(super) fn drained(&mut self, drone: NodeId) {
        let now = self.now;
        let vehicle = &mut self.vehicles[drone.0 as usize];
        if vehicle.is_armed() && vehicle.battery().is_due(now) {
            self.tell_charge(drone);
        }
    }

    /// All but a share of a battery is gone at once.
    pub(super) fn drain(&mut self, drone: NodeId, to: f64) {
        self.trace.value(self.now, drone, Kind::Drained, &to);
        let vehicle = &mut self.vehicles[drone.0 as usize];
        vehicle.battery().drain(self.now, to);
        self.tell_charge(drone);
    }

    fn tell_charge(&mut self, drone: NodeId) {
        let charge = self.vehicles[drone.0 as usize].battery().charge(self.now);
        if charge > 0.0 {
            self.watch_battery(drone);
            self.report_telemetry(drone);
        } else {
            self.recorder(drone).ran_empty(drone);
            self.kill(drone);
        }
    }

    /// A vehicle does not know any more where it is over ground.
    pub(super) fn lose_position(&mut self, drone: NodeId, lasts: Option<Duration>) {
        self.trace
            .value(self.now, drone, Kind::PositionLost, &lasts);
        let until = self.now + lasts.unwrap_or(Duration::MAX);
        self.vehicles[drone.0 as usize].lose_position(self.now, until);
        self.heap.plan(until, Planned::PositionFound(drone));
        self.report_telemetry(drone);
    }

    /// It knows again, unless it has lost it for longer.
    pub(super) fn find_position(&mut self, drone: NodeId) {
        self.vehicles[drone.0 as usize].find_position(self.now);
        self.report_telemetry(drone);
    }
}
