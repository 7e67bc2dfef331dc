//! A world whose drones run elsewhere, as processes in real time. The processes report what they do. The world keeps the
//! rest: vehicles, links, faults, rules and records.

use std::collections::BTreeMap;
use std::time::Duration;

use muster_controller::{Sticks, Truth};
use muster_machines::identity::NodeId;
use muster_machines::mission::{self, State};
use muster_machines::msp::FlightCommand;
use muster_machines::node::{Address, Effect, Observation};
use muster_machines::time::Timestamp;
use muster_runtime::vehicle::VehicleState;

use super::controllers::LOOK_EVERY;
use super::event::{Event, ProcessEvent, Silence};
use super::{Ending, Outcome, World};
use crate::scenario::{DroneFault, Scenario};

/// How much longer than its timeout an actor of a process may hang until its supervisor has restarted it.
const RESTARTED_AFTER: Duration = Duration::from_millis(200);

/// The state that a drone's process must be in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ProcessState {
    /// It runs.
    Runs,
    /// It hangs until it is resumed.
    Hangs,
    /// It has ended.
    Ended,
}

/// A world that follows processes.
///
/// It is `delay` behind their clocks, so that reports of several processes are taken in the order of their times. A fault of
/// a process is known that much earlier: the process must take its new state at once, and the world follows.
///
/// Invariant: no message waits in the world's inbox, since processes receive theirs by other means. Entries of `booting` and
/// `overruled` are void once the drone's incarnation has changed.
#[derive(Debug)]
pub(crate) struct Mirror {
    world: World,
    delay: Duration,
    /// Faults of actors and flight controllers that have yet to be injected, and how long each lasts.
    faults: Vec<(NodeId, DroneFault, Option<Duration>)>,
    /// States of processes that the world has yet to follow.
    foreseen: BTreeMap<NodeId, ProcessState>,
    /// Processes that are being started again, with their incarnations.
    booting: BTreeMap<NodeId, u32>,
    /// Drones whose flight controllers landed them while their processes hung, with their incarnations.
    overruled: BTreeMap<NodeId, u32>,
}

impl Mirror {
    /// The mirror of a scenario at the start of a flight. All processes run.
    pub(crate) fn new(scenario: &Scenario, delay: Duration) -> Self {
        let mut mirror = Self {
            world: World::new(scenario),
            delay,
            faults: Vec::new(),
            foreseen: BTreeMap::new(),
            booting: BTreeMap::new(),
            overruled: BTreeMap::new(),
        };
        for swarm in mirror.world.scene.core.swarms.iter_mut() {
            swarm.recorder.frames_are_reported();
        }
        for drone in (0..scenario.plan.nodes()).map(NodeId) {
            mirror.start_actors(drone);
        }
        mirror
    }

    pub(crate) const fn now(&self) -> Timestamp {
        self.world.now()
    }

    /// Whether a drone is on its way from the ground to its slot.
    pub(crate) fn is_to_take_off(&self, drone: NodeId) -> bool {
        let recorder = &self.world.scene.core.swarms.of(drone).recorder;
        recorder.state(drone) == State::TakingOff
    }

    /// How many waypoints the drones have reached so far; take-offs and landings count as one each.
    pub(crate) fn steps_done(&self) -> u64 {
        self.world.steps_done()
    }

    /// Moves time to `now`, and handles all events until then.
    pub(crate) fn advance(&mut self, now: Timestamp) {
        while let Some(event) = self.world.scene.core.timeline.next_until(now) {
            self.handle(event);
            self.deliver_elsewhere();
        }
        self.world.scene.core.timeline.advance_to(now);
    }

    /// A drone commanded its flight controller, at `at` or now if that is later.
    pub(crate) fn commanded(&mut self, at: Timestamp, drone: NodeId, command: FlightCommand) {
        self.advance(at);
        if self.world.scene.processes[drone].runs() {
            self.world.execute(drone, Effect::Command(command));
            self.deliver_elsewhere();
        }
    }

    /// A drone reported an event, likewise.
    pub(crate) fn observed(&mut self, at: Timestamp, drone: NodeId, seen: Observation) {
        self.advance(at);
        if !self.world.scene.processes[drone].runs() {
            return;
        }
        // The order to take off stays in its process; that it waits to take off shows that it has received it.
        let checkers = &mut self.world.scene.core.checkers;
        if seen == Observation::Mission(mission::Event::State(State::SetUp))
            && let Some(ballot) = checkers.election.leader(drone)
            && !ballot.is_elected()
        {
            checkers.waits_for_take_off(drone, ballot);
        }
        self.world.execute(drone, Effect::Observe(seen));
        self.deliver_elsewhere();
    }

    /// A drone's aircraft with a flight controller flies like this, likewise. `sticks`: those since the last call.
    pub(crate) fn flew(
        &mut self,
        at: Timestamp,
        drone: NodeId,
        truth: &Truth,
        sticks: Option<Sticks>,
    ) {
        self.advance(at);
        let scene = &mut self.world.scene;
        let now = scene.core.now();
        scene.controllers.flew(now, drone, truth, sticks);
        let until = now + LOOK_EVERY;
        let (core, air) = (&mut scene.core, &mut scene.air);
        scene.airspace.observe(core, air, drone, truth, until);
        self.deliver_elsewhere();
    }

    /// A drone's process has started, again if that was awaited.
    pub(crate) fn process_started(&mut self, at: Timestamp, drone: NodeId) {
        self.advance(at);
        let incarnation = self.world.scene.processes[drone].incarnation();
        if self.booting.remove(&drone).is_some()
            && self.world.scene.boot(drone, incarnation).is_some()
        {
            self.start_actors(drone);
        }
    }

    /// A drone's process has ended. It has failed unless the drone had finished, or a fault ended it.
    pub(crate) fn process_ended(&mut self, at: Timestamp, drone: NodeId) {
        self.advance(at);
        let scene = &mut self.world.scene;
        let has_finished = scene.core.recorder(drone).state(drone) == State::Finished;
        let is_foreseen = self.foreseen.contains_key(&drone);
        let ran = scene.processes[drone].runs() || self.is_booting(drone);
        self.booting.remove(&drone);
        if ran && !has_finished && !is_foreseen {
            let scene = &mut self.world.scene;
            scene.core.checkers.process_ended(scene.core.now(), drone);
            scene.kill(drone);
            self.deliver_elsewhere();
        }
    }

    /// A drone has sent this many more frames, news and keep-alives, and admitted this many more.
    pub(crate) fn count_frames(&mut self, drone: NodeId, [news, keep_alives, admitted]: [u64; 3]) {
        let recorder = self.world.scene.core.recorder(drone);
        (0..news).for_each(|_| recorder.sent(drone, false));
        (0..keep_alives).for_each(|_| recorder.sent(drone, true));
        (0..admitted).for_each(|_| recorder.received(drone));
    }

    /// The state that a drone's process must be in.
    pub(crate) fn process(&self, drone: NodeId) -> ProcessState {
        if let Some(state) = self.foreseen.get(&drone) {
            return *state;
        }
        let process = &self.world.scene.processes[drone];
        match () {
            () if !process.runs() && !self.is_booting(drone) => ProcessState::Ended,
            () if process.actors.are_hung() => ProcessState::Hangs,
            () => ProcessState::Runs,
        }
    }

    /// Whether a drone's flight controller has landed it while its process hung. Answers `true` once.
    pub(crate) fn take_overruled(&mut self, drone: NodeId) -> bool {
        let incarnation = self.world.scene.processes[drone].incarnation();
        self.overruled.remove(&drone) == Some(incarnation)
    }

    /// The state of a drone's vehicle.
    pub(crate) fn vehicle(&self, drone: NodeId) -> VehicleState {
        VehicleState(self.world.scene.airspace.vehicle(drone).clone())
    }

    /// The chance that a frame from one drone is not admitted by another, 0 to 1.
    pub(crate) fn loss(&self, from: NodeId, to: NodeId) -> f64 {
        self.world.scene.air.loss(from, to)
    }

    /// A number that rises whenever a loss may have changed.
    pub(crate) const fn loss_changes(&self) -> u64 {
        self.world.scene.air.changes()
    }

    /// The faults to inject into actors and flight controllers since the last call, and how long each lasts.
    pub(crate) fn take_faults(&mut self) -> Vec<(NodeId, DroneFault, Option<Duration>)> {
        std::mem::take(&mut self.faults)
    }

    /// Whether no vehicle is in the air any more, or the time is up.
    pub(crate) fn is_flown(&self) -> bool {
        self.world.scene.is_over() || self.world.scene.core.timeline.is_up()
    }

    pub(crate) fn finish(self, ending: Ending) -> Outcome {
        self.world.finish(ending)
    }

    /// Handles an event as the world does, except that processes follow by other means.
    fn handle(&mut self, event: Event) {
        match event {
            Event::Process(drone, event) => self.handle_process(drone, event),
            Event::Fault { index, nth } => {
                let injected = self.world.scene.inject(index, nth);
                if let Some((drone, fault, lasts)) = injected {
                    self.foresee(drone, fault, lasts);
                }
            }
            Event::Affect {
                drone,
                fault,
                lasts,
            } => {
                if !matches!(fault, DroneFault::Controller(_)) {
                    self.foreseen.remove(&drone);
                }
                self.world.scene.affect(drone, fault, lasts);
            }
            // Ports are those of the processes; the world's own controllers only keep which faults they have.
            Event::PortTick(_) => {}
            event => {
                self.world.scene.handle(event);
            }
        }
    }

    /// Handles an event of a drone's process, likewise.
    fn handle_process(&mut self, drone: NodeId, event: ProcessEvent) {
        let is_booting = self.is_booting(drone);
        let scene = &mut self.world.scene;
        let process = &scene.processes[drone];
        match event {
            // The process reports its start.
            ProcessEvent::Boot { incarnation } => {
                if scene.processes.is_awaited(drone, incarnation) {
                    self.booting.insert(drone, incarnation);
                }
                return;
            }
            ProcessEvent::LinkTimeout(_) if is_booting => return,
            ProcessEvent::LinkTimeout(Silence::Hung(hang)) if process.actors.are_held_by(hang) => {
                self.overruled.insert(drone, process.incarnation());
            }
            _ => {}
        }
        scene.handle(Event::Process(drone, event));
    }

    /// Takes the world's messages: their processes receive them by other means, or know by themselves.
    fn deliver_elsewhere(&mut self) {
        let core = &mut self.world.scene.core;
        while let Some((drone, message)) = core.inbox.pop() {
            core.checkers.delivers_elsewhere(drone, &message.envelope);
        }
    }

    /// A fault will affect a drone's process: puts the process into its new state, and schedules that the world follows.
    fn foresee(&mut self, drone: NodeId, fault: DroneFault, lasts: Option<Duration>) {
        let scene = &mut self.world.scene;
        let restarted = scene.processes.actor_timeout() + RESTARTED_AFTER;
        let lasts = match fault {
            // The process restarts the actor by itself, at once or after its timeout.
            DroneFault::CrashActor(_) => return self.faults.push((drone, fault, lasts)),
            DroneFault::Hang(Some(_)) => {
                self.faults.push((drone, fault, lasts));
                Some(lasts.map_or(restarted, |it| it.min(restarted)))
            }
            DroneFault::Controller(_) => {
                self.faults.push((drone, fault, lasts));
                lasts
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
        let affect = Event::Affect {
            drone,
            fault,
            lasts,
        };
        scene.core.schedule_after(self.delay, affect);
    }

    /// Whether a drone's process is being started again.
    fn is_booting(&self, drone: NodeId) -> bool {
        let incarnation = self.world.scene.processes[drone].incarnation();
        self.booting.get(&drone) == Some(&incarnation)
    }

    fn start_actors(&mut self, drone: NodeId) {
        for address in Address::ALL {
            self.world.starting(drone, address);
        }
    }
}
