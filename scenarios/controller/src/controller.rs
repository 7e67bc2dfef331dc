//! The controller: aircraft, sensors, firmware and port, integrated when somebody looks.

use std::time::Duration;

use muster_machines::geodetic::Geodetic;
use muster_machines::geometry::{Ned, Velocity};
use muster_machines::time::Timestamp;
use muster_msp::{
    AccCalibration, Decode, EepromWrite, Message, Mode, Reboot, ReceivedMotors, ReceivedRc,
};
use nalgebra::{UnitQuaternion, Vector3};

use crate::aircraft::Aircraft;
use crate::airframe::Airframe;
use crate::firmware::altitude::Altitudes;
use crate::firmware::failsafe::Failsafe;
use crate::firmware::settings::{CHANNELS, Settings};
use crate::firmware::{Firmware, Measured, TICK_MS, receiver};
use crate::ground::{Contact, Landing};
use crate::rc_frames::RcFrames;
use crate::sensors::{SensorNoise, Sensors};
use crate::serial::{Dropped, Request, Serial};
use crate::telemetry::View;
use crate::wind::{Gusts, Wind};

/// Length of a step, in nanoseconds.
pub(crate) const STEP_NANOS: u64 = 1_000_000;

/// A controller and its aircraft.
#[derive(Debug, Clone)]
pub struct Config {
    /// Origin of the world's frame on the Earth.
    pub origin: Geodetic,
    /// Where the aircraft stands, in the world's frame. The ground is flat at its altitude.
    pub place: Ned,
    /// Heading, in radians clockwise from north.
    pub heading_rad: f64,
    /// Aircraft.
    pub airframe: Airframe,
    /// The air around it.
    pub wind: Wind,
    /// What it survives on the ground.
    pub landing: Landing,
    /// Errors of its sensors.
    pub noise: SensorNoise,
    /// Settings of its firmware.
    pub settings: Settings,
}

impl Config {
    /// An Agilicious quadrotor at the origin, heading north, with the default noise.
    #[must_use]
    pub fn new(origin: Geodetic, settings: Settings) -> Self {
        Self {
            origin,
            place: Ned::HOME,
            heading_rad: 0.0,
            airframe: Airframe::agilicious(),
            wind: Wind::default(),
            landing: Landing::default(),
            noise: SensorNoise::default(),
            settings,
        }
    }
}

/// What can go wrong. Each holds until it is taken back, but for a wreck.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fault {
    /// The firmware hangs: no reply, motors as they were.
    Frozen(bool),
    /// No receiver hears anything: neither the pilot's nor the companion's frames count.
    Deaf(bool),
    /// The battery's voltage falls by so many volts.
    Sag(f64),
    /// GPS has no satellites.
    NoFix(bool),
    /// The aircraft breaks; its motors stop.
    Wreck,
    /// Propellers lose this share of their thrust: rear right, front right, rear left, front left.
    Weak([f64; 4]),
    /// Vibration that the gyro's filters let through, in rad/s: its standard deviation on each axis.
    Shake(f64),
}

/// The truth about an aircraft: for checkers and drawings, never for what flies it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Truth {
    /// In the world's frame.
    pub position: Ned,
    /// In the world's frame.
    pub velocity: Velocity,
    /// Turns vectors of the body's frame (forward, right, down) into the world's.
    pub attitude: UnitQuaternion<f64>,
    /// About the body's axes, in rad/s.
    pub rates_rad_s: Vector3<f64>,
    /// Speeds of the rotors in rad/s: rear right, front right, rear left, front left.
    pub rotors_rad_s: [f64; 4],
    /// Whether the firmware is armed.
    pub is_armed: bool,
    /// Whether its failsafe flies.
    pub is_failsafe: bool,
    /// What it touches.
    pub contact: Contact,
    /// Charge of the battery, as a fraction of a full one.
    pub charge: f64,
    /// Voltage of the battery.
    pub volts: f64,
    /// Current of the battery, in amperes.
    pub amps: f64,
}

impl Truth {
    pub(crate) fn of(aircraft: &Aircraft, is_armed: bool, is_failsafe: bool) -> Self {
        let (body, battery) = (&aircraft.body, &aircraft.battery);
        Self {
            position: Ned(body.position),
            velocity: Velocity(body.velocity),
            attitude: body.attitude,
            rates_rad_s: body.rates,
            rotors_rad_s: *aircraft.speeds(),
            is_armed,
            is_failsafe,
            contact: aircraft.contact,
            charge: battery.charge(),
            volts: battery.volts(),
            amps: battery.amps(),
        }
    }
}

/// What the receiver got since the last look.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sticks {
    /// Throttle stick that counts, in µs; of a firmware that doesn't tell, that of the newest RC frame over MSP.
    pub throttle_us: u16,
    /// Longest time without an RC frame over MSP. `None` before the first.
    pub rc_gap: Option<Duration>,
}

/// A simulated flight controller with its aircraft.
///
/// Time is cut into steps of a millisecond since its start. A call moves the aircraft to the last step that has begun by `now`;
/// a `now` before that changes nothing. The same calls with the same bytes give the same bits, whichever calls that only look
/// are between them.
#[derive(Debug)]
pub struct Controller {
    config: Config,
    start: Timestamp,
    /// The next step to take.
    next_step: u64,
    /// When the firmware started, in steps.
    boot_step: u64,
    /// The step from which nothing changes any more unless something happens.
    quiet_from: u64,
    aircraft: Aircraft,
    sensors: Sensors,
    firmware: Firmware,
    serial: Serial,
    is_frozen: bool,
    rc_frames: RcFrames,
}

impl Controller {
    /// A controller that starts now, disarmed on the ground. `seed` draws the errors of its sensors and the gusts.
    #[must_use]
    pub fn new(config: Config, seed: u64, now: Timestamp) -> Self {
        let place = config.place.0;
        let aircraft = Aircraft::new(&config, Gusts::new(seed, 0));
        let mut controller = Self {
            aircraft,
            sensors: Sensors::new(config.noise, seed, place),
            firmware: Firmware::new(config.settings.clone()),
            serial: Serial::default(),
            config,
            start: now,
            next_step: 0,
            boot_step: 0,
            quiet_from: 0,
            is_frozen: false,
            rc_frames: RcFrames::default(),
        };
        controller.touch();
        controller
    }

    /// Bytes from the companion.
    pub fn receive(&mut self, now: Timestamp, bytes: &[u8]) {
        self.advance(now);
        self.serial.receive(now.since(self.start), bytes);
        self.touch();
    }

    /// Bytes to the companion.
    #[must_use]
    pub fn transmit(&mut self, now: Timestamp) -> Vec<u8> {
        self.advance(now);
        self.serial.take()
    }

    /// When [`Controller::transmit`] yields bytes next, as far as can be told; `None` if no request waits.
    #[must_use]
    pub fn next_event(&self) -> Option<Timestamp> {
        if self.serial.has_output() {
            return Some(self.time_of(self.next_step.saturating_sub(1)));
        }
        if self.serial.is_idle() || self.is_frozen {
            return None;
        }
        let period = self.serial_period();
        Some(self.time_of(self.next_step.next_multiple_of(period)))
    }

    /// Sticks and switches of the pilot's transmitter in µs: roll, pitch, yaw, throttle, AUX1, …; `None` if it is off. They
    /// hold until the next call. Without an effect if the companion is the sole receiver.
    pub fn pilot(&mut self, now: Timestamp, channels: Option<&[u16; CHANNELS]>) {
        self.advance(now);
        self.firmware.receiver.pilot(channels.map(receiver::raw));
        self.touch();
    }

    /// Injects a fault.
    pub fn fault(&mut self, now: Timestamp, fault: Fault) {
        self.advance(now);
        match fault {
            Fault::Frozen(is_frozen) => self.is_frozen = is_frozen,
            Fault::Deaf(is_deaf) => self.firmware.receiver.is_deaf = is_deaf,
            Fault::Sag(volts) => self.aircraft.battery.sag(volts),
            Fault::NoFix(is_lost) => self.sensors.gps.is_lost = is_lost,
            Fault::Wreck => self.aircraft.wreck(),
            Fault::Weak(lost) => self.aircraft.weaken(lost),
            Fault::Shake(rad_s) => self.sensors.shake_rad_s = rad_s,
        }
        self.touch();
    }

    /// Sets the wind.
    pub fn wind(&mut self, now: Timestamp, wind: Wind) {
        self.advance(now);
        self.aircraft.wind = wind;
    }

    /// The truth about the aircraft.
    #[must_use]
    pub fn aircraft(&mut self, now: Timestamp) -> Truth {
        self.advance(now);
        let is_failsafe = self.firmware.is_active(Mode::Failsafe);
        Truth::of(&self.aircraft, self.firmware.is_armed(), is_failsafe)
    }

    /// Channels that count, in µs: roll, pitch, yaw, throttle, AUX1, …
    #[must_use]
    pub fn channels(&self) -> [u16; CHANNELS] {
        *self.firmware.receiver.channels()
    }

    /// What the receiver got since the last call. It changes nothing else.
    pub fn take_sticks(&mut self, now: Timestamp) -> Sticks {
        self.advance(now);
        let step = self.next_step.saturating_sub(1);
        let now = self.time_of(step);
        Sticks {
            throttle_us: self.channels()[3],
            rc_gap: self.rc_frames.take_gap(now),
        }
    }

    /// What the port dropped.
    #[must_use]
    pub fn dropped(&self) -> Dropped {
        self.serial.dropped()
    }

    /// Moves on to `now`. At rest this costs the same for any span.
    pub fn advance(&mut self, now: Timestamp) {
        if now < self.start {
            return;
        }
        let last_step =
            u64::try_from(now.since(self.start).as_nanos()).unwrap_or(u64::MAX) / STEP_NANOS;
        while self.next_step <= last_step {
            if self.is_quiet() {
                let steps = last_step + 1 - self.next_step;
                self.aircraft.rest(steps);
                self.next_step += steps;
                return;
            }
            self.take_step();
        }
    }

    /// Whether nothing happens until a call does something.
    fn is_quiet(&self) -> bool {
        self.next_step >= self.quiet_from && self.serial.is_idle() && self.is_resting()
    }

    fn is_resting(&self) -> bool {
        let mut duties = self.firmware.last_duties().iter();
        self.aircraft.is_at_rest() && duties.all(|duty| *duty <= 0.0)
    }

    fn take_step(&mut self) {
        let step = self.next_step;
        if self.is_resting() {
            self.aircraft.rest(1);
        } else {
            self.aircraft.step(step, self.firmware.last_duties());
        }
        self.next_step += 1;
        if step.is_multiple_of(TICK_MS) {
            self.sensors.gps.look(step, &self.aircraft.body);
        }
        if self.is_frozen {
            return;
        }
        if step.is_multiple_of(self.serial_period())
            && let Some(request) = self.serial.next_request()
        {
            self.answer(step, &request);
        }
        if step.is_multiple_of(TICK_MS) {
            let measured = self.measure(step);
            self.firmware.tick(step - self.boot_step, &measured);
        }
        if self.firmware.is_armed() {
            let rates = self.sensors.rates(step, &self.aircraft.body);
            self.firmware.stabilise(rates);
        } else {
            self.firmware.run_motor_test();
        }
    }

    fn measure(&mut self, step: u64) -> Measured {
        let body = &self.aircraft.body;
        let fix = self.sensors.gps.fix();
        Measured {
            angles_rad: self.sensors.angles_rad(step, body),
            altitudes: Altitudes {
                barometer_m: self.sensors.barometer_m(step, body),
                gps_m: fix.map(|fix| self.config.origin.altitude_m() + fix.place.altitude_m()),
            },
            volts: self.aircraft.battery.volts(),
            place: fix.map(|fix| fix.place),
        }
    }

    fn answer(&mut self, step: u64, request: &Request) {
        let serial = &mut self.serial;
        let mut view = View {
            step,
            origin: self.config.origin,
            aircraft: &self.aircraft,
            firmware: &self.firmware,
            sensors: &mut self.sensors,
        };
        let is_answered = view.state(serial, request)
            || view.measurement(serial, request)
            || serial.identify(request, &self.firmware.settings)
            || serial.describe(request, &self.firmware.settings);
        if !is_answered && !self.execute(step, request) {
            self.serial.refuse(request);
        }
    }

    /// Carries out an order. Yields whether it is one, and can be.
    fn execute(&mut self, step: u64, request: &Request) -> bool {
        match request.command {
            ReceivedRc::COMMAND => {
                let Ok(rc) = ReceivedRc::decode(&request.payload) else {
                    return false;
                };
                self.firmware.receive(step - self.boot_step, rc.channels_us);
                let now = self.time_of(step);
                self.rc_frames.count(now);
            }
            ReceivedMotors::COMMAND => {
                let Ok(motors) = ReceivedMotors::decode(&request.payload) else {
                    return false;
                };
                self.firmware.set_motor_test(&motors.outputs_us);
            }
            AccCalibration::COMMAND => {}
            EepromWrite::COMMAND if !self.firmware.is_armed() => {}
            Reboot::COMMAND => return self.reboot(step, request),
            _ => return false,
        }
        self.serial.acknowledge(request);
        true
    }

    /// Starts the firmware anew, armed or not.
    fn reboot(&mut self, step: u64, request: &Request) -> bool {
        let Ok(reboot) = Reboot::decode(&request.payload) else {
            return false;
        };
        self.serial.reply(request, &reboot);
        let is_deaf = self.firmware.receiver.is_deaf;
        self.firmware = Firmware::new(self.config.settings.clone());
        self.firmware.receiver.is_deaf = is_deaf;
        self.boot_step = step;
        self.touch();
        true
    }

    /// Something happened: all timers of the firmware may run.
    fn touch(&mut self) {
        let settling_ms = Failsafe::settling_ms(&self.config.settings.failsafe);
        self.quiet_from = self.next_step + settling_ms;
    }

    fn serial_period(&self) -> u64 {
        u64::from(self.config.settings.serial_period_ms).max(1)
    }

    fn time_of(&self, step: u64) -> Timestamp {
        self.start + Duration::from_nanos(step.saturating_mul(STEP_NANOS))
    }
}
