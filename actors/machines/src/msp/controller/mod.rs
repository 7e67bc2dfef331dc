//! Link to a flight controller that takes sticks: an estimator, control loops and the arm switch behind the commands that
//! the navigation gives to any vehicle.

mod arming;
mod authority;
mod battery;
mod checkpoint;
mod config;
mod control;
mod estimator;
mod gate;
mod guidance;
mod impairment;
mod lift;
mod loops;
mod message;
mod reports;
mod tether;
mod touchdown;

use std::time::Duration;

use muster_msp::{Status, Telemetry as MspTelemetry};

use self::arming::Arming;
use self::authority::Authority;
pub use self::authority::{ACKNOWLEDGED_MIN, FRESH_ANSWER_TIMEOUT, Handover, LOST_AFTER, Taken};
use self::battery::Gauge;
pub use self::checkpoint::Flight;
pub use self::config::{Config, FlowModule, Gains, Noise, PlaceSensor, Receiver, Stage};
pub use self::estimator::{Agreement, Innovations, fix_place};
use self::gate::Gate;
pub use self::loops::HEIGHT_LOST_AFTER;
use self::loops::{ControlLoops, Hands};
pub use self::message::{PortEvent, Pose};
use self::reports::{Reported, Reports};
pub use self::tether::{
    TETHER_HEIGHT_MAX_M, TETHER_RADIUS_MAX_M, TETHER_THROTTLE_MAX, TETHER_TILT_MAX_RAD,
};
use super::outputs::Outputs;
use super::{Checkpoint, Event, FlightCommand, Input, Telemetry, Transmit};
use crate::machine::{Machine, Output};
use crate::time::Timestamp;

/// From one control step to the next: 50 Hz, as often as RC frames leave.
const PERIOD: Duration = Duration::from_millis(20);

/// A link to a flight controller that takes sticks.
///
/// Invariant: what leaves it passes its gate: no value above its stage.
#[derive(Debug)]
pub struct ControllerLink {
    place: PlaceSensor,
    gave_up: bool,
    /// It is to land as soon as it is known whether and where it flies.
    must_land: bool,
    gate: Gate,
    reports: Reports,
    gauge: Gauge,
    authority: Authority,
    arming: Arming,
    loops: ControlLoops,
    /// Its motors are to stop, and it is still armed.
    is_stopped: bool,
    /// When the controller last said that it is disarmed, since its port was opened.
    stood_at: Option<Timestamp>,
    deadline: Option<Timestamp>,
    outputs: Outputs,
}

impl ControllerLink {
    /// A link, restored from `checkpoint` if there is one. Its port is closed.
    #[must_use]
    pub fn new(config: Config, checkpoint: Option<Checkpoint>, now: Timestamp) -> Self {
        let before = checkpoint.and_then(|it| it.flight);
        let has_flown = before.is_some_and(|it| it.has_flown);
        let taken = before.map(|it| it.taken).unwrap_or_default();
        let mut link = Self {
            place: config.place,
            gave_up: checkpoint.is_some_and(|it| it.gave_up),
            must_land: before.is_some_and(|it| it.is_landing),
            gate: Gate::new(&config),
            reports: Reports::new(has_flown),
            gauge: Gauge::default(),
            authority: Authority::new(config.receiver, has_flown, taken, now),
            arming: Arming::new(config.receiver, has_flown, now),
            loops: ControlLoops::new(&config, before, now),
            is_stopped: false,
            stood_at: None,
            deadline: None,
            outputs: Outputs::new(),
        };
        if checkpoint.is_some() {
            link.outputs.resync();
        }
        link.keep();
        link
    }

    /// How well what it measured in flight agreed with what it expected.
    #[must_use]
    pub const fn innovations(&self) -> Innovations {
        self.loops.estimator.innovations()
    }

    fn is_armed(&self) -> bool {
        self.reports.last().is_some_and(|it| it.armed)
    }

    fn handle_command(&mut self, now: Timestamp, command: FlightCommand) {
        match command {
            FlightCommand::Report => return self.report(now),
            _ if self.gave_up => return,
            FlightCommand::Arm => self.arming.order(),
            FlightCommand::Yield => return self.report(now),
            FlightCommand::Fly(setpoint) if self.is_armed() && !self.must_land => {
                self.loops.fly(now, self.gate.stage(), setpoint);
            }
            FlightCommand::Fly(_) => {}
            FlightCommand::Land => self.must_land = true,
        }
        self.keep();
        self.report_news(now);
    }

    /// Begins to land, if it is to and has not begun; on the ground it stays there.
    fn land_if_due(&mut self, now: Timestamp) {
        if !self.must_land {
            return;
        }
        if !self.is_armed() {
            self.arming.end();
        } else {
            self.loops.land(now);
        }
    }

    fn handle_port(&mut self, now: Timestamp, event: PortEvent) {
        match event {
            PortEvent::Identified { identity, granted } => {
                // The port still repeats the sticks that a link gave before its restart.
                if self.gate.identity().is_some() {
                    self.close();
                }
                self.gate.open(*identity, granted);
            }
            PortEvent::Closed => self.close(),
            // From an autopilot, which this link does not have.
            PortEvent::Autopilot(_) => {}
            PortEvent::Pose(pose) => {
                self.loops.estimator.predict(now);
                self.loops.estimator.measure_pose(now, &pose);
            }
            PortEvent::Flow(reading) => {
                self.loops.estimator.predict(now);
                self.loops.estimator.measure_flow(now, &reading);
            }
            PortEvent::Telemetry(telemetry) => {
                self.loops.estimator.predict(now);
                if !matches!(telemetry, MspTelemetry::Acknowledged(_)) {
                    self.authority
                        .heard(now, matches!(telemetry, MspTelemetry::Late));
                }
                match telemetry {
                    MspTelemetry::Status(status) => self.handle_status(now, &status),
                    MspTelemetry::Attitude(attitude) => {
                        self.loops.estimator.measure_attitude(now, &attitude);
                    }
                    MspTelemetry::Altitude(altitude) => {
                        self.loops.estimator.measure_altitude(now, &altitude);
                    }
                    MspTelemetry::Gps(gps) if self.place == PlaceSensor::Gps => {
                        self.loops.estimator.measure_gps(now, &gps);
                    }
                    MspTelemetry::Gps(_) => return,
                    MspTelemetry::Battery(state) if battery::is_possible(&state) => {
                        self.gauge.measure(&state);
                        self.loops.watch.measure_battery(&state);
                    }
                    MspTelemetry::Motor(motors) => self.loops.watch.measure_motors(&motors),
                    MspTelemetry::Acknowledged(count) => {
                        if self.authority.count_acknowledged(count) {
                            self.lose(now);
                        }
                        return;
                    }
                    MspTelemetry::Battery(_)
                    | MspTelemetry::Rc(_)
                    | MspTelemetry::Sonar(_)
                    | MspTelemetry::Analog(_)
                    | MspTelemetry::Late => return,
                }
                self.take_up(now);
            }
        }
    }

    /// Nothing leaves until the controller has said who it is and how it is.
    fn close(&mut self) {
        self.gate.close();
        self.reports.close();
        self.stood_at = None;
        self.deadline = None;
        self.outputs.rc(None);
    }

    /// The link was lost in flight, or the height: the controller's failsafe is to fly.
    fn lose(&mut self, now: Timestamp) {
        self.outputs.rc(None);
        self.keep();
        self.report_news(now);
    }

    fn handle_status(&mut self, now: Timestamp, status: &Status) {
        let Some(identity) = self.gate.identity() else {
            return;
        };
        let was_armed = self.reports.current().is_some_and(|it| it.armed);
        let last = self.reports.last();
        let said = Reported::of(status, &identity.boxes);
        self.reports.take(said);
        let Some(reported) = self.reports.current() else {
            return;
        };
        if reported.armed && !was_armed {
            self.meet_armed(now, last);
        }
        if !said.armed {
            self.stood_at = Some(now);
        }
        self.loops.estimator.stand(now, !reported.armed);
        self.authority.take(now, reported);
        self.deadline.get_or_insert(now + PERIOD);
        self.step(now);
    }

    /// It is armed, and was not, as far as is known. A pilot may have taken off while nothing was heard.
    /// `last`: what it said last.
    fn meet_armed(&mut self, now: Timestamp, last: Option<Reported>) {
        let (has_pilot, has_flown) = (self.authority.has_pilot(), self.arming.has_flown());
        let stood = self.stood_at.is_some_and(|at| now.since(at) <= LOST_AFTER);
        if last.is_none() && !has_flown || has_pilot && !stood {
            self.loops.meet(now, last.is_some_and(|it| !it.armed));
        } else if !has_flown {
            self.loops.arm(now);
        }
    }

    /// Goes on with what was flown before a restart, once the controller is known. An aircraft that was brought down meanwhile
    /// stays there: it gets no RC until it has disarmed.
    fn take_up(&mut self, now: Timestamp) {
        if self.reports.current().is_some()
            && self.loops.take_up(now, self.is_armed())
            && self.authority.give_up()
        {
            self.lose(now);
        }
    }

    /// One control step: moves the arm switch, and yields the newest sticks.
    fn step(&mut self, now: Timestamp) {
        let Some(reported) = self.reports.current() else {
            return;
        };
        self.loops.estimator.predict(now);
        self.is_stopped &= self.is_armed();
        self.detect_end(now);
        if self.is_armed() && self.loops.is_height_lost(now) && self.authority.give_up() {
            self.lose(now);
        }
        let (stage, is_simulation) = (self.gate.stage(), self.gate.is_simulation());
        self.arming.step(now, stage, is_simulation, reported);
        let sticks = (self.loops).sticks(now, stage, self.hands(), !self.must_land);
        let rc = match self.authority.may_send() {
            true => self.gate.rc(sticks, self.arming.is_high(), Some(reported)),
            false => None,
        };
        self.outputs.rc(rc);
        self.keep();
        self.report_news(now);
    }

    fn hands(&self) -> Hands {
        if !self.is_armed() {
            Hands::None
        } else if !self.authority.is_links() {
            Hands::Others
        } else if self.authority.is_waiting() {
            Hands::Pilot
        } else if self.is_stopped {
            Hands::None
        } else {
            Hands::Link
        }
    }

    /// Lands an aircraft that does not do what it is told; one that has not left the ground or lies on its side stops its motors,
    /// and so does one that has landed.
    fn detect_end(&mut self, now: Timestamp) {
        let is_flown = self.is_armed() && self.authority.is_links() && self.gate.may_fly();
        let remedy = self.loops.detect_impairment(now, is_flown);
        self.must_land |= remedy.must_land;
        if remedy.must_stop_motors {
            self.stop_motors();
        }
        self.land_if_due(now);
        let is_links = self.hands() == Hands::Link;
        if self.loops.has_landed(now, is_links) {
            self.stop_motors();
        }
    }

    /// The arm switch goes low, for good; where a pilot has it the link gives idle sticks until it has disarmed. What the
    /// pilot flies then, and hands over, is flown.
    fn stop_motors(&mut self) {
        self.arming.end();
        self.is_stopped |= self.hands() == Hands::Link;
    }

    fn telemetry(&self, now: Timestamp) -> Telemetry {
        let loops = &self.loops;
        let estimate = loops.estimate();
        let (stop, is_at_rest) = loops.rest(now, &estimate);
        let is_lost = self.authority.taken().by_failsafe;
        let armed = self.reports.last().map_or(is_lost, |it| it.armed);
        let gate = &self.gate;
        let is_anothers =
            !self.authority.is_links() || gate.identity().is_some() && !gate.may_fly();
        let landing = armed && (loops.is_landing() || is_anothers);
        Telemetry {
            position: estimate.position,
            position_lost_for: loops.estimator.lost_for(now),
            velocity: estimate.velocity,
            stop,
            at_rest: !armed || !landing && is_at_rest,
            armed,
            landing,
            landing_cause: self.authority.taken().cause().or(loops.impaired()),
            target: loops.target().filter(|_| armed),
            charge: self.gauge.charge().unwrap_or(1.0),
        }
    }

    /// Whether there is something to report: the controller has said whether it is armed, and if it is, where it is; or it is
    /// silent.
    fn can_report(&self) -> bool {
        let is_known = self.reports.last().is_some()
            && (!self.is_armed() || self.loops.estimator.estimate().is_some());
        is_known || !self.authority.may_send()
    }

    fn report(&mut self, now: Timestamp) {
        if self.can_report() {
            self.outputs.report(self.telemetry(now));
        }
    }

    /// Reports what the navigation must know at once.
    fn report_news(&mut self, now: Timestamp) {
        if self.can_report() {
            self.outputs.report_if_news(self.telemetry(now));
        }
    }

    fn checkpoint(&self) -> Checkpoint {
        let loops = &self.loops;
        let flight = Flight {
            has_flown: self.arming.has_flown(),
            setpoint: loops.setpoint(),
            from: loops.from(),
            start: loops.start(),
            is_high: loops.is_high(),
            is_landing: self.must_land,
            hover_throttle: loops.hover_throttle(),
            ground_m: loops.estimator.ground_m(),
            taken: self.authority.taken(),
            impaired: loops.impaired(),
        };
        Checkpoint {
            gave_up: self.gave_up,
            flight: Some(flight),
        }
    }

    /// Keeps a checkpoint, if it has changed.
    fn keep(&mut self) {
        self.outputs.keep_if_changed(self.checkpoint());
    }
}

impl Machine for ControllerLink {
    type Input = Input;
    type Transmit = Transmit;
    type Event = Event;

    fn handle_input(&mut self, now: Timestamp, input: Input) {
        match input {
            Input::FlightCommand(command) => self.handle_command(now, command),
            Input::Port(event) => self.handle_port(now, event),
            // From a closed-form vehicle, which this link does not have.
            Input::Telemetry(_) => {}
            Input::GiveUp => {
                self.gave_up = true;
                self.must_land = true;
                self.outputs.keep(self.checkpoint());
            }
        }
    }

    fn handle_timeout(&mut self, now: Timestamp) {
        if self.authority.handle_timeout(now) {
            self.lose(now);
        }
        if self.deadline.is_some_and(|at| at <= now) {
            self.step(now);
            self.deadline = Some(now + PERIOD);
        }
    }

    fn poll_output(&mut self) -> Output<Transmit, Event> {
        let deadlines = [self.deadline, self.authority.deadline()];
        self.outputs.poll(deadlines.into_iter().flatten().min())
    }
}

#[cfg(test)]
mod tests;
