//! The aircraft: rotors, battery, body, wind and ground, in steps of a millisecond.

use nalgebra::Vector3;

use crate::airframe::Airframe;
use crate::battery::Battery;
use crate::body::{Body, ROTORS};
use crate::controller::Config;
use crate::ground::{Contact, Landing};
use crate::wind::{Gusts, Wind};

/// Length of a step, in seconds. What it costs: the example `throughput`. Its error: the test
/// `step_of_a_millisecond_errs_by_millimetres`.
pub(crate) const STEP_S: f64 = 1e-3;

/// Speed below which a rotor without power stands still, in rad/s.
const ROTOR_STILL_RAD_S: f64 = 1.0;

/// Steps between two looks at the wind.
const WIND_STEPS: u64 = 10;

/// What a controller moves.
#[derive(Debug, Clone)]
pub(crate) struct Aircraft {
    airframe: Airframe,
    landing: Landing,
    ground_down_m: f64,
    pub(crate) body: Body,
    /// In rad/s, in Betaflight's order.
    speeds: [f64; 4],
    /// Speeds of whole propellers with the same thrust, as shares of theirs.
    whole_shares: [f64; 4],
    pub(crate) battery: Battery,
    pub(crate) contact: Contact,
    pub(crate) wind: Wind,
    gusts: Gusts,
    air: Vector3<f64>,
    lag_share: f64,
}

impl Aircraft {
    /// At rest on the ground.
    pub(crate) fn new(config: &Config, gusts: Gusts) -> Self {
        let (airframe, place) = (config.airframe, config.place.0);
        Self {
            airframe,
            landing: config.landing,
            ground_down_m: place.z,
            body: Body::at_rest(place, config.heading_rad),
            speeds: [0.0; 4],
            whole_shares: [1.0; 4],
            battery: Battery::new(airframe.battery),
            contact: Contact::Ground,
            wind: config.wind,
            gusts,
            air: Vector3::zeros(),
            lag_share: 1.0 - libm::exp(-STEP_S / airframe.motor.lag_s),
        }
    }

    /// Whether nothing moves while motors are off.
    pub(crate) fn is_at_rest(&self) -> bool {
        self.contact != Contact::Airborne
            && self.body.position.z >= self.ground_down_m
            && self.body.is_still()
            && self.speeds.iter().all(|speed| *speed <= 0.0)
    }

    /// Lets `steps` pass at rest.
    pub(crate) fn rest(&mut self, steps: u64) {
        self.battery.draw(0.0, steps, STEP_S);
    }

    /// Breaks it, wherever it is.
    pub(crate) fn wreck(&mut self) {
        self.contact = Contact::Wreck;
    }

    /// Propellers lose a share of their thrust, in Betaflight's order.
    pub(crate) fn weaken(&mut self, lost: [f64; 4]) {
        self.whole_shares = lost.map(|share| libm::sqrt(1.0 - share));
    }

    /// Height above the ground, in metres.
    pub(crate) fn height_m(&self) -> f64 {
        self.ground_down_m - self.body.position.z
    }

    /// Speeds of the rotors in rad/s, in Betaflight's order.
    pub(crate) fn speeds(&self) -> &[f64; 4] {
        &self.speeds
    }

    /// Moves on by a step with duty cycles from 0 to 1. A wreck's motors turn no more.
    pub(crate) fn step(&mut self, step: u64, duties: &[f64; 4]) {
        let is_wreck = self.contact == Contact::Wreck;
        let duties = if is_wreck { &[0.0; 4] } else { duties };
        let (motors_a, reaction_nm) = self.turn_rotors(duties);
        self.battery.draw(motors_a, 1, STEP_S);
        if step.is_multiple_of(WIND_STEPS) {
            let airspeed_mps = (self.body.velocity - self.air).norm();
            #[expect(clippy::cast_precision_loss, reason = "small")]
            let span_s = STEP_S * WIND_STEPS as f64;
            let at = (airspeed_mps, self.height_m());
            self.air = self.gusts.step(&self.wind, step, at, span_s);
        }
        let before = self.body.velocity;
        let mut speeds = self.speeds;
        for (speed, share) in speeds.iter_mut().zip(self.whole_shares) {
            *speed *= share;
        }
        self.body
            .integrate(&self.airframe, &speeds, reaction_nm, self.air, STEP_S);
        let contact = self
            .landing
            .contact(&mut self.body, before, self.ground_down_m, STEP_S);
        if is_wreck {
            if contact != Contact::Airborne {
                self.body.stop();
            }
        } else {
            self.contact = contact;
        }
    }

    /// Yields the motors' current, in amperes, and what changes of speed turn the body with about its axis down, in N·m.
    fn turn_rotors(&mut self, duties: &[f64; 4]) -> (f64, f64) {
        let motor = self.airframe.motor;
        let volts = self.battery.volts();
        let (mut motors_a, mut change_rad_s) = (0.0, 0.0);
        for ((speed, &duty), [_, _, turn]) in self.speeds.iter_mut().zip(duties).zip(&ROTORS) {
            let before = *speed;
            let goal = motor.steady_speed_rad_s(duty, volts);
            *speed += (goal - *speed) * self.lag_share;
            if duty <= 0.0 && *speed < ROTOR_STILL_RAD_S {
                *speed = 0.0;
            }
            motors_a += motor.battery_a(*speed, duty);
            change_rad_s += turn * (*speed - before);
        }
        (motors_a, motor.inertia_kgm2 * change_rad_s / STEP_S)
    }
}
