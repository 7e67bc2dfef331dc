use super::*;

const LANDING: Landing = Landing {
    descent_mps: 1.5,
    final_mps: 0.5,
    final_altitude_m: 10.0,
    acceleration_mps2: 1.0,
};

fn at(seconds: f64) -> Timestamp {
    Timestamp::from_secs_f64(seconds)
}

fn leg(north_m: f64, altitude_m: f64) -> Demand {
    Demand::Fly(Setpoint::Leg {
        to: Ned::new(north_m, 0.0, -altitude_m),
        speed_mps: 10.0,
        acceleration_mps2: 1.0,
    })
}

/// Armed, hovering 20 m over home.
fn hovering() -> Vehicle {
    let mut vehicle = Vehicle::new(LANDING, Ned::new(0.0, 0.0, -20.0));
    vehicle.obey(Timestamp::ZERO, Demand::Arm);
    vehicle
}

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-6
}

#[test]
fn a_long_leg_is_a_trapezoid_and_a_short_one_a_triangle() {
    for (length_m, seconds) in [(500.0, 60.0), (100.0, 20.0), (25.0, 10.0)] {
        let mut vehicle = hovering();
        assert!(vehicle.obey(at(5.0), leg(length_m, 20.0)));
        let end = vehicle.motion().end_time().unwrap();
        assert!(close((end - at(5.0)).as_secs_f64(), seconds));
        assert_eq!(vehicle.motion().end(), Ned::new(length_m, 0.0, -20.0));
        assert!(!vehicle.telemetry(at(5.1)).at_rest);
        assert!(vehicle.telemetry(end).at_rest);
    }
}

#[test]
fn a_leg_is_half_flown_at_half_its_time() {
    let mut vehicle = hovering();
    vehicle.obey(Timestamp::ZERO, leg(500.0, 20.0));
    assert!(close(vehicle.motion().position(at(30.0)).north_m(), 250.0));
    assert!(close(vehicle.motion().position(at(10.0)).north_m(), 50.0));
}

#[test]
fn a_new_leg_in_flight_begins_with_a_brake() {
    let mut vehicle = hovering();
    vehicle.obey(Timestamp::ZERO, leg(500.0, 20.0));
    let stop = vehicle.telemetry(at(30.0)).stop;
    assert!(close(stop.north_m(), 300.0), "10 m/s at 1 m/s² take 50 m");
    vehicle.obey(at(30.0), leg(200.0, 20.0));
    assert!(close(vehicle.motion().position(at(40.0)).north_m(), 300.0));
    assert_eq!(vehicle.motion().end(), Ned::new(200.0, 0.0, -20.0));
    let back = vehicle.motion().end_time().unwrap() - at(40.0);
    assert!(close(back.as_secs_f64(), 20.0));
}

#[test]
fn nothing_jumps_where_pieces_meet() {
    let mut vehicle = hovering();
    vehicle.obey(at(1.0), leg(300.0, 30.0));
    vehicle.obey(at(12.3), leg(-50.0, 20.0));
    vehicle.obey(at(17.0), Demand::Land);
    for pair in vehicle.motion().pieces().windows(2) {
        let before = pair[0].position(pair[0].end);
        let after = pair[1].position(pair[1].start);
        assert!((before - after).norm() < 1e-6, "{before} {after}");
    }
}

#[test]
fn a_landing_ends_disarmed_on_the_ground_and_is_not_called_off() {
    let mut vehicle = hovering();
    vehicle.obey(Timestamp::ZERO, Demand::Land);
    assert!(!vehicle.obey(at(3.0), leg(100.0, 20.0)));
    // 10 m at 1.5 m/s and 10 m at 0.5 m/s, with the ramps of both.
    let end = vehicle.motion().end_time().unwrap();
    assert!(close(
        end.as_secs_f64(),
        10.0 / 1.5 + 1.5 + 10.0 / 0.5 + 0.5
    ));
    vehicle.come_to_rest();
    assert!(!vehicle.is_armed());
    assert_eq!(vehicle.motion().end(), Ned::HOME);
}

#[test]
fn a_vehicle_that_is_not_armed_does_not_move_and_one_that_has_landed_does_not_arm_again() {
    let mut vehicle = Vehicle::new(LANDING, Ned::HOME);
    assert!(!vehicle.obey(Timestamp::ZERO, leg(0.0, 20.0)));
    assert!(!vehicle.obey(Timestamp::ZERO, Demand::Land));
    vehicle.obey(Timestamp::ZERO, Demand::Arm);
    assert!(vehicle.obey(Timestamp::ZERO, Demand::Land));
    vehicle.come_to_rest();
    vehicle.obey(at(9.0), Demand::Arm);
    assert!(!vehicle.is_armed());
}

#[test]
fn a_span_of_time_is_covered_without_gaps_rests_included() {
    let mut vehicle = hovering();
    vehicle.obey(at(2.0), leg(100.0, 20.0));
    vehicle.obey(at(40.0), leg(0.0, 20.0));
    for (from, to) in [
        (0.0, 100.0),
        (1.0, 3.0),
        (30.0, 41.0),
        (5.0, 6.0),
        (70.0, 80.0),
    ] {
        let pieces: Vec<_> = vehicle.motion().within(at(from)..at(to)).collect();
        assert_eq!(pieces[0].start, at(from));
        assert_eq!(pieces[pieces.len() - 1].end, at(to));
        for pair in pieces.windows(2) {
            assert_eq!(pair[0].end, pair[1].start);
        }
        for piece in pieces {
            let middle = piece.start + (piece.end - piece.start) / 2;
            let apart = piece.position(middle) - vehicle.motion().position(middle).0;
            assert!(apart.norm() < 1e-6);
        }
    }
}
