//! A world whose drones run elsewhere, as processes in real time. It is told what they do, and holds the rest: where their
//! vehicles are by what they were told, who hears whom, what befalls them, which rules hold, what is written down.

use std::time::Duration;

use muster_machines::identity::NodeId;
use muster_machines::mission::{self, State};
use muster_machines::msp::FlightCommand;
use muster_machines::node::{Address, Effect, Observation};
use muster_machines::time::Timestamp;

use super::{Envelope, Planned, World};
use crate::checkers::Violation;
use crate::scenario::{DroneFault, Scenario};
use muster_runtime::vehicle::VehicleState;

/// How much longer than it may an actor of a process hangs at the most, until it is found and built anew.
const FOUND_AFTER: Duration = Duration::from_millis(200);

/// How a drone's process is to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ProcessState {
    /// It runs.
    Runs,
    /// It hangs: nothing of it runs until it goes on.
    Hangs,
    /// It has ended.
    Ended,
}

impl World {
    /// The world of a scenario whose drones run elsewhere, before anything has happened in it. It is to be so far `behind`
    /// their clocks; what befalls a process is known that much earlier: it is made to be so at once, and the world follows
    /// once it has heard what the process said until then.
    pub(crate) fn mirroring(scenario: &Scenario, behind: Duration) -> Self {
        let mut world = Self::new(scenario);
        world.behind = Some(behind);
        for drone in (0..scenario.plan.nodes()).map(NodeId) {
            for address in Address::ALL {
                world.starting(drone, address);
            }
        }
        world
    }

    /// Lets everything happen that happens up to `now`.
    pub(crate) fn advance(&mut self, now: Timestamp) {
        while self.heap.next_at().is_some_and(|at| at <= now) {
            let Some((at, planned)) = self.heap.pop() else {
                break;
            };
            self.now = self.now.max(at);
            if let Planned::Boot { drone, incarnation } = planned {
                // It is there once it says so.
                let state = self.drone(drone);
                let is_awaited = state.incarnations == incarnation && !state.runs;
                self.booting.extend(is_awaited.then_some(drone));
            } else {
                self.happen(planned);
            }
        }
        self.now = self.now.max(now);
    }

    /// A drone told its vehicle something, at `at` or, if the world has gone on since, now.
    pub(crate) fn was_commanded(&mut self, at: Timestamp, drone: NodeId, command: FlightCommand) {
        self.advance(at);
        if self.drones[drone.0 as usize].runs {
            self.effect(drone, Effect::Command(command));
        }
    }

    /// Something was seen of a drone, likewise.
    pub(crate) fn was_seen(&mut self, at: Timestamp, drone: NodeId, seen: Observation) {
        self.advance(at);
        if !self.drones[drone.0 as usize].runs {
            return;
        }
        // What a drone is told stays in its process: that it was told to take off shows in its waiting to do so.
        if seen == Observation::Mission(mission::Event::State(State::SetUp))
            && let Some(ballot) = self.election.leader(drone).filter(|it| !it.is_elected())
        {
            self.arming.told_by(drone, ballot);
        }
        self.effect(drone, Effect::Observe(seen));
    }

    /// A drone's process has started, again if that was foreseen: its actors are about to be built.
    pub(crate) fn process_started(&mut self, at: Timestamp, drone: NodeId) {
        self.advance(at);
        let incarnation = self.drone(drone).incarnations;
        if self.booting.remove(&drone) && self.boot(drone, incarnation).is_some() {
            for address in Address::ALL {
                self.starting(drone, address);
            }
        }
    }

    /// A drone's process has ended. That of one that is down has done what it was there for; any other that was not ended
    /// by the plan has failed.
    pub(crate) fn process_ended(&mut self, at: Timestamp, drone: NodeId) {
        self.advance(at);
        let is_done = self.recorder(drone).state(drone) == State::Finished;
        let is_foreseen = self.foreseen.contains_key(&drone);
        let is_there = self.drones[drone.0 as usize].runs || self.booting.remove(&drone);
        if is_there && !is_done && !is_foreseen {
            self.find(Some(Violation {
                rule: 9,
                at: self.now,
                drones: vec![drone],
                what: format!("the process of drone {drone} ended in the middle of its flight"),
            }));
            self.kill(drone);
        }
    }

    /// A drone has sent so many frames more, news and keep-alives, and let in so many.
    pub(crate) fn has_talked(&mut self, drone: NodeId, [news, keep_alives, let_in]: [u64; 3]) {
        let recorder = self.recorder(drone);
        (0..news).for_each(|_| recorder.sent(drone, false));
        (0..keep_alives).for_each(|_| recorder.sent(drone, true));
        (0..let_in).for_each(|_| recorder.received(drone));
    }

    /// What the world would tell a drone's machines: their process is told by other means, or knows by itself.
    pub(super) fn tell_elsewhere(&mut self, drone: NodeId, envelope: &Envelope) {
        self.arming.told(drone, envelope);
    }

    /// Something is about to befall a drone's process.
    pub(super) fn foresee(
        &mut self,
        behind: Duration,
        drone: NodeId,
        fault: DroneFault,
        lasts: Option<Duration>,
    ) {
        let mended = self.hang_max + FOUND_AFTER;
        let lasts = match fault {
            // The process mends that by itself, at once or when it has found it.
            DroneFault::CrashActor(_) => return self.actor_faults.push((drone, fault, lasts)),
            DroneFault::Hang(Some(_)) => {
                self.actor_faults.push((drone, fault, lasts));
                Some(lasts.map_or(mended, |it| it.min(mended)))
            }
            DroneFault::Hang(None) => {
                self.foreseen.insert(drone, ProcessState::Hangs);
                lasts
            }
            _ => {
                self.foreseen.insert(drone, ProcessState::Ended);
                lasts
            }
        };
        let affects = Planned::Affects {
            drone,
            fault,
            lasts,
        };
        self.heap.plan(self.now + behind, affects);
    }

    /// It befalls it.
    pub(super) fn affects(&mut self, drone: NodeId, fault: DroneFault, lasts: Option<Duration>) {
        self.foreseen.remove(&drone);
        self.inject_into_drone(drone, fault, lasts);
    }

    /// How a drone's process is to be by now.
    pub(crate) fn process(&self, drone: NodeId) -> ProcessState {
        if let Some(standing) = self.foreseen.get(&drone) {
            return *standing;
        }
        let state = &self.drones[drone.0 as usize];
        match () {
            () if !state.runs && !self.booting.contains(&drone) => ProcessState::Ended,
            () if Address::ALL.iter().all(|it| state.is_hung(*it)) => ProcessState::Hangs,
            () => ProcessState::Runs,
        }
    }

    /// Whether a drone's vehicle does something else than its process told it, which hung meanwhile; told once.
    pub(crate) fn is_overruled(&mut self, drone: NodeId) -> bool {
        self.overruled.remove(&drone)
    }

    /// What a drone's vehicle is doing.
    pub(crate) fn vehicle(&self, drone: NodeId) -> VehicleState {
        VehicleState(self.vehicles[drone.0 as usize].clone())
    }

    /// The chance that a frame from one drone is not to be let in by another, 0 to 1.
    pub(crate) fn loss(&self, from: NodeId, to: NodeId) -> f64 {
        self.medium.loss(from, to)
    }

    /// A number that rises whenever those chances may be others than before.
    pub(crate) const fn loss_changes(&self) -> u64 {
        self.medium.changes()
    }

    /// The faults to inject into actors of processes since the last call, and how long each lasts.
    pub(crate) fn take_actor_faults(&mut self) -> Vec<(NodeId, DroneFault, Option<Duration>)> {
        std::mem::take(&mut self.actor_faults)
    }

    /// Whether nobody is in the air any more, or the time is up.
    pub(crate) fn is_flown(&self) -> bool {
        self.is_over() || self.now >= self.limit
    }
}
