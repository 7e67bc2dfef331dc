//! Model of Betaflight, as far as a companion sees it: receivers, failsafe, arming, controllers, battery monitor.

pub(crate) mod altitude;
pub(crate) mod arming;
pub(crate) mod failsafe;
pub(crate) mod motors;
pub(crate) mod power;
pub(crate) mod receiver;
pub(crate) mod settings;
pub(crate) mod stabiliser;

use muster_machines::geometry::Ned;
use muster_msp::Mode;
use nalgebra::Vector3;

use self::altitude::{AltitudeEstimate, Altitudes};
use self::arming::{Arming, Conditions};
use self::failsafe::Failsafe;
use self::motors::Motors;
use self::power::PowerMonitor;
use self::receiver::{FLIGHT_CHANNELS, Look, Raw, Receiver, THROTTLE};
use self::settings::Settings;
use self::stabiliser::{Setpoint, Stabiliser};

/// Time between two looks at receiver, failsafe, arming and attitude, in milliseconds: Betaflight's tasks at 100 Hz.
pub(crate) const TICK_MS: u64 = 10;

/// Throttle below which it is low, in µs (`min_check`).
pub(crate) const THROTTLE_LOW_US: u16 = 1_050;

/// What the sensors say at a tick.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Measured {
    /// Roll to the right, pitch nose up, heading.
    pub(crate) angles_rad: [f64; 3],
    pub(crate) altitudes: Altitudes,
    pub(crate) volts: f64,
    /// In the world's frame; `None` without a fix.
    pub(crate) place: Option<Ned>,
}

/// The firmware. Times are milliseconds since its start.
#[derive(Debug, Clone)]
pub(crate) struct Firmware {
    pub(crate) settings: Settings,
    pub(crate) receiver: Receiver,
    failsafe: Failsafe,
    arming: Arming,
    stabiliser: Stabiliser,
    pub(crate) power: PowerMonitor,
    pub(crate) altitude: AltitudeEstimate,
    angles_rad: [f64; 3],
    /// What the stabiliser is to reach until the next tick.
    setpoint: Setpoint,
    motors: Motors,
    /// Where it armed.
    home: Option<Ned>,
    last_tick: Option<u64>,
}

impl Firmware {
    pub(crate) fn new(settings: Settings) -> Self {
        Self {
            receiver: Receiver::new(&settings),
            failsafe: Failsafe::new(settings.failsafe),
            arming: Arming::default(),
            stabiliser: Stabiliser::new(settings.tuning),
            power: PowerMonitor::new(settings.cell),
            altitude: AltitudeEstimate::default(),
            angles_rad: [0.0; 3],
            setpoint: Setpoint::default(),
            motors: Motors::default(),
            home: None,
            last_tick: None,
            settings,
        }
    }

    /// Every [`TICK_MS`]; seldom while the aircraft rests.
    pub(crate) fn tick(&mut self, now: u64, measured: &Measured) {
        self.angles_rad = measured.angles_rad;
        let was_armed = self.is_armed();
        let has_frame = self.look_at_receiver(now);
        self.arm(now, has_frame);
        if self.is_armed() && !was_armed {
            self.stabiliser.reset();
            self.home = measured.place;
        }
        self.setpoint = Setpoint::of(self.receiver.channels(), self.is_active(Mode::Angle));
        #[expect(clippy::cast_precision_loss, reason = "below 2^53")]
        let span_s = (now - self.last_tick.unwrap_or(0)).max(1) as f64 / 1_000.0;
        self.last_tick = Some(now);
        let is_armed = self.is_armed();
        self.altitude.update(is_armed, measured.altitudes, span_s);
        self.power.update(measured.volts, span_s);
    }

    /// Yields whether a new frame was used.
    fn look_at_receiver(&mut self, now: u64) -> bool {
        let is_override_on = self.is_active(Mode::MspOverride);
        let stage_2_us = self.failsafe.throttle_us();
        let look = self.receiver.look(now, is_override_on, stage_2_us);
        match look {
            Look::Idle => {}
            Look::Good => self.failsafe.good(now),
            Look::Bad => self.failsafe.bad(now),
        }
        let is_low = self.is_throttle_low();
        if self.failsafe.check(now, self.arming.is_armed(), is_low) {
            self.arming.disarm();
        }
        look == Look::Good
    }

    fn arm(&mut self, now: u64, has_frame: bool) {
        let [roll, pitch, _] = self.angles_rad;
        let tilt_rad = libm::acos(libm::cos(roll) * libm::cos(pitch));
        let conditions = Conditions {
            is_receiving: self.receiver.is_receiving(),
            is_switch_on: self.is_switched_on(Mode::Arm),
            is_throttle_low: self.is_throttle_low(),
            is_level: tilt_rad <= f64::from(self.settings.small_angle_deg).to_radians(),
            is_signal_lost: self.failsafe.is_signal_lost(),
            is_failsafe_active: self.failsafe.is_active(),
            has_failsafe_disarmed: self.failsafe.has_disarmed(),
        };
        self.arming.update(now, &conditions, has_frame);
    }

    /// Turns the motors of an armed aircraft, every millisecond.
    #[inline]
    pub(crate) fn stabilise(&mut self, rates_rad_s: Vector3<f64>) {
        let [roll, pitch, _] = self.angles_rad;
        let duties = self
            .stabiliser
            .duties(&self.setpoint, [roll, pitch], rates_rad_s);
        self.motors.drive(duties);
    }

    /// Turns the motors of a disarmed aircraft as they are tested.
    pub(crate) fn run_motor_test(&mut self) {
        self.motors.drive_test();
    }

    /// Sets the motors of a disarmed aircraft, in µs from 1,000 to 2,000. They turn until they are set to 1,000. What is set
    /// while armed counts from disarming on.
    pub(crate) fn set_motor_test(&mut self, outputs_us: &[u16]) {
        self.motors.set_test(outputs_us);
    }

    /// The last duty cycles.
    pub(crate) fn last_duties(&self) -> &[f64; 4] {
        self.motors.duties()
    }

    pub(crate) fn is_armed(&self) -> bool {
        self.arming.is_armed()
    }

    /// Reasons against arming, by [`Refusal`](arming::Refusal).
    pub(crate) fn refusals(&self) -> u32 {
        self.arming.refusals()
    }

    /// Roll to the right, pitch nose up and heading as estimated, in radians.
    pub(crate) fn angles_rad(&self) -> [f64; 3] {
        self.angles_rad
    }

    /// Where it armed last, in the world's frame.
    pub(crate) fn home(&self) -> Option<Ned> {
        self.home
    }

    fn is_throttle_low(&self) -> bool {
        self.receiver.channels()[THROTTLE] < THROTTLE_LOW_US
    }

    /// Whether a mode's switch is on.
    fn is_switched_on(&self, mode: Mode) -> bool {
        let channels = self.receiver.channels();
        let mut ranges = self.settings.modes.iter().filter(|it| it.mode == mode);
        ranges.any(|it| {
            let channel = channels.get(FLIGHT_CHANNELS + usize::from(it.aux));
            channel.is_some_and(|value_us| it.range_us.contains(value_us))
        })
    }

    /// Whether a mode is active.
    pub(crate) fn is_active(&self, mode: Mode) -> bool {
        match mode {
            Mode::Arm => self.is_armed(),
            Mode::Angle => self.is_switched_on(mode) || self.failsafe.is_active(),
            Mode::Failsafe => self.failsafe.is_active(),
            Mode::MspOverride => self.is_switched_on(mode),
            _ => false,
        }
    }

    /// Takes a frame of the companion's.
    pub(crate) fn receive(&mut self, now: u64, raw: Raw) {
        self.receiver.receive(now, raw);
    }
}
