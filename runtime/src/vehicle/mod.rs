//! Simulated vehicles in closed form: motions are computed when they are commanded, without time steps.

mod battery;
mod link;
mod simulated;

use std::time::Duration;

use muster_machines::geometry::{Ned, Velocity};
use muster_machines::motion::{Landing, Motion};
use muster_machines::msp::{FlightCommand, Setpoint, Telemetry};
use muster_machines::time::Timestamp;
use serde::{Deserialize, Serialize};

use self::battery::Battery;
pub use link::SimulatedLink;
pub use simulated::{SimulatedVehicle, VehicleState};

/// What a drone flies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VehicleKind {
    /// A [`Vehicle`].
    ClosedForm,
    /// A flight controller over MSP.
    Msp,
}

/// How long a pilot's stick input holds: longer than any flight.
const STICKS_HOLD: Duration = Duration::from_secs(1_000_000);

/// A vehicle with its autopilot: it arms, flies legs, and has a landing mode that ends disarmed on the ground.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Vehicle {
    /// Home of the drone's local frame, in the world's frame.
    home: Ned,
    landing: Landing,
    motion: Motion,
    armed: bool,
    has_flown: bool,
    is_landing: bool,
    is_wreck: bool,
    target: Option<Ned>,
    /// Whether the pilot's sticks are ignored, because a failsafe holds the vehicle.
    is_held: bool,
    battery: Battery,
    /// Start and end of a loss of the horizontal position.
    lost: Option<(Timestamp, Timestamp)>,
}

impl Vehicle {
    /// A disarmed vehicle at `place` with a full battery.
    #[must_use]
    pub fn new(landing: Landing, place: Ned) -> Self {
        Self {
            home: Ned::HOME,
            landing,
            motion: Motion::at_rest(place),
            armed: false,
            has_flown: false,
            is_landing: false,
            is_wreck: false,
            target: None,
            is_held: false,
            battery: Battery::full(),
            lost: None,
        }
    }

    /// Sets how long a full battery lasts with armed motors. `None` (the default): the battery does not drain.
    pub fn with_endurance(mut self, endurance: Option<Duration>) -> Self {
        self.battery.set_endurance(endurance);
        self
    }

    /// Sets the home of the vehicle's swarm, in the world's frame (default: the origin), and moves the vehicle with it.
    pub fn with_home(mut self, home: Ned) -> Self {
        self.motion = Motion::at_rest(self.motion.end() + home);
        self.home = home;
        self
    }

    /// The battery.
    pub const fn battery(&mut self) -> &mut Battery {
        &mut self.battery
    }

    /// The horizontal position is unknown from `now` until at least `until`.
    pub fn lose_position(&mut self, now: Timestamp, until: Timestamp) {
        let lost = self.lost.get_or_insert((now, until));
        lost.1 = lost.1.max(until);
    }

    /// The horizontal position is known again, unless a longer loss is under way.
    pub fn recover_position(&mut self, now: Timestamp) {
        self.lost = self.lost.filter(|(_, until)| now < *until);
    }

    /// Whether the horizontal position is known.
    #[must_use]
    pub const fn has_position(&self) -> bool {
        self.lost.is_none()
    }

    /// The vehicle's motion, past and planned.
    #[must_use]
    pub const fn motion(&self) -> &Motion {
        &self.motion
    }

    /// Whether the motors are armed.
    #[must_use]
    pub const fn is_armed(&self) -> bool {
        self.armed
    }

    /// The flight controller's telemetry, in the drone's local frame. Nothing but its commands moves this vehicle, so without a
    /// horizontal position its dead reckoning has no error.
    #[must_use]
    pub fn telemetry(&self, now: Timestamp) -> Telemetry {
        Telemetry {
            position: self.motion.position(now) - self.home,
            position_lost_for: self.lost.map(|(lost, _)| now.since(lost)),
            velocity: self.motion.velocity(now).map_or(Velocity::ZERO, Velocity),
            stop: self.motion.stop(now) - self.home,
            at_rest: self.motion.is_at_rest(now),
            armed: self.armed,
            landing: self.is_landing,
            landing_cause: None,
            target: self.target,
            charge: self.battery.charge(now),
        }
    }

    /// Executes a command. Returns whether the motion changed.
    pub fn execute(&mut self, now: Timestamp, command: FlightCommand) -> bool {
        match command {
            FlightCommand::Report => false,
            FlightCommand::Arm => {
                if !self.has_flown {
                    self.armed = true;
                    self.has_flown = true;
                    self.battery.draw(now);
                }
                false
            }
            FlightCommand::Yield => {
                self.is_held = false;
                false
            }
            // A landing is not aborted.
            FlightCommand::Fly(_) | FlightCommand::Land if !self.armed || self.is_landing => false,
            FlightCommand::Fly(setpoint) => {
                self.fly(now, setpoint);
                true
            }
            FlightCommand::Land => {
                self.land(now);
                true
            }
        }
    }

    fn fly(&mut self, now: Timestamp, setpoint: Setpoint) {
        self.target = match setpoint {
            Setpoint::Leg { to, .. } => Some(to),
            Setpoint::Track { .. } | Setpoint::Hold { .. } => None,
        };
        self.is_held |= matches!(setpoint, Setpoint::Hold { .. });
        self.motion.follow(now, setpoint, self.home);
    }

    fn land(&mut self, now: Timestamp) {
        self.target = None;
        self.is_landing = true;
        self.motion.land(now, self.landing);
    }

    /// Hovers for `time` at the end of the planned leg before the vehicle counts as at rest.
    pub fn settle(&mut self, time: Duration) {
        self.motion.hover(time);
    }

    /// Applies a pilot's stick input until the next input or command. Returns whether the motion changed. Ignored while the
    /// vehicle is disarmed, landing, or held by a failsafe.
    pub fn steer(&mut self, now: Timestamp, velocity: Velocity, acceleration_mps2: f64) -> bool {
        let is_steerable = self.armed && !self.is_landing && !self.is_held;
        if is_steerable {
            self.target = None;
            self.motion
                .steer(now, velocity, acceleration_mps2, STICKS_HOLD);
        }
        is_steerable
    }

    /// Takes the state of an aircraft that is simulated elsewhere, at a place in the swarm's frame. It is assumed to keep its
    /// velocity until `until`, or the next call.
    pub fn observe(
        &mut self,
        now: Timestamp,
        (place, velocity): (Ned, Velocity),
        is_armed: bool,
        until: Timestamp,
    ) {
        self.armed = is_armed;
        self.has_flown |= is_armed;
        let velocity = if is_armed { velocity } else { Velocity::ZERO };
        (self.motion).observe(now, place + self.home, velocity, until);
    }

    /// Whether the vehicle fell. Separation from it is not checked any more.
    pub const fn is_wreck(&self) -> bool {
        self.is_wreck
    }

    /// Falls to the ground from its current motion, with its motors off for good.
    pub fn fall(&mut self, now: Timestamp) {
        self.armed = false;
        self.has_flown = true;
        self.is_landing = false;
        self.is_wreck = true;
        self.target = None;
        self.motion.fall(now);
    }

    /// Ends the motion; a landing ends disarmed. Returns whether it was a landing.
    pub fn come_to_rest(&mut self) -> bool {
        let lands = std::mem::take(&mut self.is_landing);
        self.armed &= !lands;
        lands
    }
}

#[cfg(test)]
mod tests;
