use muster_msp::{
    Altitude, ArmingFlags, Attitude, BatteryState, BoardInfo, BoxIds, Letters, RawGps, StatusFlags,
    StatusHead,
};
use proptest::prelude::*;

use super::*;
use crate::geodetic::Geodetic;
use crate::motion::Landing;

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
    PortEvent::Told(Told::Status(Status {
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
    PortEvent::Told(Told::Gps(RawGps {
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
    telemetry: Vec<Telemetry>,
    checkpoint: Option<Checkpoint>,
}

impl Bench {
    fn new(config: Config, checkpoint: Option<Checkpoint>) -> Self {
        let mut bench = Self {
            link: ControllerLink::new(config, checkpoint, at(0)),
            now_ms: 0,
            rc: None,
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
        let altitude = PortEvent::Told(Told::Altitude(Altitude::default()));
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
                let altitude = PortEvent::Told(Told::Altitude(Altitude::default()));
                self.give(Input::Port(altitude));
                self.give(Input::Port(status(modes)));
            }
        }
    }

    fn drain(&mut self) {
        loop {
            match self.link.poll_output() {
                Output::Transmit(Transmit::Rc(rc)) => self.rc = rc,
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
fn vehicle_arms_and_climbs_when_it_is_told_to() {
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
        bench.give(Input::Port(PortEvent::Told(Told::Altitude(altitude))));
        bench.give(Input::Port(status(ARM)));
    }
    assert!(bench.telemetry.last().unwrap().landing);
}

#[test]
fn vehicle_that_a_pilot_hands_over_in_the_air_stays_there() {
    let mut bench = Bench::ready(Receiver::Override);
    let rise = |bench: &mut Bench, modes: u32, range: std::ops::Range<i32>| {
        for altitude_cm in range {
            bench.wait(20);
            let altitude = Altitude {
                altitude_cm,
                climb_cmps: if altitude_cm < 1_000 { 50 } else { 0 },
            };
            bench.give(Input::Port(PortEvent::Told(Told::Altitude(altitude))));
            bench.give(Input::Port(fix()));
            bench.give(Input::Port(status(modes)));
        }
    };
    rise(&mut bench, ARM, 0..2);
    assert_eq!(bench.throttle(), 1_000, "on the ground");
    rise(&mut bench, ARM, 2..1_000);
    for _ in 0..50 {
        rise(&mut bench, ARM | OVERRIDE, 1_000..1_001);
        assert!(bench.throttle() > 1_200, "{:?}", bench.rc);
    }
    let hold = bench.checkpoint.unwrap().flight.unwrap().setpoint;
    assert!(
        matches!(hold, Some(Setpoint::Hold { altitude_m, .. }) if altitude_m > 8.0),
        "{hold:?}"
    );
}

#[test]
fn a_board_that_is_no_simulation_is_never_armed_in_the_stage_sim() {
    let mut bench = Bench::new(config(), None);
    bench.give(Input::Port(identity(*b"S405")));
    bench.give(Input::FlightCommand(FlightCommand::Arm));
    bench.pass(2_000, 0);
    assert!(!bench.is_arm_high() && bench.throttle() == 1_000);
    bench.pass(500, ARM);
    assert!(!bench.is_arm_high() && bench.throttle() == 1_000);
}

#[test]
fn restarted_link_flies_on_and_arms_nothing_that_is_disarmed() {
    let bench = Bench::flying(Receiver::Sole, ARM);
    let checkpoint = bench.checkpoint.unwrap();
    assert!(checkpoint.flight.unwrap().has_flown);
    let mut armed = Bench::new(config(), Some(checkpoint));
    armed.give(Input::Port(identity(*b"SITL")));
    assert_eq!(armed.rc, None, "it asks first whether it is armed");
    armed.give(Input::Port(status(ARM)));
    assert!(armed.is_arm_high() && armed.throttle() > 1_200, "level");
    let altitude = PortEvent::Told(Told::Altitude(Altitude::default()));
    armed.give(Input::Port(altitude));
    armed.pass(200, ARM);
    assert_eq!(
        armed.link.guidance.target(),
        Some(Ned::HOME.at_altitude(10.0))
    );

    let mut disarmed = Bench::new(config(), Some(checkpoint));
    disarmed.give(Input::Port(identity(*b"SITL")));
    disarmed.give(Input::FlightCommand(FlightCommand::Arm));
    disarmed.pass(5_000, 0);
    assert!(!disarmed.is_arm_high() && disarmed.throttle() == 1_000);
}

#[test]
fn restarted_link_leaves_the_newest_sticks_to_the_port_until_it_gives_its_own() {
    let mut bench = Bench::new(config(), None);
    let given = SetRawRc::new(Sticks::IDLE, &[Channel::HIGH, ANGLE]).unwrap();
    bench.rc = Some(given);
    bench.give(Input::Port(identity(*b"SITL")));
    assert_eq!(bench.rc, Some(given));
    bench.give(Input::Port(PortEvent::Closed));
    assert_eq!(bench.rc, None);
}

#[test]
fn closed_port_stops_rc_and_an_open_one_begins_with_a_question() {
    let mut bench = Bench::flying(Receiver::Sole, ARM);
    bench.give(Input::Port(PortEvent::Closed));
    assert_eq!(bench.rc, None);
    bench.now_ms += 1_000;
    bench.link.handle_timeout(at(bench.now_ms));
    bench.drain();
    assert_eq!(bench.rc, None);
    bench.give(Input::Port(identity(*b"SITL")));
    bench.give(Input::Port(status(0)));
    assert!(!bench.is_arm_high(), "its failsafe has disarmed");
}

/// A defect of the indoor thesis's code: a client that disconnected dropped all channels, which disarmed in mid-air.
#[test]
fn a_connection_that_ends_in_flight_drops_no_channel() {
    let mut bench = Bench::flying(Receiver::Sole, ARM);
    bench.give(Input::Port(PortEvent::Closed));
    for _ in 0..50 {
        // Without RC the controller's own failsafe acts.
        assert_eq!(bench.rc, None);
        bench.now_ms += 10;
        bench.link.handle_timeout(at(bench.now_ms));
        bench.drain();
    }
    bench.give(Input::Port(identity(*b"SITL")));
    assert_eq!(bench.rc, None, "it asks first whether it is armed");
    bench.give(Input::Port(status(ARM)));
    assert!(bench.is_arm_high() && bench.throttle() > 1_200);
}

#[test]
fn pilot_who_takes_over_is_not_fought() {
    let mut bench = Bench::flying(Receiver::Override, ARM | OVERRIDE);
    assert!(bench.throttle() > 1_200);
    bench.give(Input::Port(status(ARM)));
    assert!(!bench.telemetry.last().unwrap().landing, "once is noise");
    bench.give(Input::Port(status(ARM)));
    assert!(bench.telemetry.last().unwrap().landing);
    // Sticks that are given back by mistake neither lean nor stop the motors.
    bench.pass(1_000, ARM | OVERRIDE);
    let sticks = bench.rc.unwrap().sticks();
    assert_eq!(
        (sticks.roll, sticks.pitch),
        (Channel::CENTRE, Channel::CENTRE)
    );
    assert!((1_250..1_350).contains(&sticks.throttle.us()), "it hovers");
    assert!(bench.telemetry.last().unwrap().landing);
}

#[test]
fn failsafe_of_the_controller_counts_as_landing_and_is_not_ended_by_frames() {
    let mut bench = Bench::flying(Receiver::Sole, ARM);
    bench.give(Input::Port(status(ARM | FAILSAFE)));
    bench.give(Input::Port(status(ARM | FAILSAFE)));
    assert!(bench.telemetry.last().unwrap().landing);
    assert_eq!(bench.rc, None);
    bench.pass(1_000, ARM);
    assert_eq!(bench.rc, None, "its link is back, and it is left alone");
    bench.pass(1_000, 0);
    assert!(
        bench.rc.is_some() && !bench.is_arm_high(),
        "it has disarmed"
    );
}

#[test]
fn an_order_to_land_right_after_a_restart_in_the_air_stops_no_motor() {
    let bench = Bench::flying(Receiver::Sole, ARM);
    let mut restarted = Bench::new(config(), bench.checkpoint);
    restarted.give(Input::FlightCommand(FlightCommand::Land));
    restarted.give(Input::Port(identity(*b"SITL")));
    restarted.give(Input::Port(status(ARM)));
    assert!(restarted.is_arm_high() && restarted.throttle() > 1_200);
    restarted.pass(300, ARM);
    assert!(restarted.is_arm_high() && restarted.link.guidance.is_landing());
}

#[test]
fn height_is_held_without_a_position() {
    let bench = Bench::flying(Receiver::Sole, ARM);
    let mut restarted = Bench::new(config(), bench.checkpoint);
    restarted.give(Input::Port(identity(*b"SITL")));
    restarted.give(Input::Port(status(ARM)));
    let altitude = PortEvent::Told(Told::Altitude(Altitude::default()));
    restarted.give(Input::Port(altitude));
    restarted.give(Input::Port(status(ARM)));
    let told = restarted.telemetry.last().unwrap();
    assert!(told.armed && told.position_lost_for.is_some());
    let sticks = restarted.rc.unwrap().sticks();
    assert_eq!(
        (sticks.roll, sticks.pitch),
        (Channel::CENTRE, Channel::CENTRE)
    );
    assert!(restarted.link.guidance.target().is_some(), "it climbs on");
}

#[test]
fn a_controller_that_is_silent_for_a_second_in_flight_is_left_to_its_failsafe() {
    for closes in [false, true] {
        let mut bench = Bench::flying(Receiver::Sole, ARM);
        if closes {
            bench.give(Input::Port(PortEvent::Closed));
        }
        bench.wait(950);
        assert!(!bench.telemetry.last().unwrap().landing);
        bench.wait(100);
        let last = *bench.telemetry.last().unwrap();
        assert!(last.armed && last.landing);
        assert_eq!(bench.rc, None);
        bench.give(Input::Port(identity(*b"SITL")));
        bench.pass(1_000, ARM);
        assert_eq!(bench.rc, None, "it is not taken back");
        bench.pass(200, 0);
        assert!(!bench.telemetry.last().unwrap().armed);
    }
}

#[test]
fn silence_while_the_link_itself_was_held_up_is_no_loss() {
    let mut bench = Bench::flying(Receiver::Sole, ARM);
    bench.now_ms += 2_000;
    bench.pass(500, ARM);
    assert!(bench.is_arm_high() && !bench.telemetry.last().unwrap().landing);
}

#[test]
fn port_that_was_closed_for_a_moment_in_flight_changes_no_height_and_loses_no_order() {
    let mut bench = Bench::flying(Receiver::Sole, ARM);
    let ground_m = bench.link.estimator.ground_m();
    let high = Altitude {
        altitude_cm: 30,
        ..Altitude::default()
    };
    bench.give(Input::Port(PortEvent::Told(Told::Altitude(high))));
    bench.give(Input::Port(PortEvent::Closed));
    bench.give(Input::FlightCommand(FlightCommand::Land));
    bench.wait(300);
    bench.give(Input::Port(identity(*b"SITL")));
    assert_eq!(bench.rc, None, "it asks first whether it is armed");
    bench.give(Input::Port(status(ARM)));
    assert!(bench.is_arm_high(), "the motors keep on turning");
    assert!(bench.link.guidance.is_landing());
    assert_eq!(bench.link.estimator.ground_m(), ground_m);
}

#[test]
fn link_that_was_given_up_lands_and_takes_no_commands() {
    let mut bench = Bench::flying(Receiver::Sole, ARM);
    bench.give(Input::GiveUp);
    bench.give(Input::FlightCommand(up()));
    bench.pass(20, ARM);
    assert!(bench.link.guidance.is_landing());
    assert!(bench.checkpoint.unwrap().gave_up);
}

#[test]
fn granted_stages_fly_a_real_board_and_leave_the_arm_switch_to_the_pilot() {
    for stage in [Stage::Tethered, Stage::Flight] {
        let bench = Bench::piloted(stage, stage);
        assert!(bench.throttle() > 1_200, "{stage:?}");
        assert!(!bench.is_arm_high());
        let last = bench.telemetry.last().unwrap();
        assert!(last.armed && !last.landing);
    }
}

#[test]
fn without_a_grant_nothing_is_sent_to_what_a_pilot_has_armed() {
    for (stage, grant) in [
        (Stage::Tethered, Stage::Bench),
        (Stage::Flight, Stage::Bench),
        (Stage::Bench, Stage::Flight),
    ] {
        let bench = Bench::piloted(stage, grant);
        assert_eq!(bench.rc, None, "{stage:?}");
        assert!(bench.telemetry.last().unwrap().landing, "not counted on");
    }
    // A lower grant lowers the stage.
    let bench = Bench::piloted(Stage::Flight, Stage::Tethered);
    let target = bench.link.guidance.target();
    assert_eq!(target, Some(Ned::HOME.at_altitude(TETHER_HEIGHT_MAX_M)));
}

#[test]
fn without_a_pilot_no_grant_counts() {
    let config = staged(Stage::Flight, Receiver::Sole);
    let mut bench = Bench::ready_with(config, granted(*b"S405", Stage::Flight));
    bench.take_off(ARM);
    assert_eq!(bench.rc.unwrap().sticks(), Sticks::IDLE);
}

#[test]
fn a_tether_stops_a_mission_at_its_edge_also_after_a_restart() {
    let mut bench = Bench::piloted(Stage::Tethered, Stage::Tethered);
    let far = FlightCommand::Fly(Setpoint::Leg {
        to: Ned::new(30.0, 40.0, -20.0),
        speed_mps: 5.0,
        acceleration_mps2: 2.0,
    });
    let edge = Ned::new(1.8, 2.4, -TETHER_HEIGHT_MAX_M);
    let target = |bench: &Bench| bench.link.guidance.target().unwrap();
    bench.give(Input::FlightCommand(far));
    assert!(target(&bench).distance_m(edge) < 1e-9);

    // The vehicle has moved when the link restarts: its tether has not.
    let config = staged(Stage::Tethered, Receiver::Override);
    let mut restarted = Bench::new(config, bench.checkpoint);
    restarted.give(Input::Port(granted(*b"S405", Stage::Tethered)));
    restarted.give(Input::Port(status(ARM | OVERRIDE)));
    let mut moved = fix();
    if let PortEvent::Told(Told::Gps(gps)) = &mut moved {
        gps.latitude_e7 += 270;
    }
    restarted.give(Input::Port(moved));
    let altitude = PortEvent::Told(Told::Altitude(Altitude::default()));
    restarted.give(Input::Port(altitude));
    restarted.give(Input::Port(status(ARM | OVERRIDE)));
    restarted.give(Input::FlightCommand(far));
    assert!(target(&restarted).distance_m(edge) < 1e-9);
}

fn rolled(deg: i16) -> Input {
    Input::Port(PortEvent::Told(Told::Attitude(Attitude {
        roll_ddeg: deg * 10,
        pitch_ddeg: 0,
        yaw_deg: 0,
    })))
}

#[test]
fn a_vehicle_that_tips_over_is_righted_and_lands_and_one_that_lies_stops_its_motors() {
    let mut bench = Bench::flying(Receiver::Sole, ARM);
    let tip = |bench: &mut Bench, deg| {
        for _ in 0..2 {
            bench.give(rolled(deg));
        }
    };
    tip(&mut bench, 80);
    bench.pass(200, ARM);
    assert!(
        !bench.telemetry.last().unwrap().landing,
        "not for long enough"
    );
    bench.pass(200, ARM);
    let last = *bench.telemetry.last().unwrap();
    assert!(last.landing && last.landing_cause == Some(LandingCause::Tilt));
    assert_eq!(bench.rc.unwrap().sticks(), Control::upright());
    let restarted = Bench::new(config(), bench.checkpoint);
    assert_eq!(restarted.link.impaired, Some(LandingCause::Tilt));
    tip(&mut bench, 0);
    bench.pass(100, ARM);
    assert!(bench.is_arm_high() && bench.throttle() > 1_200);
    assert!(bench.link.guidance.is_landing(), "it is not taken back");
    tip(&mut bench, 80);
    bench.pass(2_100, ARM);
    assert!(!bench.is_arm_high());
}

#[test]
fn a_vehicle_too_heavy_to_leave_the_ground_stops_its_motors() {
    let mut bench = Bench::flying(Receiver::Sole, ARM);
    bench.pass(6_000, ARM);
    let last = *bench.telemetry.last().unwrap();
    assert_eq!(last.landing_cause, Some(LandingCause::Thrust));
    assert!(!bench.is_arm_high());
}

/// A checkpoint of a flight that has learnt a hover throttle.
fn in_flight(hover_throttle: f64) -> Checkpoint {
    Checkpoint {
        gave_up: false,
        flight: Some(Flight {
            has_flown: true,
            setpoint: Some(Setpoint::Leg {
                to: Ned::HOME.at_altitude(10.0),
                speed_mps: 2.0,
                acceleration_mps2: 1.0,
            }),
            start: Some(Ned::HOME),
            is_landing: false,
            hover_throttle,
            ground_m: Some(0.0),
            taken: Taken::default(),
            impaired: None,
        }),
    }
}

fn any_stage() -> impl Strategy<Value = Stage> {
    prop_oneof![
        Just(Stage::Sim),
        Just(Stage::Bench),
        Just(Stage::Tethered),
        Just(Stage::Flight),
    ]
}

fn any_told() -> impl Strategy<Value = PortEvent> {
    let board = prop_oneof![Just(*b"SITL"), Just(*b"S405"), any::<[u8; 4]>()];
    let identity = (board, any_stage()).prop_map(|(board, stage)| granted(board, stage));
    let flags = (any::<u32>(), any::<u8>(), any::<u32>()).prop_map(|(modes, count, bits)| {
        Told::Status(Status {
            head: StatusHead {
                modes,
                ..StatusHead::default()
            },
            flags: StatusFlags {
                arming: ArmingFlags { count, bits },
                ..StatusFlags::default()
            },
            ..Status::default()
        })
    });
    let gps = (any::<[i32; 2]>(), any::<[u8; 2]>(), any::<[u16; 3]>()).prop_map(
        |([latitude_e7, longitude_e7], [fix, satellites], [altitude_m, speed, course])| {
            Told::Gps(RawGps {
                fix,
                satellites,
                latitude_e7,
                longitude_e7,
                altitude_m,
                speed_cmps: speed,
                course_ddeg: course,
                pdop_e2: None,
            })
        },
    );
    let attitude = any::<[i16; 3]>().prop_map(|[roll_ddeg, pitch_ddeg, yaw_deg]| {
        Told::Attitude(Attitude {
            roll_ddeg,
            pitch_ddeg,
            yaw_deg,
        })
    });
    let altitude = (any::<i32>(), any::<i16>()).prop_map(|(altitude_cm, climb_cmps)| {
        Told::Altitude(Altitude {
            altitude_cm,
            climb_cmps,
        })
    });
    let motors =
        any::<[u16; 8]>().prop_map(|outputs_us| Told::Motor(muster_msp::Motor { outputs_us }));
    let battery = (any::<u8>(), any::<u16>(), any::<i16>()).prop_map(|(cells, cv, current_ca)| {
        Told::Battery(BatteryState {
            cells,
            current_ca,
            voltage_cv: Some(cv),
            ..BatteryState::default()
        })
    });
    let told =
        prop_oneof![flags, gps, attitude, altitude, motors, battery].prop_map(PortEvent::Told);
    prop_oneof![1 => identity, 1 => Just(PortEvent::Closed), 1 => Just(status(0)), 1 => Just(status(ARM)), 1 => Just(status(ARM | OVERRIDE)), 6 => told]
}

fn any_input() -> impl Strategy<Value = Input> {
    let command = prop_oneof![
        Just(FlightCommand::Report),
        Just(FlightCommand::Arm),
        Just(FlightCommand::Yield),
        Just(up()),
        Just(FlightCommand::Land),
    ];
    prop_oneof![
        8 => any_told().prop_map(Input::Port),
        4 => command.prop_map(Input::FlightCommand),
        1 => Just(Input::GiveUp),
    ]
}

proptest! {
    // Sequences of 50 inputs on average. `PROPTEST_CASES` asks for more.
    #![proptest_config(ProptestConfig::with_cases(ProptestConfig::default().cases.max(2_500)))]

    /// Whatever it is given, no link lets a value above its stage out, and no value that the controller would not take.
    #[test]
    fn nothing_above_the_stage_leaves(
        inputs in prop::collection::vec((any_input(), 0_u64..200), 1..100),
        stage in any_stage(),
        grant in any_stage(),
        has_pilot: bool,
        hover_throttle in prop::option::of(0.0..1.0),
    ) {
        let receiver = if has_pilot { Receiver::Override } else { Receiver::Sole };
        let mut bench = Bench::new(staged(stage, receiver), hover_throttle.map(in_flight));
        let mut ceiling = Ceiling::Idle;
        let first = [granted(*b"S405", grant), fix(), status(ARM | OVERRIDE)];
        let first = first.map(|it| (Input::Port(it), 0));
        for (input, later_ms) in first.into_iter().chain(inputs) {
            if let Input::Port(PortEvent::Identified { identity, granted }) = &input {
                let is_simulation = identity.board.board.0 == *b"SITL";
                ceiling = Ceiling::of(stage, *granted, has_pilot, is_simulation);
            }
            bench.give(input);
            bench.now_ms += later_ms;
            bench.link.handle_timeout(at(bench.now_ms));
            bench.drain();
            if let Some(rc) = bench.rc {
                prop_assert!(ceiling.admits(rc), "{ceiling:?}: {rc:?}");
            }
        }
    }
}

/// The most that may leave, written apart from the gate.
#[derive(Debug)]
enum Ceiling {
    Idle,
    /// 10° of 60° of lean; 1.2 times the hover throttle of 0.3; no ARM.
    Tethered,
    /// No ARM.
    Piloted,
    Unlimited,
}

impl Ceiling {
    fn of(stage: Stage, granted: Stage, has_pilot: bool, is_simulation: bool) -> Self {
        match (stage, granted) {
            (Stage::Sim, _) if is_simulation => Self::Unlimited,
            (Stage::Flight, Stage::Flight) if has_pilot => Self::Piloted,
            (Stage::Tethered, Stage::Tethered | Stage::Flight)
            | (Stage::Flight, Stage::Tethered)
                if has_pilot =>
            {
                Self::Tethered
            }
            _ => Self::Idle,
        }
    }

    fn admits(&self, rc: SetRawRc) -> bool {
        let sticks = rc.sticks();
        let arm_is_low = rc.aux()[0] == Channel::LOW;
        match self {
            Self::Idle => sticks == Sticks::IDLE && rc.aux().iter().all(|it| *it == Channel::LOW),
            Self::Tethered => {
                let leans = [sticks.roll, sticks.pitch];
                let is_upright = leans.iter().all(|it| it.us().abs_diff(1_500) <= 83);
                arm_is_low && is_upright && sticks.throttle.us() <= 1_360
            }
            Self::Piloted => arm_is_low,
            Self::Unlimited => true,
        }
    }
}
