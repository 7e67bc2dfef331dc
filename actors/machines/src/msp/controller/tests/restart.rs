//! Restarts of the link, and a port that was closed or silent.

use super::*;

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
    let altitude = PortEvent::Telemetry(MspTelemetry::Altitude(Altitude::default()));
    armed.give(Input::Port(altitude));
    armed.pass(200, ARM);
    assert_eq!(armed.link.loops.target(), Some(Ned::HOME.at_altitude(10.0)));

    let mut disarmed = Bench::new(config(), Some(checkpoint));
    disarmed.give(Input::Port(identity(*b"SITL")));
    disarmed.give(Input::FlightCommand(FlightCommand::Arm));
    disarmed.pass(5_000, 0);
    assert!(!disarmed.is_arm_high() && disarmed.throttle() == 1_000);
}

#[test]
fn restarted_link_leaves_the_newest_sticks_to_the_port_until_it_gives_its_own() {
    let mut bench = Bench::new(config(), None);
    let given = SetRawRc::new(Sticks::IDLE, &[Channel::HIGH; 2]).unwrap();
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
fn an_order_to_land_right_after_a_restart_in_the_air_stops_no_motor() {
    let bench = Bench::flying(Receiver::Sole, ARM);
    let mut restarted = Bench::new(config(), bench.checkpoint);
    restarted.give(Input::FlightCommand(FlightCommand::Land));
    restarted.give(Input::Port(identity(*b"SITL")));
    restarted.give(Input::Port(status(ARM)));
    assert!(restarted.is_arm_high() && restarted.throttle() > 1_200);
    restarted.pass(300, ARM);
    assert!(restarted.is_arm_high() && restarted.link.loops.is_landing());
}

#[test]
fn a_landing_that_restarts_twice_in_the_air_closes_no_throttle() {
    let mut checkpoint = Bench::flying(Receiver::Sole, ARM).checkpoint;
    for restart in 0..3 {
        let mut restarted = Bench::new(config(), checkpoint);
        restarted.give(Input::FlightCommand(FlightCommand::Land));
        restarted.give(Input::Port(identity(*b"SITL")));
        restarted.give(Input::Port(status(ARM)));
        assert!(restarted.throttle() > 1_200, "restart {restart}");
        restarted.pass(300, ARM);
        checkpoint = restarted.checkpoint;
    }
}

#[test]
fn height_is_held_without_a_position() {
    let bench = Bench::flying(Receiver::Sole, ARM);
    let mut restarted = Bench::new(config(), bench.checkpoint);
    restarted.give(Input::Port(identity(*b"SITL")));
    restarted.give(Input::Port(status(ARM)));
    let altitude = PortEvent::Telemetry(MspTelemetry::Altitude(Altitude::default()));
    restarted.give(Input::Port(altitude));
    restarted.give(Input::Port(status(ARM)));
    let latest = restarted.telemetry.last().unwrap();
    assert!(latest.armed && latest.position_lost_for.is_some());
    let sticks = restarted.rc.unwrap().sticks();
    assert_eq!(
        (sticks.roll, sticks.pitch),
        (Channel::CENTRE, Channel::CENTRE)
    );
    assert!(restarted.link.loops.target().is_some(), "it climbs on");
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
    let ground_m = bench.link.loops.estimator.ground_m();
    let high = Altitude {
        altitude_cm: 30,
        ..Altitude::default()
    };
    bench.give(Input::Port(PortEvent::Telemetry(MspTelemetry::Altitude(
        high,
    ))));
    bench.give(Input::Port(PortEvent::Closed));
    bench.give(Input::FlightCommand(FlightCommand::Land));
    bench.wait(300);
    bench.give(Input::Port(identity(*b"SITL")));
    assert_eq!(bench.rc, None, "it asks first whether it is armed");
    bench.give(Input::Port(status(ARM)));
    assert!(bench.is_arm_high(), "the motors keep on turning");
    assert!(bench.link.loops.is_landing());
    assert_eq!(bench.link.loops.estimator.ground_m(), ground_m);
}

/// A pilot or the failsafe brought the aircraft down while its process did not run. Found by `muster chaos`: it took off again.
#[test]
fn an_aircraft_that_was_high_and_is_found_on_the_ground_gets_no_rc_until_it_has_disarmed() {
    for receiver in [Receiver::Sole, Receiver::Override] {
        let modes = match receiver {
            Receiver::Sole => ARM,
            Receiver::Override => ARM | OVERRIDE,
        };
        let mut checkpoint = Bench::flying(receiver, modes).checkpoint.unwrap();
        let flight = checkpoint.flight.as_mut().unwrap();
        assert!(!flight.is_high && flight.start.is_some());
        flight.is_high = true;
        let found_at = |altitude_cm| {
            let mut found = Bench::new(staged(Stage::Sim, receiver), Some(checkpoint));
            found.give(Input::Port(identity(*b"SITL")));
            found.give(Input::Port(status(modes)));
            found.give(Input::Port(PortEvent::Telemetry(MspTelemetry::Altitude(
                Altitude {
                    altitude_cm,
                    ..Altitude::default()
                },
            ))));
            found.give(Input::Port(status(modes)));
            found
        };
        assert!(found_at(500).rc.is_some(), "{receiver:?}: it flies on");
        let mut down = found_at(0);
        assert_eq!(down.rc, None, "{receiver:?}");
        let latest = *down.telemetry.last().unwrap();
        assert!(latest.armed && latest.landing, "{receiver:?}: {latest:?}");
        let mut again = Bench::new(staged(Stage::Sim, receiver), down.checkpoint);
        again.give(Input::Port(identity(*b"SITL")));
        again.give(Input::Port(status(modes)));
        assert_eq!(again.rc, None, "{receiver:?}: nor after the next restart");
        down.pass(300, 0);
        assert!(!down.telemetry.last().unwrap().armed, "{receiver:?}");
    }
}

/// Rounds in a hover at 10 m: by hand, then handed over. Returns the least throttle once it was handed over.
fn hand_over_in_a_hover(bench: &mut Bench) -> u16 {
    for _ in 0..10 {
        bench.rise(1_000, 0, ARM);
    }
    let rounds = (0..50).map(|_| {
        bench.rise(1_000, 0, ARM | OVERRIDE);
        bench.throttle()
    });
    rounds.skip(1).min().unwrap()
}

#[test]
fn vehicle_that_is_handed_over_after_a_restart_in_a_pilots_hover_stays_there() {
    let mut bench = Bench::ready(Receiver::Override);
    bench.rise_to_10_m(ARM);
    let config = staged(Stage::Sim, Receiver::Override);
    let mut restarted = Bench::new(config, bench.checkpoint);
    restarted.give(Input::Port(identity(*b"SITL")));
    let least = hand_over_in_a_hover(&mut restarted);
    assert!(least > 1_200, "{least}");
}

#[test]
fn vehicle_that_a_pilot_flew_while_nothing_was_heard_stays_where_it_is_handed_over() {
    for (closes, flew_before) in [(true, false), (false, false), (true, true), (false, true)] {
        let mut bench = Bench::ready(Receiver::Override);
        if flew_before {
            bench.pass(500, ARM);
        }
        bench.pass(1_000, 0);
        if closes {
            bench.give(Input::Port(PortEvent::Closed));
        }
        bench.wait(30_000);
        if closes {
            bench.give(Input::Port(identity(*b"SITL")));
        }
        let least = hand_over_in_a_hover(&mut bench);
        assert!(least > 1_200, "{closes} {flew_before}: {least}");
    }
}

#[test]
fn vehicle_that_stands_handed_over_when_its_link_restarts_turns_no_motor() {
    let mut bench = Bench::ready(Receiver::Override);
    bench.pass(500, ARM | OVERRIDE);
    let config = staged(Stage::Sim, Receiver::Override);
    let mut restarted = Bench::new(config, bench.checkpoint);
    restarted.give(Input::Port(identity(*b"SITL")));
    restarted.give(Input::Port(status(ARM | OVERRIDE)));
    for _ in 0..50 {
        assert_eq!(restarted.throttle(), 1_000);
        restarted.pass(10, ARM | OVERRIDE);
    }
}
