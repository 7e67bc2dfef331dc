//! What each stage lets fly.

use super::*;

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
    let target = bench.link.loops.target();
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
    let target = |bench: &Bench| bench.link.loops.target().unwrap();
    bench.give(Input::FlightCommand(far));
    assert!(target(&bench).distance_m(edge) < 1e-9);

    // The vehicle has moved when the link restarts: its tether has not.
    let config = staged(Stage::Tethered, Receiver::Override);
    let mut restarted = Bench::new(config, bench.checkpoint);
    restarted.give(Input::Port(granted(*b"S405", Stage::Tethered)));
    restarted.give(Input::Port(status(ARM | OVERRIDE)));
    let mut moved = fix();
    if let PortEvent::Telemetry(MspTelemetry::Gps(gps)) = &mut moved {
        gps.latitude_e7 += 270;
    }
    restarted.give(Input::Port(moved));
    let altitude = PortEvent::Telemetry(MspTelemetry::Altitude(Altitude::default()));
    restarted.give(Input::Port(altitude));
    restarted.give(Input::Port(status(ARM | OVERRIDE)));
    restarted.give(Input::FlightCommand(far));
    assert!(target(&restarted).distance_m(edge) < 1e-9);
}

#[test]
fn vehicle_commanded_to_fly_before_its_position_is_known_is_tethered_where_it_is_found() {
    let config = staged(Stage::Tethered, Receiver::Override);
    let mut bench = Bench::new(config, None);
    bench.give(Input::Port(granted(*b"S405", Stage::Tethered)));
    bench.give(Input::Port(status(0)));
    let pass = |bench: &mut Bench, gps: Option<PortEvent>| {
        for _ in 0..10 {
            bench.wait(100);
            let altitude = PortEvent::Telemetry(MspTelemetry::Altitude(Altitude::default()));
            let status = status(ARM | OVERRIDE);
            for event in gps.iter().cloned().chain([altitude, status]) {
                bench.give(Input::Port(event));
            }
        }
    };
    pass(&mut bench, None);
    bench.give(Input::FlightCommand(up()));
    pass(&mut bench, None);
    assert_eq!(bench.link.loops.start(), None);
    let mut found = fix();
    if let PortEvent::Telemetry(MspTelemetry::Gps(gps)) = &mut found {
        gps.latitude_e7 += 4_500;
    }
    pass(&mut bench, Some(found));
    let start = bench.link.loops.start().unwrap();
    assert!((start.north_m() - 50.0).abs() < 1.0, "{start:?}");
    let target = bench.link.loops.target().unwrap();
    assert!(target.distance_m(start) < TETHER_RADIUS_MAX_M + TETHER_HEIGHT_MAX_M);
}
