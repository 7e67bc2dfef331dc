//! Navigation: flies goals by straight legs, deconflicts with traffic, reports failures, hosts the indoor machine.

mod config;
mod deconfliction;
mod fence;
mod goal;
mod health;
mod host;
mod landing;
mod message;
mod tracking;

use std::collections::VecDeque;

pub use self::config::Config;
pub use self::fence::{Area, Fence, Polygon, PolygonError, Zone};
pub use self::goal::{Checkpoint, Goal, Progress};
pub use self::health::{Failsafe, Failure};
pub use self::message::{Event, Input, Notice, Transmit};

use self::deconfliction::Deconfliction;
use self::goal::ARRIVAL_RADIUS_M;
use self::health::HealthMonitor;
use self::host::Host;
use crate::formation::Path;
use crate::geometry::Ned;
use crate::identity::NodeId;
use crate::indoor::Indoor;
use crate::machine::{Machine, Outbox, Output, Stimulus};
use crate::msp::{FlightCommand, Telemetry};
use crate::time::Timestamp;

/// Navigation of one drone.
#[derive(Debug)]
pub struct Navigation {
    config: Config,
    durable: Checkpoint,
    /// Whether the mission waits for [`Notice::Position`].
    position_requested: bool,
    /// Altitude of the last hold command because of a lost position, in metres above home.
    hold_commanded_m: Option<f64>,
    /// Expiry of the tracked place.
    track_expires_at: Option<Timestamp>,
    /// Whether it flies back to a tracked place that it has left.
    returns: bool,
    /// Whether it goes on from a checkpoint, and has seen no telemetry since.
    is_restored: bool,
    /// Whether the link was ordered to arm a vehicle that has not armed yet. The link arms it once it can.
    awaits_arming: bool,
    health: HealthMonitor,
    deconfliction: Deconfliction,
    /// `None` without a map.
    indoor: Option<Host>,
    outbox: Outbox<Transmit, Event>,
}

impl Navigation {
    /// Navigation of drone `id`, restored from `checkpoint` if there is one.
    #[must_use]
    pub fn new(id: NodeId, config: Config, checkpoint: Option<Checkpoint>) -> Self {
        let fence =
            (config.failsafe.fence.clone()).map(|fence| (fence, Fence::margin_m(config.speed_mps)));
        let mut navigation = Self {
            deconfliction: Deconfliction::new(id, config.avoid.clone(), fence),
            config,
            durable: Checkpoint::default(),
            position_requested: false,
            hold_commanded_m: None,
            track_expires_at: None,
            returns: false,
            is_restored: false,
            awaits_arming: false,
            health: HealthMonitor::default(),
            indoor: None,
            outbox: Outbox::new(),
        };
        match checkpoint {
            Some(checkpoint) => {
                navigation.awaits_arming =
                    matches!(checkpoint.goal, Some(Goal::TakeOff { arm: true, .. }));
                navigation.durable = checkpoint;
                navigation.is_restored = true;
                navigation.reset_deconfliction(Timestamp::ZERO);
                navigation.inform(Notice::Resync);
                if !navigation.deconfliction.ignores_traffic() {
                    navigation.outbox.transmit(Transmit::Resync);
                }
                navigation.command(FlightCommand::Report);
            }
            // A restart before the first input must ask for the goal, so it needs a checkpoint.
            None => navigation.set_progress(Progress::Planning),
        }
        navigation
    }

    /// The same, hosting an indoor machine if there is one.
    #[must_use]
    pub fn with_indoor(mut self, machine: Option<Box<dyn Indoor>>) -> Self {
        self.indoor = machine.map(Host::new);
        self
    }

    fn inform(&mut self, notice: Notice) {
        self.outbox.transmit(Transmit::Inform(notice));
    }

    fn command(&mut self, command: FlightCommand) {
        self.outbox.transmit(Transmit::FlightCommand(command));
    }

    fn set_progress(&mut self, progress: Progress) {
        self.durable.progress = progress;
        let checkpoint = Box::new(self.durable.clone());
        self.outbox.event(Event::Checkpoint(checkpoint));
    }

    fn accept_goal(&mut self, now: Timestamp, goal: Goal) {
        self.health.clear_reported();
        self.track_expires_at = None;
        if let Goal::Track {
            to, velocity, hold, ..
        } = goal
            && !self.health.is_position_lost()
        {
            return self.track(now, goal, (to, velocity, hold));
        }
        if self.durable.goal != Some(goal) {
            self.durable.goal = Some(goal);
            self.reset_deconfliction(now);
            self.set_progress(Progress::Planning);
        }
        if self.durable.progress == Progress::Done {
            self.inform_done(goal);
        } else {
            self.command(FlightCommand::Report);
        }
    }

    /// Starts deconfliction anew for the current goal; only [`Goal::FlyTo`] is flown in lockstep.
    fn reset_deconfliction(&mut self, now: Timestamp) {
        let in_lockstep = matches!(self.durable.goal, Some(Goal::FlyTo { .. }));
        self.deconfliction.reset(now, in_lockstep);
    }

    fn inform_done(&mut self, goal: Goal) {
        self.inform(if goal == Goal::Land {
            Notice::Landed
        } else {
            Notice::Arrived(goal)
        });
    }

    fn handle_telemetry(&mut self, now: Timestamp, telemetry: &Telemetry) {
        if std::mem::take(&mut self.position_requested) {
            self.inform(Notice::Position {
                position: telemetry.position,
                velocity: telemetry.velocity,
            });
        }
        self.awaits_arming &= !telemetry.armed;
        self.resume_tracking(now);
        self.apply_failsafe(now, telemetry);
        let is_landing = telemetry.landing || self.durable.goal == Some(Goal::Land);
        if is_landing || !self.health.is_position_lost() {
            self.advance(now, telemetry);
        }
    }

    /// Holds or resumes according to the health of the vehicle, and reports failures to the mission.
    fn apply_failsafe(&mut self, now: Timestamp, telemetry: &Telemetry) {
        let Config {
            failsafe,
            speed_mps,
            ..
        } = &self.config;
        let takes_off = matches!(self.durable.goal, Some(Goal::TakeOff { arm: true, .. }));
        let report = self
            .health
            .check(now, telemetry, failsafe, (takes_off, *speed_mps));
        if report.position_regained {
            self.hold_commanded_m = None;
            if self.durable.goal == Some(Goal::Yield) {
                self.command(FlightCommand::Yield);
            }
            self.set_progress(Progress::Planning);
        }
        if self.health.is_position_lost() && self.may_hold(telemetry) {
            // A goal received meanwhile may have another hold altitude.
            let altitude_m = self.hold_altitude_m(now, telemetry);
            if self.hold_commanded_m != Some(altitude_m) {
                self.hold_commanded_m = Some(altitude_m);
                self.hold(now, telemetry, altitude_m);
            }
            if telemetry.at_rest && matches!(self.durable.goal, Some(Goal::TransitTo { .. })) {
                // Out of lockstep and on the way to land others may land below it, and it may come down on them.
                self.announce_descent(now, telemetry);
            }
        }
        for failure in report.failures {
            if failure == Failure::Geofence {
                let altitude_m = self.hold_altitude_m(now, telemetry);
                self.hold(now, telemetry, altitude_m);
                // A landing goes on: the mission orders it once.
                if self.durable.goal != Some(Goal::Land) {
                    self.durable.goal = Some(Goal::Hold);
                    self.set_progress(Progress::Done);
                }
            }
            self.inform(Notice::Failing {
                failure,
                stop: telemetry.stop,
                is_airborne: telemetry.armed,
            });
        }
    }

    /// Whether a vehicle whose position is lost is to hold: it flies, and doesn't land. One that a pilot armed for a take-off
    /// that has not begun stands.
    fn may_hold(&self, telemetry: &Telemetry) -> bool {
        let durable = &self.durable;
        let stands = matches!(durable.goal, Some(Goal::TakeOff { .. }))
            && durable.progress == Progress::Planning
            && self.hold_commanded_m.is_none();
        telemetry.armed && !telemetry.landing && !stands && durable.goal != Some(Goal::Land)
    }

    /// Altitude at which to hold on the spot, in metres above home: the goal's, or while others are on the way there that
    /// of the last command, or where the vehicle comes to rest.
    fn hold_altitude_m(&self, now: Timestamp, telemetry: &Telemetry) -> f64 {
        let is_clear = |altitude_m: f64| {
            let column = Path::new(telemetry.stop, telemetry.stop.at_altitude(altitude_m));
            self.deconfliction.is_clear(now, column)
        };
        (self.durable.goal.and_then(Goal::hold_altitude_m))
            .filter(|it| self.hold_commanded_m == Some(*it) || is_clear(*it))
            .or(self.hold_commanded_m)
            .unwrap_or(telemetry.stop.altitude_m())
    }

    /// Holds on the spot at an altitude in metres above home.
    fn hold(&mut self, now: Timestamp, telemetry: &Telemetry, altitude_m: f64) {
        let path = Path::new(telemetry.position, telemetry.stop.at_altitude(altitude_m));
        self.announce_stop(now, path, false);
        self.command(FlightCommand::Fly(self.config.hold(altitude_m)));
    }

    fn advance(&mut self, now: Timestamp, telemetry: &Telemetry) {
        let Some(goal) = self.durable.goal else {
            return;
        };
        if goal != Goal::Land {
            let is_done = self.durable.progress == Progress::Done;
            let may_arm = matches!(goal, Goal::TakeOff { arm: true, .. }) && !is_done;
            if telemetry.landing || !(telemetry.armed || may_arm) {
                return self.report_not_flying(now, telemetry);
            }
        }
        if telemetry.at_rest && goal.may_make_room() {
            self.make_room(now, telemetry.stop);
        }
        match self.durable.progress.clone() {
            Progress::Done => {}
            Progress::Planning => self.plan_legs(now, goal, telemetry),
            Progress::Flying(_) if goal == Goal::Land => self.monitor_landing(now, telemetry),
            Progress::Flying(_) if matches!(goal, Goal::Track { .. }) => {
                self.monitor_track(now, telemetry);
            }
            Progress::Flying(_) if goal == Goal::Yield => {}
            Progress::Flying(corners) => self.monitor_legs(now, goal, corners, telemetry),
        }
    }

    /// Reports that the vehicle can't fly to a goal: it is on the ground or landing.
    fn report_not_flying(&mut self, now: Timestamp, telemetry: &Telemetry) {
        if telemetry.armed {
            self.announce_descent(now, telemetry);
            self.inform(Notice::UncommandedLanding(telemetry.landing_cause));
        } else {
            self.inform(Notice::Landed);
        }
    }

    /// Plans the legs to a goal from where the vehicle would come to rest.
    fn plan_legs(&mut self, now: Timestamp, goal: Goal, telemetry: &Telemetry) {
        match goal {
            Goal::TakeOff { .. } if !telemetry.armed => {
                let has_position = telemetry.position_lost_for.is_none();
                let has_charge = telemetry.charge > self.config.failsafe.battery_low;
                if has_position && has_charge {
                    self.awaits_arming = true;
                    self.command(FlightCommand::Arm);
                }
                return;
            }
            Goal::Track { .. } => return self.leave_track(now, telemetry),
            Goal::Yield => self.announce(now, None, false),
            _ => {}
        }
        self.set_progress(Progress::Flying(goal.corners(telemetry.stop)));
        self.advance(now, telemetry);
    }

    fn monitor_legs(
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
                self.announce(now, Some(Path::stationary(telemetry.position)), false);
                self.set_progress(Progress::Done);
                self.inform_done(goal);
            }
            Some(corner) => {
                if corners.len() < before {
                    self.set_progress(Progress::Flying(corners));
                }
                self.fly_to(now, corner, telemetry);
            }
        }
    }

    /// Flies straight to `corner` as soon as the path is clear.
    fn fly_to(&mut self, now: Timestamp, corner: Ned, telemetry: &Telemetry) {
        let path = Path::new(telemetry.stop, corner);
        let deconfliction = &mut self.deconfliction;
        if telemetry.target != Some(corner) {
            // An intent is one straight path, but braking and flying on may be two.
            let may_begin = deconfliction.ignores_traffic()
                || telemetry.at_rest && deconfliction.may_begin(now, path);
            if may_begin {
                self.announce(now, Some(path), false);
                let leg = self.config.leg(telemetry.stop, corner);
                self.command(FlightCommand::Fly(leg));
            } else if telemetry.at_rest
                && let Some(side) = self.start_detour(now, path)
            {
                self.fly_to(now, side, telemetry);
            } else {
                self.wait_for_traffic(now, Some(corner), telemetry);
            }
        } else if deconfliction.must_stop(now, telemetry.stop, corner) {
            self.wait_for_traffic(now, Some(corner), telemetry);
        } else {
            let place = telemetry.position;
            (self.deconfliction).announce_flight(now, place, corner, &mut self.outbox);
        }
    }

    /// Plans a leg aside and back, if another drone may come down here.
    fn make_room(&mut self, now: Timestamp, here: Ned) {
        let Some(side) = self.deconfliction.room_beside(now, here) else {
            return;
        };
        let mut corners = match &self.durable.progress {
            Progress::Planning => return,
            Progress::Flying(corners) => corners.clone(),
            Progress::Done => VecDeque::new(),
        };
        corners.push_front(here);
        corners.push_front(side);
        self.set_progress(Progress::Flying(corners));
    }

    /// Plans a detour around traffic that blocks the path for too long; returns its first corner.
    fn start_detour(&mut self, now: Timestamp, path: Path) -> Option<Ned> {
        let [side, level] = self.deconfliction.detour(now, path)?;
        let Progress::Flying(mut corners) = self.durable.progress.clone() else {
            return None;
        };
        corners.push_front(level);
        corners.push_front(side);
        self.set_progress(Progress::Flying(corners));
        Some(side)
    }

    /// Comes to rest and retries the path to `corner`, or the landing if `None`.
    fn wait_for_traffic(&mut self, now: Timestamp, corner: Option<Ned>, telemetry: &Telemetry) {
        let is_waiting = self.deconfliction.wait(now);
        // A vehicle that climbs while it brakes would come to rest higher each time it is told to hold.
        if is_waiting && !telemetry.at_rest && telemetry.target.is_none() {
            return self.announce_progress(now, telemetry);
        }
        let path = Path::new(telemetry.position, telemetry.stop);
        self.announce_stop(now, path, telemetry.at_rest);
        if !telemetry.at_rest || corner.is_some() && telemetry.target == corner {
            let hold = self.config.hold(telemetry.stop.altitude_m());
            self.command(FlightCommand::Fly(hold));
        }
    }

    /// Announces the path; `None` if it is unknown.
    fn announce(&mut self, now: Timestamp, path: Option<Path>, has_priority: bool) {
        (self.deconfliction).announce(now, path, has_priority, &mut self.outbox);
    }

    /// Announces that the drone comes to rest at the end of `path`.
    fn announce_stop(&mut self, now: Timestamp, path: Path, at_rest: bool) {
        (self.deconfliction).announce_stop(now, path, at_rest, &mut self.outbox);
    }

    /// Announces a landing that can't be interrupted.
    fn announce_descent(&mut self, now: Timestamp, telemetry: &Telemetry) {
        let (stop, place) = (telemetry.stop, telemetry.position);
        (self.deconfliction).announce_descent(now, stop, place, &mut self.outbox);
    }

    /// Announces the progress on the path.
    fn announce_progress(&mut self, now: Timestamp, telemetry: &Telemetry) {
        (self.deconfliction).announce_progress(now, telemetry.position, &mut self.outbox);
    }

    /// Asks for telemetry if what was learnt of other drones affects the own path.
    fn check_path(&mut self, is_affected: bool) {
        if is_affected {
            self.command(FlightCommand::Report);
        }
    }
}

impl Machine for Navigation {
    type Input = Input;
    type Transmit = Transmit;
    type Event = Event;

    fn handle_input(&mut self, now: Timestamp, input: Input) {
        match input {
            Input::Goal(goal) => self.accept_goal(now, goal),
            Input::Locate => {
                self.position_requested = true;
                self.command(FlightCommand::Report);
            }
            Input::Telemetry(telemetry) => self.handle_telemetry(now, &telemetry),
            Input::Traffic {
                sender,
                intent,
                heard_at,
            } => {
                let is_affected =
                    (self.deconfliction).update_traffic(now, sender, (intent, heard_at));
                self.check_path(is_affected);
            }
            Input::Deaf(deaf) => {
                let is_affected = self.deconfliction.update_deaf(now, deaf);
                self.check_path(is_affected);
            }
            Input::Indoor(input) => {
                if let Some(indoor) = &mut self.indoor {
                    indoor.step(now, Stimulus::Input(input), &mut self.outbox);
                }
            }
            Input::Resync => self.command(FlightCommand::Report),
            Input::ResendIntent => self.deconfliction.send_intent(true, &mut self.outbox),
        }
    }

    fn handle_timeout(&mut self, now: Timestamp) {
        if let Some(indoor) = &mut self.indoor {
            indoor.step(now, Stimulus::Timeout, &mut self.outbox);
        }
        let track_expired = self.track_expires_at.take_if(|at| *at <= now).is_some();
        if track_expired {
            self.set_progress(Progress::Planning);
        }
        let is_check_due = self.health.next_check().is_some_and(|at| at <= now);
        let is_traffic_due = self.deconfliction.take_due(now);
        if is_check_due {
            self.health.checked();
        }
        if track_expired || is_check_due || is_traffic_due {
            self.command(FlightCommand::Report);
        }
    }

    fn poll_output(&mut self) -> Output<Transmit, Event> {
        let deadlines = [
            self.health.next_check(),
            self.deconfliction.deadline(),
            self.track_expires_at,
            self.indoor.as_ref().and_then(Host::deadline),
        ];
        self.outbox.poll(deadlines.into_iter().flatten().min())
    }
}

#[cfg(test)]
mod tests;
