//! The scene of a run: what surrounds the drones' actors.

use std::time::Duration;

use muster_machines::identity::NodeId;
use muster_machines::machine::Stimulus;
use muster_machines::mission;
use muster_machines::msp::{self, FlightCommand};
use muster_machines::node::{Address, Envelope};
use muster_machines::radio;
use muster_msp::TICK;
use muster_transport::{Fate, Outcome};

use super::air::Air;
use super::airspace::{Airspace, PLACE_RADIOS_EVERY};
use super::controllers::Controllers;
use super::core::Core;
use super::event::{Event, ProcessEvent, Silence};
use super::injection::{Injection, Phase};
use super::leadership::Leadership;
use super::links::LinkWatch;
use super::message::{Message, Task, What};
use super::port::PortState;
use super::processes::{Processes, RESTART_AFTER, Remedy};
use super::recorder::InjectedFault;
use super::trace::Kind;
use crate::scenario::{DroneFault, FaultKind, LinkFault, Target, Trigger};

/// The medium, the vehicles and the processes of all drones, and what happens to them. Each part keeps its own state.
///
/// Invariant: elections are checked after each event that may change who leads whom.
#[derive(Debug)]
pub(super) struct Scene {
    pub(super) core: Core,
    pub(super) air: Air,
    pub(super) airspace: Airspace,
    pub(super) controllers: Controllers,
    pub(super) processes: Processes,
    pub(super) links: LinkWatch,
}

impl Scene {
    /// Whether no vehicle is in the air, and every swarm has flown or never will.
    pub(super) fn is_over(&self) -> bool {
        self.airspace.is_clear()
            && self.core.swarms.are_done()
            && !self
                .controllers
                .drones()
                .any(|id| self.has_yet_to_learn(id))
    }

    /// Whether a drone will soon be told by its flight controller that it has landed.
    fn has_yet_to_learn(&self, drone: NodeId) -> bool {
        let state = self.core.swarms.of(drone).recorder.state(drone);
        let can_learn =
            self.processes[drone].runs() && !self.controllers.is_silent(self.core.now(), drone);
        can_learn && state == mission::State::Landing
    }

    /// Delivers a message: the task to step its actor. `None` if the actor is down, or hangs and receives it later.
    pub(super) fn deliver(&mut self, drone: NodeId, message: Message) -> Option<Task> {
        let address = message.envelope.address();
        let actors = &self.processes[drone].actors;
        if actors.is_hung(address) {
            self.core.inbox.hold_back(drone, message);
            return None;
        }
        if !actors.is_up(address) {
            self.core.trace(drone, Kind::Undeliverable, &address);
            return None;
        }
        let Message { envelope, origin } = message;
        if self.core.checkers.are_on() {
            let (swarms, checkers) = (&self.core.swarms, &mut self.core.checkers);
            let is_genuine = self.air.delivers(swarms, drone, origin, &envelope);
            let swarm = swarms.of(drone);
            checkers.delivers(drone, &envelope, is_genuine, |member| swarm.number(member));
        }
        let what = What::Step(Stimulus::Input(envelope));
        Some(Task::new(drone, address, what))
    }

    /// Handles an event. Returns the task that must run at once, if any. Messages go to the inbox.
    pub(super) fn handle(&mut self, event: Event) -> Option<Task> {
        let core = &mut self.core;
        match event {
            Event::Fly(master) => core.post(master, Envelope::Mission(mission::Input::Fly)),
            Event::Land(master) => core.post(master, Envelope::Mission(mission::Input::Land)),
            Event::Steer(master, velocity) => self.airspace.steer(core, master, velocity),
            Event::Medium => self.air.wake(core),
            Event::Arrive {
                to,
                datagram,
                origin,
            } => {
                let message = Air::arrive(core, to, datagram, origin);
                return self.deliver(to, message);
            }
            Event::Outcome(outcome) => self.report_delivery(outcome),
            Event::Wake {
                drone,
                address,
                generation,
            } => {
                let wakes = self.processes[drone].actors.wake(address, generation);
                let what = What::Step(Stimulus::Timeout);
                return wakes.then_some(Task::new(drone, address, what));
            }
            Event::ComeToRest { drone, generation } => {
                (self.airspace).come_to_rest(core, &mut self.air, drone, generation);
            }
            Event::PlaceRadios => self.place_radios(),
            Event::PortTick(drone) => self.tick_port(drone),
            Event::Drained(drone) => {
                if self.airspace.check_battery(core, drone) {
                    self.kill(drone);
                }
            }
            Event::PositionFound(drone) => {
                self.airspace.recover_position(core, drone);
                if self.airspace.vehicle(drone).has_position() {
                    (self.controllers).lose_position(core.now(), drone, false);
                }
            }
            Event::Process(drone, event) => return self.handle_process(drone, event),
            Event::Fault { index, nth } => {
                let (drone, fault, lasts) = self.inject(index, nth)?;
                return self.affect(drone, fault, lasts);
            }
            Event::FaultOver { index } => self.end_fault(index),
            Event::Affect {
                drone,
                fault,
                lasts,
            } => return self.affect(drone, fault, lasts),
        }
        None
    }

    /// Handles an event of a drone's process, likewise.
    fn handle_process(&mut self, drone: NodeId, event: ProcessEvent) -> Option<Task> {
        match event {
            ProcessEvent::Boot { incarnation } => return self.boot(drone, incarnation),
            ProcessEvent::RestartActor {
                address,
                incarnation,
            } => {
                let restarts = self.processes.restarts(drone, incarnation);
                return restarts.then_some(Task::new(drone, address, What::Restart));
            }
            ProcessEvent::LinkTimeout(silence) => self.link_timeout(drone, silence),
            ProcessEvent::Watchdog { actor, hang } => {
                return self.watchdog_timeout(drone, actor, hang);
            }
            ProcessEvent::Resume { hang } => self.resume(drone, hang),
            ProcessEvent::Backlog { incarnation } => {
                if self.processes[drone].incarnation() == incarnation {
                    self.core.inbox.release(drone);
                }
            }
            ProcessEvent::Skew { ppm } => self.processes.skew(&mut self.core, drone, ppm),
        }
        None
    }

    /// A tick of the port to a drone's flight controller.
    fn tick_port(&mut self, drone: NodeId) {
        let core = &mut self.core;
        let process = &self.processes[drone];
        let has_link = process.actors.is_up(Address::Msp) && !process.actors.is_hung(Address::Msp);
        let state = match () {
            () if !process.runs() || process.actors.are_hung() => PortState::Still,
            () if !has_link || process.given_up => PortState::WithoutLink,
            () => PortState::Runs,
        };
        let now = core.now();
        let drone_state = core.swarms.of(drone).recorder.state(drone);
        let is_to_take_off = drone_state == mission::State::TakingOff;
        self.controllers.show_pilot(drone, is_to_take_off);
        let flown = self.controllers.tick(now, drone, state, |event| {
            core.post(drone, Envelope::Msp(Box::new(msp::Input::Port(event))));
        });
        core.checkers.report(self.controllers.check(now, drone));
        if let Some((truth, until)) = flown {
            self.airspace
                .observe(core, &mut self.air, drone, &truth, until);
        }
        core.schedule_after(TICK, Event::PortTick(drone));
    }

    /// Reports to a radio whether its unicast frame was delivered.
    fn report_delivery(&mut self, outcome: Outcome) {
        let report = radio::Input::Delivery {
            to: self.core.swarms.of(outcome.from).member(outcome.to),
            delivered: outcome.fate == Fate::Delivered,
            frame: outcome.datagram,
        };
        self.core.post(outcome.from, Envelope::Radio(report));
    }

    /// Updates the positions of all radios, and looks at the links if that is due.
    fn place_radios(&mut self) {
        let (core, air) = (&mut self.core, &mut self.air);
        if self.airspace.place_radios(core, air) {
            if core.checkers.are_on() && self.links.is_due(core.now()) {
                self.look_at_links();
                self.check_settled();
            }
            let core = &mut self.core;
            core.schedule_after(PLACE_RADIOS_EVERY, Event::PlaceRadios);
        }
    }

    /// Schedules what the pilot and the operator do once a master is followed.
    pub(super) fn follow_begins(&mut self, master: NodeId) {
        let core = &mut self.core;
        if let Some(follow) = &core.swarms.of(master).follow {
            for sticks in &follow.pilot {
                let steer = Event::Steer(master, sticks.velocity);
                core.timeline.schedule_after(sticks.after, steer);
            }
            if let Some(after) = follow.land_after {
                core.timeline.schedule_after(after, Event::Land(master));
            }
        }
    }

    /// Executes a command of a drone to its flight controller.
    pub(super) fn command(&mut self, id: NodeId, command: FlightCommand) {
        if self.controllers.has(id) {
            // Its flight controller does what RC says, and by itself what its failsafe is set to.
            return;
        }
        let drone = (id, &mut self.processes[id]);
        self.airspace.command(&mut self.core, drone, command);
    }

    pub(super) const fn leadership(&self) -> Leadership<'_> {
        Leadership {
            core: &self.core,
            processes: &self.processes,
        }
    }

    pub(super) fn look_at_links(&mut self) {
        self.links
            .look(&mut self.core, &self.processes, &mut self.air);
    }

    /// Checks that each segment has one master, once it has had time to settle.
    fn check_settled(&mut self) {
        if self.core.checkers.are_on() {
            let found = self.leadership().check_settled();
            self.core.checkers.report(found);
        }
    }

    /// Records when a swarm has lost its master or follows several, and when each segment has one again.
    pub(super) fn check_elections(&mut self) {
        self.look_at_links();
        self.check_settled();
        let now = self.core.now();
        for index in 0..self.core.swarms.len() {
            let swarm = self.core.swarms.get(index);
            let mut vehicles = swarm.ids().map(|id| self.airspace.vehicle(id));
            if !vehicles.any(|it| it.is_armed()) {
                continue;
            }
            let masters = self.leadership().masters_of(swarm);
            let swarm = self.core.swarms.get_mut(index);
            if swarm.record_masters(now, masters) {
                let centre = swarm.recorder.centre();
                self.core.trigger(centre, Trigger::Settled);
            }
        }
    }

    /// Injects a fault of the plan. Returns the fault of a single drone, which has yet to affect it.
    pub(super) fn inject(
        &mut self,
        index: usize,
        nth: u32,
    ) -> Option<(NodeId, DroneFault, Option<Duration>)> {
        self.record_injection(index);
        if self.core.checkers.are_on() {
            // A drone that fails now may have been heard by one that has come near since the last look.
            self.look_at_links();
        }
        self.links.invalidate();
        let core = &mut self.core;
        core.faults.schedule_next(index, nth, &mut core.timeline);
        let fault = core.faults.get(index).clone();
        match &fault.kind {
            FaultKind::Drone(target, what) => {
                let drone = self.leadership().find(*target)?;
                return Some((drone, *what, fault.duration));
            }
            FaultKind::Links(links, link) => self.air.set_links(core, links, *link),
            FaultKind::Jam { centre, radius_m } => self.air.jam(index, *centre, *radius_m),
            FaultKind::Tamper(tampered) => self.air.tamper(core, index, *tampered),
        }
        if let Some(lasts) = fault.duration {
            core.schedule_after(lasts, Event::FaultOver { index });
        }
        self.check_elections();
        None
    }

    /// Records a fault that is about to be injected, and the state that it meets.
    fn record_injection(&mut self, fault: usize) {
        let leadership = self.leadership();
        let target = match self.core.faults.get(fault).kind {
            FaultKind::Drone(Target::Drone(drone), _) => Some(drone),
            _ => leadership.find(Target::Master),
        };
        let affects_drone = matches!(self.core.faults.get(fault).kind, FaultKind::Drone(..));
        let own = self.core.swarms.own();
        let is_alive = |id: &NodeId| own.recorder.of(*id).killed.is_none();
        let phase = match target.filter(is_alive) {
            Some(id) => Phase::of(own.recorder.state(id)),
            None => Phase::Down,
        };
        let injection = Injection {
            fault,
            phase,
            leads: target.is_some_and(|id| leadership.leads(id)),
            electing: own.recorder.is_electing(),
            apart: own.segments.iter().count() > 1,
        };
        self.core.faults.record(injection);
        let injected = InjectedFault {
            at: self.core.now(),
            index: fault,
            target: target.filter(|_| affects_drone),
        };
        self.core.swarms.get_mut(0).recorder.injected(injected);
    }

    /// Ends a fault of the plan. Faults of single drones end by events of their own.
    fn end_fault(&mut self, index: usize) {
        self.links.invalidate();
        match self.core.faults.get(index).kind.clone() {
            FaultKind::Drone(..) => {}
            FaultKind::Links(links, _) => {
                self.air
                    .set_links(&mut self.core, &links, LinkFault::Healed);
            }
            FaultKind::Jam { .. } => self.air.stop_jamming(index),
            FaultKind::Tamper(_) => self.air.stop_tampering(&mut self.core, index),
        }
        self.check_elections();
    }

    /// A fault affects a drone: the task to make an actor panic, if it does that.
    pub(super) fn affect(
        &mut self,
        drone: NodeId,
        fault: DroneFault,
        lasts: Option<Duration>,
    ) -> Option<Task> {
        let core = &mut self.core;
        match fault {
            DroneFault::CrashActor(address) => {
                let is_up = self.processes[drone].actors.is_up(address);
                return is_up.then_some(Task::new(drone, address, What::Crash));
            }
            DroneFault::Kill => self.kill(drone),
            DroneFault::CrashAircraft => self.crash_aircraft(drone),
            DroneFault::Restart => self.restart(drone, lasts.unwrap_or(RESTART_AFTER)),
            DroneFault::Hang(actor) => self.hang(drone, actor, lasts),
            DroneFault::Drain(to) => {
                if self.airspace.drain(core, drone, to) {
                    self.kill(drone);
                }
            }
            DroneFault::LoseGps => {
                self.airspace.lose_position(core, drone, lasts);
                (self.controllers).lose_position(core.now(), drone, true);
            }
            DroneFault::Replay => self.air.replay(core, drone),
            DroneFault::Forge => self.air.forge(core, drone),
            DroneFault::Controller(fault) => {
                (self.controllers).affect(core.now(), drone, fault, lasts);
            }
            DroneFault::Skew(ppm) => {
                self.processes.skew(core, drone, ppm);
                if let Some(lasts) = lasts {
                    let over = ProcessEvent::Skew { ppm: 0 };
                    core.schedule_after(lasts, Event::Process(drone, over));
                }
            }
        }
        None
    }

    /// A drone's companion computer dies; its flight controller lands it.
    pub(super) fn kill(&mut self, drone: NodeId) {
        self.core.trace(drone, Kind::Killed, &());
        self.end_process(drone);
        let now = self.core.now();
        self.core.recorder(drone).killed(drone, now);
        self.command(drone, FlightCommand::Land);
        self.check_elections();
    }

    /// An aircraft falls, with all that is on it.
    fn crash_aircraft(&mut self, drone: NodeId) {
        self.core.trace(drone, Kind::Fell, &());
        self.end_process(drone);
        let now = self.core.now();
        self.core.recorder(drone).fell(drone, now);
        self.controllers.wreck(now, drone);
        self.airspace.fall(&mut self.core, drone);
        self.check_elections();
    }

    /// A drone's process ends; its service manager starts it again after a while.
    fn restart(&mut self, drone: NodeId, after: Duration) {
        if self.airspace.vehicle(drone).is_wreck() {
            return;
        }
        self.core.trace(drone, Kind::Stopped, &());
        self.end_process(drone);
        let now = self.core.now();
        self.core.recorder(drone).stopped(drone, now);
        self.processes.schedule_boot(&mut self.core, drone, after);
        self.check_elections();
    }

    /// Ends a drone's process.
    fn end_process(&mut self, drone: NodeId) {
        self.links.invalidate();
        self.processes.end(&mut self.core, drone);
        self.controllers.close(self.core.now(), drone);
    }

    /// A drone's process starts again: the task to build its actors. `None` if the incarnation is void.
    pub(super) fn boot(&mut self, drone: NodeId, incarnation: u32) -> Option<Task> {
        if !self.processes.is_awaited(drone, incarnation) {
            return None;
        }
        self.links.invalidate();
        self.processes[drone].start();
        let now = self.core.now();
        self.core.recorder(drone).rebooted(drone, now);
        self.core.checkers.boots(drone);
        Some(Task::new(drone, Address::Radio, What::Boot))
    }

    /// A flight controller's link timeout: it lands the aircraft if its drone's process is still silent.
    fn link_timeout(&mut self, drone: NodeId, silence: Silence) {
        if self.processes.is_silent(drone, silence) {
            self.command(drone, FlightCommand::Land);
        }
    }

    /// An actor hangs, or a whole process (`None`).
    fn hang(&mut self, drone: NodeId, actor: Option<Address>, lasts: Option<Duration>) {
        if self.processes[drone].runs() {
            self.links.invalidate();
            let now = self.core.now();
            self.core.recorder(drone).hangs(drone, now, actor);
            self.processes.hang(&mut self.core, drone, actor, lasts);
            self.check_elections();
        }
    }

    /// A hang has lasted too long: the task to restart the actor that hangs. `None` for a process, or if the hang is over.
    fn watchdog_timeout(
        &mut self,
        drone: NodeId,
        actor: Option<Address>,
        hang: u32,
    ) -> Option<Task> {
        match self.processes.remedy(drone, actor, hang)? {
            Remedy::RestartActor(address) => Some(Task::new(drone, address, What::Crash)),
            Remedy::RestartProcess => {
                self.restart(drone, RESTART_AFTER);
                None
            }
        }
    }

    /// A hang ends, unless it is over.
    fn resume(&mut self, drone: NodeId, hang: u32) {
        if self.processes.resume(&mut self.core, drone, hang) {
            let now = self.core.now();
            self.core.recorder(drone).resumed(drone, now);
            self.links.invalidate();
            self.check_elections();
        }
    }
}
