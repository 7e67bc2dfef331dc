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

/// An armed vehicle that hovers 20 m above home.
fn hovering() -> Vehicle {
    let mut vehicle = Vehicle::new(LANDING, Ned::new(0.0, 0.0, -20.0));
    vehicle.execute(Timestamp::ZERO, FlightCommand::Arm);
    vehicle
}

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-6
}

#[test]
fn speed_profile_is_a_trapezoid_on_long_legs_and_a_triangle_on_short_ones() {
    for (length_m, seconds) in [(500.0, 60.0), (100.0, 20.0), (25.0, 10.0)] {
        let mut vehicle = hovering();
        assert!(vehicle.execute(at(5.0), leg(length_m, 20.0)));
        let end = vehicle.motion().end_time().unwrap();
        assert!(close((end - at(5.0)).as_secs_f64(), seconds));
        assert_eq!(vehicle.motion().end(), Ned::new(length_m, 0.0, -20.0));
        assert!(!vehicle.telemetry(at(5.1)).at_rest);
        assert!(vehicle.telemetry(end).at_rest);
    }
}

#[test]
fn leg_is_half_flown_at_half_its_time() {
    let mut vehicle = hovering();
    vehicle.execute(Timestamp::ZERO, leg(500.0, 20.0));
    assert!(close(vehicle.motion().position(at(30.0)).north_m(), 250.0));
    assert!(close(vehicle.motion().position(at(10.0)).north_m(), 50.0));
}

#[test]
fn new_leg_in_flight_begins_with_braking() {
    let mut vehicle = hovering();
    vehicle.execute(Timestamp::ZERO, leg(500.0, 20.0));
    let stop = vehicle.telemetry(at(30.0)).stop;
    assert!(close(stop.north_m(), 300.0), "10 m/s at 1 m/s² take 50 m");
    vehicle.execute(at(30.0), leg(200.0, 20.0));
    assert!(close(vehicle.motion().position(at(40.0)).north_m(), 300.0));
    assert_eq!(vehicle.motion().end(), Ned::new(200.0, 0.0, -20.0));
    let back = vehicle.motion().end_time().unwrap() - at(40.0);
    assert!(close(back.as_secs_f64(), 20.0));
}

#[test]
fn settling_vehicle_hovers_at_the_leg_end_until_at_rest() {
    let mut vehicle = hovering();
    vehicle.execute(Timestamp::ZERO, leg(500.0, 20.0));
    vehicle.settle(Duration::from_millis(1_500));
    for at_s in [60.0, 60.7, 61.4] {
        let telemetry = vehicle.telemetry(at(at_s));
        assert!(!telemetry.at_rest, "{at_s}");
        assert_eq!(telemetry.position, Ned::new(500.0, 0.0, -20.0));
        assert_eq!(telemetry.velocity, Velocity::ZERO);
    }
    assert!(vehicle.telemetry(at(61.5)).at_rest);
}

#[test]
fn settling_vehicle_starts_its_next_leg_or_landing_at_once() {
    for (next, seconds) in [
        (leg(0.0, 20.0), 60.0),
        (FlightCommand::Land, 8.166_666_667 + 20.5),
    ] {
        let mut vehicle = hovering();
        vehicle.execute(Timestamp::ZERO, leg(500.0, 20.0));
        vehicle.settle(Duration::from_secs(30));
        vehicle.execute(at(61.0), next);
        let end = vehicle.motion().end_time().unwrap();
        assert!(close(end.as_secs_f64(), 61.0 + seconds), "{next:?}: {end}");
    }
}

#[test]
fn position_is_continuous_between_pieces() {
    let mut vehicle = hovering();
    vehicle.execute(at(1.0), leg(300.0, 30.0));
    vehicle.settle(Duration::from_secs(2));
    vehicle.execute(at(12.3), leg(-50.0, 20.0));
    vehicle.execute(at(17.0), FlightCommand::Land);
    for pair in vehicle.motion().pieces().windows(2) {
        let before = pair[0].position(pair[0].end);
        let after = pair[1].position(pair[1].start);
        assert!((before - after).norm() < 1e-6, "{before} {after}");
    }
}

#[test]
fn landing_ends_disarmed_on_the_ground_and_cannot_be_aborted() {
    let mut vehicle = hovering();
    vehicle.execute(Timestamp::ZERO, FlightCommand::Land);
    assert!(!vehicle.execute(at(3.0), leg(100.0, 20.0)));
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
fn disarmed_vehicle_stays_and_landed_vehicle_does_not_rearm() {
    let mut vehicle = Vehicle::new(LANDING, Ned::HOME);
    assert!(!vehicle.execute(Timestamp::ZERO, leg(0.0, 20.0)));
    assert!(!vehicle.execute(Timestamp::ZERO, FlightCommand::Land));
    vehicle.execute(Timestamp::ZERO, FlightCommand::Arm);
    assert!(vehicle.execute(Timestamp::ZERO, FlightCommand::Land));
    vehicle.come_to_rest();
    vehicle.execute(at(9.0), FlightCommand::Arm);
    assert!(!vehicle.is_armed());
}

#[test]
fn pieces_within_a_span_cover_it_without_gaps() {
    let mut vehicle = hovering();
    vehicle.execute(at(2.0), leg(100.0, 20.0));
    vehicle.execute(at(40.0), leg(0.0, 20.0));
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
fn moving_target_is_reached_and_kept() {
    for behind_m in [-40.0, -3.0, 0.0, 0.5, 25.0] {
        let mut vehicle = hovering();
        assert!(vehicle.execute(at(5.0), track(behind_m, 10.0)));
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
fn target_at_full_speed_is_followed_at_a_constant_distance() {
    let mut vehicle = hovering();
    vehicle.execute(at(0.0), track(80.0, 12.0));
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
fn tracking_vehicle_keeps_its_limits() {
    let mut vehicle = hovering();
    let mut before: Option<Velocity> = None;
    vehicle.execute(at(0.0), track(80.0, 11.0));
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
fn tracking_vehicle_without_new_setpoints_comes_to_rest() {
    let mut vehicle = hovering();
    vehicle.execute(at(0.0), track(0.0, 10.0));
    let end = vehicle.motion().end_time().unwrap();
    assert!(
        end > at(60.0) && end <= at(65.001),
        "60 s and braking: {end}"
    );
    assert!(vehicle.telemetry(end).at_rest);
}

#[test]
fn stick_input_holds_until_the_next_input() {
    let mut vehicle = hovering();
    assert!(vehicle.steer(at(1.0), Velocity::new(8.0, 0.0, 0.0), 2.0));
    let telemetry = vehicle.telemetry(at(100.0));
    assert!(close(telemetry.velocity.0.x, 8.0));
    assert!(close(telemetry.position.north_m(), 16.0 + 8.0 * 95.0));
    vehicle.steer(at(100.0), Velocity::ZERO, 2.0);
    assert!(vehicle.telemetry(at(104.1)).at_rest);
    vehicle.execute(at(105.0), FlightCommand::Land);
    assert!(!vehicle.steer(at(106.0), Velocity::new(8.0, 0.0, 0.0), 2.0));
}

#[test]
fn position_is_continuous_between_pieces_while_tracking() {
    let mut vehicle = hovering();
    for tick in 0..50 {
        let now = f64::from(tick) * 0.2;
        vehicle.execute(at(now), track(10.0 * now + 1.0, 10.0));
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
fn holding_vehicle_brakes_while_it_changes_altitude() {
    for altitude_m in [25.5, 20.0, 12.0] {
        let mut vehicle = hovering();
        vehicle.execute(Timestamp::ZERO, leg(500.0, 20.0));
        assert!(vehicle.execute(at(30.0), hold(altitude_m)));
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
fn holding_vehicle_overshoots_while_climbing_and_returns() {
    let mut vehicle = hovering();
    vehicle.execute(Timestamp::ZERO, leg(0.0, 60.0));
    let climbing = vehicle.motion().position(at(5.0)).altitude_m();
    vehicle.execute(at(5.0), hold(climbing));
    let highest = vehicle.motion().position(at(10.0)).altitude_m();
    assert!(highest > climbing + 10.0, "5 m/s take 12.5 m to stop");
    assert!(close(vehicle.motion().end().altitude_m(), climbing));
}

#[test]
fn holding_vehicle_ignores_its_pilot_until_yield() {
    let mut vehicle = hovering();
    let north = Velocity::new(5.0, 0.0, 0.0);
    assert!(vehicle.steer(at(1.0), north, 1.0));
    vehicle.execute(at(2.0), hold(20.0));
    assert!(!vehicle.steer(at(3.0), north, 1.0));
    vehicle.execute(at(4.0), FlightCommand::Yield);
    assert!(vehicle.steer(at(5.0), north, 1.0));
}

#[test]
fn telemetry_without_position_goes_on_by_dead_reckoning_and_has_its_age() {
    let mut vehicle = hovering();
    vehicle.execute(Timestamp::ZERO, leg(500.0, 30.0));
    vehicle.lose_position(at(10.0), at(25.0));
    vehicle.lose_position(at(12.0), at(15.0));
    vehicle.recover_position(at(15.0));
    let telemetry = vehicle.telemetry(at(20.0));
    assert_eq!(telemetry.position_lost_for, Some(Duration::from_secs(10)));
    assert_eq!(telemetry.position, vehicle.motion().position(at(20.0)));
    vehicle.recover_position(at(25.0));
    let telemetry = vehicle.telemetry(at(20.0));
    assert_eq!(telemetry.position_lost_for, None);
    assert_eq!(telemetry.position, vehicle.motion().position(at(20.0)));
}
