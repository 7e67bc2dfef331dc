//! Link to an autopilot that flies legs itself: it is armed, told where to fly, and told to land.

mod arming;
mod contact;
mod course;
mod gate;
mod place;
mod vocabulary;

use std::time::Duration;

use self::arming::Arming;
use self::contact::Contact;
pub use self::contact::LOST_AFTER;
use self::course::Course;
use self::gate::Gate;
use self::place::Place;
pub use self::vocabulary::{AutopilotReport, Landed, Mode, Order};
use super::controller::{Flight, Stage};
use super::outputs::Outputs;
use super::{Checkpoint, Event, FlightCommand, Input, PortEvent, Telemetry, Transmit};
use crate::geodetic::Geodetic;
use crate::geometry::{Ned, Velocity};
use crate::machine::{Machine, Output};
use crate::time::{Timestamp, first_of};

/// From one heartbeat of the link to the next, and until an order that was not carried out is repeated.
const PERIOD: Duration = Duration::from_secs(1);
/// Braking before the first setpoint, in m/s².
const BRAKING_MPS2: f64 = 1.0;

/// Configuration of a link to an autopilot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Config {
    /// What the drone may do. Only [`Stage::Sim`] flies.
    pub stage: Stage,
    /// Home of the drone's local frame.
    pub home: Geodetic,
}

/// A link to an autopilot that flies legs itself.
///
/// Invariant: all orders pass its gate.
#[derive(Debug)]
pub struct AutopilotLink {
    gave_up: bool,
    must_land: bool,
    arming: Arming,
    gate: Gate,
    contact: Contact,
    place: Place,
    landed: Option<Landed>,
    charge: Option<f64>,
    course: Option<Course>,
    /// When the next heartbeat leaves. `None` before the first one is heard.
    acts_at: Option<Timestamp>,
    outputs: Outputs,
}

impl AutopilotLink {
    /// A link, restored from `checkpoint` if there is one.
    #[must_use]
    pub fn new(config: Config, checkpoint: Option<Checkpoint>, now: Timestamp) -> Self {
        let before = checkpoint.and_then(|it| it.flight);
        let has_flown = before.is_some_and(|it| it.has_flown);
        let taken = before.map(|it| it.taken).unwrap_or_default();
        let setpoint = before.and_then(|it| it.setpoint);
        let mut link = Self {
            gave_up: checkpoint.is_some_and(|it| it.gave_up),
            must_land: before.is_some_and(|it| it.is_landing),
            arming: Arming::new(has_flown),
            gate: Gate::new(config.stage),
            contact: Contact::new(has_flown, taken, now),
            place: Place::new(config.home, now),
            landed: None,
            charge: None,
            course: setpoint.map(|it| Course::new(now, it, None)),
            acts_at: None,
            outputs: Outputs::new(),
        };
        if checkpoint.is_some() {
            link.outputs.resync();
        }
        link.keep();
        link
    }

    fn handle_command(&mut self, now: Timestamp, command: FlightCommand) {
        match command {
            FlightCommand::Report | FlightCommand::Yield => return self.report(now),
            _ if self.gave_up => return,
            FlightCommand::Arm => self.arming.order(),
            FlightCommand::Fly(setpoint) if self.contact.is_armed() && !self.must_land => {
                let course = Course::new(now, setpoint, self.stop());
                self.order(now, course.speed());
                self.course = Some(course);
            }
            FlightCommand::Fly(_) => return,
            FlightCommand::Land => self.must_land = true,
        }
        self.act(now);
        self.aim(now);
        self.keep();
        self.report_news(now);
    }

    fn handle_report(&mut self, now: Timestamp, report: AutopilotReport) {
        match report {
            AutopilotReport::Heartbeat { armed, mode } => {
                let has_flown = self.arming.has_flown();
                let is_news = self.contact.hear(now, armed, mode, has_flown);
                if armed {
                    self.arming.end();
                }
                if self.acts_at.is_none() {
                    self.handle_second(now);
                } else if is_news {
                    self.act(now);
                }
                self.keep();
            }
            AutopilotReport::Landed(landed) => self.landed = Some(landed),
            AutopilotReport::Origin(origin) => {
                self.place.set_origin(origin, self.contact.is_armed());
            }
            AutopilotReport::Place { position, velocity } => {
                self.place.set(now, position, velocity);
                if let (Some(stop), Some(course)) = (self.stop(), &mut self.course) {
                    course.begin(stop);
                }
            }
            AutopilotReport::Charge(charge) => self.charge = Some(charge),
            AutopilotReport::Simulated => {
                if self.gate.hear_simulated(now) && self.acts_at.is_some() {
                    self.handle_second(now);
                    self.keep();
                }
            }
        }
        self.report_news(now);
    }

    /// The link's heartbeat, and what is repeated with it. A link that is lost sends none, so that the autopilot's own failsafe
    /// acts.
    fn handle_second(&mut self, now: Timestamp) {
        self.acts_at = Some(now + PERIOD);
        if !self.contact.taken().by_failsafe {
            self.order(now, Order::Heartbeat);
        }
        let is_unknown = self.landed.is_none() || !self.gate.is_simulation();
        if self.place.lost_for(now).is_some() || is_unknown {
            self.order(now, Order::RequestTelemetry);
        }
        if let Some(course) = self.course.filter(|_| self.flies()) {
            self.order(now, course.speed());
        }
        self.act(now);
    }

    /// Whether the autopilot is armed and takes orders, and isn't to land.
    fn flies(&self) -> bool {
        self.contact.is_armed()
            && self.contact.is_links()
            && self.contact.is_in(Mode::Guided)
            && !self.must_land
    }

    /// Orders what is to be done next, unless it is being done.
    fn act(&mut self, now: Timestamp) {
        if self.must_land {
            self.arming.end();
            let is_others = self.contact.taken().is_pilots();
            if self.contact.is_armed() && !is_others && !self.contact.is_in(Mode::Landing) {
                self.order(now, Order::Land);
            }
        } else if self.arming.is_due() {
            let is_ready = self.contact.is_known() && self.place.lost_for(now).is_none();
            if !is_ready || !self.gate.may_arm(now) {
                return;
            }
            if self.contact.is_in(Mode::Guided) {
                self.arming.send();
                self.order(now, Order::Arm);
            } else {
                self.order(now, Order::Guide);
            }
        } else if self.flies()
            && self.landed == Some(Landed::Ground)
            && let Some((to, _)) = self.course.and_then(|it| it.target(now))
        {
            let height_m = to.altitude_m();
            self.order(now, Order::TakeOff { height_m });
        }
    }

    /// Gives the autopilot its target, once it is in the air.
    fn aim(&mut self, now: Timestamp) {
        let target = (self.course.as_mut()).and_then(|it| it.take_due_target(now));
        if self.flies()
            && self.landed == Some(Landed::Air)
            && let Some((to, velocity)) = target
            && let Some(to) = self.place.to_autopilot(to)
        {
            self.order(now, Order::Fly { to, velocity });
        }
    }

    /// Sends an order, if it may leave.
    fn order(&mut self, now: Timestamp, order: Order) {
        if self.gate.may_leave(order, now) {
            self.outputs.order(order);
        }
    }

    /// Where it would come to rest if it braked now. `None` if it isn't known where it is.
    fn stop(&self) -> Option<Ned> {
        let braking_mps2 = (self.course).map_or(BRAKING_MPS2, |it| it.acceleration_mps2());
        (self.place.last()).map(|place| course::stop(place, braking_mps2))
    }

    fn telemetry(&self, now: Timestamp) -> Telemetry {
        let place = self.place.last().unwrap_or((Ned::HOME, Velocity::ZERO));
        let armed = self.contact.is_armed();
        let is_descending = self.landed == Some(Landed::Landing);
        let is_own = self.contact.is_links() && self.contact.is_in(Mode::Guided);
        let landing = armed && (is_descending || !is_own);
        let has_come_to_rest = match &self.course {
            Some(course) => course.is_reached(now, place),
            None => course::is_slow(place.1),
        };
        Telemetry {
            position: place.0,
            position_lost_for: self.place.lost_for(now),
            velocity: place.1,
            stop: self.stop().unwrap_or(Ned::HOME),
            at_rest: !armed || !landing && has_come_to_rest,
            armed,
            landing,
            landing_cause: self.contact.taken().cause(),
            target: (self.course.filter(|_| armed && !landing)).and_then(|it| it.leg_end()),
            charge: self.charge.unwrap_or(1.0),
        }
    }

    /// Whether there is something to report: the autopilot has said whether it is armed, and if it is, where it is; or it is
    /// silent.
    fn can_report(&self) -> bool {
        let is_placed = !self.contact.is_armed() || self.place.last().is_some();
        self.contact.is_known() && is_placed || self.contact.taken().by_failsafe
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

    /// Keeps a checkpoint, if it has changed.
    fn keep(&mut self) {
        self.outputs.keep_if_changed(Checkpoint {
            gave_up: self.gave_up,
            flight: Some(Flight {
                has_flown: self.arming.has_flown(),
                setpoint: self.course.map(|it| it.setpoint),
                is_landing: self.must_land,
                taken: self.contact.taken(),
                impaired: None,
                // The autopilot's own business.
                from: None,
                start: None,
                is_high: false,
                hover_throttle: 0.0,
                ground_m: None,
            }),
        });
    }
}

impl Machine for AutopilotLink {
    type Input = Input;
    type Transmit = Transmit;
    type Event = Event;

    fn handle_input(&mut self, now: Timestamp, input: Input) {
        match input {
            Input::FlightCommand(command) => self.handle_command(now, command),
            Input::Port(PortEvent::Autopilot(report)) => self.handle_report(now, report),
            // From a flight controller or a closed-form vehicle, which this link does not have.
            Input::Port(_) | Input::Telemetry(_) => {}
            Input::GiveUp => {
                self.gave_up = true;
                self.must_land = true;
                self.act(now);
                self.keep();
            }
        }
    }

    fn handle_timeout(&mut self, now: Timestamp) {
        if self.contact.handle_timeout(now) {
            self.must_land = true;
            self.keep();
            self.report_news(now);
        }
        if self.acts_at.is_some_and(|at| at <= now) {
            self.handle_second(now);
            self.keep();
            self.report_news(now);
        }
        self.aim(now);
    }

    fn poll_output(&mut self) -> Output<Transmit, Event> {
        let aims_at = self.course.map(|it| it.aims_at());
        let deadline = first_of([self.acts_at, aims_at, self.contact.deadline()]);
        self.outputs.poll(deadline)
    }
}

#[cfg(test)]
mod tests;
