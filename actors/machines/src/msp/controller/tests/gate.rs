//! Nothing above the stage leaves.

use std::time::Duration;

use muster_msp::{Attitude, BatteryState};
use proptest::prelude::*;

use super::*;

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
            from: Some(Ned::HOME),
            start: Some(Ned::HOME),
            is_high: false,
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

fn any_telemetry() -> impl Strategy<Value = PortEvent> {
    let board = prop_oneof![Just(*b"SITL"), Just(*b"S405"), any::<[u8; 4]>()];
    let identity = (board, any_stage()).prop_map(|(board, stage)| granted(board, stage));
    let flags = (any::<u32>(), any::<u8>(), any::<u32>()).prop_map(|(modes, count, bits)| {
        MspTelemetry::Status(Status {
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
            MspTelemetry::Gps(RawGps {
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
        MspTelemetry::Attitude(Attitude {
            roll_ddeg,
            pitch_ddeg,
            yaw_deg,
        })
    });
    let altitude = (any::<i32>(), any::<i16>()).prop_map(|(altitude_cm, climb_cmps)| {
        MspTelemetry::Altitude(Altitude {
            altitude_cm,
            climb_cmps,
        })
    });
    let motors = any::<[u16; 8]>()
        .prop_map(|outputs_us| MspTelemetry::Motor(muster_msp::Motor { outputs_us }));
    let battery = (any::<u8>(), any::<u16>(), any::<i16>()).prop_map(|(cells, cv, current_ca)| {
        MspTelemetry::Battery(BatteryState {
            cells,
            current_ca,
            voltage_cv: Some(cv),
            ..BatteryState::default()
        })
    });
    let telemetry =
        prop_oneof![flags, gps, attitude, altitude, motors, battery].prop_map(PortEvent::Telemetry);
    let pose = (any_place(), 0_u64..1_000).prop_map(|(position, age_ms)| {
        PortEvent::Pose(Pose {
            position,
            sigma_m: 0.1,
            age: Duration::from_millis(age_ms),
        })
    });
    let counted =
        (0_u32..=100).prop_map(|count| PortEvent::Telemetry(MspTelemetry::Acknowledged(count)));
    prop_oneof![
        1 => identity,
        1 => Just(PortEvent::Closed),
        1 => Just(status(0)),
        1 => Just(status(ARM)),
        4 => Just(status(ARM | OVERRIDE)),
        4 => Just(fix()),
        4 => Just(PortEvent::Telemetry(MspTelemetry::Altitude(Altitude::default()))),
        2 => pose,
        1 => counted,
        1 => Just(PortEvent::Telemetry(MspTelemetry::Late)),
        6 => telemetry,
    ]
}

/// Near home, or far from it.
fn any_place() -> impl Strategy<Value = Ned> {
    prop_oneof![
        [-5.0..5.0, -5.0..5.0, -20.0..0.0],
        [-500.0..500.0, -500.0..500.0, -100.0..0.0],
    ]
    .prop_map(|[north, east, down]| Ned::new(north, east, down))
}

fn any_setpoint() -> impl Strategy<Value = Setpoint> {
    let leg = (any_place(), 0.1..20.0, 0.1..8.0).prop_map(|(to, speed_mps, acceleration_mps2)| {
        Setpoint::Leg {
            to,
            speed_mps,
            acceleration_mps2,
        }
    });
    let hold = (-10.0..100.0, 0.1..5.0).prop_map(|(altitude_m, vertical_mps)| Setpoint::Hold {
        altitude_m,
        vertical_mps,
        acceleration_mps2: 2.0,
    });
    prop_oneof![leg, hold]
}

fn any_input() -> impl Strategy<Value = Input> {
    let command = prop_oneof![
        Just(FlightCommand::Report),
        Just(FlightCommand::Arm),
        Just(FlightCommand::Yield),
        any_setpoint().prop_map(FlightCommand::Fly),
        Just(FlightCommand::Land),
    ];
    prop_oneof![
        8 => any_telemetry().prop_map(Input::Port),
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
            bench.sent.clear();
            bench.give(input);
            bench.wait(later_ms);
            for rc in &bench.sent {
                prop_assert!(ceiling.admits(*rc), "{ceiling:?}: {rc:?}");
            }
        }
    }
}

#[test]
fn tethered_vehicle_that_is_far_off_leans_and_climbs_as_much_as_its_stage_allows() {
    let mut bench = Bench::piloted(Stage::Tethered, Stage::Tethered);
    bench.give(Input::FlightCommand(FlightCommand::Fly(Setpoint::Leg {
        to: Ned::new(300.0, 0.0, -50.0),
        speed_mps: 20.0,
        acceleration_mps2: 8.0,
    })));
    // It rises a metre, and is held fast there.
    for step in 0..100 {
        let altitude_m = (0.05 * f64::from(step)).min(1.0);
        bench.give(Input::Port(PortEvent::Pose(Pose {
            position: Ned::HOME.at_altitude(altitude_m),
            sigma_m: 0.1,
            age: Duration::ZERO,
        })));
        bench.wait(100);
        bench.give(Input::Port(status(ARM | OVERRIDE)));
    }
    let most = |of: fn(&SetRawRc) -> u16| bench.sent.iter().map(of).max().unwrap();
    let pitch_us = most(|it| it.sticks().pitch.us().abs_diff(1_500));
    let roll_us = most(|it| it.sticks().roll.us().abs_diff(1_500));
    assert_eq!(pitch_us.max(roll_us), TETHERED_LEAN_US);
    let throttle_us = most(|it| it.sticks().throttle.us());
    assert!(
        (1_350..=TETHERED_THROTTLE_US).contains(&throttle_us),
        "{throttle_us}"
    );
}

/// 10° of lean by Betaflight's rates.
const TETHERED_LEAN_US: u16 = 188;
/// 1.2 times the hover throttle of 0.3.
const TETHERED_THROTTLE_US: u16 = 1_360;

/// The most that may leave, written apart from the gate.
#[derive(Debug)]
enum Ceiling {
    Idle,
    /// Little lean, little throttle; no ARM.
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
                let is_upright = leans
                    .iter()
                    .all(|it| it.us().abs_diff(1_500) <= TETHERED_LEAN_US);
                arm_is_low && is_upright && sticks.throttle.us() <= TETHERED_THROTTLE_US
            }
            Self::Piloted => arm_is_low,
            Self::Unlimited => true,
        }
    }
}
