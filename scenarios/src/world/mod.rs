//! The world that a run's drones live in: what happens, in which order, and what is written down of it.
//!
//! Both engines do the same two things: ask [`World::next`] whom to step, and hand what came of it to
//! [`World::carry_out`]. All order is decided here. At one instant a drone's messages run in the order in which they
//! were sent, one at a time, before anything else happens.

mod air;
mod clock;
mod connected;
mod disk;
mod drone;
mod faults;
mod flying;
mod health;
mod heap;
mod injections;
mod mirror;
mod process;
mod recorder;
mod swarm;
mod tampering;
mod trace;
mod whereabouts;

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::Duration;

use bytes::Bytes;
use muster_machines::geometry::Velocity;
use muster_machines::identity::{NodeId, SwarmId};
use muster_machines::machine::Stimulus;
use muster_machines::mission::State;
use muster_machines::node::{
    Address, Blueprint, Checkpoints, Effect, Envelope, Observation, StepOutput, last_resort,
};
use muster_machines::supervision::RestartDecision;
use muster_machines::time::Timestamp;
use muster_machines::{mission, radio, routing, wire};
use muster_transport::Fate;
use muster_transport::sim::Medium;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use self::drone::Drone;
use self::faults::Plan;
use self::heap::Heap;
pub(crate) use self::injections::{Injection, Phase};
pub use self::mirror::ProcessState;
use self::process::Silence;
pub(crate) use self::recorder::{Flown, Outcome, Record, Recorder, track};
use self::swarm::Swarm;
use self::tampering::Tampering;
use self::trace::{HEADING_LEN, Kind, Trace};
use self::whereabouts::Whereabouts;
use crate::checkers::{
    AdmissionChecker, ArmingChecker, BoundsChecker, ElectionChecker, ObedienceChecker,
    ProgressChecker, SeparationChecker, Violation, check_landed, unplanned_failure,
};
use crate::engine::RunLimit;
use crate::scenario::{DroneFault, Scenario, Trigger};
use muster_runtime::vehicle::Vehicle;

/// Numbers of the generators that are drawn from the scenario's seed; drones follow.
const MEDIUM_STREAM: u64 = 0;
const FIRST_DRONE_STREAM: u64 = 1;
const FAULTS_STREAM: u64 = u64::MAX;

/// As long as no more happens in a slice of time, what that takes is not read ahead: there is little to be waited for side
/// by side, and of a small swarm all is at hand.
const MANY: usize = 4;

/// What an engine is to do next.
#[derive(Debug)]
pub(crate) struct Task {
    pub(crate) drone: NodeId,
    pub(crate) address: Address,
    pub(crate) what: What,
}

#[derive(Debug)]
pub(crate) enum What {
    /// Step the machine.
    Step(Stimulus<Envelope>),
    /// Let the actor panic.
    Crash,
    /// Build the actor anew.
    Restart,
    /// Build all five, under a new supervisor.
    Boot,
}

#[derive(Debug)]
enum Planned {
    /// The operator tells a master to fly.
    Fly(NodeId),
    /// The medium has something to do.
    Medium,
    Arrive {
        to: NodeId,
        datagram: Bytes,
        origin: Origin,
    },
    /// What became of a frame for one drone.
    Outcome(muster_transport::Outcome),
    Wake {
        drone: NodeId,
        address: Address,
        generation: u32,
    },
    ComeToRest {
        drone: NodeId,
        generation: u32,
    },
    PlaceRadios,
    /// A battery says that there is less in it.
    Drained(NodeId),
    /// A vehicle knows again where it is.
    PositionFound(NodeId),
    Restart {
        drone: NodeId,
        address: Address,
        incarnation: u32,
    },
    /// A drone's process starts.
    Boot {
        drone: NodeId,
        incarnation: u32,
    },
    /// Its flight controller has waited for it for long enough.
    LinkTimeout {
        drone: NodeId,
        by: Silence,
    },
    /// Whoever watches a drone finds that it hangs.
    Watchdog {
        drone: NodeId,
        actor: Option<Address>,
        hang: u32,
    },
    /// A drone's clock gains so many millionths from now on.
    Skew {
        drone: NodeId,
        ppm: i32,
    },
    /// What hangs goes on.
    GoOn {
        drone: NodeId,
        hang: u32,
    },
    /// What has waited for a drone that hung is handed to it.
    Backlog {
        drone: NodeId,
        incarnation: u32,
    },
    /// A fault of the plan befalls, for the nth time from 0.
    Fault {
        index: usize,
        nth: u32,
    },
    /// Something befalls a process elsewhere that was foreseen.
    Affects {
        drone: NodeId,
        fault: DroneFault,
        lasts: Option<Duration>,
    },
    /// It is over.
    FaultOver {
        index: usize,
    },
    /// The pilot of a master moves the sticks.
    Steer(NodeId, Velocity),
    /// The operator ends the flight that a master leads.
    Land(NodeId),
}

/// What waits for one of a drone's actors.
#[derive(Debug)]
struct Message {
    envelope: Envelope,
    origin: Origin,
}

/// Where a message comes from, as far as a radio is to let it in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Origin {
    /// From whoever it says.
    Genuine,
    /// From somebody who sends again what he heard: it is to be let in by whoever has not let it in before.
    Replayed,
    /// From nobody who said this, or not to this swarm.
    Spurious,
}

/// A world in the middle of a run.
#[derive(Debug)]
pub(crate) struct World {
    now: Timestamp,
    limit: Timestamp,
    /// Ends the run after so much wall-clock time.
    run_limit: Option<RunLimit>,
    heap: Heap<Planned>,
    plan: Plan,
    tampering: Tampering,
    inbox: VecDeque<(NodeId, Message)>,
    medium: Medium,
    /// When the medium is woken next, as far as that is planned.
    medium_wakes: Option<Timestamp>,
    drones: Vec<Drone>,
    vehicles: Vec<Vehicle>,
    whereabouts: Whereabouts,
    swarms: Vec<Swarm>,
    /// How long an actor may hang before its supervisor takes it for failed.
    hang_max: Duration,
    /// How long a process may before its service manager ends it.
    watchdog: Duration,
    /// How long a flight controller waits for one.
    controller_max: Duration,
    airborne: usize,
    trace: Trace,
    /// When the links are looked at next.
    next_look: Timestamp,
    /// Rises with whatever changes who passes frames on, or what anybody does.
    process_changes: u64,
    /// What the standings and the medium were when the links were last looked at.
    looked_at: Option<(u64, u64)>,
    /// Whether rules are checked.
    checks: bool,
    /// How far it is behind the drones' clocks, if they run elsewhere.
    behind: Option<Duration>,
    /// Faults to inject into actors of processes elsewhere, until the processes are told.
    actor_faults: Vec<(NodeId, DroneFault, Option<Duration>)>,
    /// How processes elsewhere are about to be.
    foreseen: BTreeMap<NodeId, ProcessState>,
    /// Whose processes elsewhere are being started again.
    booting: BTreeSet<NodeId>,
    /// Whose vehicles were brought down by their flight controllers while their processes elsewhere hang.
    overruled: BTreeSet<NodeId>,
    election: ElectionChecker,
    admission: AdmissionChecker,
    obedience: ObedienceChecker,
    arming: ArmingChecker,
    separation: SeparationChecker,
    bounds: BoundsChecker,
    progress: ProgressChecker,
    /// The frame that a radio was told of last, where somebody listens.
    told_of: Option<Bytes>,
    violation: Option<Violation>,
    /// Which actor is being made to panic.
    crashing: Option<(NodeId, Address)>,
    /// What the faults met so far.
    struck: Vec<Injection>,
    /// What drones said, as their processes would.
    #[cfg(test)]
    pub(crate) said: Vec<(Timestamp, NodeId, crate::twin::Said)>,
}

impl World {
    /// The world of a scenario before anything has happened in it: all drones on the ground, nobody told to fly.
    pub(crate) fn new(scenario: &Scenario) -> Self {
        let (mut swarms, mut places, mut vehicles) = (Vec::new(), Vec::new(), Vec::new());
        let mut heap = Heap::new();
        let mut nodes = 0;
        for (swarm, joins) in scenario.swarms() {
            let began = Swarm::new(swarm, nodes);
            heap.plan(
                Timestamp::ZERO + joins.after,
                Planned::Fly(began.recorder.centre()),
            );
            places.extend(swarm.plan.stands().map(|place| place + joins.home));
            vehicles.extend((swarm.plan.stands()).map(|place| {
                Vehicle::new(swarm.plan.landing, place)
                    .lasting(swarm.plan.endurance)
                    .with_home(joins.home)
            }));
            swarms.push(began);
            nodes += swarm.plan.nodes();
        }
        let generator = |stream: u64| {
            let mut rng = ChaCha8Rng::seed_from_u64(scenario.seed);
            rng.set_stream(stream);
            rng
        };
        let plan = Plan::new(&scenario.faults);
        let has_journals = plan.restarts_processes();
        for (index, at) in plan.timed() {
            heap.plan(at, Planned::Fault { index, nth: 0 });
        }
        Self {
            now: Timestamp::ZERO,
            limit: Timestamp::ZERO + scenario.bound(),
            run_limit: None,
            heap,
            tampering: Tampering::new(
                generator(FAULTS_STREAM),
                plan.listened_to(scenario.plan.nodes()).into_iter(),
            ),
            plan,
            inbox: VecDeque::new(),
            medium: Medium::new(scenario.radio, generator(MEDIUM_STREAM), &places),
            medium_wakes: None,
            drones: (0..u64::from(nodes))
                .map(|id| Drone::new(generator(FIRST_DRONE_STREAM + id), has_journals))
                .collect(),
            separation: SeparationChecker::new(scenario.plan.limits.separation, &vehicles),
            whereabouts: Whereabouts::of(vehicles.len()),
            vehicles,
            swarms,
            hang_max: scenario.plan.limits.hang,
            watchdog: scenario.plan.limits.watchdog,
            controller_max: scenario.plan.limits.controller,
            airborne: 0,
            trace: Trace::new(),
            next_look: Timestamp::ZERO,
            process_changes: 0,
            looked_at: None,
            checks: !scenario.unchecked,
            behind: None,
            actor_faults: Vec::new(),
            foreseen: BTreeMap::new(),
            booting: BTreeSet::new(),
            overruled: BTreeSet::new(),
            election: ElectionChecker::new(nodes as usize),
            admission: AdmissionChecker::default(),
            obedience: ObedienceChecker::default(),
            arming: ArmingChecker::new(nodes as usize),
            bounds: BoundsChecker {
                waiting_max: scenario.plan.limits.waiting_max,
            },
            progress: ProgressChecker::new(nodes, scenario.plan.limits.waiting_max),
            told_of: None,
            violation: None,
            crashing: None,
            struck: Vec::new(),
            #[cfg(test)]
            said: Vec::new(),
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
        self.now
    }

    /// What a drone's own clock shows.
    pub(crate) fn now_of(&self, drone: NodeId) -> Timestamp {
        self.drones[drone.0 as usize].clock.at(self.now)
    }

    /// What the next machine to be built draws its lots from.
    pub(crate) fn seed(&mut self, drone: NodeId) -> u64 {
        self.drone(drone).rng.next_u64()
    }

    pub(crate) fn checkpoints(&mut self, drone: NodeId) -> &Checkpoints {
        &self.drone(drone).checkpoints
    }

    /// Goes on to what happens next and says whom to step for it; nothing once the run is over.
    pub(crate) fn next(&mut self) -> Option<Task> {
        self.obedience.keeps_going();
        loop {
            if let Some(run_limit) = &mut self.run_limit
                && run_limit.is_over()
            {
                let overran = ProgressChecker::overran(self.now, run_limit.limit);
                self.give_up(overran);
                return None;
            }
            while let Some((drone, message)) = self.inbox.pop_front() {
                self.drone(drone).unqueue(message.envelope.address());
                if let Some(task) = self.hand_over(drone, message) {
                    return Some(task);
                }
            }
            if self.violation.is_some() || self.is_over() {
                return None;
            }
            let (at, planned) = self.heap.pop()?;
            if at > self.limit {
                self.now = self.limit;
                return None;
            }
            self.now = at;
            if let Some(task) = self.happen(planned) {
                let crashes = matches!(task.what, What::Crash);
                self.crashing = crashes.then_some((task.drone, task.address));
                return Some(task);
            }
        }
    }

    /// Ends a run that would not end by itself, whether or not rules are checked.
    fn give_up(&mut self, why: Violation) {
        self.inbox.clear();
        self.violation.get_or_insert(why);
    }

    /// Hands a message to the actor that it is for: a task, if that runs.
    fn hand_over(&mut self, drone: NodeId, message: Message) -> Option<Task> {
        let address = message.envelope.address();
        let state = &self.drones[drone.0 as usize];
        if state.is_hung(address) {
            self.wait_for(drone, message);
            return None;
        }
        if !state.is_up(address) {
            self.trace
                .value(self.now, drone, Kind::Undeliverable, &address);
            return None;
        }
        let envelope = message.envelope;
        if self.checks {
            self.is_told(drone, &envelope, message.origin);
        }
        Some(Task {
            drone,
            address,
            what: What::Step(Stimulus::Input(envelope)),
        })
    }

    /// An actor is about to be told something.
    fn is_told(&mut self, drone: NodeId, envelope: &Envelope, origin: Origin) {
        self.admit(drone, origin, envelope);
        self.arming.told(drone, envelope);
        let leader = self.election.leader(drone);
        let swarm = &self.swarms[self.index_of_swarm(drone)];
        let number = |member| swarm.number(member);
        self.obedience.told(drone, envelope, leader, number);
    }

    /// A radio is about to be told of a frame, or somebody else of something.
    fn admit(&mut self, drone: NodeId, origin: Origin, envelope: &Envelope) {
        self.told_of = match envelope {
            Envelope::Radio(radio::Input::Received { datagram, .. })
                if self.tampering.listens() =>
            {
                Some(datagram.clone())
            }
            _ => None,
        };
        let sender = || Some((self.sender(self.told_of.as_ref()?)?, self.told_of.as_ref()?));
        let is_genuine = match origin {
            Origin::Genuine => true,
            Origin::Spurious => false,
            Origin::Replayed => {
                sender().is_some_and(|(from, frame)| !self.tampering.has_let_in(from, drone, frame))
            }
        };
        self.admission.told(is_genuine);
    }

    /// Keeps what comes for an actor that hangs, as far as there is room.
    fn wait_for(&mut self, drone: NodeId, message: Message) {
        let waiting_max = self.bounds.waiting_max;
        let backlog = &mut self.drone(drone).backlog;
        if backlog.len() < waiting_max {
            backlog.push_back(message);
        }
    }

    /// Lets something planned happen; whom to step for it, if that is not told by message.
    fn happen(&mut self, planned: Planned) -> Option<Task> {
        match planned {
            Planned::Fly(master) => self.post(master, Envelope::Mission(mission::Input::Fly)),
            Planned::Medium => self.wake_medium(),
            Planned::Arrive {
                to,
                datagram,
                origin,
            } => {
                let covered = datagram.len().saturating_sub(wire::AUTHENTICATOR_LEN);
                let heading = &datagram[..covered.min(HEADING_LEN)];
                self.trace.bytes(self.now, to, Kind::Arrived, heading);
                let source = None;
                let message = Message {
                    envelope: Envelope::Radio(radio::Input::Received {
                        datagram,
                        source,
                        peer: None,
                    }),
                    origin,
                };
                return self.hand_over(to, message);
            }
            Planned::Outcome(outcome) => {
                let told = radio::Input::Outcome {
                    to: self.swarm(outcome.from).member(outcome.to),
                    delivered: outcome.fate == Fate::Delivered,
                    frame: outcome.datagram,
                };
                self.post(outcome.from, Envelope::Radio(told));
            }
            Planned::Wake {
                drone,
                address,
                generation,
            } => {
                return self.drone(drone).wake(address, generation).then_some(Task {
                    drone,
                    address,
                    what: What::Step(Stimulus::Timeout),
                });
            }
            Planned::ComeToRest { drone, generation } => self.come_to_rest(drone, generation),
            Planned::PlaceRadios => self.place_radios(),
            Planned::Drained(drone) => self.drained(drone),
            Planned::PositionFound(drone) => self.find_position(drone),
            Planned::Boot { drone, incarnation } => return self.boot(drone, incarnation),
            Planned::LinkTimeout { drone, by } => self.link_timeout(drone, by),
            Planned::Watchdog { drone, actor, hang } => {
                return self.watchdog_fires(drone, actor, hang);
            }
            Planned::Skew { drone, ppm } => self.skew(drone, ppm),
            Planned::GoOn { drone, hang } => self.go_on(drone, hang),
            Planned::Backlog { drone, incarnation } => self.hand_over_backlog(drone, incarnation),
            Planned::Restart {
                drone,
                address,
                incarnation,
            } => {
                let state = self.drone(drone);
                return (!state.given_up && state.incarnations == incarnation).then_some(Task {
                    drone,
                    address,
                    what: What::Restart,
                });
            }
            Planned::Fault { index, nth } => return self.inject(index, nth),
            Planned::Affects {
                drone,
                fault,
                lasts,
            } => self.affects(drone, fault, lasts),
            Planned::FaultOver { index } => self.is_over_now(index),
            Planned::Steer(master, velocity) => self.steer(master, velocity),
            Planned::Land(master) => self.post(master, Envelope::Mission(mission::Input::Land)),
        }
        None
    }

    /// Overwrites `soon` with the drones whose radios and routings are stepped in the slice of time that has just begun, and
    /// for whose frames; whether one has in which there are many.
    pub(crate) fn look_ahead(&mut self, soon: &mut Vec<(NodeId, Option<NodeId>)>) -> bool {
        if self.heap.newly_begun() < MANY {
            return false;
        }
        soon.clear();
        soon.extend(self.heap.begun().filter_map(|planned| match planned {
            Planned::Arrive { to, datagram, .. } => Some((*to, wire::sender(datagram))),
            Planned::Wake { drone, address, .. } => {
                (*address == Address::Routing).then_some((*drone, None))
            }
            _ => None,
        }));
        for (drone, _) in soon {
            self.drones[drone.0 as usize].read_ahead();
            self.swarm(*drone).recorder.read_ahead(*drone);
        }
        true
    }

    /// Does what a step asked for, in order, and sets the machine's timer.
    pub(crate) fn carry_out(&mut self, drone: NodeId, from: Address, output: &mut StepOutput) {
        if self.checks {
            let (now, kept) = (self.now, &self.drones[drone.0 as usize].checkpoints);
            let effects = &output.effects;
            let found = self.obedience.stepped(now, drone, from, effects, kept);
            self.find(found);
        }
        for effect in output.effects.drain(..) {
            self.effect(drone, effect);
        }
        if self.checks {
            let table = output.occupancy;
            self.find(self.bounds.table(self.now, drone, from, table));
            let is_overdue = output.is_overdue;
            self.find(ProgressChecker::stepped(self.now, drone, from, is_overdue));
        }
        self.set_timer(drone, from, output.deadline);
        let now = self.now;
        let nth = self.drone(drone).count_step(now);
        if let Some(spins) = self.progress.steps(now, drone, from, nth) {
            self.give_up(spins);
        }
    }

    /// Sets a machine's timer, by its drone's own clock.
    fn set_timer(&mut self, drone: NodeId, address: Address, deadline: Option<Timestamp>) {
        let state = self.drone(drone);
        let generation = state.set_timer(address, deadline);
        if let (Some(generation), Some(deadline)) = (generation, deadline) {
            let at = state.clock.when(deadline).max(self.now);
            let wake = Planned::Wake {
                drone,
                address,
                generation,
            };
            self.heap.plan(at, wake);
        }
    }

    fn effect(&mut self, drone: NodeId, effect: Effect) {
        match effect {
            Effect::Post(envelope) => self.post(drone, envelope),
            Effect::Send {
                to,
                frame,
                keep_alive,
            } => {
                self.recorder(drone).sent(drone, keep_alive);
                let to = to.map(|member| self.swarm(drone).number(member));
                self.send(drone, to, &frame);
            }
            // A simulated medium finds drones by their numbers.
            Effect::Locate { .. } => {}
            Effect::Command(command) => {
                #[cfg(test)]
                self.said
                    .push((self.now, drone, crate::twin::Said::Commanded(command)));
                self.command(drone, command);
            }
            Effect::Keep(checkpoint) => self.drone(drone).keep(checkpoint),
            Effect::Observe(seen) => {
                #[cfg(test)]
                self.said
                    .push((self.now, drone, crate::twin::Said::Seen(seen.clone())));
                let seen = self.swarm(drone).renumbered(seen);
                self.observe(drone, &seen);
            }
        }
    }

    fn post(&mut self, drone: NodeId, envelope: Envelope) {
        if self.behind.is_some() {
            return self.tell_elsewhere(drone, &envelope);
        }
        if let Envelope::Routing(routing::Input::Heard { .. }) = envelope {
            self.recorder(drone).received(drone);
            if self.checks {
                let found = self.admission.lets_in(self.now, drone);
                self.find(found);
            }
            if let Some(frame) = self.told_of.take()
                && let Some(from) = self.sender(&frame)
            {
                self.tampering.let_in(from, drone, &frame);
            }
        }
        let message = Message {
            envelope,
            origin: Origin::Genuine,
        };
        self.enqueue(drone, message);
    }

    fn enqueue(&mut self, drone: NodeId, message: Message) {
        let waiting = self.drone(drone).queue(message.envelope.address());
        if self.checks {
            let found = self.bounds.queue(self.now, drone, waiting);
            self.find(found);
        }
        self.inbox.push_back((drone, message));
    }

    fn observe(&mut self, drone: NodeId, observation: &Observation) {
        self.trace
            .value(self.now, drone, Kind::Observed, observation);
        match observation {
            Observation::Mission(event) => {
                let now = self.now;
                let found = self.election.observe(now, drone, event);
                self.find(found);
                let leader = self.election.leader(drone);
                let found = self.arming.observe(now, drone, event, leader);
                self.find(found);
                if self.checks && matches!(event, mission::Event::State(State::Finished)) {
                    // Its last frame may reach a drone that has come near since they were looked at.
                    self.look_at_links_before_silence();
                }
                if matches!(event, mission::Event::State(_)) {
                    self.process_changes += 1;
                }
                let mut awaited = BTreeSet::new();
                if self.checks && matches!(event, mission::Event::Opened { .. }) {
                    self.look_at_links();
                    awaited = self.awaited_by(drone);
                }
                let barrier = &mut self.swarm_mut(drone).barrier;
                let found = barrier.observe(now, drone, event, leader, || awaited);
                self.find(found);
                self.recorder(drone).mission(now, drone, event);
                self.occurs_to(drone, event);
                if let mission::Event::Obeys(ballot) = event
                    && ballot.is_elected()
                {
                    self.look_at_elections();
                }
                if *event == mission::Event::State(State::Following)
                    && drone == self.swarm(drone).recorder.centre()
                {
                    self.follow_begins(drone);
                }
            }
            Observation::Routing(event) => self.recorder(drone).routing(drone, event),
            Observation::Radio(event) => self.recorder(drone).radio(event),
        }
    }

    /// An actor failed: drops what waits for it and carries the verdict out.
    pub(crate) fn failed(&mut self, drone: NodeId, address: Address, decision: RestartDecision) {
        self.trace
            .value(self.now, drone, Kind::Failed, &(address, decision));
        if self.crashing.take() != Some((drone, address)) {
            self.find(Some(unplanned_failure(self.now, drone, address)));
        }
        self.process_changes += 1;
        self.drone(drone).take_down(address);
        self.inbox
            .retain(|(to, it)| *to != drone || it.envelope.address() != address);
        self.drone(drone).clear_queue(address);
        match decision {
            RestartDecision::Restart { at } => {
                self.recorder(drone).restarts(drone);
                let at = self.drone(drone).clock.when(at).max(self.now);
                let incarnation = self.drone(drone).incarnations;
                let restart = Planned::Restart {
                    drone,
                    address,
                    incarnation,
                };
                self.heap.plan(at, restart);
            }
            RestartDecision::GiveUp => {
                self.recorder(drone).given_up(drone);
                self.swarm_mut(drone).barrier.given_up(drone);
                let actors = self.drone(drone);
                actors.given_up = true;
                for effect in last_resort(|address| actors.is_up(address)) {
                    self.effect(drone, effect);
                }
            }
        }
    }

    /// What happens to a drone may be what a fault waits for.
    fn occurs_to(&mut self, drone: NodeId, event: &mission::Event) {
        match *event {
            mission::Event::State(State::WaypointReached { waypoint }) => {
                self.occurs(drone, Trigger::Waypoint(waypoint));
            }
            mission::Event::Landing(_) => self.occurs(drone, Trigger::Landing),
            mission::Event::Obeys(ballot) if ballot.is_elected() && ballot.master == drone => {
                self.occurs(drone, Trigger::Elected);
            }
            _ => {}
        }
    }

    /// An actor is about to be built.
    pub(crate) fn starting(&mut self, drone: NodeId, address: Address) {
        self.trace.value(self.now, drone, Kind::Started, &address);
        self.arming.starting(drone, address);
        self.process_changes += 1;
        self.drone(drone).bring_up(address);
        if self.recorder(drone).is_electing() && self.passes_on(drone) {
            // Those that hear only this drone may have a master again.
            self.look_at_elections();
        }
    }

    /// The end of the run: last checks, and what came of it.
    pub(crate) fn finish(mut self) -> Outcome {
        for id in (0..).map(NodeId).take(self.vehicles.len()) {
            self.path_ends(id);
        }
        if self.violation.is_none() && self.checks {
            let armed = (0..)
                .map(NodeId)
                .zip(&self.vehicles)
                .filter(|(_, vehicle)| vehicle.is_armed())
                .map(|(id, _)| id)
                .collect();
            self.violation = check_landed(self.now, armed);
        }
        let mut vehicles = self.vehicles.into_iter();
        let flown = self.swarms.into_iter().map(|swarm| Flown {
            vehicles: vehicles.by_ref().take(swarm.ids().count()).collect(),
            recorder: swarm.recorder,
        });
        Outcome {
            swarms: flown.collect(),
            trace: self.trace.finish(),
            ended: self.now,
            medium: self.medium.counters(),
            closest_m: self.separation.closest_m(),
            violations: self.violation.into_iter().collect(),
            struck: self.struck,
        }
    }

    fn find(&mut self, found: Option<Violation>) {
        if self.violation.is_none() && self.checks {
            self.violation = found;
        }
    }

    fn drone(&mut self, id: NodeId) -> &mut Drone {
        &mut self.drones[id.0 as usize]
    }
}

/// What each drone of a scenario is built with, in the order of their numbers; each knows itself by its swarm's.
pub(crate) fn blueprints(scenario: &Scenario) -> Vec<Blueprint> {
    let swarms = (muster_runtime::plan::Plan::FIRST_SWARM.0..).map(SwarmId);
    swarms
        .zip(scenario.swarms())
        .flat_map(|(id, (swarm, _))| {
            (0..swarm.plan.nodes()).map(move |member| swarm.plan.blueprint(id, NodeId(member)))
        })
        .collect()
}
