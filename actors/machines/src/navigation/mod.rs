//! How a drone gets where its mission wants it: guidance in the open, by straight legs; and whether it can go on.

mod fence;
mod watch;

use std::collections::VecDeque;
use std::convert::Infallible;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::formation::{Separation, Way};
use crate::geometry::{Ned, Velocity};
use crate::identity::NodeId;
use crate::machine::{Machine, Outbox, Output};
use crate::msp::{Demand, Setpoint, Telemetry};
use crate::time::Timestamp;
use crate::traffic::{Intent, Traffic};

pub use self::fence::{Area, Fence, Polygon, PolygonError, Zone};
use self::watch::Watch;
pub use self::watch::{Failsafe, Failure};

/// How near to the end of a leg a drone at rest counts as there, in metres: the ancestor's arrival radius.
const ARRIVAL_RADIUS_M: f64 = 1.0;
/// How often a drone looks whether a way is free that it waits to fly, besides whenever another says that it goes.
const TRY_AGAIN_AFTER: Duration = Duration::from_millis(500);
/// How long it waits before it flies round whoever does not go: as long as a process that hangs is given.
const ROUND_AFTER: Duration = Duration::from_secs(3);

/// How fast the vehicle may fly.
#[derive(Debug, Clone, PartialEq)]
pub struct Config {
    /// Over ground, in m/s.
    pub speed_mps: f64,
    /// Upwards, in m/s.
    pub climb_mps: f64,
    /// Downwards, in m/s.
    pub descent_mps: f64,
    /// Along any leg, in m/s².
    pub acceleration_mps2: f64,
    /// From when on the drone can't go on.
    pub failsafe: Failsafe,
    /// How far it keeps from drones near it that say where they are and go, if it heeds them.
    pub avoid: Option<Separation>,
}

/// Where a mission wants its drone.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Goal {
    /// Arm, climb straight up to a height, fly level to above `to`, go there.
    TakeOff {
        /// The slot.
        to: Ned,
        /// The height at which the way is flown, in metres above home.
        transit_altitude_m: f64,
        /// Whether to arm a vehicle that is not; otherwise it stays on the ground.
        arm: bool,
    },
    /// Fly straight there.
    FlyTo {
        /// Where.
        to: Ned,
        /// At which height the drone is in nobody's way who flies on, should it have to stop; in metres above home.
        refuge_altitude_m: f64,
    },
    /// Climb or descend to the height of `to` first, then fly level.
    TransitTo {
        /// Where.
        to: Ned,
    },
    /// Be at a place that moves, and move along with it.
    Track {
        /// Where it is now.
        to: Ned,
        /// As for [`Self::FlyTo`].
        refuge_altitude_m: f64,
        /// How it moves.
        velocity: Velocity,
        /// For how long it may be thought to move so; the drone comes to rest then unless it is told more.
        hold: Duration,
    },
    /// Come to rest.
    Hold,
    /// Leave the vehicle to the pilot.
    Yield,
    /// Come down on the spot and disarm.
    Land,
}

/// What a navigation is told.
#[derive(Debug, Clone, PartialEq)]
pub enum Input {
    /// By the mission: go there; the same goal again only asks whether it is reached.
    Goal(Goal),
    /// By the mission: tell where the drone is.
    Locate,
    /// By the flight controller's link.
    Telemetry(Telemetry),
    /// By the radio: where another drone is and goes.
    Traffic {
        /// Who.
        sender: NodeId,
        /// Where; nothing if it does not say so any more.
        intent: Option<Intent>,
    },
    /// By the link, restarted: tell me again what I should do.
    Resync,
}

/// What a navigation sends.
#[derive(Debug, Clone, PartialEq)]
pub enum Transmit {
    /// To the flight controller's link.
    Demand(Demand),
    /// To the mission.
    Inform(Notice),
    /// To the radio: where the drone is and goes, if that is a straight way.
    Intend(Option<Intent>),
}

/// What a navigation lets its mission know.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Notice {
    /// The goal is reached and the drone is at rest.
    Arrived,
    /// Where the drone was when it was asked.
    At {
        /// Where.
        position: Ned,
        /// How it moved.
        velocity: Velocity,
    },
    /// The vehicle is coming down to land, which it was not told to.
    ComingDown,
    /// The drone is on the ground and disarmed.
    Landed,
    /// The drone can't go on; of what has been told before, only what is worse. It holds where the failure is its
    /// position or its fence, until it is told where else to go.
    Failing {
        /// Why.
        failure: Failure,
        /// Where it would be at rest if it braked now.
        stop: Ned,
        /// Whether its motors are armed.
        is_airborne: bool,
    },
    /// This navigation restarted: tell me again where to go.
    Resync,
}

/// What can be seen of a navigation.
#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    /// What a restarted navigation is built from.
    Checkpoint(Box<Checkpoint>),
}

/// What outlives a navigation.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Checkpoint {
    /// Where the mission wants the drone.
    pub goal: Option<Goal>,
    /// What has become of it.
    pub progress: Progress,
}

/// What has become of a goal.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub enum Progress {
    /// The vehicle's state is needed before legs can be laid.
    #[default]
    Planning,
    /// The corners still to be flown to, the next one first; none while landing.
    Flying(VecDeque<Ned>),
    /// It is reached.
    Done,
}

/// The navigation of one drone.
#[derive(Debug)]
pub struct Navigation {
    config: Config,
    durable: Checkpoint,
    /// Whether the mission waits to be told where the drone is.
    locating: bool,
    /// At which height the vehicle was last told to hold for want of a position, in metres above home.
    held_at_m: Option<f64>,
    watch: Watch,
    /// Who is near, where they are heeded.
    traffic: Option<Traffic>,
    /// The way that the drone flies or waits to fly, as the others were told last.
    way: Option<Way>,
    /// Since when it has waited for its way to be free.
    waits_since: Option<Timestamp>,
    /// When it next looks whether a way is free that it waits to fly.
    next_try: Option<Timestamp>,
    outbox: Outbox<Transmit, Event>,
}

impl Navigation {
    /// The navigation of drone `id` as `checkpoint` left it; one without has been told nothing.
    #[must_use]
    pub fn new(id: NodeId, config: Config, checkpoint: Option<Checkpoint>) -> Self {
        let mut navigation = Self {
            traffic: config.avoid.map(|it| Traffic::new(id, it)),
            config,
            durable: Checkpoint::default(),
            locating: false,
            held_at_m: None,
            watch: Watch::default(),
            way: None,
            waits_since: None,
            next_try: None,
            outbox: Outbox::new(),
        };
        match checkpoint {
            Some(checkpoint) => {
                navigation.durable = checkpoint;
                navigation.inform(Notice::Resync);
                navigation.demand(Demand::Report);
            }
            // Should it fail before it is told anything, it is to ask for what it was being told.
            None => navigation.progress(Progress::Planning),
        }
        navigation
    }

    fn inform(&mut self, notice: Notice) {
        self.outbox.transmit(Transmit::Inform(notice));
    }

    fn demand(&mut self, demand: Demand) {
        self.outbox.transmit(Transmit::Demand(demand));
    }

    fn progress(&mut self, progress: Progress) {
        self.durable.progress = progress;
        let checkpoint = Box::new(self.durable.clone());
        self.outbox.event(Event::Checkpoint(checkpoint));
    }

    fn take_goal(&mut self, goal: Goal) {
        self.watch.tell_again();
        if let Goal::Track {
            to, velocity, hold, ..
        } = goal
            && !self.watch.is_lost()
        {
            return self.track(goal, to, velocity, hold);
        }
        if self.durable.goal != Some(goal) {
            self.durable.goal = Some(goal);
            self.waits_since = None;
            self.progress(Progress::Planning);
        }
        if self.durable.progress == Progress::Done {
            self.inform_done(goal);
        } else {
            self.demand(Demand::Report);
        }
    }

    /// A moving place needs no legs: the vehicle is told at once.
    fn track(&mut self, goal: Goal, to: Ned, velocity: Velocity, hold: Duration) {
        self.durable.goal = Some(goal);
        self.progress(Progress::Flying(VecDeque::new()));
        self.intend_way(None);
        self.demand(Demand::Fly(Setpoint::Track {
            to,
            velocity,
            speed_mps: self.config.speed_mps,
            acceleration_mps2: self.config.acceleration_mps2,
            hold,
        }));
    }

    fn inform_done(&mut self, goal: Goal) {
        self.inform(if goal == Goal::Land {
            Notice::Landed
        } else {
            Notice::Arrived
        });
    }

    fn hear(&mut self, now: Timestamp, telemetry: &Telemetry) {
        if std::mem::take(&mut self.locating) {
            self.inform(Notice::At {
                position: telemetry.position,
                velocity: telemetry.velocity,
            });
        }
        self.heed(now, telemetry);
        let comes_down = telemetry.landing || self.durable.goal == Some(Goal::Land);
        if comes_down || !self.watch.is_lost() {
            self.pursue(now, telemetry);
        }
    }

    /// Holds, or goes on, as the state of the vehicle demands, and lets the mission know.
    fn heed(&mut self, now: Timestamp, telemetry: &Telemetry) {
        let Config {
            failsafe,
            speed_mps,
            ..
        } = &self.config;
        let takes_off = matches!(self.durable.goal, Some(Goal::TakeOff { arm: true, .. }));
        let fit_for = (takes_off, *speed_mps);
        let verdict = self.watch.judge(now, telemetry, failsafe, fit_for);
        if verdict.is_found {
            self.held_at_m = None;
            if self.durable.goal == Some(Goal::Yield) {
                self.demand(Demand::Yield);
            }
            self.progress(Progress::Planning);
        }
        let may_hold = telemetry.armed && !telemetry.landing;
        if self.watch.is_lost() && may_hold && self.durable.goal != Some(Goal::Land) {
            // A goal that it is told meanwhile may want it at another height.
            let altitude_m = self.refuge_altitude_m().or(self.held_at_m);
            if altitude_m.is_none() || altitude_m != self.held_at_m {
                self.held_at_m = Some(self.hold(telemetry));
            }
        }
        for failure in verdict.failures {
            if failure == Failure::Geofence {
                self.hold(telemetry);
                self.durable.goal = Some(Goal::Hold);
                self.progress(Progress::Done);
            }
            self.inform(Notice::Failing {
                failure,
                stop: telemetry.stop,
                is_airborne: telemetry.armed,
            });
        }
    }

    /// The height at which a drone with this goal is in nobody's way, in metres above home.
    fn refuge_altitude_m(&self) -> Option<f64> {
        match self.durable.goal {
            Some(
                Goal::FlyTo {
                    refuge_altitude_m, ..
                }
                | Goal::Track {
                    refuge_altitude_m, ..
                },
            ) => Some(refuge_altitude_m),
            Some(Goal::TakeOff {
                transit_altitude_m, ..
            }) => Some(transit_altitude_m),
            Some(Goal::TransitTo { to }) => Some(to.altitude_m()),
            Some(Goal::Hold | Goal::Yield | Goal::Land) | None => None,
        }
    }

    /// Stops wherever the vehicle is, at the height at which it is in nobody's way; which that is, in metres above home.
    fn hold(&mut self, telemetry: &Telemetry) -> f64 {
        let stop_m = telemetry.stop.altitude_m();
        let altitude_m = self.refuge_altitude_m().unwrap_or(stop_m);
        self.intend(telemetry.stop, telemetry.stop.at_altitude(altitude_m));
        self.demand(Demand::Fly(Setpoint::Hold {
            altitude_m,
            vertical_mps: self.config.climb_mps.min(self.config.descent_mps),
            acceleration_mps2: self.config.acceleration_mps2,
        }));
        altitude_m
    }

    fn pursue(&mut self, now: Timestamp, telemetry: &Telemetry) {
        let Some(goal) = self.durable.goal else {
            return;
        };
        if goal != Goal::Land {
            let is_done = self.durable.progress == Progress::Done;
            let may_arm = matches!(goal, Goal::TakeOff { arm: true, .. }) && !is_done;
            if telemetry.landing || !(telemetry.armed || may_arm) {
                return self.find_out_of_the_air(telemetry);
            }
        }
        match self.durable.progress.clone() {
            Progress::Done => {}
            Progress::Planning => self.plan(now, goal, telemetry),
            Progress::Flying(_) if goal == Goal::Land => self.watch_landing(telemetry),
            Progress::Flying(_) if matches!(goal, Goal::Track { .. } | Goal::Yield) => {}
            Progress::Flying(corners) => self.watch_legs(now, goal, corners, telemetry),
        }
    }

    /// The vehicle can't be flown anywhere any more: it is on the ground, or on its way there.
    fn find_out_of_the_air(&mut self, telemetry: &Telemetry) {
        self.inform(if telemetry.armed {
            Notice::ComingDown
        } else {
            Notice::Landed
        });
    }

    /// Lays the legs to a goal from where the vehicle would come to rest.
    fn plan(&mut self, now: Timestamp, goal: Goal, telemetry: &Telemetry) {
        let start = telemetry.stop;
        let corners: Vec<Ned> = match goal {
            Goal::TakeOff { .. } if !telemetry.armed => {
                let knows_where_it_is = telemetry.position_lost_for.is_none();
                let has_charge = telemetry.charge > self.config.failsafe.battery_low;
                if knows_where_it_is && has_charge {
                    self.demand(Demand::Arm);
                }
                return;
            }
            Goal::TakeOff {
                to,
                transit_altitude_m,
                ..
            } => vec![
                start.at_altitude(transit_altitude_m),
                to.at_altitude(transit_altitude_m),
                to,
            ],
            Goal::FlyTo {
                to,
                refuge_altitude_m,
            } => way_from_refuge(start, to, refuge_altitude_m),
            Goal::TransitTo { to } => vec![start.at_altitude(to.altitude_m()), to],
            Goal::Hold => vec![start],
            Goal::Land => Vec::new(),
            Goal::Track { .. } | Goal::Yield => {
                self.intend_way(None);
                Vec::new()
            }
        };
        self.progress(Progress::Flying(corners.into()));
        self.pursue(now, telemetry);
    }

    fn watch_landing(&mut self, telemetry: &Telemetry) {
        if !telemetry.armed {
            self.progress(Progress::Done);
            self.inform(Notice::Landed);
        } else if !telemetry.landing {
            self.intend(telemetry.position, telemetry.position.at_altitude(0.0));
            self.demand(Demand::Land);
        }
    }

    fn watch_legs(
        &mut self,
        now: Timestamp,
        goal: Goal,
        mut corners: VecDeque<Ned>,
        telemetry: &Telemetry,
    ) {
        let before = corners.len();
        while let Some(corner) = corners.front()
            && telemetry.at_rest
            && telemetry.position.distance_m(*corner) < ARRIVAL_RADIUS_M
        {
            corners.pop_front();
        }
        match corners.front().copied() {
            None => {
                self.intend(telemetry.position, telemetry.position);
                self.progress(Progress::Done);
                self.inform_done(goal);
            }
            Some(corner) => {
                if corners.len() < before {
                    self.progress(Progress::Flying(corners));
                }
                self.fly(now, corner, telemetry);
            }
        }
    }

    /// Flies straight to `corner`, as soon as nobody is in the way.
    fn fly(&mut self, now: Timestamp, corner: Ned, telemetry: &Telemetry) {
        let way = Way {
            from: telemetry.stop,
            to: corner,
        };
        self.next_try = None;
        if telemetry.target != Some(corner) {
            if self.traffic.as_ref().is_none_or(|it| it.is_free(now, way)) {
                self.waits_since = None;
                self.intend(way.from, way.to);
                let leg = self.leg(telemetry.stop, corner);
                self.demand(Demand::Fly(leg));
            } else if let Some(side) = self.turn_aside(now, way) {
                self.fly(now, side, telemetry);
            } else {
                self.wait(now, corner, telemetry);
            }
        } else if self
            .traffic
            .as_ref()
            .is_some_and(|it| it.gives_way(now, way))
        {
            self.wait(now, corner, telemetry);
        }
    }

    /// Lays a way round whoever stays in the way for too long, if there is one; where it begins.
    fn turn_aside(&mut self, now: Timestamp, way: Way) -> Option<Ned> {
        let has_waited = now.since(self.waits_since?) >= ROUND_AFTER;
        let traffic = self.traffic.as_ref().filter(|_| has_waited)?;
        let [side, level] = traffic.way_round(now, way)?;
        let Progress::Flying(mut corners) = self.durable.progress.clone() else {
            return None;
        };
        corners.push_front(level);
        corners.push_front(side);
        self.progress(Progress::Flying(corners));
        Some(side)
    }

    /// Comes to rest, and tries again.
    fn wait(&mut self, now: Timestamp, corner: Ned, telemetry: &Telemetry) {
        self.next_try = Some(now + TRY_AGAIN_AFTER);
        self.waits_since.get_or_insert(now);
        self.intend(telemetry.stop, telemetry.stop);
        if !telemetry.at_rest || telemetry.target == Some(corner) {
            self.demand(Demand::Fly(Setpoint::Hold {
                altitude_m: telemetry.stop.altitude_m(),
                vertical_mps: self.config.climb_mps.min(self.config.descent_mps),
                acceleration_mps2: self.config.acceleration_mps2,
            }));
        }
    }

    /// Lets the others know where the drone is and goes.
    fn intend(&mut self, from: Ned, to: Ned) {
        self.intend_way(Some(Way { from, to }));
    }

    fn intend_way(&mut self, way: Option<Way>) {
        if self.traffic.is_some() && self.way != way {
            self.way = way;
            let intent = way.map(Intent::of);
            self.outbox.transmit(Transmit::Intend(intent));
        }
    }

    /// Takes in where another is and goes, and looks what that means for the own way.
    fn hear_of(&mut self, now: Timestamp, sender: NodeId, intent: Option<Intent>) {
        let Some(traffic) = &mut self.traffic else {
            return;
        };
        let is_news = traffic.hears(now, sender, intent);
        let is_in_the_way = self.way.is_some_and(|way| traffic.gives_way(now, way));
        // One that was forgotten is in the way again though it says nothing new.
        if is_in_the_way || is_news && self.next_try.is_some() {
            self.demand(Demand::Report);
        }
    }

    /// A leg as fast as the vehicle may fly in that direction.
    fn leg(&self, from: Ned, to: Ned) -> Setpoint {
        let way = to - from;
        let length_m = way.0.norm();
        let over_ground = from.horizontal_distance_m(to) / length_m;
        let climbing = way.altitude_m() / length_m;
        let vertical_mps = if climbing > 0.0 {
            self.config.climb_mps
        } else {
            self.config.descent_mps
        };
        // A share of zero divides to infinity, which no minimum takes.
        let speed_mps = if length_m > 0.0 {
            (self.config.speed_mps / over_ground).min(vertical_mps / climbing.abs())
        } else {
            self.config.speed_mps
        };
        Setpoint::Leg {
            to,
            speed_mps,
            acceleration_mps2: self.config.acceleration_mps2,
        }
    }
}

impl Machine for Navigation {
    type Input = Input;
    type Transmit = Transmit;
    type Event = Event;
    type Rejection = Infallible;

    fn handle_input(&mut self, now: Timestamp, input: Input) -> Result<(), Infallible> {
        match input {
            Input::Goal(goal) => self.take_goal(goal),
            Input::Locate => {
                self.locating = true;
                self.demand(Demand::Report);
            }
            Input::Telemetry(telemetry) => self.hear(now, &telemetry),
            Input::Traffic { sender, intent } => self.hear_of(now, sender, intent),
            Input::Resync => self.demand(Demand::Report),
        }
        Ok(())
    }

    fn handle_timeout(&mut self, now: Timestamp) {
        let is_due = |at: Option<Timestamp>| at.is_some_and(|at| at <= now);
        if is_due(self.watch.next_look()) || is_due(self.next_try) {
            if is_due(self.watch.next_look()) {
                self.watch.looked();
            }
            self.next_try = self.next_try.filter(|at| *at > now);
            self.demand(Demand::Report);
        }
    }

    fn poll_output(&mut self) -> Output<Transmit, Event> {
        let deadlines = [self.watch.next_look(), self.next_try];
        self.outbox.poll(deadlines.into_iter().flatten().min())
    }
}

/// The corners of the way to a slot: a drone that has held in its refuge descends only once it is over its slot.
fn way_from_refuge(start: Ned, to: Ned, refuge_altitude_m: f64) -> Vec<Ned> {
    let height_m = start.altitude_m();
    let is_in_refuge = (height_m - refuge_altitude_m).abs() < ARRIVAL_RADIUS_M
        && height_m > to.altitude_m() + ARRIVAL_RADIUS_M;
    if is_in_refuge {
        vec![to.at_altitude(height_m), to]
    } else {
        vec![to]
    }
}

#[cfg(test)]
mod tests;
