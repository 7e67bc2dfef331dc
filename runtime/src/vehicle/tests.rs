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

fn leg(north_m: f64, altitude_m: f64) -> FlightCommand {
    FlightCommand::Fly(Setpoint::Leg {
        to: Ned::new(north_m, 0.0, -altitude_m),
        speed_mps: 10.0,
        acceleration_mps2: 1.0,
    })
}

/// Armed, hovering 20 m over home.
fn hovering() -> Vehicle {
    let mut vehicle = Vehicle::new(LANDING, Ned::new(0.0, 0.0, -20.0));
    vehicle.obey(Timestamp::ZERO, FlightCommand::Arm);
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
fn a_vehicle_that_settles_hovers_at_the_end_of_its_leg_until_it_is_at_rest() {
    let mut vehicle = hovering();
    vehicle.obey(Timestamp::ZERO, leg(500.0, 20.0));
    vehicle.settle(Duration::from_millis(1_500));
    for hovers in [60.0, 60.7, 61.4] {
        let telemetry = vehicle.telemetry(at(hovers));
        assert!(!telemetry.at_rest, "{hovers}");
        assert_eq!(telemetry.position, Ned::new(500.0, 0.0, -20.0));
        assert_eq!(telemetry.velocity, Velocity::ZERO);
    }
    assert!(vehicle.telemetry(at(61.5)).at_rest);
}

#[test]
fn a_vehicle_that_settles_leaves_for_its_next_leg_and_to_land_at_once() {
    for (next, seconds) in [
        (leg(0.0, 20.0), 60.0),
        (FlightCommand::Land, 8.166_666_667 + 20.5),
    ] {
        let mut vehicle = hovering();
        vehicle.obey(Timestamp::ZERO, leg(500.0, 20.0));
        vehicle.settle(Duration::from_secs(30));
        vehicle.obey(at(61.0), next);
        let end = vehicle.motion().end_time().unwrap();
        assert!(close(end.as_secs_f64(), 61.0 + seconds), "{next:?}: {end}");
    }
}

#[test]
fn nothing_jumps_where_pieces_meet() {
    let mut vehicle = hovering();
    vehicle.obey(at(1.0), leg(300.0, 30.0));
    vehicle.settle(Duration::from_secs(2));
    vehicle.obey(at(12.3), leg(-50.0, 20.0));
    vehicle.obey(at(17.0), FlightCommand::Land);
    for pair in vehicle.motion().pieces().windows(2) {
        let before = pair[0].position(pair[0].end);
        let after = pair[1].position(pair[1].start);
        assert!((before - after).norm() < 1e-6, "{before} {after}");
    }
}

#[test]
fn a_landing_ends_disarmed_on_the_ground_and_is_not_called_off() {
    let mut vehicle = hovering();
    vehicle.obey(Timestamp::ZERO, FlightCommand::Land);
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
    assert!(!vehicle.obey(Timestamp::ZERO, FlightCommand::Land));
    vehicle.obey(Timestamp::ZERO, FlightCommand::Arm);
    assert!(vehicle.obey(Timestamp::ZERO, FlightCommand::Land));
    vehicle.come_to_rest();
    vehicle.obey(at(9.0), FlightCommand::Arm);
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

fn track(north_m: f64, north_mps: f64) -> FlightCommand {
    FlightCommand::Fly(Setpoint::Track {
        to: Ned::new(north_m, 0.0, -20.0),
        velocity: Velocity::new(north_mps, 0.0, 0.0),
        speed_mps: 12.0,
        acceleration_mps2: 2.0,
        hold: Duration::from_secs(60),
    })
}

#[test]
fn a_place_that_moves_is_caught_up_with_and_kept() {
    for behind_m in [-40.0, -3.0, 0.0, 0.5, 25.0] {
        let mut vehicle = hovering();
        assert!(vehicle.obey(at(5.0), track(behind_m, 10.0)));
        let place_m = |at_s: f64| behind_m + 10.0 * (at_s - 5.0);
        for at_s in [55.0, 60.0, 64.9] {
            let telemetry = vehicle.telemetry(at(at_s));
            assert!(
                close(telemetry.position.north_m(), place_m(at_s)),
                "{behind_m}: {} instead of {}",
                telemetry.position.north_m(),
                place_m(at_s)
            );
            assert!(close(telemetry.velocity.0.x, 10.0));
        }
    }
}

#[test]
fn a_place_as_fast_as_the_vehicle_is_kept_up_with_at_the_distance_that_it_has_then() {
    let mut vehicle = hovering();
    vehicle.obey(at(0.0), track(80.0, 12.0));
    let behind_m = |at_s: f64| {
        let telemetry = vehicle.telemetry(at(at_s));
        assert!(close(telemetry.velocity.0.x, 12.0));
        80.0 + 12.0 * at_s - telemetry.position.north_m()
    };
    // Six seconds to 12 m/s.
    assert!(close(behind_m(7.0), 80.0 + 36.0));
    assert!(close(behind_m(59.0), 80.0 + 36.0));
}

#[test]
fn a_vehicle_after_a_place_that_moves_keeps_to_its_limits() {
    let mut vehicle = hovering();
    let mut before: Option<Velocity> = None;
    vehicle.obey(at(0.0), track(80.0, 11.0));
    for tick in 0..800 {
        let velocity = vehicle.telemetry(at(f64::from(tick) / 10.0)).velocity;
        assert!(velocity.0.norm() <= 12.0 + 1e-6, "{velocity:?}");
        if let Some(before) = before {
            let change = (velocity.0 - before.0).norm();
            assert!(change <= 0.2 + 1e-6, "{change} in a tenth of a second");
        }
        before = Some(velocity);
    }
}

#[test]
fn a_vehicle_that_is_told_no_more_where_its_place_is_comes_to_rest() {
    let mut vehicle = hovering();
    vehicle.obey(at(0.0), track(0.0, 10.0));
    let end = vehicle.motion().end_time().unwrap();
    assert!(
        end > at(60.0) && end <= at(65.001),
        "60 s and braking: {end}"
    );
    assert!(vehicle.telemetry(end).at_rest);
}

#[test]
fn sticks_are_obeyed_until_they_are_moved_again() {
    let mut vehicle = hovering();
    assert!(vehicle.steer(at(1.0), Velocity::new(8.0, 0.0, 0.0), 2.0));
    let telemetry = vehicle.telemetry(at(100.0));
    assert!(close(telemetry.velocity.0.x, 8.0));
    assert!(close(telemetry.position.north_m(), 16.0 + 8.0 * 95.0));
    vehicle.steer(at(100.0), Velocity::ZERO, 2.0);
    assert!(vehicle.telemetry(at(104.1)).at_rest);
    vehicle.obey(at(105.0), FlightCommand::Land);
    assert!(!vehicle.steer(at(106.0), Velocity::new(8.0, 0.0, 0.0), 2.0));
}

#[test]
fn pieces_of_a_tracked_motion_meet() {
    let mut vehicle = hovering();
    for tick in 0..50 {
        let now = f64::from(tick) * 0.2;
        vehicle.obey(at(now), track(10.0 * now + 1.0, 10.0));
    }
    for pair in vehicle.motion().pieces().windows(2) {
        let gap = pair[0].position(pair[0].end) - pair[1].position(pair[1].start);
        assert!(gap.norm() < 1e-6, "{gap:?}");
        assert_eq!(pair[0].end, pair[1].start);
    }
}

fn hold(altitude_m: f64) -> FlightCommand {
    FlightCommand::Fly(Setpoint::Hold {
        altitude_m,
        vertical_mps: 1.5,
        acceleration_mps2: 1.0,
    })
}

#[test]
fn a_vehicle_that_holds_brakes_over_ground_and_climbs_or_descends_meanwhile() {
    for altitude_m in [25.5, 20.0, 12.0] {
        let mut vehicle = hovering();
        vehicle.obey(Timestamp::ZERO, leg(500.0, 20.0));
        assert!(vehicle.obey(at(30.0), hold(altitude_m)));
        // At 10 m/s it takes 10 s and 50 m to brake.
        let after = |seconds: f64| vehicle.motion().position(at(30.0 + seconds));
        assert!(close(after(5.0).north_m(), 250.0 + 37.5));
        let end = vehicle.motion().end();
        assert!(close(end.north_m(), 300.0), "{end:?}");
        assert!(close(end.altitude_m(), altitude_m));
        assert!(vehicle.motion().is_at_rest(at(40.1)));
        // 1.5 s to 1.5 m/s are 1.1 m; the rest takes its time at 1.5 m/s.
        let climbed = after(3.5).altitude_m() - 20.0;
        let towards = (altitude_m - 20.0).clamp(-1.0, 1.0);
        assert!(close(climbed, towards * (1.125 + 3.0)), "{climbed}");
    }
}

#[test]
fn a_vehicle_that_holds_while_it_climbs_overshoots_and_comes_back() {
    let mut vehicle = hovering();
    vehicle.obey(Timestamp::ZERO, leg(0.0, 60.0));
    let climbing = vehicle.motion().position(at(5.0)).altitude_m();
    vehicle.obey(at(5.0), hold(climbing));
    let highest = vehicle.motion().position(at(10.0)).altitude_m();
    assert!(highest > climbing + 10.0, "5 m/s take 12.5 m to stop");
    assert!(close(vehicle.motion().end().altitude_m(), climbing));
}

#[test]
fn a_vehicle_that_holds_ignores_its_pilot_until_it_is_given_back() {
    let mut vehicle = hovering();
    let north = Velocity::new(5.0, 0.0, 0.0);
    assert!(vehicle.steer(at(1.0), north, 1.0));
    vehicle.obey(at(2.0), hold(20.0));
    assert!(!vehicle.steer(at(3.0), north, 1.0));
    vehicle.obey(at(4.0), FlightCommand::Yield);
    assert!(vehicle.steer(at(5.0), north, 1.0));
}

#[test]
fn a_vehicle_that_lost_its_position_tells_where_it_was_then_and_for_how_long() {
    let mut vehicle = hovering();
    vehicle.obey(Timestamp::ZERO, leg(500.0, 30.0));
    vehicle.lose_position(at(10.0), at(25.0));
    vehicle.lose_position(at(12.0), at(15.0));
    vehicle.find_position(at(15.0));
    let told = vehicle.telemetry(at(20.0));
    let then = vehicle.motion().position(at(10.0));
    assert_eq!(told.position_lost_for, Some(Duration::from_secs(10)));
    assert!(close(told.position.north_m(), then.north_m()));
    assert!(
        told.position.altitude_m() > then.altitude_m(),
        "its height it knows"
    );
    vehicle.find_position(at(25.0));
    let told = vehicle.telemetry(at(20.0));
    assert_eq!(told.position_lost_for, None);
    assert_eq!(told.position, vehicle.motion().position(at(20.0)));
}
