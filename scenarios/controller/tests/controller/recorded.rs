//! The model beside a recording of the real firmware: Betaflight 4.6's simulation build in the loop with the rigid body of
//! `tests/betaflight/physics.py`, whose parameters are set here.

use muster_controller::{Airframe, Config, Contact, Motor, Pack, Settings};
use nalgebra::Vector3;

use crate::companion::{Companion, Rc, exact};

const RECORDED: &str = include_str!(concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../tests/betaflight/data/step-response.csv"
));

/// The body of the recording: thrust is 8 N times the square of a lagged duty cycle, whatever the voltage.
fn body() -> Airframe {
    let full_speed_rad_s = 1_000.0;
    let full_v = 16.8;
    Airframe {
        mass_kg: 0.65,
        inertia_kgm2: Vector3::new(0.0035, 0.0035, 0.006),
        rotor_forward_m: 0.08,
        rotor_right_m: 0.08,
        // 0.25 N/(m/s) in all directions at hover, where the four speeds sum up to 1,785 rad/s.
        rotor_drag: Vector3::repeat(0.25 / 1_785.0),
        frame_drag: Vector3::zeros(),
        motor: Motor {
            thrust_coefficient: 8.0 / (full_speed_rad_s * full_speed_rad_s),
            torque_ratio_m: 0.012,
            // The square term is a millionth: speed is in proportion to the duty cycle.
            speed_constant: full_speed_rad_s / full_v * 1.000_001,
            full_speed_rad_s,
            full_v,
            lag_s: 0.02,
        },
        battery: Pack {
            cells: 4,
            capacity_mah: 1e9,
            charge: 1.0,
            resistance_ohm: 0.0,
            electronics_a: 0.0,
        },
    }
}

struct Row {
    ms: u64,
    phase: String,
    rc: Rc,
    /// Roll, pitch nose up, heading.
    angles_deg: [f64; 3],
}

fn rows() -> Vec<Row> {
    let of = |line: &str| {
        let cells: Vec<_> = line.split(',').collect();
        let number = |column: usize| cells[column].parse::<f64>().unwrap();
        let stick = |column: usize| cells[column].parse::<u16>().unwrap();
        Row {
            ms: (number(0) * 1_000.0).round() as u64,
            phase: cells[1].into(),
            rc: Rc {
                roll: stick(2),
                pitch: stick(3),
                throttle: stick(4),
                yaw: stick(5),
                ..Rc::ARM
            },
            angles_deg: [number(12), number(13), number(14)],
        }
    };
    RECORDED.lines().skip(1).map(of).collect()
}

/// The largest differences in angles in a phase, in degrees, when the model gets the recorded sticks.
fn differences_deg(phases: &[&str]) -> [f64; 3] {
    let config = Config {
        airframe: body(),
        ..exact(Settings::sole())
    };
    let mut companion = Companion::armed(config);
    let mut differences = [0.0_f64; 3];
    for row in rows() {
        companion.rc = Some(row.rc);
        companion.run_ms(20);
        let truth = companion.truth();
        let (roll, pitch, heading) = truth.attitude.euler_angles();
        if phases.contains(&row.phase.as_str()) {
            assert_eq!(truth.contact, Contact::Airborne, "at {} ms", row.ms);
            for (axis, angle) in [roll, pitch, heading].into_iter().enumerate() {
                let difference = (angle.to_degrees() - row.angles_deg[axis]).abs();
                differences[axis] = differences[axis].max(difference);
            }
        }
    }
    differences
}

#[test]
fn steps_of_roll_and_pitch_are_the_firmwares_within_a_fifth() {
    let [roll, _, _] = differences_deg(&["roll 10", "roll 0"]);
    assert!(roll < 2.0, "{roll}° of 10°");
    let [_, pitch, _] = differences_deg(&["pitch 10", "pitch 0"]);
    assert!(pitch < 2.0, "{pitch}° of 10°");
}

#[test]
fn step_of_yaw_is_the_firmwares_within_a_tenth() {
    let [_, _, heading] = differences_deg(&["yaw", "yaw 0"]);
    assert!(heading < 3.8, "{heading}° of 38°");
}
