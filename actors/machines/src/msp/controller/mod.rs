//! Link to a flight controller that takes sticks: an estimator, control loops and the arm switch behind the commands that
//! the navigation gives to any vehicle.

mod arming;
mod authority;
mod battery;
mod config;
mod control;
mod estimator;
mod guidance;
mod impairment;
mod reports;
mod tether;
mod touchdown;

use std::time::Duration;

use muster_msp::{Channel, Identity, Mode, SetRawRc, Status, Sticks, Telemetry as Told};
use serde::{Deserialize, Serialize};

use self::arming::Arming;
use self::authority::Authority;
pub use self::authority::{ACKNOWLEDGED_MIN, LOST_AFTER, Taken};
use self::battery::Gauge;
pub use self::config::{Config, Gains, Noise, PlaceSensor, Receiver, Stage};
use self::control::{Control, Lean};
pub use self::estimator::fix_place;
use self::estimator::{Estimate, Estimator, Tilt};
use self::guidance::Guidance;
use self::impairment::{Finding, Response, Watch};
use self::reports::{Reported, Reports};
pub use self::tether::{
    TETHER_HEIGHT_MAX_M, TETHER_RADIUS_MAX_M, TETHER_THROTTLE_MAX, TETHER_TILT_MAX_RAD,
};
use self::touchdown::{Descent, Touchdown};
use super::{Checkpoint, Event, FlightCommand, Input, LandingCause, Setpoint, Telemetry, Transmit};
use crate::geometry::{Ned, Velocity};
use crate::machine::{Machine, Outbox, Output};
use crate::time::Timestamp;

/// From one control step to the next: 50 Hz, as often as RC frames leave.
const PERIOD: Duration = Duration::from_millis(20);
/// Altitude and climb of a vehicle that has left the ground, in metres and m/s. Until then it is kept level: leaning on the
/// ground tips it over.
const LIFTED_M: f64 = 0.5;
/// As above.
const LIFTED_MPS: f64 = 0.3;
/// Modes in which sticks are no tilts, or throttle is no thrust.
const OTHER_MODES: [Mode; 4] = [Mode::Horizon, Mode::AltHold, Mode::PosHold, Mode::GpsRescue];
/// Value of the switch of the mode ANGLE: always on.
const ANGLE: Channel = Channel::HIGH;
/// `ARM_SWITCH` is the last of the reasons not to arm.
const fn arm_switch(count: u8) -> u32 {
    1_u32.wrapping_shl(count.saturating_sub(1) as u32)
}

/// What a vehicle flies that a pilot handed over in the air before it was told anything.
const fn hold(altitude_m: f64) -> Setpoint {
    Setpoint::Hold {
        altitude_m,
        vertical_mps: 1.0,
        acceleration_mps2: 1.0,
    }
}

/// What a link is told: by the port of its controller, or by a sensor beside it.
#[derive(Debug, Clone, PartialEq)]
pub enum PortEvent {
    /// The controller said who it is. The port is open.
    Identified {
        /// Who it is.
        identity: Box<Identity>,
        /// The highest stage above `bench` that a grant allows with it; `Bench` without one.
        granted: Stage,
    },
    /// The port was closed.
    Closed,
    /// The controller told something.
    Told(Told),
    /// A sensor beside the controller measured where the vehicle is.
    Pose(Pose),
    /// An autopilot told something.
    Autopilot(super::autopilot::Told),
}

/// Where a vehicle is, as measured from outside: by motion capture, beacons or a localisation of its own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// In the drone's local frame.
    pub position: Ned,
    /// Standard deviation on each axis, in metres.
    pub sigma_m: f64,
    /// Time since it was measured.
    pub age: Duration,
}

/// What a link needs to go on after a restart.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Flight {
    /// The motors were or may have been armed.
    pub has_flown: bool,
    /// What it was told to fly.
    pub setpoint: Option<Setpoint>,
    /// Where it was when it was first told to fly.
    pub start: Option<Ned>,
    /// Whether it was landing.
    pub is_landing: bool,
    /// Throttle at which the vehicle hovers, 0 to 1.
    pub hover_throttle: f64,
    /// The barometer's altitude on the ground, in metres.
    pub ground_m: Option<f64>,
    /// Whether the pilot or the controller's failsafe took the aircraft.
    pub taken: Taken,
    /// Why it lands, if the aircraft does not do what it is told.
    pub impaired: Option<LandingCause>,
}

/// A link to a flight controller that takes sticks.
///
/// Invariant: what leaves it passes one gate: no value above its stage.
#[derive(Debug)]
pub struct ControllerLink {
    config: Config,
    gave_up: bool,
    /// What was flown before a restart, until it is taken up.
    before: Option<Flight>,
    kept: Option<Flight>,
    /// It is to land as soon as it is known whether and where it flies.
    must_land: bool,
    identity: Option<Identity>,
    /// The configured one, or what is left of it without a grant.
    stage: Stage,
    /// Where it was when it was first told to fly.
    start: Option<Ned>,
    reports: Reports,
    gauge: Gauge,
    authority: Authority,
    estimator: Estimator,
    arming: Arming,
    guidance: Guidance,
    control: Control,
    stepped_at: Timestamp,
    /// It has left the ground.
    has_lifted: bool,
    /// It was armed when it was met, and nothing is known of its flight: it may be in the air.
    was_met_armed: bool,
    touchdown: Touchdown,
    watch: Watch,
    /// Why it must land, if the aircraft does not do what it is told. The first reason counts.
    impaired: Option<LandingCause>,
    last: Option<Telemetry>,
    deadline: Option<Timestamp>,
    outbox: Outbox<Transmit, Event>,
}

impl ControllerLink {
    /// A link, restored from `checkpoint` if there is one. Its port is closed.
    #[must_use]
    pub fn new(config: Config, checkpoint: Option<Checkpoint>, now: Timestamp) -> Self {
        let before = checkpoint.and_then(|it| it.flight);
        let mut gains = match config.stage {
            Stage::Tethered => tether::gains(config.gains),
            Stage::Sim | Stage::Bench | Stage::Flight => config.gains,
        };
        if let Some(flight) = before {
            gains.hover_throttle = flight.hover_throttle;
        }
        let has_flown = before.is_some_and(|it| it.has_flown);
        let ground_m = before.and_then(|it| it.ground_m);
        let taken = before.map(|it| it.taken).unwrap_or_default();
        let mut link = Self {
            config,
            gave_up: checkpoint.is_some_and(|it| it.gave_up),
            before,
            kept: None,
            must_land: before.is_some_and(|it| it.is_landing),
            identity: None,
            stage: config.stage.min(Stage::Bench),
            start: before.and_then(|it| it.start),
            reports: Reports::new(has_flown),
            gauge: Gauge::default(),
            authority: Authority::new(config.receiver, has_flown, taken, now),
            estimator: Estimator::new(&config, now, ground_m),
            arming: Arming::new(config.receiver, has_flown, now),
            guidance: Guidance::new(config.landing),
            control: Control::new(gains),
            stepped_at: now,
            has_lifted: before.is_some_and(|it| it.setpoint.is_some()),
            was_met_armed: false,
            touchdown: Touchdown::default(),
            watch: Watch::default(),
            impaired: before.and_then(|it| it.impaired),
            last: None,
            deadline: None,
            outbox: Outbox::new(),
        };
        if link.impaired == Some(LandingCause::Thrust) {
            link.control.expect_little_thrust();
        }
        if checkpoint.is_some() {
            link.outbox.transmit(Transmit::Resync);
        }
        link.keep();
        link
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
            FlightCommand::Fly(setpoint) => self.fly(now, setpoint),
            FlightCommand::Land => self.must_land = true,
        }
        self.keep();
        self.report_news(now);
    }

    fn fly(&mut self, now: Timestamp, setpoint: Setpoint) {
        if !self.is_armed() || self.must_land {
            return;
        }
        self.estimator.set_ground();
        if let Some(estimate) = self.estimator.estimate() {
            self.before = None;
            let start = *self.start.get_or_insert(estimate.position);
            let setpoint = match self.stage {
                Stage::Tethered => tether::setpoint(start, setpoint),
                Stage::Sim | Stage::Bench | Stage::Flight => setpoint,
            };
            self.guidance.fly(now, setpoint, &estimate);
        }
    }

    /// Begins to land, if it is to and has not begun; on the ground it stays there.
    fn land_if_due(&mut self, now: Timestamp) {
        if !self.must_land {
            return;
        }
        if !self.is_armed() {
            self.arming.end();
        } else if let Some(estimate) = self.estimator.estimate() {
            self.guidance.land(now, &estimate);
        }
    }

    fn handle_port(&mut self, now: Timestamp, event: PortEvent) {
        match event {
            PortEvent::Identified { identity, granted } => {
                // The port still repeats the sticks that a link gave before its restart.
                if self.identity.is_some() {
                    self.close();
                }
                // Without ARM among its modes it can't say whether it is armed.
                let has_arm = identity.boxes.modes.contains(&Mode::Arm);
                self.identity = has_arm.then_some(*identity);
                self.stage = match self.config.receiver {
                    Receiver::Override => self.config.stage.min(granted.max(Stage::Bench)),
                    Receiver::Sole => self.config.stage.min(Stage::Bench),
                };
            }
            PortEvent::Closed => self.close(),
            // From an autopilot, which this link does not have.
            PortEvent::Autopilot(_) => {}
            PortEvent::Pose(pose) => {
                self.estimator.predict(now);
                self.estimator.measure_pose(now, &pose);
            }
            PortEvent::Told(told) => {
                self.estimator.predict(now);
                if !matches!(told, Told::Acknowledged(_)) {
                    self.authority.heard(now);
                }
                match told {
                    Told::Status(status) => self.handle_status(now, &status),
                    Told::Attitude(attitude) => self.estimator.measure_attitude(now, &attitude),
                    Told::Altitude(altitude) => self.estimator.measure_altitude(now, &altitude),
                    Told::Gps(gps) if self.config.place == PlaceSensor::Gps => {
                        self.estimator.measure_gps(now, &gps);
                    }
                    Told::Gps(_) => return,
                    Told::Battery(state) => {
                        self.gauge.measure(&state);
                        self.watch.measure_battery(&state);
                    }
                    Told::Motor(motors) => self.watch.measure_motors(&motors),
                    Told::Acknowledged(count) => {
                        if self.authority.count_acknowledged(count) {
                            self.lose(now);
                        }
                        return;
                    }
                    Told::Rc(_) | Told::Sonar(_) | Told::Analog(_) | Told::Late => return,
                }
                self.take_up(now);
            }
        }
    }

    /// Nothing leaves until the controller has said who it is and how it is.
    fn close(&mut self) {
        self.identity = None;
        self.reports.close();
        self.deadline = None;
        self.outbox.transmit(Transmit::Rc(None));
    }

    /// The link was lost in flight: the controller's failsafe is to fly.
    fn lose(&mut self, now: Timestamp) {
        self.outbox.transmit(Transmit::Rc(None));
        self.keep();
        self.report_news(now);
    }

    fn handle_status(&mut self, now: Timestamp, status: &Status) {
        let Some(identity) = &self.identity else {
            return;
        };
        let is_active = |mode| identity.boxes.is_active(mode, status.modes());
        let arming = status.flags.arming;
        let is_first = self.reports.last().is_none();
        self.reports.take(Reported {
            armed: is_active(Mode::Arm) == Some(true),
            is_prevented: arming.bits & !arm_switch(arming.count) != 0,
            failsafe: is_active(Mode::Failsafe) == Some(true),
            overridden: is_active(Mode::MspOverride),
            levels: is_active(Mode::Angle) == Some(true)
                && OTHER_MODES.iter().all(|it| is_active(*it) != Some(true)),
        });
        let Some(reported) = self.reports.current() else {
            return;
        };
        if reported.armed && !self.arming.has_flown() {
            self.was_met_armed = is_first;
            if is_first {
                self.estimator.set_ground_where_armed();
            } else {
                self.estimator.forget_height();
            }
        }
        self.estimator.stand(!reported.armed);
        self.authority.take(now, reported);
        self.deadline.get_or_insert(now + PERIOD);
        self.step(now);
    }

    /// Goes on with what was flown before a restart, once it is known where the vehicle is.
    fn take_up(&mut self, now: Timestamp) {
        if self.before.is_none() || self.reports.current().is_none() {
            return;
        }
        let Some(estimate) = self.estimator.estimate() else {
            return;
        };
        let Some(before) = self.before.take() else {
            return;
        };
        if !self.is_armed() {
            return;
        }
        if let Some(setpoint) = before.setpoint.filter(|_| !self.must_land) {
            self.guidance.fly(now, setpoint, &estimate);
        }
    }

    /// One control step: moves the arm switch, and yields the newest sticks.
    fn step(&mut self, now: Timestamp) {
        let Some(reported) = self.reports.current() else {
            return;
        };
        let seconds = now.since(self.stepped_at).as_secs_f64().min(0.1);
        self.stepped_at = now;
        self.estimator.predict(now);
        self.detect_impairment(now);
        self.land_if_due(now);
        self.detect_ground(now);
        self.arming
            .step(now, self.stage, self.is_simulation(), reported);
        let sticks = self.sticks(now, seconds);
        let rc = self
            .authority
            .may_send()
            .then(|| self.gate(sticks))
            .flatten();
        self.outbox.transmit(Transmit::Rc(rc));
        let is_kept = self.kept.is_some_and(|kept| {
            (kept.has_flown, kept.taken, kept.impaired)
                == (
                    self.arming.has_flown(),
                    self.authority.taken(),
                    self.impaired,
                )
        });
        if !is_kept {
            self.keep();
        }
        self.report_news(now);
    }

    /// Whether the controller says that no motor hangs on it.
    fn is_simulation(&self) -> bool {
        let board = self.identity.as_ref().map(|it| it.board.board.0);
        board == Some(*b"SITL")
    }

    /// Whether its stage lets it fly this controller.
    fn may_fly(&self) -> bool {
        match self.stage {
            Stage::Sim => self.is_simulation(),
            Stage::Bench => false,
            Stage::Tethered | Stage::Flight => true,
        }
    }

    fn sticks(&mut self, now: Timestamp, seconds: f64) -> Sticks {
        let tilt = self.estimator.tilt();
        if !self.is_armed() {
            (self.has_lifted, self.was_met_armed) = (false, false);
            return Sticks::IDLE;
        }
        if !self.authority.is_links() {
            // Not heard, unless the pilot gives the sticks back.
            return self.control.level(tilt);
        }
        let was_flying = self.has_lifted || self.before.is_some_and(|it| it.setpoint.is_some());
        let Some(estimate) = self.estimator.estimate() else {
            // Right after a restart in the air, or right after arming.
            return self.level_if(was_flying || self.was_met_armed, tilt);
        };
        let altitude_m = estimate.position.altitude_m();
        let climbs = estimate.velocity.0.z < -LIFTED_MPS;
        self.has_lifted |= altitude_m > LIFTED_M && (climbs || self.was_met_armed);
        let is_in_air = self.has_lifted && altitude_m > LIFTED_M;
        if self.is_flown_by_pilot() {
            // What it gives is not heard, until the pilot hands the sticks over.
            self.estimator.set_ground_where_armed();
            self.guidance.begin_anew(now, &estimate);
            return self.level_if(is_in_air, tilt);
        }
        if is_in_air && self.guidance.setpoint().is_none() {
            self.fly(now, hold(altitude_m));
            self.keep();
        }
        if self.watch.is_tilted() {
            return Control::upright();
        }
        let still_for = self.touchdown.still_for(now);
        match self.guidance.reference(now, &estimate, still_for) {
            Some(reference) => {
                let reference = match (self.stage, self.start) {
                    (Stage::Tethered, Some(start)) => tether::reference(start, reference),
                    _ => reference,
                };
                let is_free = self.has_lifted && !self.touchdown.is_pressed();
                let lean = match self.estimator.lost_for(now) {
                    _ if !is_free => Lean::Level,
                    Some(_) => Lean::Steady,
                    None => Lean::Free,
                };
                let control = &mut self.control;
                control.step(seconds, &reference, &estimate, tilt, lean)
            }
            // Right after a restart in the air; else on the ground, before the first setpoint.
            None => self.level_if(was_flying, tilt),
        }
    }

    fn level_if(&self, flies: bool, tilt: Tilt) -> Sticks {
        if flies {
            self.control.level(tilt)
        } else {
            Sticks::IDLE
        }
    }

    /// Whether a pilot, who may give the sticks to the link, flies by hand.
    fn is_flown_by_pilot(&self) -> bool {
        let overridden = self.reports.last().and_then(|it| it.overridden);
        self.config.receiver == Receiver::Override && overridden == Some(false)
    }

    /// The last point before values leave: nothing above the stage does.
    /// `None`: it does not take the sticks of a pilot who has armed what it may not fly, and gives none to a controller that
    /// would take them for something else.
    fn gate(&self, sticks: Sticks) -> Option<SetRawRc> {
        let is_heard =
            |it: Reported| self.config.receiver == Receiver::Sole || it.overridden == Some(true);
        let takes_others = |it: Reported| it.armed && !it.levels && is_heard(it);
        if self.reports.last().is_some_and(takes_others) {
            return None;
        }
        let arm = if self.arming.is_high() {
            Channel::HIGH
        } else {
            Channel::LOW
        };
        let (sticks, aux) = match self.stage {
            _ if !self.may_fly() => match self.config.receiver {
                Receiver::Override if self.is_armed() => return None,
                Receiver::Override | Receiver::Sole => (Sticks::IDLE, [Channel::LOW; 2]),
            },
            Stage::Sim | Stage::Bench => (sticks, [arm, ANGLE]),
            Stage::Tethered => {
                let sticks = tether::sticks(sticks, &self.config.gains);
                (sticks, [Channel::LOW, ANGLE])
            }
            Stage::Flight => (sticks, [Channel::LOW, ANGLE]),
        };
        Some(SetRawRc::new(sticks, &aux).expect("two aux channels are within the limit"))
    }

    /// Looks whether an aircraft that the link flies does what it is told. If not it lands; one that has not left the ground
    /// or lies on its side stops its motors.
    fn detect_impairment(&mut self, now: Timestamp) {
        let is_flown = self.is_armed() && self.authority.is_links() && self.may_fly();
        let estimate = self.estimator.estimate().filter(|_| is_flown);
        let response = estimate.map(|estimate| Response {
            tilt_rad: libm::acos(self.estimator.tilt().vertical_share()),
            up_mps2: -self.control.down_mps2(),
            climb_mps: -estimate.velocity.0.z,
        });
        match self.watch.look(now, response) {
            None => {}
            Some(Finding::Tipped) => self.arming.end(),
            Some(Finding::Impaired(cause)) => {
                self.impaired.get_or_insert(cause);
                self.must_land = true;
                match cause {
                    LandingCause::Thrust if self.has_lifted => self.control.expect_little_thrust(),
                    LandingCause::Thrust => self.arming.end(),
                    _ => {}
                }
            }
        }
    }

    /// Stops the motors of a vehicle that has landed.
    fn detect_ground(&mut self, now: Timestamp) {
        let estimate = self.estimator.estimate();
        let descent = estimate.filter(|_| self.guidance.is_landing());
        let descent = descent.map(|estimate| Descent {
            down_mps2: self.control.down_mps2(),
            height_m: estimate.position.altitude_m(),
            height_age: self.estimator.height_age(now),
            is_expected: self.guidance.expects_ground(now),
        });
        if self.touchdown.look(now, descent) {
            self.arming.end();
        }
    }

    fn telemetry(&self, now: Timestamp) -> Telemetry {
        let estimate = self.estimator.estimate().unwrap_or(Estimate {
            position: Ned::HOME,
            velocity: Velocity::ZERO,
        });
        let is_lost = self.authority.taken().by_failsafe;
        let armed = self.reports.last().map_or(is_lost, |it| it.armed);
        let is_anothers = !self.authority.is_links() || self.identity.is_some() && !self.may_fly();
        let landing = armed && (self.guidance.is_landing() || is_anothers);
        Telemetry {
            position: estimate.position,
            position_lost_for: self.estimator.lost_for(now),
            velocity: estimate.velocity,
            stop: self.guidance.stop(now, &estimate),
            at_rest: !armed || !landing && self.guidance.is_at_rest(now, &estimate),
            armed,
            landing,
            landing_cause: self.authority.taken().cause().or(self.impaired),
            target: self.guidance.target().filter(|_| armed),
            charge: self.gauge.charge().unwrap_or(1.0),
        }
    }

    /// Whether there is something to report: the controller has said whether it is armed, and if it is, where it is; or it is
    /// silent.
    fn can_report(&self) -> bool {
        let is_known = self.reports.last().is_some()
            && (!self.is_armed() || self.estimator.estimate().is_some());
        is_known || !self.authority.may_send()
    }

    fn report(&mut self, now: Timestamp) {
        if self.can_report() {
            let telemetry = self.telemetry(now);
            self.last = Some(telemetry);
            self.outbox.transmit(Transmit::Telemetry(telemetry));
        }
    }

    /// Reports what the navigation must know at once.
    fn report_news(&mut self, now: Timestamp) {
        if self.telemetry(now).is_news(self.last) {
            self.report(now);
        }
    }

    /// Keeps a checkpoint, if anything of it has changed but the hover throttle.
    fn keep(&mut self) {
        let before = self.before;
        let flight = Flight {
            has_flown: self.arming.has_flown(),
            setpoint: (self.guidance.setpoint()).or(before.and_then(|it| it.setpoint)),
            start: self.start,
            is_landing: self.must_land,
            hover_throttle: self.control.hover_throttle(),
            ground_m: self.estimator.ground_m(),
            taken: self.authority.taken(),
            impaired: self.impaired,
        };
        let is_same = self.kept.is_some_and(|kept| {
            let hover_throttle = kept.hover_throttle;
            kept == Flight {
                hover_throttle,
                ..flight
            }
        });
        if !is_same {
            self.kept = Some(flight);
            self.outbox.event(Event::Checkpoint(Checkpoint {
                gave_up: self.gave_up,
                flight: Some(flight),
            }));
        }
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
                self.kept = None;
                self.keep();
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
        self.outbox.poll(deadlines.into_iter().flatten().min())
    }
}

#[cfg(test)]
mod tests;
