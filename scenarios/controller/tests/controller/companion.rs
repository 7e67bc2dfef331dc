//! A companion computer with a virtual clock: it sends RC at 50 Hz and asks for messages.

use std::time::Duration;

use muster_controller::{Airframe, Config, Controller, SensorNoise, Settings, Truth};
use muster_machines::geodetic::Geodetic;
use muster_machines::time::Timestamp;
use muster_msp::{
    Channel, Decode, Decoder, Direction, SetRawRc, Status, Sticks, Version, order, request,
};

/// Sticks and switches in µs.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rc {
    pub(crate) roll: u16,
    pub(crate) pitch: u16,
    pub(crate) throttle: u16,
    pub(crate) yaw: u16,
    /// ARM.
    pub(crate) aux1: u16,
    /// ANGLE.
    pub(crate) aux2: u16,
}

impl Rc {
    pub(crate) const IDLE: Self = Self {
        roll: 1_500,
        pitch: 1_500,
        throttle: 1_000,
        yaw: 1_500,
        aux1: 1_000,
        aux2: 1_800,
    };

    pub(crate) const ARM: Self = Self {
        aux1: 1_800,
        ..Self::IDLE
    };

    /// In angle mode, armed.
    pub(crate) fn throttle(throttle: u16) -> Self {
        Self {
            throttle,
            ..Self::ARM
        }
    }
}

pub(crate) struct Companion {
    pub(crate) controller: Controller,
    pub(crate) now: Timestamp,
    /// What is sent at 50 Hz; `None` while it is silent.
    pub(crate) rc: Option<Rc>,
    decoder: Decoder,
    replies: Vec<(u16, Direction, Vec<u8>)>,
}

pub(crate) fn origin() -> Geodetic {
    Geodetic::new(39.48, -0.34, 20.0).unwrap()
}

/// Without errors of sensors.
pub(crate) fn exact(settings: Settings) -> Config {
    Config {
        noise: SensorNoise::NONE,
        ..Config::new(origin(), settings)
    }
}

pub(crate) fn micros(us: u16) -> Channel {
    Channel::new(us).unwrap()
}

/// The throttle at which four motors carry the weight at a voltage, from the model's equations, in µs.
pub(crate) fn hover_us(volts: f64) -> f64 {
    let airframe = Airframe::agilicious();
    let speed = airframe.hover_speed_rad_s();
    let motor = airframe.motor;
    let linear = 1.0 / motor.speed_constant;
    let square = (motor.full_v - linear * motor.full_speed_rad_s) / motor.full_speed_rad_s.powi(2);
    let duty = (linear * speed + square * speed * speed) / volts;
    1_050.0 + 950.0 * (duty - 0.055) / 0.945
}

impl Companion {
    pub(crate) fn new(config: Config) -> Self {
        Self {
            controller: Controller::new(config, 1, Timestamp::ZERO),
            now: Timestamp::ZERO,
            rc: None,
            decoder: Decoder::default(),
            replies: Vec::new(),
        }
    }

    /// A sole receiver's companion that has sent RC with all switches off since the start, until arming is possible.
    pub(crate) fn ready(config: Config) -> Self {
        let mut companion = Self::new(config);
        companion.rc = Some(Rc::IDLE);
        companion.run_ms(5_500);
        companion
    }

    /// [`Companion::ready`], then armed.
    pub(crate) fn armed(config: Config) -> Self {
        let mut companion = Self::ready(config);
        companion.rc = Some(Rc::ARM);
        companion.run_ms(100);
        assert!(companion.truth().is_armed);
        companion
    }

    /// [`Companion::armed`], then held at a height for 15 s.
    pub(crate) fn hovering(config: Config, height_m: f64) -> Self {
        let mut companion = Self::armed(config);
        companion.hold(height_m, Rc::ARM, 15_000);
        companion
    }

    /// Keeps a height in angle mode by a simple law on the true state.
    pub(crate) fn hold(&mut self, height_m: f64, sticks: Rc, span_ms: u64) {
        for _ in 0..span_ms / 20 {
            let truth = self.truth();
            let climb_mps = -truth.velocity.0.z;
            let error_m = height_m - truth.position.altitude_m();
            let lift_us = 60.0 * (error_m.clamp(-2.0, 2.0) - climb_mps);
            let throttle_us = (hover_us(truth.volts) + lift_us).clamp(1_060.0, 1_700.0);
            self.rc = Some(Rc {
                throttle: throttle_us as u16,
                ..sticks
            });
            self.run_ms(20);
        }
    }

    pub(crate) fn truth(&mut self) -> Truth {
        self.controller.aircraft(self.now)
    }

    pub(crate) fn ms(&self) -> u64 {
        self.now.as_nanos() / 1_000_000
    }

    /// Lets time pass in steps of 5 ms, off the controller's ticks by 1 ms.
    pub(crate) fn run_ms(&mut self, span_ms: u64) {
        let end = self.now + Duration::from_millis(span_ms);
        while self.now < end {
            if self.ms().is_multiple_of(20)
                && let Some(rc) = self.rc
            {
                self.send_rc(rc);
            }
            let step = Duration::from_millis(5).min(end - self.now);
            self.now += step;
            self.read();
        }
    }

    fn read(&mut self) {
        let bytes = self.controller.transmit(self.now);
        self.decoder.read(&bytes, |frame| {
            self.replies
                .push((frame.command, frame.direction, frame.payload.to_vec()));
        });
    }

    fn send_rc(&mut self, rc: Rc) {
        let sticks = Sticks {
            roll: micros(rc.roll),
            pitch: micros(rc.pitch),
            throttle: micros(rc.throttle),
            yaw: micros(rc.yaw),
        };
        let message = SetRawRc::new(sticks, &[micros(rc.aux1), micros(rc.aux2)]).unwrap();
        let mut bytes = Vec::new();
        order(Version::V1, &message, &mut bytes).unwrap();
        self.controller.receive(self.now, &bytes);
    }

    pub(crate) fn send(&mut self, bytes: &[u8]) {
        self.controller.receive(self.now, bytes);
    }

    /// Asks for a message; waits up to 100 ms.
    pub(crate) fn ask<M: Decode>(&mut self) -> M {
        let mut bytes = Vec::new();
        request::<M>(Version::V1, &mut bytes).unwrap();
        self.send(&bytes);
        let payload = self.answer(M::COMMAND).expect("an answer");
        M::decode(&payload).unwrap()
    }

    /// The payload of the reply to a command, waiting up to 100 ms; `None` if it was refused.
    pub(crate) fn answer(&mut self, command: u16) -> Option<Vec<u8>> {
        self.replies.clear();
        for _ in 0..20 {
            self.run_ms(5);
            let found = self.replies.iter().find(|it| it.0 == command);
            if let Some((_, direction, payload)) = found {
                return (*direction == Direction::Reply).then(|| payload.clone());
            }
        }
        panic!("no reply to command {command} within 100 ms");
    }

    /// Names of what refuses arming.
    pub(crate) fn refusals(&mut self) -> Vec<&'static str> {
        self.ask::<Status>().flags.arming.names().collect()
    }

    /// Runs until a condition holds, looking every 5 ms; yields how long it took, in ms.
    pub(crate) fn run_until(
        &mut self,
        most_ms: u64,
        mut holds: impl FnMut(&mut Self) -> bool,
    ) -> u64 {
        let start = self.ms();
        while !holds(self) {
            assert!(self.ms() - start < most_ms, "not within {most_ms} ms");
            self.run_ms(5);
        }
        self.ms() - start
    }
}
