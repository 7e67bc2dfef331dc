//! The world in which a run's drones live: what happens, in which order, and what is recorded.
//!
//! Both engines do the same: they take a task from [`World::next`], and give its result to [`World::carry_out`]. All
//! order is decided here. At one instant a drone's messages are delivered in the order in which they were sent, one at a
//! time, before any other event.

mod actors;
mod air;
mod airspace;
mod checkpoints;
mod clock;
mod controllers;
mod core;
mod disk;
mod drone;
mod event;
mod event_queue;
mod faults;
mod faulty;
mod inbox;
mod injection;
mod leadership;
mod line;
mod links;
mod message;
mod mirror;
mod outcome;
mod pilot;
mod port;
mod positions;
mod processes;
mod recorder;
mod scene;
mod setup;
mod swarm;
mod tampering;
mod timeline;
mod trace;

use std::collections::BTreeSet;

use muster_machines::identity::NodeId;
use muster_machines::mission::{self, State};
use muster_machines::node::{
    Address, Checkpoints, Effect, Envelope, Observation, StepOutput, emergency_landing,
};
use muster_machines::supervision::RestartDecision;
use muster_machines::time::Timestamp;
use muster_machines::{msp, routing, wire};

pub use self::controllers::{Controllers, LOOK_EVERY};
use self::event::Event;
pub use self::faulty::FaultyController;
pub use self::injection::{Injection, Phase};
use self::links::relays_frames;
pub(crate) use self::message::{Task, What};
pub(crate) use self::mirror::Mirror;
pub use self::mirror::ProcessState;
pub use self::outcome::Outcome;
pub(crate) use self::outcome::{Ending, SwarmOutcome, track};
pub use self::pilot::Pilot;
pub(crate) use self::port::PortFigures;
pub use self::port::PortState;
pub(crate) use self::recorder::{Incident, LINKED_NODES_MAX, Record, Recorder};
use self::scene::Scene;
pub(crate) use self::setup::blueprints;
use self::trace::Kind;
use crate::engine::RunLimit;
use crate::scenario::{Scenario, Trigger};

/// Fewer events than this in a slice of time are not read ahead: little memory would be loaded side by side.
const READ_AHEAD_MIN: usize = 4;
/// Nothing is read ahead with fewer drones than this: they are in the cache.
const READ_AHEAD_DRONES_MIN: usize = 300;

/// A world in the middle of a run: connects the drones' actors, which an engine steps, with the scene.
///
/// Invariant: a task is only taken after the result of the one before it was carried out.
#[derive(Debug)]
pub(crate) struct World {
    scene: Scene,
    /// Ends the run after this much wall-clock time.
    run_limit: Option<RunLimit>,
    /// What the drones' processes would report.
    #[cfg(test)]
    pub(crate) reports: Vec<(Timestamp, NodeId, crate::twin::ProcessReport)>,
}

impl World {
    /// The world of a scenario at the start of a run: all drones on the ground.
    pub(crate) fn new(scenario: &Scenario) -> Self {
        Self {
            scene: setup::scene(scenario),
            run_limit: None,
            #[cfg(test)]
            reports: Vec::new(),
        }
    }

    /// The same world, whose run ends once this limit has passed.
    pub(crate) fn within(self, run_limit: RunLimit) -> Self {
        Self {
            run_limit: Some(run_limit),
            ..self
        }
    }

    pub(crate) const fn now(&self) -> Timestamp {
        self.scene.core.now()
    }

    /// The time on a drone's own clock.
    pub(crate) fn now_of(&self, drone: NodeId) -> Timestamp {
        self.scene.processes[drone].clock.at(self.scene.core.now())
    }

    /// Draws the seed of the next machine to be built.
    pub(crate) fn seed(&mut self, drone: NodeId) -> u64 {
        self.scene.processes[drone].draw_seed()
    }

    pub(crate) fn checkpoints(&self, drone: NodeId) -> &Checkpoints {
        self.scene.processes[drone].checkpoints.current()
    }

    /// How many waypoints the drones have reached so far; take-offs and landings count as one each.
    pub(crate) fn steps_done(&self) -> u64 {
        self.scene.core.swarms.steps_done()
    }

    /// Moves on to the next task. `None` once the run is over.
    pub(crate) fn next(&mut self) -> Option<Task> {
        self.scene.core.checkers.before_task();
        loop {
            if let Some(run_limit) = &mut self.run_limit
                && run_limit.is_over()
            {
                self.scene.core.inbox.clear();
                let now = self.scene.core.now();
                self.scene.core.checkers.overran(now, run_limit.limit);
                return None;
            }
            while let Some((drone, message)) = self.scene.core.inbox.pop() {
                if let Some(task) = self.scene.deliver(drone, message) {
                    return Some(task);
                }
            }
            if self.scene.core.checkers.has_found() || self.scene.is_over() {
                return None;
            }
            let event = self.scene.core.timeline.next()?;
            if let Some(task) = self.scene.handle(event) {
                let crashes = matches!(task.what, What::Crash);
                let crashes = crashes.then_some((task.drone, task.address));
                self.scene.core.checkers.plan_failure(crashes);
                #[cfg(test)]
                if matches!(task.what, What::Boot) {
                    self.report(task.drone, crate::twin::ProcessReport::Started);
                }
                return Some(task);
            }
        }
    }

    /// Overwrites `soon` with the drones that receive frames or route in the slice of time that has just begun, and the
    /// senders of the frames. Returns whether there are enough for read-ahead to pay off.
    pub(crate) fn look_ahead(&mut self, soon: &mut Vec<(NodeId, Option<NodeId>)>) -> bool {
        if self.scene.processes.len() < READ_AHEAD_DRONES_MIN {
            return false;
        }
        let Some(events) = self.scene.core.timeline.new_slice(READ_AHEAD_MIN) else {
            return false;
        };
        soon.clear();
        soon.extend(events.filter_map(|event| match event {
            Event::Arrive { to, datagram, .. } => Some((*to, wire::sender(datagram))),
            Event::Wake { drone, address, .. } => {
                (*address == Address::Routing).then_some((*drone, None))
            }
            _ => None,
        }));
        for (drone, _) in soon {
            self.scene.processes[*drone].read_ahead();
            self.scene.core.inbox.read_ahead(*drone);
            let swarm = self.scene.core.swarms.of(*drone);
            swarm.recorder.read_ahead(*drone);
        }
        true
    }

    /// Executes the effects of a step in order, and sets the machine's timer.
    pub(crate) fn carry_out(&mut self, drone: NodeId, from: Address, output: &mut StepOutput) {
        let now = self.scene.core.now();
        let kept = self.scene.processes[drone].checkpoints.current();
        let checkers = &mut self.scene.core.checkers;
        checkers.yields(now, drone, from, &output.effects, kept);
        for effect in output.effects.drain(..) {
            self.execute(drone, effect);
        }
        self.scene.core.checkers.stepped(now, drone, from, output);
        let scene = &mut self.scene;
        (scene.processes).set_timer(&mut scene.core, drone, from, output.deadline);
        let nth = self.scene.processes[drone].count_step(now);
        if self.scene.core.checkers.counts_step(now, drone, from, nth) {
            self.scene.core.inbox.clear();
        }
    }

    /// An actor is about to be built.
    pub(crate) fn starting(&mut self, drone: NodeId, address: Address) {
        self.scene.core.trace(drone, Kind::Started, &address);
        self.scene.core.checkers.starting(drone, address);
        self.scene.links.invalidate();
        self.scene.processes[drone].actors.bring_up(address);
        if address == Address::Msp {
            let core = &mut self.scene.core;
            for event in self.scene.controllers.introduction(core.now(), drone) {
                core.post(drone, Envelope::Msp(Box::new(msp::Input::Port(event))));
            }
        }
        let swarm = self.scene.core.swarms.of(drone);
        if swarm.recorder.is_electing() && relays_frames(drone, swarm, &self.scene.processes) {
            // Drones that hear only this one may have a master again.
            self.scene.check_elections();
        }
    }

    /// An actor failed: drops its messages and executes its supervisor's decision.
    pub(crate) fn failed(&mut self, drone: NodeId, address: Address, decision: RestartDecision) {
        let scene = &mut self.scene;
        scene.core.trace(drone, Kind::Failed, &(address, decision));
        let now = scene.core.now();
        scene.core.checkers.failed(now, drone, address);
        scene.links.invalidate();
        (scene.processes).stop_actor(&mut scene.core, drone, address);
        match decision {
            RestartDecision::Restart { at } => {
                let recorder = scene.core.recorder(drone);
                recorder.restarts(drone, now, address);
                (scene.processes).schedule_restart(&mut scene.core, drone, address, at);
            }
            RestartDecision::GiveUp => {
                let swarm = scene.core.swarms.of_mut(drone);
                swarm.recorder.given_up(drone, now, address);
                swarm.barrier.given_up(drone);
                scene.processes[drone].given_up = true;
                let actors = &scene.processes[drone].actors;
                for effect in emergency_landing(|address| actors.is_up(address)) {
                    self.execute(drone, effect);
                }
            }
        }
    }

    /// Ends the run: the last checks, and the outcome.
    pub(crate) fn finish(mut self, ending: Ending) -> Outcome {
        let (core, controllers) = (&mut self.scene.core, &self.scene.controllers);
        let now = core.now();
        let may_be_armed = |id| ending == Ending::Interrupted || controllers.is_frozen(now, id);
        let (vehicles, closest_m) = (self.scene.airspace).finish(core, may_be_armed);
        let ended = self.scene.core.now();
        let mut ports = (0..).map(NodeId).map(|id| controllers.figures(id));
        let mut controls = (0..).map(NodeId).map(|id| controllers.series(id));
        let mut vehicles = vehicles.into_iter();
        let swarms = self.scene.core.swarms.finish().map(|(recorder, nodes)| {
            let vehicles = vehicles.by_ref().take(nodes).collect();
            let ports = ports.by_ref().take(nodes).collect();
            let controls = controls.by_ref().take(nodes).collect();
            SwarmOutcome {
                recorder,
                vehicles,
                ports,
                controls,
            }
        });
        Outcome {
            swarms: swarms.collect(),
            trace: self.scene.core.trace.finish(),
            ended,
            medium: self.scene.air.counters(),
            closest_m,
            violations: self.scene.core.checkers.finish().into_iter().collect(),
            injections: self.scene.core.faults.finish(),
        }
    }
}

/// Execution of effects.
impl World {
    /// Executes an effect of a step.
    fn execute(&mut self, drone: NodeId, effect: Effect) {
        match effect {
            Effect::Post(envelope) => self.post(drone, envelope),
            Effect::Send {
                to,
                frame,
                keep_alive,
            } => {
                let swarm = self.scene.core.swarms.of_mut(drone);
                swarm.recorder.sent(drone, keep_alive);
                let to = to.map(|member| swarm.number(member));
                self.scene.air.send(&mut self.scene.core, drone, to, &frame);
            }
            // The medium addresses drones by their numbers, and simulated fleets have no revocation lists.
            // No world has autopilots.
            Effect::LearnAddress { .. } | Effect::KeepList(_) | Effect::Order(_) => {}
            Effect::Command(command) => {
                #[cfg(test)]
                self.report(drone, crate::twin::ProcessReport::Commanded(command));
                self.scene.command(drone, command);
            }
            Effect::Rc(rc) => {
                let now = self.scene.core.now();
                self.scene.controllers.set_rc(now, drone, rc);
            }
            Effect::StoreCheckpoint(checkpoint) => {
                self.scene.processes[drone].checkpoints.keep(checkpoint);
            }
            Effect::Observe(seen) => {
                #[cfg(test)]
                self.report(drone, crate::twin::ProcessReport::Observed(seen.clone()));
                let seen = self.scene.core.swarms.of(drone).renumbered(seen);
                self.observe(drone, &seen);
            }
        }
    }

    #[cfg(test)]
    fn report(&mut self, drone: NodeId, report: crate::twin::ProcessReport) {
        self.reports.push((self.scene.core.now(), drone, report));
    }

    /// Sends a message from one of a drone's actors to another.
    fn post(&mut self, drone: NodeId, envelope: Envelope) {
        if let Envelope::Routing(routing::Input::Received { sender, .. }) = &envelope {
            // Its radio has admitted a frame.
            let now = self.scene.core.now();
            let swarm = self.scene.core.swarms.of_mut(drone);
            let sender = swarm.number(*sender);
            swarm.recorder.received(drone);
            swarm.segments.heard(now, sender, drone);
            self.scene.core.checkers.admits(now, drone);
            self.scene.air.admitted(&self.scene.core.swarms, drone);
        }
        self.scene.core.post(drone, envelope);
    }

    /// A drone reports an event.
    fn observe(&mut self, drone: NodeId, observation: &Observation) {
        self.trace_observation(drone, observation);
        match observation {
            Observation::Mission(event) => self.observe_mission(drone, event),
            Observation::Routing(event) => {
                let now = self.scene.core.now();
                let recorder = self.scene.core.recorder(drone);
                recorder.routing(now, drone, event);
                if *event == routing::Event::Left {
                    self.scene.links.invalidate();
                }
            }
            Observation::Radio(event) => self.scene.core.recorder(drone).radio(event),
            Observation::Navigation(_) => {}
        }
    }

    /// Of a failed agent, only that it failed: its words may hold addresses in memory or paths of this computer. That a drone has
    /// left lockstep shows in what it commands.
    fn trace_observation(&mut self, drone: NodeId, observation: &Observation) {
        let failed;
        let traced = match observation {
            Observation::Mission(mission::Event::AgentFailed(_)) => {
                failed = Observation::Mission(mission::Event::AgentFailed(String::new()));
                &failed
            }
            Observation::Mission(mission::Event::LeftLockstep) => return,
            observation => observation,
        };
        self.scene.core.trace(drone, Kind::Observed, traced);
    }

    /// A drone's mission reports an event.
    fn observe_mission(&mut self, drone: NodeId, event: &mission::Event) {
        let now = self.scene.core.now();
        let checkers = &mut self.scene.core.checkers;
        checkers.observe(now, drone, event);
        let (is_checked, leader) = (checkers.are_on(), checkers.election.leader(drone));
        if is_checked
            && matches!(event, mission::Event::State(State::Finished))
            && !self.scene.links.is_recent(now)
        {
            // Its last frame may reach a drone that has come near since the last look. Where a thousand land at once, each
            // look would find what the last one found.
            self.scene.look_at_links();
        }
        if matches!(event, mission::Event::State(_)) {
            self.scene.links.invalidate();
        }
        let mut awaited = BTreeSet::new();
        if is_checked && matches!(event, mission::Event::Opened { .. }) {
            self.scene.look_at_links();
            awaited = self.scene.leadership().awaited_by(drone);
        }
        let barrier = &mut self.scene.core.swarms.of_mut(drone).barrier;
        let found = barrier.observe(now, drone, event, leader, || awaited);
        self.scene.core.checkers.report(found);
        self.scene.core.recorder(drone).mission(now, drone, event);
        self.trigger(drone, event);
        if let mission::Event::Follows(ballot) = event
            && ballot.is_elected()
        {
            self.scene.check_elections();
        }
        if *event == mission::Event::State(State::Following)
            && drone == self.scene.core.swarms.of(drone).recorder.centre()
        {
            self.scene.follow_begins(drone);
        }
    }

    /// Schedules the faults that wait for an event of a mission.
    fn trigger(&mut self, drone: NodeId, event: &mission::Event) {
        let trigger = match *event {
            mission::Event::State(State::WaypointReached { waypoint }) => {
                Trigger::Waypoint(waypoint)
            }
            mission::Event::Landing(_) => Trigger::Landing,
            mission::Event::Follows(ballot) if ballot.is_elected() && ballot.master == drone => {
                Trigger::Elected
            }
            _ => return,
        };
        self.scene.core.trigger(drone, trigger);
    }
}
