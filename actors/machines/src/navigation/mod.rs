//! How a drone gets where its mission wants it: guidance in the open, by straight legs; and whether it can go on.

mod fence;
mod guard;
mod watch;

use std::collections::VecDeque;
use std::convert::Infallible;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::formation::Path;
use crate::geometry::{Ned, Velocity};
use crate::identity::NodeId;
use crate::machine::{Machine, Outbox, Output};
use crate::msp::{FlightCommand, Setpoint, Telemetry};
use crate::time::Timestamp;
use crate::traffic::{self, Intent};

pub use self::fence::{Area, Fence, Polygon, PolygonError, Zone};
use self::guard::Guard;
use self::watch::Watch;
pub use self::watch::{Failsafe, Failure};

/// How near to the end of a leg a drone at rest counts as there, in metres: the ancestor's arrival radius.
const ARRIVAL_RADIUS_M: f64 = 1.0;
/// How many times as long as it may be thought to move on a drone waits for news of a place that it tracks.
const HOLDS_BORNE: u32 = 2;

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
    /// How it keeps clear of drones near it that say where they are and go, if it heeds them.
    pub avoid: Option<traffic::Config>,
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
        hold_altitude_m: f64,
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
        hold_altitude_m: f64,
        /// How it moves.
        velocity: Velocity,
        /// For how long it may be thought to move so; the drone comes to rest then unless it is told more, and after as
        /// long again goes out of the way of those that move on.
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
    /// By the radio, restarted: say again where the drone is and goes.
    SayWay,
}

/// What a navigation sends.
#[derive(Debug, Clone, PartialEq)]
pub enum Transmit {
    /// To the flight controller's link.
    FlightCommand(FlightCommand),
    /// To the mission.
    Inform(Notice),
    /// To the radio.
    Intend {
        /// Where the drone is and goes, if that is a straight way.
        intent: Option<Intent>,
        /// Whether others are to know at once.
        at_once: bool,
    },
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
    /// Until when a place that it tracks counts as known.
    tracks_until: Option<Timestamp>,
    watch: Watch,
    /// Where those near it are heeded.
    guard: Option<Guard>,
    outbox: Outbox<Transmit, Event>,
}

impl Navigation {
    /// The navigation of drone `id` as `checkpoint` left it; one without has been told nothing.
    #[must_use]
    pub fn new(id: NodeId, config: Config, checkpoint: Option<Checkpoint>) -> Self {
        let mut navigation = Self {
            guard: config.avoid.map(|it| Guard::new(id, it)),
            config,
            durable: Checkpoint::default(),
            locating: false,
            held_at_m: None,
            tracks_until: None,
            watch: Watch::default(),
            outbox: Outbox::new(),
        };
        match checkpoint {
            Some(checkpoint) => {
                navigation.durable = checkpoint;
                if let Some(guard) = &mut navigation.guard {
                    guard.starts_anew(matches!(navigation.durable.goal, Some(Goal::FlyTo { .. })));
                }
                navigation.inform(Notice::Resync);
                navigation.command(FlightCommand::Report);
            }
            // Should it fail before it is told anything, it is to ask for what it was being told.
            None => navigation.progress(Progress::Planning),
        }
        navigation
    }

    fn inform(&mut self, notice: Notice) {
        self.outbox.transmit(Transmit::Inform(notice));
    }

    fn command(&mut self, command: FlightCommand) {
        self.outbox.transmit(Transmit::FlightCommand(command));
    }

    fn progress(&mut self, progress: Progress) {
        self.durable.progress = progress;
        let checkpoint = Box::new(self.durable.clone());
        self.outbox.event(Event::Checkpoint(checkpoint));
    }

    fn take_goal(&mut self, now: Timestamp, goal: Goal) {
        self.watch.tell_again();
        self.tracks_until = None;
        if let Goal::Track {
            to, velocity, hold, ..
        } = goal
            && !self.watch.is_lost()
        {
            return self.track(now, goal, (to, velocity, hold));
        }
        if self.durable.goal != Some(goal) {
            self.durable.goal = Some(goal);
            if let Some(guard) = &mut self.guard {
                guard.starts_anew(matches!(goal, Goal::FlyTo { .. }));
            }
            self.progress(Progress::Planning);
        }
        if self.durable.progress == Progress::Done {
            self.inform_done(goal);
        } else {
            self.command(FlightCommand::Report);
        }
    }

    /// A moving place needs no legs: the vehicle is told at once.
    fn track(
        &mut self,
        now: Timestamp,
        goal: Goal,
        (to, velocity, hold): (Ned, Velocity, Duration),
    ) {
        self.durable.goal = Some(goal);
        self.tracks_until = Some(now + hold * HOLDS_BORNE);
        self.progress(Progress::Flying(VecDeque::new()));
        if let Some(guard) = &mut self.guard {
            let said = guard.follows(to, velocity, hold);
            self.outbox.transmit(said);
        }
        self.command(FlightCommand::Fly(Setpoint::Track {
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
                self.command(FlightCommand::Yield);
            }
            self.progress(Progress::Planning);
        }
        let may_hold = telemetry.armed && !telemetry.landing;
        if self.watch.is_lost() && may_hold && self.durable.goal != Some(Goal::Land) {
            // A goal that it is told meanwhile may want it at another height.
            let altitude_m = self.hold_altitude_m().or(self.held_at_m);
            if altitude_m.is_none() || altitude_m != self.held_at_m {
                self.held_at_m = Some(self.hold(now, telemetry));
            }
        }
        for failure in verdict.failures {
            if failure == Failure::Geofence {
                self.hold(now, telemetry);
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
    fn hold_altitude_m(&self) -> Option<f64> {
        match self.durable.goal {
            Some(
                Goal::FlyTo {
                    hold_altitude_m, ..
                }
                | Goal::Track {
                    hold_altitude_m, ..
                },
            ) => Some(hold_altitude_m),
            Some(Goal::TakeOff {
                transit_altitude_m, ..
            }) => Some(transit_altitude_m),
            Some(Goal::TransitTo { to }) => Some(to.altitude_m()),
            Some(Goal::Hold | Goal::Yield | Goal::Land) | None => None,
        }
    }

    /// Stops wherever the vehicle is, at the height at which it is in nobody's way; which that is, in metres above home.
    fn hold(&mut self, now: Timestamp, telemetry: &Telemetry) -> f64 {
        let stop_m = telemetry.stop.altitude_m();
        let altitude_m = self.hold_altitude_m().unwrap_or(stop_m);
        let path = Path {
            from: telemetry.position,
            to: telemetry.stop.at_altitude(altitude_m),
        };
        self.intend(now, Some(path), false);
        self.command(FlightCommand::Fly(Setpoint::Hold {
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
                return self.find_out_of_the_air(now, telemetry);
            }
        }
        match self.durable.progress.clone() {
            Progress::Done => {}
            Progress::Planning => self.plan(now, goal, telemetry),
            Progress::Flying(_) if goal == Goal::Land => self.watch_landing(now, telemetry),
            Progress::Flying(_) if matches!(goal, Goal::Track { .. } | Goal::Yield) => {}
            Progress::Flying(corners) => self.watch_legs(now, goal, corners, telemetry),
        }
    }

    /// The vehicle can't be flown anywhere any more: it is on the ground, or on its way there.
    fn find_out_of_the_air(&mut self, now: Timestamp, telemetry: &Telemetry) {
        if telemetry.armed {
            self.sinks(now, telemetry);
        }
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
                    self.command(FlightCommand::Arm);
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
                hold_altitude_m,
            } => path_from_hold_altitude(start, to, hold_altitude_m),
            Goal::TransitTo { to } => vec![start.at_altitude(to.altitude_m()), to],
            Goal::Hold => vec![start],
            Goal::Land => Vec::new(),
            Goal::Track { .. } => {
                self.hold(now, telemetry);
                Vec::new()
            }
            Goal::Yield => {
                self.intend(now, None, false);
                Vec::new()
            }
        };
        self.progress(Progress::Flying(corners.into()));
        self.pursue(now, telemetry);
    }

    fn watch_landing(&mut self, now: Timestamp, telemetry: &Telemetry) {
        let column = Path {
            from: telemetry.stop,
            to: telemetry.stop.at_altitude(0.0),
        };
        if !telemetry.armed {
            self.progress(Progress::Done);
            self.inform(Notice::Landed);
        } else if telemetry.landing {
            self.sinks(now, telemetry);
        } else if self.may_come_down(now, column, telemetry) {
            self.intend(now, Some(column), true);
            self.command(FlightCommand::Land);
        } else {
            self.wait_to_come_down(now, column, telemetry);
        }
    }

    /// Whether it comes down at once: nobody is below it, or it can't wait or has waited for long enough.
    fn may_come_down(&mut self, now: Timestamp, column: Path, telemetry: &Telemetry) -> bool {
        let is_urgent =
            self.watch.is_lost() || telemetry.charge <= self.config.failsafe.battery_critical;
        let mut guard = self.guard.iter_mut().filter(|_| !is_urgent);
        guard.all(|it| it.lets_down(now, column))
    }

    /// Holds above others, or makes for where it comes down beside them.
    fn wait_to_come_down(&mut self, now: Timestamp, column: Path, telemetry: &Telemetry) {
        let Some(guard) = &mut self.guard else { return };
        match guard.beside(now, column).filter(|_| telemetry.at_rest) {
            Some(side) => {
                guard.waits(now);
                let path = Path {
                    from: column.from,
                    to: side,
                };
                self.intend(now, Some(path), false);
                let leg = self.leg(path.from, side);
                self.command(FlightCommand::Fly(leg));
            }
            None if !telemetry.at_rest && guard.goes_aside(telemetry.target) => guard.waits(now),
            None => self.wait(now, None, telemetry),
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
                self.stand(now, telemetry.position);
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
        let path = Path {
            from: telemetry.stop,
            to: corner,
        };
        let guard = self.guard.as_mut();
        if telemetry.target != Some(corner) {
            // What others are told of it is one straight way: to brake and to fly on may be two.
            let can_tell = |guard: &mut Guard| telemetry.at_rest && guard.lets_begin(now, path);
            if guard.is_none_or(can_tell) {
                self.intend(now, Some(path), false);
                let leg = self.leg(telemetry.stop, corner);
                self.command(FlightCommand::Fly(leg));
            } else if telemetry.at_rest
                && let Some(side) = self.turn_aside(now, path)
            {
                self.fly(now, side, telemetry);
            } else {
                self.wait(now, Some(corner), telemetry);
            }
        } else if guard.is_some_and(|it| it.stops(now, telemetry.stop, corner)) {
            self.wait(now, Some(corner), telemetry);
        } else {
            self.gets(now, telemetry);
        }
    }

    /// Lays a way round one that stays in the way for too long, if there is one; where it begins.
    fn turn_aside(&mut self, now: Timestamp, path: Path) -> Option<Ned> {
        let [side, level] = self.guard.as_ref()?.way_round(now, path)?;
        let Progress::Flying(mut corners) = self.durable.progress.clone() else {
            return None;
        };
        corners.push_front(level);
        corners.push_front(side);
        self.progress(Progress::Flying(corners));
        Some(side)
    }

    /// Comes to rest, if it is not, and tries again to fly to `corner`, or to come down.
    fn wait(&mut self, now: Timestamp, corner: Option<Ned>, telemetry: &Telemetry) {
        let path = Path {
            from: telemetry.position,
            to: telemetry.stop,
        };
        self.intend(now, Some(path), false);
        if let Some(guard) = &mut self.guard {
            guard.waits(now);
        }
        if !telemetry.at_rest || corner.is_some() && telemetry.target == corner {
            self.command(FlightCommand::Fly(Setpoint::Hold {
                altitude_m: telemetry.stop.altitude_m(),
                vertical_mps: self.config.climb_mps.min(self.config.descent_mps),
                acceleration_mps2: self.config.acceleration_mps2,
            }));
        }
    }

    /// Lets the others know that the drone stands still.
    fn stand(&mut self, now: Timestamp, place: Ned) {
        let path = Path {
            from: place,
            to: place,
        };
        self.intend(now, Some(path), false);
    }

    /// Lets the others know where the drone is and goes, if that can be said.
    fn intend(&mut self, now: Timestamp, path: Option<Path>, is_heedless: bool) {
        let guard = self.guard.as_mut();
        if let Some(said) = guard.and_then(|it| it.intend(now, path, is_heedless)) {
            self.outbox.transmit(said);
        }
    }

    /// Lets the others know that the vehicle comes down, which nobody can call off.
    fn sinks(&mut self, now: Timestamp, telemetry: &Telemetry) {
        let ground = telemetry.stop.at_altitude(0.0);
        let is_said = |guard: &Guard| guard.leads_to(ground);
        if self.guard.as_ref().is_some_and(is_said) {
            self.gets(now, telemetry);
        } else {
            let path = Path {
                from: telemetry.stop,
                to: ground,
            };
            self.intend(now, Some(path), true);
        }
    }

    /// Lets the others know how far it has got.
    fn gets(&mut self, now: Timestamp, telemetry: &Telemetry) {
        let guard = self.guard.as_mut();
        if let Some(said) = guard.and_then(|it| it.gets(now, telemetry.position)) {
            self.outbox.transmit(said);
        }
    }

    /// Takes in where another is and goes, and looks what that means for the own way.
    fn hear_of(&mut self, now: Timestamp, sender: NodeId, intent: Option<Intent>) {
        let guard = self.guard.as_mut();
        if guard.is_some_and(|it| it.hears(now, sender, intent)) {
            self.command(FlightCommand::Report);
        }
    }

    /// A leg as fast as the vehicle may fly in that direction.
    fn leg(&self, from: Ned, to: Ned) -> Setpoint {
        let path = to - from;
        let length_m = path.0.norm();
        let over_ground = from.horizontal_distance_m(to) / length_m;
        let climbing = path.altitude_m() / length_m;
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
            Input::Goal(goal) => self.take_goal(now, goal),
            Input::Locate => {
                self.locating = true;
                self.command(FlightCommand::Report);
            }
            Input::Telemetry(telemetry) => self.hear(now, &telemetry),
            Input::Traffic { sender, intent } => self.hear_of(now, sender, intent),
            Input::Resync => self.command(FlightCommand::Report),
            Input::SayWay => {
                if let Some(guard) = &self.guard {
                    self.outbox.transmit(guard.word(true));
                }
            }
        }
        Ok(())
    }

    fn handle_timeout(&mut self, now: Timestamp) {
        let is_lost = self.tracks_until.take_if(|at| *at <= now).is_some();
        if is_lost {
            self.progress(Progress::Planning);
        }
        let looks = self.watch.next_look().is_some_and(|at| at <= now);
        let guards = self.guard.as_mut().is_some_and(|it| it.is_due(now));
        if looks {
            self.watch.looked();
        }
        if is_lost || looks || guards {
            self.command(FlightCommand::Report);
        }
    }

    fn poll_output(&mut self) -> Output<Transmit, Event> {
        let guard = self.guard.as_ref().and_then(Guard::deadline);
        let deadlines = [self.watch.next_look(), guard, self.tracks_until];
        self.outbox.poll(deadlines.into_iter().flatten().min())
    }
}

/// The corners of the way to a slot: a drone that has held in its refuge descends only once it is over its slot.
fn path_from_hold_altitude(start: Ned, to: Ned, hold_altitude_m: f64) -> Vec<Ned> {
    let height_m = start.altitude_m();
    let is_at_hold_altitude = (height_m - hold_altitude_m).abs() < ARRIVAL_RADIUS_M
        && height_m > to.altitude_m() + ARRIVAL_RADIUS_M;
    if is_at_hold_altitude {
        vec![to.at_altitude(height_m), to]
    } else {
        vec![to]
    }
}

#[cfg(test)]
mod tests;
