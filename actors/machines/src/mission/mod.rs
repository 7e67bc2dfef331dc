//! The swarm protocol: who leads, what the swarm does next, and when a drone comes down.

mod change;
mod durable;
mod election;
mod failsafe;
mod follow;
mod hold;
mod master;
mod member;
mod order;

use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;

use bytes::Bytes;
use serde::{Deserialize, Serialize};

pub use durable::{Checkpoint, Followed, Lead, RoutesPhase, State};
pub use follow::Following;
pub use hold::{Hold, HoldTooLong, Holds};
pub use order::{Order, Step};

use crate::flaw::{self, Flaw};
use crate::formation::{Change, Flown, Layout};
use crate::geometry::Ned;
use crate::identity::{Ballot, NodeId, NodeSet};
use crate::machine::{Machine, Outbox, Output};
use crate::navigation::{Goal, Notice as NavigationNotice};
use crate::routing::Notice as RoutingNotice;
use crate::stall::StallDetector;
use crate::time::Timestamp;
use crate::wire;

/// What a mission is built with.
#[derive(Debug, Clone)]
pub struct Config {
    /// Whose mission this is.
    pub id: NodeId,
    /// Its slot, its landing place, its layer.
    pub layout: Arc<Layout>,
    /// The waypoints to lead the swarm along; none for a drone that was given no mission.
    pub mission: Arc<[Ned]>,
    /// How long the swarm waits at them.
    pub holds: Holds,
    /// The changes of formation on the way, in the order in which they are made.
    pub changes: Arc<[Change]>,
    /// How the master is followed, where it does not lead from waypoint to waypoint.
    pub following: Option<Following>,
    /// For whom a master waits at a waypoint.
    pub barrier: Barrier,
    /// When a silent master or member counts as lost.
    pub liveness: Liveness,
    /// What a drone in the air does once its master counts as lost.
    pub succession: Succession,
    /// What a drone in the air does that hears of nobody else.
    pub alone: Alone,
    /// How much longer a drone that would elect another bears a silent master while the swarm spreads out, when ways are
    /// lost and found again; and any master silent members while it takes off.
    pub spreading_patience: Duration,
    /// How long it leaves it to each drone that would lead rather, but for the one that is missed, to say that it does.
    pub candidacy_back_off: Duration,
    /// How long the master waits for members that do not get ready on the ground.
    pub set_up_limit: Duration,
    /// How long the master waits for members of a wave that do not get to their slots.
    pub take_off_limit: Duration,
    /// How long it waits for members of a wave that do not get to the ground.
    pub landing_limit: Duration,
    /// The longest that a leg may take; a drone that takes longer lands.
    pub leg_limit: Duration,
    /// How long a drone flies at most: then it goes to land as soon as it is in its slot and, if that takes longer than a
    /// leg may, on the spot.
    pub flight_time: Duration,
    /// The most waypoints that a mission may have.
    pub waypoints_max: usize,
}

/// For whom a master waits at a waypoint; on the ground and for the take-off it waits for all in either case.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Barrier {
    /// For every member.
    Strict,
    /// For those that it hears itself, as the thesis's figures say; who is beyond them follows as it is told.
    Neighbours,
}

/// When a silent master or member counts as lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Liveness {
    /// Once the master's own number, or the member's own, has not risen for the time to live, wherever the drone is.
    Heartbeat,
    /// Likewise, but looked at only while waiting at a waypoint, as the thesis does.
    Thesis,
}

/// What a drone in the air does once its master counts as lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Succession {
    /// It leads whoever hears it, unless it hears of a better claim.
    Elect,
    /// It lands, at the end of the way that it is on.
    Land,
}

/// What a drone in the air does that leads and has not heard of any other for the time to live.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Alone {
    /// It flies on, a swarm of one.
    CarryOn,
    /// It goes to land from the waypoint that it is at or makes for.
    Land,
}

/// What a mission is told.
#[derive(Debug, Clone, PartialEq)]
pub enum Input {
    /// By the operator, to the drone at the centre slot: lead the swarm along its mission.
    Fly,
    /// By the operator, to a master that is followed: stop, let all assemble, and land.
    Land,
    /// By the routing.
    Routing(RoutingNotice),
    /// By the navigation.
    Navigation(NavigationNotice),
    /// By the supervisor: an actor can't be kept alive and the drone is being landed.
    GiveUp,
    /// By whoever runs the drone: come down on the spot, or stay on the ground, for this reason.
    ComeDown(LandingReason),
}

/// What a mission sends.
#[derive(Debug, Clone, PartialEq)]
pub enum Transmit {
    /// To the routing: this drone is the master.
    Lead(Ballot),
    /// To the routing, as master: a new order.
    Publish {
        /// Under which ballot of its own.
        ballot: Ballot,
        /// Its number.
        sequence: u32,
        /// The order, encoded.
        order: Bytes,
    },
    /// To the routing: this order and all before it are carried out.
    Acknowledge {
        /// Whose order it is.
        ballot: Ballot,
        /// The order's number.
        sequence: u32,
    },
    /// To the routing, as master: start neighbour discovery.
    Discover,
    /// To the routing: the drones change places.
    Scatter,
    /// To the routing: this drone is going to land.
    Land,
    /// To the routing: this drone is done.
    Stop,
    /// To the routing: tell me again what I should know.
    Resync,
    /// To the navigation.
    Goal(Goal),
    /// To the navigation: tell me where I am.
    Locate,
}

/// Why a drone comes down.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum LandingReason {
    /// The mission is over.
    MissionOver,
    /// The master is silent.
    MasterSilent,
    /// The drone was not in its slot when the swarm moved on.
    Late,
    /// A leg took longer than it may.
    Overdue,
    /// An actor of the drone can't be kept alive.
    ActorGivenUp,
    /// The drone's process restarted on the ground: it stays there.
    Restarted,
    /// Its flight controller brings it down, or has brought it down, by itself.
    Controller,
    /// It had not heard of any other drone for the time to live.
    Alone,
    /// It was about to leave the geofence.
    Geofence,
    /// Its battery was low.
    BatteryLow,
    /// It did not know where it was.
    PositionLost,
    /// Its battery was all but empty.
    BatteryCritical,
    /// It had flown for as long as it may.
    FlightTime,
    /// Whoever runs its process called it down.
    Recalled,
    /// What it must remember could not be written down any more, or not be understood.
    JournalLost,
    /// Its process could not listen any more.
    NetworkLost,
}

/// What can be seen of a mission.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Event {
    /// The drone is doing something else.
    State(State),
    /// The drone obeys another ballot, perhaps its own.
    Obeys(Ballot),
    /// As master: a waypoint was opened.
    Opened {
        /// Which one.
        waypoint: u16,
    },
    /// As master: the swarm flies without this member.
    LeftOut(NodeId),
    /// The drone is coming down.
    Landing(LandingReason),
    /// An order could not be read, or not be obeyed in this state.
    Refused,
    /// What a restarted mission is built from.
    Checkpoint(Box<Checkpoint>),
}

/// The mission of one drone.
#[derive(Debug, Clone)]
pub struct Mission {
    config: Config,
    durable: Checkpoint,
    /// Since when the master has been missed.
    master_silent: Option<Timestamp>,
    /// Whether it says that it is going to land.
    master_lands: bool,
    stall_detector: StallDetector,
    outbox: Outbox<Transmit, Event>,
}

impl Mission {
    /// A mission as `checkpoint` left it; one without has been told nothing and does nothing.
    #[must_use]
    pub fn new(config: Config, checkpoint: Option<Checkpoint>) -> Self {
        let mut mission = Self {
            config,
            durable: Checkpoint::default(),
            master_silent: None,
            master_lands: false,
            stall_detector: StallDetector::default(),
            outbox: Outbox::new(),
        };
        if let Some(checkpoint) = checkpoint {
            mission.durable = checkpoint;
            if mission.durable.restarted {
                mission.begin_incarnation();
            }
            mission.outbox.transmit(Transmit::Resync);
            if let Some(goal) = mission.goal() {
                mission.outbox.transmit(Transmit::Goal(goal));
            }
        }
        mission
    }

    /// The process started anew: on the ground the drone stays there, in the air it has to catch up.
    fn begin_incarnation(&mut self) {
        match self.durable.state {
            State::SetUp => self.stay_down(LandingReason::Restarted),
            // The others are in their sectors, or on the same leg behind it and before: it goes on in their midst.
            State::ChangingFormation { .. } | State::MovingToWaypoint { .. } => {}
            State::TakingOff if self.is_below_waves() => {}
            state if state.is_following() => self.keep_apart(),
            _ => {}
        }
        self.checkpoint();
    }

    /// Entries in the larger of its tables, and the most either takes.
    #[must_use]
    pub fn occupancy(&self) -> (usize, usize) {
        (self.durable.plan.len(), self.config.waypoints_max)
    }

    /// Whether it has been told that its master is silent, and has neither heard of it since nor turned to another.
    #[must_use]
    pub const fn misses_master(&self) -> bool {
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
                self.durable.wave = None;
            }
            self.outbox.event(Event::State(state));
        }
    }

    /// The mission as far as this drone knows it.
    fn flown(&self) -> Flown<'_> {
        Flown {
            layout: &self.config.layout,
            changes: &self.config.changes,
            waypoints: &self.durable.plan,
        }
    }

    /// Who flies, stands and lands where, as of now.
    fn layout(&self) -> &Layout {
        self.flown().layout_after(self.durable.changes)
    }

    /// Where the drone's state wants it to be.
    fn goal(&self) -> Option<Goal> {
        let id = self.config.id;
        let layout = self.layout();
        match self.durable.state {
            State::Start | State::SetUp => None,
            State::TakingOff | State::NeighbourDiscovery | State::HopUpdate
                if self.durable.in_layer && !self.is_taking_off() =>
            {
                Some(self.goal_in_layer(*self.durable.plan.first()?))
            }
            State::TakingOff => {
                let to = layout.slot(id, *self.durable.plan.first()?);
                Some(Goal::TakeOff {
                    to,
                    transit_altitude_m: if flaw::has(Flaw::TakesOffInOneLayer) {
                        to.altitude_m()
                    } else {
                        to.altitude_m() + layout.take_off_layers_m()[id.0 as usize]
                    },
                    arm: !self.durable.restarted,
                })
            }
            State::NeighbourDiscovery | State::HopUpdate => None,
            State::WaypointReached { waypoint } | State::MovingToWaypoint { waypoint } => {
                let centre = *self.durable.plan.get(usize::from(waypoint))?;
                if self.durable.in_layer {
                    return Some(self.goal_in_layer(centre));
                }
                let to = layout.slot(id, centre);
                let hold_altitude_m = self.altitude_alone_m(to);
                Some(Goal::FlyTo {
                    to,
                    hold_altitude_m,
                })
            }
            State::ChangingFormation { change, step } => {
                let to = self.corner(change, step)?;
                if self.flies_in_own_layer() {
                    return Some(Goal::TransitTo { to });
                }
                // In a column of its own, or in its sector.
                let hold_altitude_m = to.altitude_m();
                Some(Goal::FlyTo {
                    to,
                    hold_altitude_m,
                })
            }
            State::Following => self.goal_as_followed(),
            State::Assembling => {
                let at = self.durable.assembled_at?;
                if self.durable.in_layer {
                    return Some(self.goal_in_layer(at));
                }
                let to = layout.slot(id, at);
                let hold_altitude_m = self.altitude_alone_m(at);
                Some(Goal::FlyTo {
                    to,
                    hold_altitude_m,
                })
            }
            State::MovingToLand if self.durable.leaving.is_some() && !self.flies_in_own_layer() => {
                self.goal_alone()
            }
            State::MovingToLand => {
                let at = self.durable.land_at;
                let altitude_m = self.landing_altitude_m();
                let place = if flaw::has(Flaw::LandsOnOnePoint) {
                    at
                } else if self.lands_apart() {
                    layout.slot(id, at)
                } else {
                    layout.place(id, at)
                };
                let to = place.at_altitude(altitude_m);
                Some(Goal::TransitTo { to })
            }
            State::Landing | State::Finished => Some(Goal::Land),
        }
    }

    /// Above its slot around a centre, in the drone's own layer.
    fn goal_in_layer(&self, centre: Ned) -> Goal {
        let slot = self.layout().slot(self.config.id, centre);
        let to = slot.at_altitude(self.altitude_alone_m(centre));
        Goal::TransitTo { to }
    }

    fn pursue_goal(&mut self) {
        if let Some(goal) = self.goal() {
            self.outbox.transmit(Transmit::Goal(goal));
        }
    }

    /// How high the way to land is flown: from the end of the mission all start in lockstep, from elsewhere perhaps not.
    fn landing_altitude_m(&self) -> f64 {
        let at = self.durable.land_at;
        let is_where_all_are =
            self.durable.plan.last() == Some(&at) || self.durable.assembled_at == Some(at);
        if flaw::has(Flaw::GoesToLandInOneLayer) {
            at.altitude_m()
        } else if is_where_all_are && !self.durable.in_layer {
            at.altitude_m() + self.layout().landing_layers_m()[self.config.id.0 as usize]
        } else {
            self.altitude_alone_m(at)
        }
    }

    fn land(&mut self, reason: LandingReason) {
        self.outbox.transmit(Transmit::Land);
        self.descend(reason);
    }

    /// Comes down on the spot; that it does is told separately.
    fn descend(&mut self, reason: LandingReason) {
        self.enter(State::Landing);
        self.outbox.event(Event::Landing(reason));
        self.durable.limit = None;
        self.pursue_goal();
    }

    fn begin_to_fly(&mut self, now: Timestamp) {
        self.durable.limit = Some(now + self.config.take_off_limit);
        self.durable.flies_until = Some(now + self.config.flight_time);
        self.enter(State::TakingOff);
        self.outbox.transmit(Transmit::Scatter);
        self.pursue_goal();
    }

    fn leave_for(&mut self, now: Timestamp, waypoint: u16) {
        self.enter(State::MovingToWaypoint { waypoint });
        // Not in step with all the others.
        let has_fallen_behind = self.durable.opened > Some(waypoint);
        if self.durable.in_layer || self.is_elected_epoch() || has_fallen_behind {
            self.keep_apart();
        }
        self.durable.limit = Some(now + self.config.leg_limit);
        self.pursue_goal();
    }

    /// Whether its master was elected: there may be parts of the swarm then that do not fly in step with this one.
    pub(super) fn is_elected_epoch(&self) -> bool {
        let ballot = self.durable.leader.ballot();
        ballot.is_some_and(|it| it.is_elected())
    }

    /// Flies in its layer from now on, on whose ways it may not hear the others as it did.
    pub(super) fn keep_apart(&mut self) {
        self.durable.in_layer = true;
        self.outbox.transmit(Transmit::Scatter);
    }

    /// Whether others may fly over its slot: a climb from there would lead through their ways.
    fn is_below_waves(&self) -> bool {
        self.durable.state == State::TakingOff && self.layout().take_off_waves() > 1
    }

    /// Waits in its layer, out of the way of parts of the swarm that go on sooner.
    pub(super) fn wait_in_layer(&mut self) {
        let waits = match self.durable.state {
            State::WaypointReached { .. }
            | State::TakingOff
            | State::NeighbourDiscovery
            | State::HopUpdate => {
                self.is_elected_epoch() && !self.is_taking_off() && !self.is_below_waves()
            }
            // The others may be about to cross over it.
            State::ChangingFormation {
                step: Step::Climb, ..
            } => self.durable.pending.is_none() && self.master_silent.is_some(),
            _ => false,
        };
        if waits && !self.durable.in_layer {
            self.keep_apart();
            self.pursue_goal();
        }
    }

    fn hear_routing(&mut self, now: Timestamp, notice: RoutingNotice) {
        match notice {
            RoutingNotice::Leader(ballot) => {
                let is_followed = self.hear_epoch(ballot);
                if is_followed && ballot.master == self.config.id && self.durable.lead.is_none() {
                    // It led, and lost the memory of it: nobody leads.
                    self.master_silent.get_or_insert(now);
                }
            }
            RoutingNotice::Order {
                ballot,
                sequence,
                order,
            } => {
                if !self.hear_epoch(ballot) || self.durable.lead.is_some() {
                    return;
                }
                match wire::decode_order(&order) {
                    Ok(order) => self.obey(now, sequence, order),
                    Err(_) => self.outbox.event(Event::Refused),
                }
            }
            RoutingNotice::Progress {
                sequence,
                acknowledged,
                landing,
            } => self.hear_progress(sequence, &acknowledged, &landing),
            RoutingNotice::Hears(neighbours) => {
                if let Some(lead) = &mut self.durable.lead {
                    lead.neighbours = neighbours;
                }
            }
            RoutingNotice::Silent(members) => self.miss(now, &members),
            RoutingNotice::Returned(members) => self.hear_of(&members),
            RoutingNotice::MasterSilent => {
                self.master_silent.get_or_insert(now);
            }
            RoutingNotice::MasterReturned => {
                self.master_silent = None;
                if self.durable.state == State::SetUp {
                    // It may have been told to take off meanwhile.
                    self.outbox.transmit(Transmit::Resync);
                }
            }
            // It leads no longer; one that takes the swarm down with it has ordered that.
            RoutingNotice::MasterLands if self.config.succession == Succession::Elect => {
                self.master_lands = true;
                self.master_silent.get_or_insert(now);
            }
            RoutingNotice::MasterLands => {}
            RoutingNotice::DiscoveryStarted => self.routes_are(RoutesPhase::Discovery),
            RoutingNotice::HopUpdateStarted => self.routes_are(RoutesPhase::HopUpdate),
            RoutingNotice::RoutesReady => self.routes_are(RoutesPhase::Ready),
            RoutingNotice::Resync => self.repeat_to_routing(),
        }
    }

    fn routes_are(&mut self, phase: RoutesPhase) {
        self.durable.routes = self.durable.routes.max(phase);
        let in_its_slot = match self.durable.state {
            State::TakingOff => self.durable.pending.is_none(),
            State::NeighbourDiscovery | State::HopUpdate => true,
            _ => false,
        };
        if in_its_slot {
            self.enter_routes_state();
        }
    }

    /// Does what the routing's progress asks of a drone in its slot.
    fn enter_routes_state(&mut self) {
        match self.durable.routes {
            RoutesPhase::None => {}
            RoutesPhase::Discovery => self.enter(State::NeighbourDiscovery),
            RoutesPhase::HopUpdate => self.enter(State::HopUpdate),
            RoutesPhase::Ready => self.enter(State::WaypointReached { waypoint: 0 }),
        }
    }

    fn arrived(&mut self, now: Timestamp) {
        match self.durable.state {
            State::TakingOff => {
                // A master's limit is the one up to which it waits for the others.
                if self.durable.lead.is_none() {
                    self.durable.limit = None;
                }
                self.carried_out();
                self.enter_routes_state();
            }
            State::MovingToWaypoint { waypoint } => {
                // Nobody who lives takes longer to arrive than a leg may take.
                let waits = self.durable.lead.is_some();
                self.durable.limit = waits.then(|| now + self.config.leg_limit);
                self.enter(State::WaypointReached { waypoint });
                if self.durable.opened <= Some(waypoint) && self.durable.catches_up {
                    self.durable.catches_up = false;
                    self.outbox.transmit(Transmit::Resync);
                }
            }
            State::ChangingFormation { change, step } => self.stepped(now, change, step),
            State::Following => self.arrived_as_followed(now),
            State::Assembling => self.carried_out(),
            State::MovingToLand => {
                if self.durable.leaving.is_some() {
                    self.outbox.transmit(Transmit::Land);
                }
                self.durable.limit = None;
                self.enter(State::Landing);
                self.pursue_goal();
            }
            _ => return,
        }
        self.react(now);
    }

    /// Acknowledges the order that was being carried out.
    fn carried_out(&mut self) {
        if let Some(sequence) = self.durable.pending.take() {
            self.acknowledge(sequence);
        }
    }

    fn acknowledge(&mut self, sequence: u32) {
        if sequence > self.durable.acknowledged {
            self.durable.acknowledged = sequence;
            self.say_acknowledged();
        }
    }

    fn say_acknowledged(&mut self) {
        if let Some(ballot) = self.durable.leader.ballot() {
            let sequence = self.durable.acknowledged;
            self.outbox
                .transmit(Transmit::Acknowledge { ballot, sequence });
        }
    }

    fn landed(&mut self) {
        match self.durable.state {
            State::Start | State::SetUp | State::Finished => return,
            State::Landing => {}
            _ => self.come_down(LandingReason::Controller),
        }
        self.enter(State::Finished);
        if self.is_awaited_on_ground() {
            // From now on its silence means nothing.
            self.outbox.transmit(Transmit::Land);
        }
        self.carried_out();
        self.outbox.transmit(Transmit::Stop);
    }

    /// The flight controller brings the drone down without having been told to.
    fn coming_down(&mut self) {
        if self.durable.state.is_following() || self.durable.state == State::MovingToLand {
            self.come_down(LandingReason::Controller);
        }
    }

    /// Goes on as far as what is known allows.
    fn react(&mut self, now: Timestamp) {
        if self.leave_if_due(now) {
            return;
        }
        if self.durable.lead.is_some() {
            self.lead(now);
        } else {
            self.follow(now);
        }
        self.wait_in_layer();
    }

    fn repeat_to_routing(&mut self) {
        self.repeat_lead();
        if let Some(lead) = &mut self.durable.lead {
            // It gives every member its time to live anew.
            lead.silent = NodeSet::default();
        }
        self.say_acknowledged();
        match self.durable.state {
            // It says so once it is below the others.
            State::MovingToLand if self.durable.leaving.is_some() => {}
            State::MovingToLand | State::Landing if self.is_awaited_on_ground() => {}
            State::MovingToLand | State::Landing => self.outbox.transmit(Transmit::Land),
            State::Finished => self.outbox.transmit(Transmit::Stop),
            _ => {}
        }
    }

    /// Can't or is not to go on, wherever it is.
    fn end_here(&mut self, reason: LandingReason) {
        match self.durable.state {
            State::Landing | State::Finished => {}
            State::Start | State::SetUp => self.stay_down(reason),
            _ => self.come_down(reason),
        }
    }

    /// The host stood still, perhaps while others did what the drone waits for: it gives them as long again.
    fn allow_for_stall(&mut self, now: Timestamp) {
        if let Some(stall) = self.stall_detector.stalled_for(now) {
            self.durable.limit = self.durable.limit.map(|limit| limit.max(now) + stall);
            self.master_silent = self.master_silent.map(|_| now);
        }
    }

    fn deadline(&self) -> Option<Timestamp> {
        let deadlines = [
            self.durable.limit,
            self.durable.flies_until,
            self.next_fix(),
            self.succeeds_at(),
            self.bears_silence_until(),
            self.holds_until(),
        ];
        deadlines.into_iter().flatten().min()
    }
}

impl Machine for Mission {
    type Input = Input;
    type Transmit = Transmit;
    type Event = Event;
    type Rejection = Infallible;

    fn handle_input(&mut self, now: Timestamp, input: Input) -> Result<(), Infallible> {
        self.allow_for_stall(now);
        match input {
            Input::Fly => self.fly(now),
            Input::Land => self.end_following(),
            Input::Routing(notice) => {
                self.hear_routing(now, notice);
                self.react(now);
            }
            Input::Navigation(NavigationNotice::Arrived) => self.arrived(now),
            Input::Navigation(NavigationNotice::At { position, velocity }) => {
                self.located(now, position, velocity);
            }
            Input::Navigation(NavigationNotice::ComingDown) => self.coming_down(),
            Input::Navigation(NavigationNotice::Landed) => self.landed(),
            Input::Navigation(NavigationNotice::Failing {
                failure,
                stop,
                is_airborne,
            }) => self.fail(now, failure, stop, is_airborne),
            Input::Navigation(NavigationNotice::Resync) => self.pursue_goal(),
            Input::GiveUp => self.end_here(LandingReason::ActorGivenUp),
            Input::ComeDown(reason) => self.end_here(reason),
        }
        self.checkpoint();
        self.stall_detector.ask(now, self.deadline());
        Ok(())
    }

    fn handle_timeout(&mut self, now: Timestamp) {
        self.allow_for_stall(now);
        self.end_flight_if_due(now);
        self.end_patience_if_due(now);
        self.end_hold_if_due(now);
        let is_needed = self.succeeds_at().is_some_and(|at| at <= now);
        if is_needed && !flaw::has(Flaw::DeadlineInThePast) {
            self.succeed(now);
            self.checkpoint();
        }
        if self.durable.limit.is_some_and(|limit| limit <= now) {
            self.durable.limit = None;
            let is_under_way = matches!(self.durable.state, State::Following | State::MovingToLand);
            if self.durable.pending.is_some() || is_under_way {
                // It is this drone that is late.
                self.come_down(LandingReason::Overdue);
            } else {
                self.leave_out_the_late();
                self.react(now);
            }
            self.checkpoint();
        }
        // Any of the above may have made it a master that is followed, which tells at once where it is.
        self.locate_if_due(now);
        self.stall_detector.ask(now, self.deadline());
    }

    fn poll_output(&mut self) -> Output<Transmit, Event> {
        self.outbox.poll(self.deadline())
    }
}

#[cfg(test)]
mod tests;
