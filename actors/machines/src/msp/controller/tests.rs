mod gate;
mod restart;
mod stages;
mod trouble;

use muster_msp::{
    Altitude, ArmingFlags, BoardInfo, BoxIds, Channel, Identity, Letters, Mode, RawGps, SetRawRc,
    StatusFlags, StatusHead, Sticks,
};

use super::*;
use crate::geodetic::Geodetic;
use crate::geometry::Ned;
use crate::motion::Landing;
use crate::msp::{LandingCause, Setpoint};

fn at(milliseconds: u64) -> Timestamp {
    Timestamp::from_nanos(milliseconds * 1_000_000)
}

/// In the stage `sim`, without a pilot.
pub(super) fn config() -> Config {
    staged(Stage::Sim, Receiver::Sole)
}

fn staged(stage: Stage, receiver: Receiver) -> Config {
    Config {
        stage,
        receiver,
        home: Geodetic::new(49.0, 12.0, 400.0).unwrap(),
        landing: Landing {
            descent_mps: 1.5,
            final_mps: 0.5,
            final_altitude_m: 10.0,
            acceleration_mps2: 1.0,
        },
        place: PlaceSensor::Gps,
        flow: None,
        noise: Noise::GPS,
        gains: Gains::QUADCOPTER,
    }
}

/// Who it is, without a grant.
fn identity(board: [u8; 4]) -> PortEvent {
    granted(board, Stage::Bench)
}

fn granted(board: [u8; 4], granted: Stage) -> PortEvent {
    let identity = Identity {
        board: BoardInfo {
            board: Letters(board),
            ..BoardInfo::default()
        },
        boxes: BoxIds {
            modes: vec![Mode::Arm, Mode::Angle, Mode::Failsafe, Mode::MspOverride],
        },
        ..Identity::default()
    };
    PortEvent::Identified {
        identity: Box::new(identity),
        granted,
    }
}

/// A status with these modes active, by their places in [`identity`].
fn status(modes: u32) -> PortEvent {
    PortEvent::Telemetry(MspTelemetry::Status(Status {
        head: StatusHead {
            modes,
            ..StatusHead::default()
        },
        flags: StatusFlags {
            arming: ArmingFlags { count: 28, bits: 0 },
            ..StatusFlags::default()
        },
        ..Status::default()
    }))
}

/// Armed, and level by the mode ANGLE.
const ARM: u32 = 1 | 2;
const FAILSAFE: u32 = 4;
const OVERRIDE: u32 = 8;

fn fix() -> PortEvent {
    PortEvent::Telemetry(MspTelemetry::Gps(RawGps {
        fix: 1,
        satellites: 12,
        latitude_e7: 490_000_000,
        longitude_e7: 120_000_000,
        altitude_m: 400,
        ..RawGps::default()
    }))
}

/// A link, the time, and what it has sent.
struct Bench {
    link: ControllerLink,
    now_ms: u64,
    rc: Option<SetRawRc>,
    /// All sticks since it was cleared.
    sent: Vec<SetRawRc>,
    telemetry: Vec<Telemetry>,
    checkpoint: Option<Checkpoint>,
}

impl Bench {
    fn new(config: Config, checkpoint: Option<Checkpoint>) -> Self {
        let mut bench = Self {
            link: ControllerLink::new(config, checkpoint, at(0)),
            now_ms: 0,
            rc: None,
            sent: Vec::new(),
            telemetry: Vec::new(),
            checkpoint: None,
        };
        bench.drain();
        bench
    }

    /// In the stage `sim`, with a simulation and a position, on the ground.
    fn ready(receiver: Receiver) -> Self {
        let simulation = identity(*b"SITL");
        Self::ready_with(staged(Stage::Sim, receiver), simulation)
    }

    /// With a controller and a position, on the ground.
    fn ready_with(config: Config, identity: PortEvent) -> Self {
        let mut bench = Self::new(config, None);
        bench.give(Input::Port(identity));
        bench.give(Input::Port(fix()));
        let altitude = PortEvent::Telemetry(MspTelemetry::Altitude(Altitude::default()));
        bench.give(Input::Port(altitude));
        bench.give(Input::Port(status(0)));
        bench
    }

    fn flying(receiver: Receiver, modes: u32) -> Self {
        let mut bench = Self::ready(receiver);
        bench.take_off(modes);
        bench
    }

    /// A real board that a pilot has armed, in a stage, of which so much is granted.
    fn piloted(stage: Stage, grant: Stage) -> Self {
        let config = staged(stage, Receiver::Override);
        let mut bench = Self::ready_with(config, granted(*b"S405", grant));
        bench.take_off(ARM | OVERRIDE);
        bench
    }

    fn take_off(&mut self, modes: u32) {
        self.give(Input::FlightCommand(FlightCommand::Arm));
        self.pass(1_000, 0);
        self.pass(300, modes);
        self.give(Input::FlightCommand(up()));
        self.pass(100, modes);
    }

    fn give(&mut self, input: Input) {
        self.link.handle_input(at(self.now_ms), input);
        self.drain();
    }

    /// So many milliseconds go by in steps of 10, without a word from the controller.
    fn wait(&mut self, milliseconds: u64) {
        for _ in 0..milliseconds / 10 {
            self.now_ms += 10;
            self.link.handle_timeout(at(self.now_ms));
            self.drain();
        }
    }

    /// So many milliseconds go by in steps of 10, with fixes, and a status with these modes each 100 ms.
    fn pass(&mut self, milliseconds: u64, modes: u32) {
        for _ in 0..milliseconds / 10 {
            self.now_ms += 10;
            self.link.handle_timeout(at(self.now_ms));
            self.drain();
            if self.now_ms.is_multiple_of(100) {
                self.give(Input::Port(fix()));
                let altitude = PortEvent::Telemetry(MspTelemetry::Altitude(Altitude::default()));
                self.give(Input::Port(altitude));
                self.give(Input::Port(status(modes)));
            }
        }
    }

    /// 20 ms go by at a height with a climb rate, with a fix and a status with these modes at their end.
    fn rise(&mut self, altitude_cm: i32, climb_cmps: i16, modes: u32) {
        self.wait(20);
        let altitude = Altitude {
            altitude_cm,
            climb_cmps,
        };
        self.give(Input::Port(PortEvent::Telemetry(MspTelemetry::Altitude(
            altitude,
        ))));
        self.give(Input::Port(fix()));
        self.give(Input::Port(status(modes)));
    }

    /// Rises from the ground to 10 m, and stays there for a while.
    fn rise_to_10_m(&mut self, modes: u32) {
        for altitude_cm in 0..1_000 {
            self.rise(altitude_cm, 50, modes);
        }
        for _ in 0..50 {
            self.rise(1_000, 0, modes);
        }
    }

    fn drain(&mut self) {
        loop {
            match self.link.poll_output() {
                Output::Transmit(Transmit::Rc(rc)) => {
                    self.rc = rc;
                    self.sent.extend(rc);
                }
                Output::Transmit(Transmit::Telemetry(it)) => self.telemetry.push(it),
                Output::Transmit(Transmit::Resync) => {}
                Output::Transmit(it @ (Transmit::Command(_) | Transmit::Order(_))) => {
                    panic!("{it:?}")
                }
                Output::Event(Event::Checkpoint(checkpoint)) => self.checkpoint = Some(checkpoint),
                Output::Idle { .. } => return,
            }
        }
    }

    fn is_arm_high(&self) -> bool {
        self.rc.is_some_and(|rc| rc.aux()[0] > Channel::CENTRE)
    }

    fn throttle(&self) -> u16 {
        self.rc.map_or(0, |rc| rc.sticks().throttle.us())
    }
}

fn up() -> FlightCommand {
    FlightCommand::Fly(Setpoint::Leg {
        to: Ned::HOME.at_altitude(10.0),
        speed_mps: 2.0,
        acceleration_mps2: 1.0,
    })
}

#[test]
fn vehicle_arms_and_climbs_on_command() {
    let mut bench = Bench::ready(Receiver::Sole);
    bench.pass(1_000, 0);
    assert!(!bench.is_arm_high(), "it was not told to arm");
    bench.give(Input::FlightCommand(FlightCommand::Arm));
    bench.pass(100, 0);
    assert!(bench.is_arm_high());
    assert_eq!(bench.throttle(), 1_000);
    bench.pass(300, ARM);
    assert!(bench.telemetry.last().unwrap().armed);
    assert_eq!(bench.throttle(), 1_000, "no setpoint yet");
    bench.give(Input::FlightCommand(up()));
    bench.pass(100, ARM);
    assert!(bench.throttle() > 1_200);
}

#[test]
fn throttle_stays_closed_between_arming_and_the_next_altitude() {
    let mut bench = Bench::ready(Receiver::Sole);
    bench.give(Input::FlightCommand(FlightCommand::Arm));
    bench.pass(300, 0);
    for _ in 0..2 {
        bench.give(Input::Port(status(ARM)));
    }
    for _ in 0..20 {
        bench.wait(10);
        assert_eq!(bench.throttle(), 1_000);
    }
}

#[test]
fn sticks_are_not_given_to_a_controller_that_takes_them_for_rates() {
    const ARM_WITHOUT_ANGLE: u32 = 1;
    for (receiver, modes) in [(Receiver::Sole, 0), (Receiver::Override, OVERRIDE)] {
        let mut bench = Bench::flying(receiver, ARM | modes);
        assert!(bench.rc.is_some());
        bench.give(Input::Port(status(ARM_WITHOUT_ANGLE | modes)));
        bench.wait(50);
        assert!(bench.rc.is_some(), "said once");
        bench.pass(300, ARM_WITHOUT_ANGLE | modes);
        assert_eq!(bench.rc, None);
    }
    let mut bench = Bench::flying(Receiver::Override, ARM | OVERRIDE);
    bench.pass(300, ARM_WITHOUT_ANGLE);
    assert!(bench.rc.is_some(), "the pilot's sticks count");
}

#[test]
fn vehicle_that_is_met_in_the_air_by_a_link_that_knows_nothing_sinks_slowly() {
    let mut bench = Bench::new(config(), None);
    bench.give(Input::Port(identity(*b"SITL")));
    bench.give(Input::FlightCommand(FlightCommand::Land));
    for _ in 0..2 {
        bench.give(Input::Port(status(ARM)));
    }
    for step in 0..100 {
        bench.wait(20);
        assert!(bench.throttle() > 1_150, "{step}: {:?}", bench.rc);
        assert!(bench.is_arm_high());
        let altitude = Altitude {
            altitude_cm: 1_200 - step,
            climb_cmps: -50,
        };
        bench.give(Input::Port(PortEvent::Telemetry(MspTelemetry::Altitude(
            altitude,
        ))));
        bench.give(Input::Port(status(ARM)));
    }
    assert!(bench.telemetry.last().unwrap().landing);
}

#[test]
fn vehicle_that_a_pilot_hands_over_in_the_air_stays_there() {
    let mut bench = Bench::ready(Receiver::Override);
    for altitude_cm in 0..2 {
        bench.rise(altitude_cm, 50, ARM);
    }
    assert_eq!(bench.throttle(), 1_000, "on the ground");
    bench.rise_to_10_m(ARM);
    for _ in 0..50 {
        bench.rise(1_000, 0, ARM | OVERRIDE);
        assert!(bench.throttle() > 1_200, "{:?}", bench.rc);
    }
    let hold = bench.checkpoint.unwrap().flight.unwrap().setpoint;
    assert!(
        matches!(hold, Some(Setpoint::Hold { altitude_m, .. }) if altitude_m > 8.0),
        "{hold:?}"
    );
}
