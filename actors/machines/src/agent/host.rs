//! Runs a drone's agent inside the swarm protocol.

use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use bytes::Bytes;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::requests::Requests;
use super::runner::{Factory, Failed, Runner};
use super::timers::Timers;
use super::waiting::Waiting;
use super::{Agent, Checkpoint, Context, MessageId, SwarmEvent, TELEMETRY_MIN, Telemetry};
use crate::geometry::{Ned, Velocity};
use crate::identity::{NodeId, NodeSet};
use crate::machine::{Machine, Outbox, Output};
use crate::mission::{Event, Input, LandingReason, Mission, Protocol, Transmit};
use crate::navigation::{Goal, Notice as NavigationNotice};
use crate::routing::Notice as RoutingNotice;
use crate::supervision::RestartLimits;
use crate::time::Timestamp;

/// Configuration of an agent's host.
#[derive(Debug, Clone)]
pub struct Config {
    /// The drone.
    pub id: NodeId,
    /// Number of drones of the swarm.
    pub drones: u32,
    /// The drone's slot at waypoint 0.
    pub slot: Ned,
    /// Waypoints of the mission file.
    pub waypoints: Arc<[Ned]>,
    /// Highest altitude that the agent may fly to, in metres above home.
    pub altitude_max_m: f64,
    /// Period of [`Agent::telemetry`], unless the agent sets one.
    pub telemetry: Duration,
    /// Builds the agent.
    pub factory: Factory,
    /// How often the agent may fail.
    pub restarts: RestartLimits,
}

/// What the context shows and changes.
#[derive(Debug)]
pub(super) struct State {
    pub(super) config: Config,
    pub(super) durable: Checkpoint,
    pub(super) rng: ChaCha8Rng,
    pub(super) timers: Timers,
    pub(super) drones_on_task: NodeSet,
    pub(super) leader: NodeId,
    pub(super) position: Ned,
    pub(super) requests: Requests,
}

impl State {
    /// Forgets what a failed agent asked for.
    fn discard(&mut self) {
        self.requests.discard();
        self.timers.clear();
    }
}

/// The swarm protocol, and the agent that flies the drone while it is on task.
///
/// Invariant: the agent runs on task only; its checkpoint is emitted before whatever its step sends.
pub struct Host {
    mission: Mission,
    runner: Runner,
    state: State,
    /// Whether the agent was told of the leader and the drones on task.
    is_informed: bool,
    is_leader_silent: bool,
    /// Period of [`Agent::telemetry`]; `None`: on arrival only.
    telemetry: Option<Duration>,
    /// `None` while the agent doesn't run, and without a period.
    next_telemetry: Option<Timestamp>,
    /// Whether the agent, resumed in flight, waits for the drone's position to start.
    awaits_position: bool,
    /// When the agent was last told that the drone has arrived.
    arrival_reported: Option<Timestamp>,
    /// When it is told again, of a goal at which the drone rests already.
    next_arrival: Option<Timestamp>,
    waiting: Waiting,
    /// Whether the agent's durable state has changed in this step.
    has_changed: bool,
    outbox: Outbox<Transmit, Event>,
}

impl fmt::Debug for Host {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Host")
            .field("mission", &self.mission)
            .field("state", &self.state)
            .finish_non_exhaustive()
    }
}

impl Host {
    /// Resumes the agent from its checkpoint, in a mission that was resumed from its own. `seed` seeds the agent's random
    /// generator.
    #[must_use]
    pub fn new(
        config: Config,
        mission: Mission,
        checkpoint: Option<Checkpoint>,
        seed: u64,
    ) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let runner = Runner::new(config.factory.clone(), config.restarts);
        let awaits_position = checkpoint.is_some();
        let state = State {
            durable: checkpoint.unwrap_or_default(),
            timers: Timers::default(),
            drones_on_task: config.id.into(),
            leader: config.id,
            position: config.slot,
            // Reports on messages that were sent before a restart must not meet new ones.
            requests: Requests::new(rng.random()),
            rng,
            config,
        };
        Self {
            mission,
            runner,
            telemetry: Some(state.config.telemetry),
            state,
            is_informed: false,
            is_leader_silent: false,
            next_telemetry: None,
            awaits_position,
            arrival_reported: None,
            next_arrival: None,
            waiting: Waiting::default(),
            has_changed: false,
            outbox: Outbox::new(),
        }
    }

    #[cfg(test)]
    pub(super) fn replace_factory(&mut self, factory: Factory) {
        self.runner.replace_factory(factory);
    }

    #[cfg(test)]
    pub(super) const fn mission(&self) -> &Mission {
        &self.mission
    }

    /// Calls the agent, then carries out what it asked for.
    fn call(&mut self, now: Timestamp, call: impl FnOnce(&mut dyn Agent, &mut Context<'_>)) {
        match self.runner.call(now, &mut self.state, call) {
            Ok(()) => self.carry_out(now),
            Err(failed) => self.fail(failed),
        }
    }

    /// Starts the agent if that is due, and gives it the messages that waited for it. Returns whether it was due.
    fn start_if_due(&mut self, now: Timestamp) -> bool {
        match self.runner.start_if_due(now, &mut self.state) {
            Ok(true) => {
                self.telemetry = Some(self.state.config.telemetry);
                self.next_telemetry = Some(now);
                // Navigation tells again of an arrival, which a failed agent may have missed.
                if self.destination().is_some() {
                    self.repeat_goal();
                }
                self.carry_out(now);
                while self.is_running()
                    && let Some((from, payload)) = self.waiting.pop()
                {
                    self.call(now, |agent, context| agent.message(from, &payload, context));
                }
                true
            }
            Ok(false) => false,
            Err(failed) => {
                self.fail(failed);
                true
            }
        }
    }

    /// Sends the agent's last goal to navigation once more.
    fn repeat_goal(&mut self) {
        if let Some(goal) = self.state.durable.goal {
            self.outbox.transmit(Transmit::Goal(goal));
        }
    }

    /// Reports a failed agent. Lands the drone if it failed too often.
    fn fail(&mut self, failed: Failed) {
        self.state.discard();
        self.next_telemetry = None;
        self.next_arrival = None;
        self.outbox.event(Event::AgentFailed(failed.what));
        if failed.is_given_up {
            self.mission.end_task(LandingReason::ActorGivenUp);
            self.take_mission_outputs();
        }
    }

    /// Carries out what the agent asked for.
    fn carry_out(&mut self, now: Timestamp) {
        if let Some(period) = self.state.requests.take_telemetry() {
            self.telemetry = period;
            self.next_telemetry = period.map(|it| now + it);
        }
        let goal = self.state.requests.take_goal();
        let kept = self.state.requests.take_kept();
        if let Some(goal) = goal {
            self.next_arrival = None;
            self.state.durable.goal = Some(goal);
            self.outbox.transmit(Transmit::Goal(goal));
        }
        if goal.is_some() || kept.is_some() {
            self.state.durable.kept = kept.or(self.state.durable.kept.take());
            self.has_changed = true;
        }
        for observed in self.state.requests.drain_observed() {
            self.outbox.event(Event::Observed(observed));
        }
        if let Some(messages) = self.state.requests.take_messages() {
            self.outbox.transmit(Transmit::Messages(messages));
        }
        if self.state.requests.take_leaving() {
            self.mission.leave();
            self.take_mission_outputs();
            self.is_leader_silent = false;
        }
        if self.state.requests.take_landing() {
            self.mission.end_task(LandingReason::MissionOver);
            self.take_mission_outputs();
        }
    }

    /// Emits a checkpoint before all other outputs of the step, if the agent's durable state changed.
    fn emit_checkpoint(&mut self) {
        if std::mem::take(&mut self.has_changed) {
            let checkpoint = Box::new(self.state.durable.clone());
            self.outbox.event_first(Event::AgentCheckpoint(checkpoint));
        }
    }

    /// Passes on what the mission sends.
    fn take_mission_outputs(&mut self) {
        loop {
            match self.mission.poll_output() {
                Output::Transmit(transmit) => self.outbox.transmit(transmit),
                Output::Event(event) => self.outbox.event(event),
                Output::Idle { .. } => return,
            }
        }
    }

    /// After each step of the mission: starts or stops the agent, and reports changes in the swarm.
    fn follow_mission(&mut self, now: Timestamp) {
        self.take_mission_outputs();
        if !self.mission.is_on_task() {
            if self.is_informed {
                self.runner.stop();
                self.waiting.clear();
            }
            return;
        }
        let is_silent = self.mission.is_master_silent();
        let leader = self.mission.leader().unwrap_or(self.state.leader);
        if !self.is_informed {
            self.is_informed = true;
            self.is_leader_silent = is_silent;
            self.state.leader = leader;
            self.state.drones_on_task = self.mission.drones_on_task().clone();
            if self.awaits_position {
                self.repeat_goal();
                self.outbox.transmit(Transmit::Locate);
            } else {
                self.start_if_due(now);
            }
            return;
        }
        if leader != std::mem::replace(&mut self.state.leader, leader) {
            self.swarm(now, SwarmEvent::LeaderChanged(leader));
        }
        if is_silent != std::mem::replace(&mut self.is_leader_silent, is_silent) {
            self.swarm(
                now,
                if is_silent {
                    SwarmEvent::LeaderSilent
                } else {
                    SwarmEvent::LeaderReturned
                },
            );
        }
        self.report_drones_on_task(now);
    }

    fn report_drones_on_task(&mut self, now: Timestamp) {
        let on_task = self.mission.drones_on_task();
        if *on_task == self.state.drones_on_task {
            return;
        }
        let lost = self.state.drones_on_task.difference(on_task);
        let joined = on_task.difference(&self.state.drones_on_task);
        self.state.drones_on_task = on_task.clone();
        if !lost.is_empty() {
            self.swarm(now, SwarmEvent::MembersLost(lost));
        }
        if !joined.is_empty() {
            self.swarm(now, SwarmEvent::MembersJoined(joined));
        }
    }

    fn swarm(&mut self, now: Timestamp, event: SwarmEvent) {
        // A method before this one may have landed the drone.
        if self.mission.is_on_task() {
            self.call(now, |agent, context| agent.swarm(event, context));
        }
    }

    fn may_start(&self) -> bool {
        self.mission.is_on_task() && !self.awaits_position
    }

    fn is_running(&self) -> bool {
        self.runner.is_running() && self.mission.is_on_task()
    }

    fn handle_telemetry(
        &mut self,
        now: Timestamp,
        (position, velocity): (Ned, Velocity),
        has_arrived: bool,
    ) {
        self.state.position = position;
        if self.is_running() {
            let telemetry = Telemetry {
                position,
                velocity,
                has_arrived,
            };
            self.call(now, |agent, context| agent.telemetry(&telemetry, context));
        }
    }

    /// Passes a message on. An agent that is to start gets it then.
    fn handle_message(&mut self, now: Timestamp, from: NodeId, payload: Bytes) {
        let is_over = self.is_informed && !self.mission.is_on_task();
        if self.is_running() {
            self.call(now, |agent, context| agent.message(from, &payload, context));
        } else if !is_over {
            self.waiting.push(from, payload);
        }
    }

    /// Tells the agent that the drone rests at its goal. The next time is [`TELEMETRY_MIN`] later, so that an agent that flies
    /// to where it is does not do so without a pause.
    fn handle_arrival(&mut self, now: Timestamp, at: Ned) {
        let due = (self.arrival_reported).map_or(Timestamp::ZERO, |last| last + TELEMETRY_MIN);
        if now < due {
            self.next_arrival = Some(due);
        } else {
            self.next_arrival = None;
            self.arrival_reported = Some(now);
            self.handle_telemetry(now, (at, Velocity::new(0.0, 0.0, 0.0)), true);
        }
    }

    /// Where the agent's last goal leads to, if the drone comes to rest there.
    const fn destination(&self) -> Option<Ned> {
        match self.state.durable.goal {
            Some(Goal::FlyTo { to, .. }) => Some(to),
            _ => None,
        }
    }

    /// Requests the position if it is due.
    fn locate_if_due(&mut self, now: Timestamp) {
        if let Some(due) = self.next_telemetry.filter(|due| *due <= now) {
            self.next_telemetry = self.telemetry.map(|it| due.next_period(it, now));
            self.outbox.transmit(Transmit::Locate);
        }
    }

    fn deadline(&self, mission: Option<Timestamp>) -> Option<Timestamp> {
        let own = [
            self.next_telemetry,
            self.next_arrival,
            self.state.timers.next(),
        ];
        // The agent may have landed the drone in this step.
        let own = own.into_iter().filter(|_| self.is_running());
        let start = (self.runner.starts_at()).filter(|_| self.may_start());
        own.chain([mission, start]).flatten().min()
    }
}

impl Machine for Host {
    type Input = Input;
    type Transmit = Transmit;
    type Event = Event;

    fn handle_input(&mut self, now: Timestamp, input: Input) {
        match input {
            Input::Routing(RoutingNotice::Message { from, payload }) => {
                self.handle_message(now, from, payload);
            }
            Input::Routing(RoutingNotice::Sent(sent)) => {
                for (id, outcome) in sent {
                    let id = MessageId(id);
                    self.swarm(now, SwarmEvent::MessageSent { id, outcome });
                }
            }
            Input::Navigation(NavigationNotice::Position { position, velocity })
                if self.is_running() =>
            {
                self.handle_telemetry(now, (position, velocity), false);
            }
            Input::Navigation(NavigationNotice::Position { position, .. })
                if self.awaits_position && self.mission.is_on_task() =>
            {
                self.awaits_position = false;
                self.state.position = position;
                self.start_if_due(now);
            }
            Input::Navigation(NavigationNotice::Arrived(goal)) if self.is_running() => {
                // The agent may have set another goal meanwhile.
                let is_current = self.state.durable.goal == Some(goal);
                if let Some(at) = self.destination().filter(|_| is_current) {
                    self.handle_arrival(now, at);
                }
            }
            Input::Navigation(NavigationNotice::Resync) if self.mission.is_on_task() => {
                self.repeat_goal();
                if self.awaits_position {
                    self.outbox.transmit(Transmit::Locate);
                }
            }
            input => self.mission.handle_input(now, input),
        }
        self.follow_mission(now);
        self.emit_checkpoint();
    }

    fn handle_timeout(&mut self, now: Timestamp) {
        self.mission.handle_timeout(now);
        self.follow_mission(now);
        if self.next_arrival.is_some_and(|due| due <= now)
            && let Some(at) = self.destination()
        {
            self.handle_arrival(now, at);
        }
        loop {
            while self.is_running()
                && let Some(timer) = self.state.timers.pop_expired(now)
            {
                self.call(now, |agent, context| agent.timer(timer, context));
            }
            // An agent that fails for the first time is started again at once, and may set a timer that has expired.
            if !(self.may_start() && self.start_if_due(now)) {
                break;
            }
        }
        if self.is_running() {
            self.locate_if_due(now);
        }
        self.emit_checkpoint();
    }

    fn poll_output(&mut self) -> Output<Transmit, Event> {
        if self.outbox.is_empty() {
            let deadline = match self.mission.poll_output() {
                Output::Idle { deadline } => self.deadline(deadline),
                output => return output,
            };
            return Output::Idle { deadline };
        }
        self.outbox.poll(None)
    }
}

impl Protocol for Host {
    fn occupancy(&self) -> (usize, usize) {
        self.mission.occupancy()
    }
}
