//! Drones whose processes end, hang, or start anew.

use std::time::Duration;

use muster_machines::identity::NodeId;
use muster_machines::msp::FlightCommand;
use muster_machines::node::Address;

use super::faults::RESTART_AFTER;
use super::trace::Kind;
use super::{Planned, Task, What, World};

/// Why a flight controller does not hear of its drone's process any more.
#[derive(Debug, Clone, Copy)]
pub(super) enum Silence {
    /// It has ended, and there has been no other since this many.
    End { incarnation: u32 },
    /// It hangs, by this hang.
    Hang(u32),
}

impl World {
    /// A drone's companion computer dies: nothing of it runs any more, and its flight controller brings it down.
    pub(super) fn kill(&mut self, drone: NodeId) {
        self.trace.value(self.now, drone, Kind::Killed, &());
        self.end_process(drone);
        let now = self.now;
        self.recorder(drone).killed(drone, now);
        self.command(drone, FlightCommand::Land);
        self.look_at_elections();
    }

    /// An aircraft falls, with all that is on it.
    pub(super) fn crash_aircraft(&mut self, drone: NodeId) {
        self.trace.value(self.now, drone, Kind::Fell, &());
        self.end_process(drone);
        let now = self.now;
        self.recorder(drone).fell(drone, now);
        self.path_ends(drone);
        if self.vehicles[drone.0 as usize].is_armed() {
            self.airborne -= 1;
            self.recorder(drone).disarmed(drone, now);
        }
        self.vehicles[drone.0 as usize].fall(now);
        self.path_begins(drone);
        self.plan_rest(drone);
        self.look_at_elections();
    }

    /// A drone's process ends, and its service manager starts it again after a while.
    pub(super) fn restart(&mut self, drone: NodeId, after: Duration) {
        if self.vehicles[drone.0 as usize].is_wreck() {
            return;
        }
        self.trace.value(self.now, drone, Kind::Stopped, &());
        self.end_process(drone);
        let incarnation = self.drone(drone).incarnations;
        self.heap
            .plan(self.now + after, Planned::Boot { drone, incarnation });
        let link_timeout = Planned::LinkTimeout {
            drone,
            by: Silence::End { incarnation },
        };
        self.heap.plan(self.now + self.controller_max, link_timeout);
        self.look_at_elections();
    }

    /// A flight controller has not heard of its drone's process for too long, and brings the aircraft down.
    pub(super) fn link_timeout(&mut self, drone: NodeId, by: Silence) {
        let runs = self.drone(drone).runs || self.booting.contains(&drone);
        let state = self.drone(drone);
        let is_silent = match by {
            Silence::End { incarnation } => state.incarnations == incarnation && !runs,
            Silence::Hang(hang) => state.is_held_by(hang),
        };
        if is_silent {
            if matches!(by, Silence::Hang(_)) && self.behind.is_some() {
                self.overruled.insert(drone);
            }
            self.command(drone, FlightCommand::Land);
        }
    }

    /// A drone's process starts; whom to step for it.
    pub(super) fn boot(&mut self, drone: NodeId, incarnation: u32) -> Option<Task> {
        if self.drone(drone).incarnations != incarnation || self.drone(drone).runs {
            return None;
        }
        self.process_changes += 1;
        self.drone(drone).begin();
        #[cfg(test)]
        self.said
            .push((self.now, drone, crate::twin::Said::Started));
        self.recorder(drone).rebooted(drone);
        self.arming.boots(drone);
        Some(Task {
            drone,
            address: Address::Radio,
            what: What::Boot,
        })
    }

    /// One of a drone's actors does nothing any more, or its whole process; what comes for it waits. Somebody watches:
    /// the supervisor takes such an actor for failed, the service manager such a process; unless it goes on after a while.
    pub(super) fn hang(&mut self, drone: NodeId, actor: Option<Address>, lasts: Option<Duration>) {
        if !self.drone(drone).runs {
            return;
        }
        self.trace.value(self.now, drone, Kind::Hung, &actor);
        self.process_changes += 1;
        let (hang, watchdog) = match actor {
            Some(actor) => (self.drone(drone).hang(&[actor]), self.hang_max),
            None => {
                let hang = self.drone(drone).hang(&Address::ALL);
                let link_timeout = Planned::LinkTimeout {
                    drone,
                    by: Silence::Hang(hang),
                };
                self.heap.plan(self.now + self.controller_max, link_timeout);
                (hang, self.watchdog)
            }
        };
        let watched = Planned::Watchdog { drone, actor, hang };
        self.heap.plan(self.now + watchdog, watched);
        if let Some(lasts) = lasts {
            let over = Planned::GoOn { drone, hang };
            self.heap.plan(self.now + lasts, over);
        }
        self.look_at_elections();
    }

    /// A hang has lasted for too long; whom to step for it.
    pub(super) fn watchdog_fires(
        &mut self,
        drone: NodeId,
        actor: Option<Address>,
        hang: u32,
    ) -> Option<Task> {
        if !self.drone(drone).is_held_by(hang) {
            return None;
        }
        let Some(address) = actor else {
            self.restart(drone, RESTART_AFTER);
            return None;
        };
        self.drone(drone).is_up(address).then_some(Task {
            drone,
            address,
            what: What::Crash,
        })
    }

    /// What hung goes on: timers that are overdue first, then what has waited.
    pub(super) fn go_on(&mut self, drone: NodeId, hang: u32) {
        if !self.drone(drone).is_held_by(hang) {
            return;
        }
        self.trace.value(self.now, drone, Kind::WentOn, &());
        self.process_changes += 1;
        let now = self.now;
        let state = self.drone(drone);
        state.go_on(hang);
        let shown = state.clock.at(now);
        let overdue = Address::ALL.map(|address| (address, state.overdue(address, shown)));
        for (address, generation) in overdue {
            if let Some(generation) = generation {
                let wake = Planned::Wake {
                    drone,
                    address,
                    generation,
                };
                self.heap.plan(now, wake);
            }
        }
        let incarnation = self.drone(drone).incarnations;
        self.heap.plan(now, Planned::Backlog { drone, incarnation });
        self.look_at_elections();
    }

    /// What has waited for a drone that hung is handed to it.
    pub(super) fn hand_over_backlog(&mut self, drone: NodeId, incarnation: u32) {
        if self.drone(drone).incarnations == incarnation {
            let backlog = std::mem::take(&mut self.drone(drone).backlog);
            for message in &backlog {
                self.drone(drone).queue(message.envelope.address());
            }
            self.inbox
                .extend(backlog.into_iter().map(|message| (drone, message)));
        }
    }

    /// A drone's clock gains `ppm` millionths from now on; its timers go off by it.
    pub(super) fn skew(&mut self, drone: NodeId, ppm: i32) {
        let now = self.now;
        self.trace.value(now, drone, Kind::Skewed, &ppm);
        let state = self.drone(drone);
        state.clock.skew(now, ppm);
        for address in Address::ALL {
            let state = self.drone(drone);
            let deadline = state.deadline(address);
            if let Some(deadline) = deadline {
                state.set_timer(address, None);
                self.set_timer(drone, address, Some(deadline));
            }
        }
    }

    /// Nothing of a drone runs any more.
    fn end_process(&mut self, drone: NodeId) {
        self.inbox.retain(|(to, _)| *to != drone);
        for address in Address::ALL {
            self.drone(drone).clear_queue(address);
        }
        self.process_changes += 1;
        self.booting.remove(&drone);
        self.overruled.remove(&drone);
        self.drone(drone).end();
        self.swarm_mut(drone).barrier.given_up(drone);
    }
}
