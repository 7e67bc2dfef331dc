//! The hover test: one simulated aircraft, flown by a drone's own link, and what the drone sees of it.

use std::ops::Range;
use std::time::Duration;

use muster_machines::geodetic::Geodetic;
use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;
use muster_machines::machine::Output;
use muster_machines::msp::controller::{Gains, Noise, Stage, fix_place};
use muster_machines::msp::{FlightCommand, Input, Link, PortEvent, Setpoint, Telemetry, Transmit};
use muster_machines::time::Timestamp;
use muster_msp::{Channel, StickResponse, Sticks, TICK, Telemetry as MspTelemetry};
use muster_runtime::vehicle::VehicleKind;
use muster_scenarios::controllers::{Controllers, PortState};
use muster_scenarios::scenario::Scenario;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::TuneError;

const DRONE: NodeId = NodeId(0);
/// Height of the test, in metres: above the ground's effect and below a ceiling.
const HEIGHT_M: f64 = 3.0;
/// Length of a step sideways, in metres.
const STEP_M: f64 = 2.0;
/// Length of a step up, in metres.
const CLIMB_M: f64 = 1.0;
/// Acceleration of a step: a lean of 11°.
const ACCELERATION_MPS2: f64 = 2.0;
/// Speed of a step.
const SPEED_MPS: f64 = 2.0;
/// Farthest from the hover that it may stray, in metres.
const STRAYS_MAX_M: f64 = 6.0;
/// Time of a step, and until the vehicle rests after it.
const STEP: Duration = Duration::from_millis(3_500);
/// Time in which the hover throttle is measured.
const HOVER: Duration = Duration::from_secs(10);
/// Patience with arming and with a landing.
const PATIENCE: Duration = Duration::from_secs(30);

/// What the drone orders: from `at_s` on, seconds from the start.
#[derive(Debug, Clone, Copy)]
pub(super) struct Commanded {
    pub(super) at_s: f64,
    /// Nose down and to the right, in radians.
    pub(super) tilt_rad: [f64; 2],
    /// 0 to 1.
    pub(super) throttle: f64,
}

/// Attitude as the drone gets it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Attitude {
    pub(super) at_s: f64,
    /// Nose down and to the right, in radians.
    pub(super) tilt_rad: [f64; 2],
    /// Clockwise from north.
    pub(super) yaw_rad: f64,
}

/// A flight, as the drone saw it.
#[derive(Debug, Default)]
pub(super) struct Recording {
    pub(super) commands: Vec<Commanded>,
    pub(super) attitudes: Vec<Attitude>,
    /// North, east and up: when each was measured, and metres.
    pub(super) places: [Vec<(f64, f64)>; 3],
    /// When it hovers, in seconds from the start.
    pub(super) hovers: Range<f64>,
    /// When it steps sideways, likewise.
    pub(super) steps_sideways: Range<f64>,
    /// When it steps up and down, likewise.
    pub(super) steps_up: Range<f64>,
}

/// Flies the test with these gains; `seed` draws the errors of the sensors.
pub(super) fn fly(scenario: &Scenario, gains: Gains, seed: u64) -> Result<Recording, TuneError> {
    let mut test = Test::new(scenario, gains, seed);
    test.take_off()?;
    test.recording.hovers.start = test.now.as_secs_f64();
    test.pass(HOVER)?;
    test.recording.hovers.end = test.now.as_secs_f64();
    for _ in 0..2 {
        for (north_m, east_m) in [(STEP_M, 0.0), (0.0, 0.0), (0.0, STEP_M), (0.0, 0.0)] {
            test.step_to(Ned::new(north_m, east_m, -HEIGHT_M))?;
        }
    }
    test.recording.steps_sideways = test.recording.hovers.end..test.now.as_secs_f64();
    for _ in 0..3 {
        for climb_m in [CLIMB_M, 0.0] {
            test.step_to(Ned::new(0.0, 0.0, -HEIGHT_M - climb_m))?;
        }
    }
    test.recording.steps_up = test.recording.steps_sideways.end..test.now.as_secs_f64();
    test.land()?;
    Ok(test.recording)
}

struct Test {
    controllers: Controllers,
    link: Box<dyn Link>,
    /// Where it takes off.
    start: Ned,
    /// Home, if GPS tells where it is.
    gps_home: Option<Geodetic>,
    now: Timestamp,
    telemetry: Option<Telemetry>,
    lands: bool,
    recording: Recording,
}

impl Test {
    fn new(scenario: &Scenario, gains: Gains, seed: u64) -> Self {
        let plan = scenario.plan.clone().with_gains(gains);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut controllers = Controllers::default();
        controllers.extend(scenario, &mut rng.clone(), &mut rng);
        let link = plan.link(VehicleKind::Msp, Stage::Sim, plan.receiver);
        Self {
            controllers,
            link: link(None, Timestamp::ZERO),
            start: plan.start_positions().next().unwrap_or(Ned::HOME),
            gps_home: plan.pose.is_none().then_some(plan.home),
            now: Timestamp::ZERO,
            telemetry: None,
            lands: false,
            recording: Recording::default(),
        }
    }

    fn take_off(&mut self) -> Result<(), TuneError> {
        self.controllers.show_pilot(DRONE, true);
        self.pass(Duration::from_secs(6))?;
        self.command(FlightCommand::Arm);
        let is_armed = |it: &Self| it.telemetry.is_some_and(|telemetry| telemetry.armed);
        if !self.pass_until(PATIENCE, is_armed)? {
            return Err(TuneError::NotArmed);
        }
        self.command(FlightCommand::Fly(Setpoint::Leg {
            to: self.place(Ned::new(0.0, 0.0, -HEIGHT_M)),
            speed_mps: 1.0,
            acceleration_mps2: 1.0,
        }));
        // The climb, and until the hover throttle is learnt.
        self.pass(Duration::from_secs(14))
    }

    fn step_to(&mut self, from_start: Ned) -> Result<(), TuneError> {
        self.command(FlightCommand::Fly(Setpoint::Leg {
            to: self.place(from_start),
            speed_mps: SPEED_MPS,
            acceleration_mps2: ACCELERATION_MPS2,
        }));
        self.pass(STEP)
    }

    fn land(&mut self) -> Result<(), TuneError> {
        self.lands = true;
        self.command(FlightCommand::Land);
        let is_down = |it: &Self| it.telemetry.is_some_and(|telemetry| !telemetry.armed);
        match self.pass_until(PATIENCE, is_down)? {
            true => Ok(()),
            false => Err(TuneError::NotDown),
        }
    }

    fn place(&self, from_start: Ned) -> Ned {
        Ned(self.start.0 + from_start.0)
    }

    fn command(&mut self, command: FlightCommand) {
        self.give(Input::FlightCommand(command));
    }

    fn give(&mut self, input: Input) {
        self.link.handle_input(self.now, input);
        self.drain();
    }

    fn drain(&mut self) {
        loop {
            match self.link.poll_output() {
                Output::Transmit(Transmit::Rc(rc)) => {
                    if let Some(rc) = rc {
                        let commanded = commanded(self.now, rc.sticks());
                        self.recording.commands.push(commanded);
                    }
                    self.controllers.set_rc(self.now, DRONE, rc);
                }
                Output::Transmit(Transmit::Telemetry(telemetry)) => {
                    self.telemetry = Some(telemetry);
                }
                Output::Transmit(_) | Output::Event(_) => {}
                Output::Idle { .. } => return,
            }
        }
    }

    fn pass(&mut self, span: Duration) -> Result<(), TuneError> {
        self.pass_until(span, |_| false).map(|_| ())
    }

    /// Passes time until something holds; returns whether it does.
    fn pass_until(
        &mut self,
        span: Duration,
        holds: impl Fn(&Self) -> bool,
    ) -> Result<bool, TuneError> {
        let end = self.now + span;
        while self.now < end {
            self.tick()?;
            if holds(self) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    fn tick(&mut self) -> Result<(), TuneError> {
        self.now += TICK;
        let mut events = Vec::new();
        self.controllers
            .tick(self.now, DRONE, PortState::Runs, |event| events.push(event));
        for event in events {
            self.note(&event);
            self.give(Input::Port(event));
        }
        self.link.handle_timeout(self.now);
        self.command(FlightCommand::Report);
        self.check()
    }

    /// Ends the test when something is wrong: what it would tell of the aircraft then is worth nothing.
    fn check(&self) -> Result<(), TuneError> {
        if let Some(broken) = self.controllers.broken_rule(self.now, DRONE) {
            return Err(TuneError::Broken(broken));
        }
        let Some(telemetry) = self.telemetry.filter(|it| it.armed && !self.lands) else {
            return Ok(());
        };
        if telemetry.landing {
            return Err(TuneError::Landed(telemetry.landing_cause));
        }
        let strays_m = telemetry.position.horizontal_distance_m(self.start);
        if strays_m > STRAYS_MAX_M {
            return Err(TuneError::Strayed { strays_m });
        }
        Ok(())
    }

    /// Notes what the drone gets.
    fn note(&mut self, event: &PortEvent) {
        let at_s = self.now.as_secs_f64();
        let recording = &mut self.recording;
        match event {
            PortEvent::Pose(pose) => {
                let at_s = at_s - pose.age.as_secs_f64();
                let place = pose.position;
                let axes_m = [place.north_m(), place.east_m(), place.altitude_m()];
                for (axis, metres) in recording.places.iter_mut().zip(axes_m) {
                    axis.push((at_s, metres));
                }
            }
            PortEvent::Telemetry(MspTelemetry::Attitude(attitude)) => {
                recording.attitudes.push(Attitude {
                    at_s,
                    tilt_rad: [attitude.pitch_ddeg, attitude.roll_ddeg]
                        .map(|it| (f64::from(it) / 10.0).to_radians()),
                    yaw_rad: f64::from(attitude.yaw_deg).to_radians(),
                });
            }
            PortEvent::Telemetry(MspTelemetry::Gps(gps)) => {
                if let Some(place) = self.gps_home.and_then(|home| fix_place(home, gps)) {
                    let at_s = at_s - Noise::GPS.gps_delay.as_secs_f64();
                    recording.places[0].push((at_s, place.north_m()));
                    recording.places[1].push((at_s, place.east_m()));
                }
            }
            PortEvent::Telemetry(MspTelemetry::Altitude(altitude)) if self.gps_home.is_some() => {
                recording.places[2].push((at_s, f64::from(altitude.altitude_cm) / 100.0));
            }
            _ => {}
        }
    }
}

fn commanded(now: Timestamp, sticks: Sticks) -> Commanded {
    let deflection = |it: Channel| (f64::from(it.us()) - 1_500.0) / 500.0;
    Commanded {
        at_s: now.as_secs_f64(),
        tilt_rad: [sticks.pitch, sticks.roll]
            .map(|it| StickResponse::ASSUMED.tilt_rad(deflection(it))),
        throttle: (f64::from(sticks.throttle.us()) - 1_000.0) / 1_000.0,
    }
}
