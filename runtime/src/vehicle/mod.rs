//! Vehicles in closed form: they fly legs from rest to rest and land by themselves; nothing ticks.

mod battery;
mod link;
mod motion;
mod simulated;
mod tracking;

use std::time::Duration;

use muster_machines::geometry::{Ned, Velocity};
use muster_machines::msp::{FlightCommand, Setpoint, Telemetry};
use muster_machines::time::Timestamp;
use serde::{Deserialize, Serialize};

use self::battery::Battery;
pub use link::SimulatedLink;
pub use motion::{Motion, Piece};
pub use simulated::{SimulatedVehicle, VehicleState};

/// How a vehicle comes down by itself.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Landing {
    /// Downwards, in m/s, as far as the final height.
    pub descent_mps: f64,
    /// Downwards from there to the ground, in m/s.
    pub final_mps: f64,
    /// The final height above home, in metres.
    pub final_altitude_m: f64,
    /// In m/s².
    pub acceleration_mps2: f64,
}

/// Longer than any flight: sticks stay where they are.
const STICKS_HOLD: Duration = Duration::from_secs(1_000_000);

/// One vehicle with its autopilot: it arms, flies legs, and has a landing mode that ends disarmed on the ground.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Vehicle {
    /// From where its drone reckons.
    home: Ned,
    landing: Landing,
    motion: Motion,
    armed: bool,
    has_flown: bool,
    is_landing: bool,
    is_wreck: bool,
    target: Option<Ned>,
    /// Whether its pilot's sticks are ignored.
    is_held: bool,
    battery: Battery,
    /// Since when it has not known where it is over ground, and until when it won't.
    lost: Option<(Timestamp, Timestamp)>,
}

impl Vehicle {
    /// A vehicle that stands at a place, disarmed, with a full battery.
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

    /// The same, with a battery that lasts so long with its motors armed.
    pub fn lasting(mut self, endurance: Option<Duration>) -> Self {
        self.battery.lasts(endurance);
        self
    }

    /// The same, of a swarm whose home is there and not where the world's is.
    pub fn with_home(mut self, home: Ned) -> Self {
        self.motion = Motion::at_rest(self.motion.end() + home);
        self.home = home;
        self
    }

    /// Its battery.
    pub const fn battery(&mut self) -> &mut Battery {
        &mut self.battery
    }

    /// It does not know where it is over ground, until then at least.
    pub fn lose_position(&mut self, now: Timestamp, until: Timestamp) {
        let lost = self.lost.get_or_insert((now, until));
        lost.1 = lost.1.max(until);
    }

    /// It knows again, unless it has lost it for longer.
    pub fn find_position(&mut self, now: Timestamp) {
        self.lost = self.lost.filter(|(_, until)| now < *until);
    }

    /// How it moves.
    #[must_use]
    pub const fn motion(&self) -> &Motion {
        &self.motion
    }

    /// Whether its motors are armed.
    #[must_use]
    pub const fn is_armed(&self) -> bool {
        self.armed
    }

    /// What its flight controller would say of it.
    #[must_use]
    pub fn telemetry(&self, now: Timestamp) -> Telemetry {
        let known = |place: Ned| {
            let place = match self.lost {
                Some((lost, _)) => self.motion.position(lost).at_altitude(place.altitude_m()),
                None => place,
            };
            place - self.home
        };
        Telemetry {
            position: known(self.motion.position(now)),
            position_lost_for: self.lost.map(|(lost, _)| now.since(lost)),
            velocity: self.motion.velocity(now).map_or(Velocity::ZERO, Velocity),
            stop: known(self.motion.stop(now)),
            at_rest: self.motion.is_at_rest(now),
            armed: self.armed,
            landing: self.is_landing,
            target: self.target,
            charge: self.battery.charge(now),
        }
    }

    /// Obeys a demand; whether its motion changed.
    pub fn obey(&mut self, now: Timestamp, command: FlightCommand) -> bool {
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
            // A vehicle that is coming down to land is not called off it.
            FlightCommand::Fly(_) | FlightCommand::Land if !self.armed || self.is_landing => false,
            FlightCommand::Fly(Setpoint::Leg {
                to,
                speed_mps,
                acceleration_mps2,
            }) => {
                self.target = Some(to);
                self.motion.brake(now);
                let to = to + self.home;
                self.motion.fly(to, speed_mps, acceleration_mps2);
                true
            }
            FlightCommand::Fly(Setpoint::Track {
                to,
                velocity,
                speed_mps,
                acceleration_mps2,
                hold,
            }) => {
                self.target = None;
                let limits = tracking::Limits {
                    speed_mps,
                    acceleration_mps2,
                };
                let to = to + self.home;
                self.motion.track(now, (to, velocity), limits, hold);
                true
            }
            FlightCommand::Fly(Setpoint::Hold {
                altitude_m,
                vertical_mps,
                acceleration_mps2,
            }) => {
                self.target = None;
                self.is_held = true;
                self.motion
                    .hold(now, altitude_m, vertical_mps, acceleration_mps2);
                true
            }
            FlightCommand::Land => {
                self.target = None;
                self.is_landing = true;
                self.motion.brake(now);
                let Landing {
                    descent_mps,
                    final_mps,
                    final_altitude_m,
                    acceleration_mps2,
                } = self.landing;
                let from = self.motion.end();
                if from.altitude_m() > final_altitude_m {
                    let low = from.at_altitude(final_altitude_m);
                    self.motion.fly(low, descent_mps, acceleration_mps2);
                }
                let ground = from.at_altitude(0.0);
                self.motion.fly(ground, final_mps, acceleration_mps2);
                true
            }
        }
    }

    /// Hovers for a while longer at the end of the leg that it has been told to fly, before it is at rest there.
    pub fn settle(&mut self, time: Duration) {
        self.motion.hover(time);
    }

    /// Obeys a pilot's sticks, until they are moved again or somebody else flies it; whether its motion changed. They
    /// are ignored while a failsafe holds it.
    pub fn steer(&mut self, now: Timestamp, velocity: Velocity, acceleration_mps2: f64) -> bool {
        let obeys = self.armed && !self.is_landing && !self.is_held;
        if obeys {
            self.target = None;
            self.motion
                .steer(now, velocity, acceleration_mps2, STICKS_HOLD);
        }
        obeys
    }

    /// Whether it fell: nobody can be kept apart from it any more.
    pub const fn is_wreck(&self) -> bool {
        self.is_wreck
    }

    /// Falls to the ground as fast as it does by its own weight, on from how it moves, its motors off for good.
    pub fn fall(&mut self, now: Timestamp) {
        self.armed = false;
        self.has_flown = true;
        self.is_landing = false;
        self.is_wreck = true;
        self.target = None;
        self.motion.fall(now);
    }

    /// Its motion has come to its end: a landing ends disarmed. Whether it was one.
    pub fn come_to_rest(&mut self) -> bool {
        let lands = std::mem::take(&mut self.is_landing);
        self.armed &= !lands;
        lands
    }
}

#[cfg(test)]
mod tests;
