//! The swarm protocol: leadership, the swarm's next step, and landing.

mod change;
mod checkpoint;
mod config;
mod election;
mod failsafe;
mod follow;
mod goal;
mod hold;
mod interface;
mod master;
mod member;
mod notices;
mod task;

pub use checkpoint::{
    Checkpoint, Deadlines, Elected, Followed, KnownPlan, Landing, Lead, Lockstep, Orders, Progress,
    RoutesPhase, State,
};
pub use config::{Alone, Barrier, Conduct, Config, Liveness, Succession};
pub use follow::Following;
pub use hold::{Hold, HoldTooLong, Holds};
pub use interface::{Event, Input, LandingReason, Transmit};

use crate::flaw::{self, Flaw};
use crate::formation::{FlightPlan, Layout};
use crate::identity::NodeSet;
use crate::machine::{Machine, Outbox, Output};
use crate::navigation::{Goal, Notice as NavigationNotice};
use crate::stall::StallDetector;
use crate::time::Timestamp;
pub use crate::wire::{Order, Step};

/// A swarm protocol, run by a drone's mission actor. [`Mission`] is one; a [`Host`](crate::agent::Host) is [`Mission`] with
/// an agent.
///
/// It must lead to the ground whatever happens: only [`Goal::Land`](crate::navigation::Goal::Land) disarms.
pub trait Protocol: Machine<Input = Input, Transmit = Transmit, Event = Event> + Send {
    /// Number of entries in the fullest table, and that table's limit.
    fn occupancy(&self) -> (usize, usize);
}

impl Protocol for Mission {
    fn occupancy(&self) -> (usize, usize) {
        (self.durable.plan.waypoints.len(), self.config.waypoints_max)
    }
}

/// The mission state machine of one drone.
#[derive(Debug, Clone)]
pub struct Mission {
    config: Config,
    durable: Checkpoint,
    /// Since when the master is silent. `None` while it is heard.
    master_silent: Option<Timestamp>,
    /// Whether the silent master has announced that it lands.
    master_lands: bool,
    stall_detector: StallDetector,
    /// Drones on task, as far as is known. Empty before the task.
    drones_on_task: NodeSet,
    /// The goal that the navigation was given last.
    given_goal: Option<Goal>,
    /// Whether it was given a goal out of lockstep since it started.
    is_apart: bool,
    outbox: Outbox<Transmit, Event>,
}

impl Mission {
    /// A mission in the state of `checkpoint`, or in [`State::Start`] without one.
    #[must_use]
    pub fn new(config: Config, checkpoint: Option<Checkpoint>) -> Self {
        let mut mission = Self {
            config,
            durable: Checkpoint::default(),
            master_silent: None,
            master_lands: false,
            stall_detector: StallDetector::default(),
            drones_on_task: NodeSet::default(),
            given_goal: None,
            is_apart: false,
            outbox: Outbox::new(),
        };
        if let Some(checkpoint) = checkpoint {
            mission.durable = checkpoint;
            if let Some(lead) = &mut mission.durable.lead {
                // The routing repeats who is silent, not who has returned meanwhile.
                lead.silent = NodeSet::default();
            }
            if mission.is_on_task() {
                // The newest order, which the routing repeats, has the others.
                mission.drones_on_task = mission.config.id.into();
            }
            if mission.durable.restarted {
                mission.begin_incarnation();
            }
            let inform = if mission.is_independent() {
                Transmit::Leave
            } else {
                Transmit::Resync
            };
            mission.outbox.transmit(inform);
            mission.send_goal();
        }
        mission
    }

    /// Resumes after a restart of the process. On the ground the drone stays there, in the air it catches up.
    fn begin_incarnation(&mut self) {
        match self.durable.state {
            State::SetUp => self.stay_on_ground(LandingReason::Restarted),
            // Still in lockstep: the others are in their own sectors, or ahead of and behind it on the same leg.
            State::ChangingFormation { .. } | State::MovingToWaypoint { .. } => {}
            State::TakingOff if self.is_below_take_off_waves() => {}
            state if state.is_on_mission() => self.leave_lockstep(),
            _ => {}
        }
        self.checkpoint();
    }

    /// Whether the master is silent and no other has replaced it.
    #[must_use]
    pub const fn is_master_silent(&self) -> bool {
        self.master_silent.is_some()
    }

    fn checkpoint(&mut self) {
        if self.is_elected_epoch() && flaw::has(Flaw::LosesCheckpoints) {
            return;
        }
        let checkpoint = Box::new(self.durable.clone());
        self.outbox.event(Event::Checkpoint(checkpoint));
    }

    fn enter(&mut self, state: State) {
        if self.durable.state != state {
            self.durable.state = state;
            if matches!(state, State::WaypointReached { .. }) {
                self.durable.progress.wave = None;
            }
            self.outbox.event(Event::State(state));
        }
    }

    /// The known part of the mission.
    fn flight_plan(&self) -> FlightPlan<'_> {
        FlightPlan {
            layout: &self.config.layout,
            changes: &self.config.changes,
            waypoints: &self.durable.plan.waypoints,
        }
    }

    /// The current layout: slots, stands and landing places after the completed changes.
    fn layout(&self) -> &Layout {
        self.flight_plan()
            .layout_after(self.durable.progress.changes)
    }

    fn send_goal(&mut self) {
        if let Some(goal) = self.goal() {
            self.give_goal(goal);
        }
    }

    fn give_goal(&mut self, goal: Goal) {
        if !self.is_apart && self.is_out_of_lockstep(goal) {
            self.is_apart = true;
            self.outbox.event(Event::LeftLockstep);
        }
        self.given_goal = Some(goal);
        self.outbox.transmit(Transmit::Goal(goal));
    }

    /// Announces the landing to the others and descends on the spot. Nobody awaits it on the ground.
    fn announce_and_descend(&mut self, reason: LandingReason) {
        self.outbox.transmit(Transmit::Land);
        self.descend(reason);
    }

    /// Descends on the spot, without an announcement to the others.
    fn descend(&mut self, reason: LandingReason) {
        self.durable.landing.reason.get_or_insert(reason);
        self.enter(State::Landing);
        self.outbox.event(Event::Landing(reason));
        self.durable.deadlines.limit = None;
        self.send_goal();
    }

    fn start_take_off(&mut self, now: Timestamp) {
        self.durable.deadlines.limit = Some(now + self.config.take_off_limit);
        self.durable.deadlines.flight_ends_at = Some(now + self.config.flight_time);
        self.enter(State::TakingOff);
        self.outbox.transmit(Transmit::TopologyChanges);
        self.send_goal();
    }

    fn start_leg(&mut self, now: Timestamp, waypoint: u16) {
        self.enter(State::MovingToWaypoint { waypoint });
        let has_fallen_behind = self.durable.progress.opened > Some(waypoint);
        if self.durable.lockstep.in_layer || self.is_elected_epoch() || has_fallen_behind {
            self.leave_lockstep();
        }
        // The leg begins with the climb.
        self.durable.lockstep.climbs = false;
        self.durable.deadlines.limit = Some(now + self.config.leg_limit);
        self.send_goal();
    }

    /// Whether the current leader was elected. Some drones may then be out of lockstep with this one.
    pub(super) fn is_elected_epoch(&self) -> bool {
        let ballot = self.durable.leader.ballot();
        ballot.is_some_and(|it| it.is_elected())
    }

    /// Flies in its own altitude layer from now on. The links to the others may change by that. At a waypoint it climbs
    /// above its slot; on a leg it does so at the end.
    pub(super) fn leave_lockstep(&mut self) {
        if !std::mem::replace(&mut self.durable.lockstep.in_layer, true) {
            self.durable.lockstep.climbs = self.is_at_waypoint()
                || matches!(self.durable.state, State::MovingToWaypoint { .. });
            self.climb_if_at_waypoint();
        }
        self.outbox.transmit(Transmit::TopologyChanges);
    }

    /// Whether the drone is in its slot at a waypoint, or climbs above it.
    fn is_at_waypoint(&self) -> bool {
        match self.durable.state {
            State::TakingOff => !self.is_taking_off(),
            State::NeighbourDiscovery | State::HopUpdate | State::WaypointReached { .. } => true,
            _ => false,
        }
    }

    fn climb_if_at_waypoint(&mut self) {
        if self.durable.lockstep.climbs && self.is_at_waypoint() {
            self.send_goal();
        }
    }

    /// Acknowledges the pending order, at a waypoint once the drone is in its layer there.
    pub(super) fn complete_order_at_waypoint(&mut self) {
        if !self.climbs_at_waypoint() {
            self.complete_order();
        }
    }

    /// Whether the drone has reached its waypoint and climbs into its layer there.
    pub(super) fn climbs_at_waypoint(&self) -> bool {
        let is_reached = matches!(self.durable.state, State::WaypointReached { .. });
        is_reached && self.durable.lockstep.climbs
    }

    /// Whether later take-off waves may fly over the drone's slot. A climb from there would cross their paths.
    fn is_below_take_off_waves(&self) -> bool {
        self.durable.state == State::TakingOff && self.layout().take_off_waves() > 1
    }

    /// Moves a waiting drone into its own layer if drones out of lockstep may pass.
    pub(super) fn hold_in_layer_if_needed(&mut self) {
        let is_needed = match self.durable.state {
            State::WaypointReached { .. }
            | State::TakingOff
            | State::NeighbourDiscovery
            | State::HopUpdate => {
                self.is_elected_epoch() && !self.is_taking_off() && !self.is_below_take_off_waves()
            }
            // The others may cross over it next.
            State::ChangingFormation {
                step: Step::Climb, ..
            } => self.durable.orders.pending.is_none() && self.master_silent.is_some(),
            _ => false,
        };
        if is_needed && !self.durable.lockstep.in_layer {
            self.leave_lockstep();
            if !self.is_at_waypoint() {
                self.send_goal();
            }
        }
    }

    fn handle_arrival(&mut self, now: Timestamp, goal: Goal) {
        // The mission may have set another one meanwhile.
        if self.given_goal != Some(goal) {
            return;
        }
        if self.is_at_waypoint() && matches!(goal, Goal::TransitTo { .. }) {
            self.durable.lockstep.climbs = false;
        }
        match self.durable.state {
            State::TakingOff => {
                // A master's limit bounds its wait for the members.
                if self.durable.lead.is_none() {
                    self.durable.deadlines.limit = None;
                }
                self.complete_order();
                self.enter_routes_state();
            }
            State::MovingToWaypoint { waypoint } => {
                // A master waits no longer than the members' legs may take.
                let is_master = self.durable.lead.is_some();
                self.durable.deadlines.limit = is_master.then(|| now + self.config.leg_limit);
                self.enter(State::WaypointReached { waypoint });
                self.climb_if_at_waypoint();
                if self.durable.progress.opened <= Some(waypoint)
                    && self.durable.lockstep.catches_up
                {
                    self.durable.lockstep.catches_up = false;
                    self.outbox.transmit(Transmit::Resync);
                }
            }
            State::WaypointReached { .. } => {}
            State::ChangingFormation { change, step } => self.complete_step(now, change, step),
            State::Following => self.complete_following_leg(now),
            State::Assembling => self.complete_order(),
            State::MovingToLand => {
                if self.durable.landing.reason.is_some() {
                    self.outbox.transmit(Transmit::Land);
                }
                self.durable.deadlines.limit = None;
                self.enter(State::Landing);
                self.send_goal();
            }
            _ => return,
        }
        self.advance(now);
    }

    /// Acknowledges the pending order.
    fn complete_order(&mut self) {
        if let Some(sequence) = self.durable.orders.pending.take() {
            self.acknowledge(sequence);
        }
    }

    fn acknowledge(&mut self, sequence: u32) {
        if self.durable.orders.acknowledge(sequence) {
            self.send_acknowledgement();
        }
    }

    fn send_acknowledgement(&mut self) {
        if let Some(ballot) = self.durable.leader.ballot() {
            let sequence = self.durable.orders.acknowledged;
            self.outbox
                .transmit(Transmit::Acknowledge { ballot, sequence });
        }
    }

    fn handle_touchdown(&mut self, now: Timestamp) {
        let is_awaited = self.is_awaited_on_ground();
        match self.durable.state {
            State::Start | State::SetUp | State::Finished => return,
            State::Landing => {}
            _ => self.land_on_the_spot(LandingReason::Controller),
        }
        self.enter(State::Finished);
        if is_awaited {
            // Its announcement was held back until now. It repeats it for a while, as frames may be lost: without it the others
            // miss a drone in flight.
            self.outbox.transmit(Transmit::Land);
            self.complete_order();
            self.durable.deadlines.limit = Some(now + self.config.spreading_grace);
        } else {
            self.complete_order();
            self.outbox.transmit(Transmit::Stop);
        }
    }

    /// The flight controller lands the drone without a command, or its pilot flies it.
    fn handle_uncommanded_landing(&mut self, reason: LandingReason) {
        if self.durable.state.is_on_mission() || self.durable.state == State::MovingToLand {
            self.land_on_the_spot(reason);
        }
    }

    /// Takes the next steps that the current state allows.
    fn advance(&mut self, now: Timestamp) {
        if self.land_separately_if_due(now) {
            return;
        }
        self.hold_in_layer_if_needed();
        if self.durable.lead.is_some() {
            self.advance_as_master(now);
        } else {
            self.advance_as_member(now);
        }
        self.update_drones_on_task();
    }

    /// Ends the mission of this drone: in the air it lands on the spot, on the ground it stays there.
    fn abort(&mut self, reason: LandingReason) {
        match self.durable.state {
            State::Landing | State::Finished => {}
            State::Start | State::SetUp => self.stay_on_ground(reason),
            _ => self.land_on_the_spot(reason),
        }
    }

    /// Extends the limits by the duration of a stall of the host, as awaited inputs may be late.
    fn extend_limits_after_stall(&mut self, now: Timestamp) {
        if let Some(stall) = self.stall_detector.stalled_for(now) {
            self.durable.deadlines.limit = self
                .durable
                .deadlines
                .limit
                .map(|limit| limit.max(now) + stall);
            self.master_silent = self.master_silent.map(|_| now);
        }
    }

    fn deadline(&self) -> Option<Timestamp> {
        let deadlines = [
            self.durable.deadlines.limit,
            self.durable.deadlines.flight_ends_at,
            self.next_fix(),
            self.succession_at(),
            self.silence_tolerated_until(),
            self.hold_ends_at(),
        ];
        deadlines.into_iter().flatten().min()
    }
}

impl Machine for Mission {
    type Input = Input;
    type Transmit = Transmit;
    type Event = Event;

    fn handle_input(&mut self, now: Timestamp, input: Input) {
        self.extend_limits_after_stall(now);
        match input {
            Input::Fly => self.start_mission(now),
            Input::Land => self.end_following(),
            Input::Routing(notice) => {
                self.handle_routing(now, notice);
                self.advance(now);
            }
            Input::Navigation(NavigationNotice::Arrived(goal)) => self.handle_arrival(now, goal),
            Input::Navigation(NavigationNotice::Position { position, velocity }) => {
                self.handle_position(now, position, velocity);
            }
            Input::Navigation(NavigationNotice::UncommandedLanding(cause)) => {
                self.handle_uncommanded_landing(cause.into());
            }
            Input::Navigation(NavigationNotice::Landed) => self.handle_touchdown(now),
            Input::Navigation(NavigationNotice::Failing {
                failure,
                stop,
                is_airborne,
            }) => self.handle_failure(now, failure, stop, is_airborne),
            Input::Navigation(NavigationNotice::Resync) => self.send_goal(),
            Input::GiveUp => self.abort(LandingReason::ActorGivenUp),
            Input::Abort(reason) => self.abort(reason),
        }
        self.checkpoint();
        self.stall_detector.expect_step(now, self.deadline());
    }

    fn handle_timeout(&mut self, now: Timestamp) {
        self.extend_limits_after_stall(now);
        self.end_flight_if_due(now);
        self.end_silence_tolerance_if_due(now);
        self.end_hold_if_due(now);
        let is_succession_due = self.succession_at().is_some_and(|at| at <= now);
        if is_succession_due && !flaw::has(Flaw::SetsPastDeadline) {
            self.start_succession(now);
            self.checkpoint();
        }
        if self
            .durable
            .deadlines
            .limit
            .is_some_and(|limit| limit <= now)
        {
            self.durable.deadlines.limit = None;
            let is_moving = matches!(self.durable.state, State::Following | State::MovingToLand);
            if self.durable.state == State::Finished {
                self.outbox.transmit(Transmit::Stop);
            } else if self.durable.orders.pending.is_some() || is_moving {
                self.land_on_the_spot(LandingReason::Overdue);
            } else {
                self.leave_out_late_members();
                self.advance(now);
            }
            self.checkpoint();
        }
        // Any of the above may have started the following, whose first position is due at once.
        self.locate_if_due(now);
        self.stall_detector.expect_step(now, self.deadline());
    }

    fn poll_output(&mut self) -> Output<Transmit, Event> {
        self.outbox.poll(self.deadline())
    }
}

#[cfg(test)]
mod tests;
