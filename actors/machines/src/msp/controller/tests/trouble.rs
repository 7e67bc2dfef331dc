//! Pilots, failsafes, and aircraft that do not do what they are told.

use muster_msp::Attitude;

use super::*;
use crate::msp::controller::control::Control;

#[test]
fn pilot_who_takes_over_is_not_fought() {
    let mut bench = Bench::flying(Receiver::Override, ARM | OVERRIDE);
    assert!(bench.throttle() > 1_200);
    for altitude_cm in 0..200 {
        bench.rise(altitude_cm, 50, ARM | OVERRIDE);
    }
    bench.give(Input::Port(status(ARM)));
    assert!(!bench.telemetry.last().unwrap().landing, "once is noise");
    bench.give(Input::Port(status(ARM)));
    assert!(bench.telemetry.last().unwrap().landing);
    // Sticks that are given back by mistake neither lean nor stop the motors.
    for _ in 0..50 {
        bench.rise(200, 0, ARM | OVERRIDE);
    }
    let sticks = bench.rc.unwrap().sticks();
    assert_eq!(
        (sticks.roll, sticks.pitch),
        (Channel::CENTRE, Channel::CENTRE)
    );
    assert!((1_250..1_350).contains(&sticks.throttle.us()), "it hovers");
    assert!(bench.telemetry.last().unwrap().landing);
}

#[test]
fn sticks_that_are_given_back_on_the_ground_turn_no_motor() {
    for between in [ARM, 0] {
        let mut bench = Bench::ready(Receiver::Override);
        bench.pass(300, ARM | OVERRIDE);
        bench.pass(300, ARM);
        bench.pass(300, between);
        bench.pass(300, ARM | OVERRIDE);
        assert_eq!(bench.throttle(), 1_000, "{between}");
    }
}

#[test]
fn sticks_that_are_taken_on_the_ground_and_given_back_in_the_air_hover() {
    let mut bench = Bench::ready(Receiver::Override);
    bench.pass(300, ARM | OVERRIDE);
    bench.rise_to_10_m(ARM);
    for _ in 0..50 {
        bench.rise(1_000, 0, ARM | OVERRIDE);
    }
    assert!((1_250..1_350).contains(&bench.throttle()));
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
fn link_that_was_given_up_lands_and_takes_no_commands() {
    let mut bench = Bench::flying(Receiver::Sole, ARM);
    bench.give(Input::GiveUp);
    bench.give(Input::FlightCommand(up()));
    bench.pass(20, ARM);
    assert!(bench.link.loops.is_landing());
    assert!(bench.checkpoint.unwrap().gave_up);
}

fn rolled(deg: i16) -> Input {
    Input::Port(PortEvent::Telemetry(MspTelemetry::Attitude(Attitude {
        roll_ddeg: deg * 10,
        pitch_ddeg: 0,
        yaw_deg: 0,
    })))
}

fn tip(bench: &mut Bench, deg: i16) {
    for _ in 0..2 {
        bench.give(rolled(deg));
    }
}

#[test]
fn a_vehicle_that_tips_over_is_righted_and_lands_and_one_that_lies_stops_its_motors() {
    let mut bench = Bench::flying(Receiver::Sole, ARM);
    tip(&mut bench, 80);
    bench.pass(200, ARM);
    assert!(
        !bench.telemetry.last().unwrap().landing,
        "not for long enough"
    );
    bench.pass(200, ARM);
    let last = *bench.telemetry.last().unwrap();
    assert!(last.landing && last.landing_cause == Some(LandingCause::Tilt));
    let upright = Control::new(Gains::QUADCOPTER).upright();
    assert_eq!(bench.rc.unwrap().sticks(), upright);
    let restarted = Bench::new(config(), bench.checkpoint);
    assert_eq!(restarted.link.loops.impaired(), Some(LandingCause::Tilt));
    tip(&mut bench, 0);
    bench.pass(100, ARM);
    assert!(bench.is_arm_high() && bench.throttle() > 1_200);
    assert!(bench.link.loops.is_landing(), "it is not taken back");
    tip(&mut bench, 80);
    bench.pass(2_100, ARM);
    assert!(!bench.is_arm_high());
}

#[test]
fn a_vehicle_too_heavy_to_leave_the_ground_lands_there() {
    let mut bench = Bench::flying(Receiver::Sole, ARM);
    bench.pass(12_000, ARM);
    let last = *bench.telemetry.last().unwrap();
    assert_eq!(last.landing_cause, Some(LandingCause::Thrust));
    assert!(!bench.is_arm_high());
}

#[test]
fn sticks_are_idle_once_the_motors_are_to_stop_and_a_pilot_has_the_arm_switch() {
    let mut tipped = Bench::piloted(Stage::Flight, Stage::Flight);
    tip(&mut tipped, 80);
    tipped.pass(2_600, ARM | OVERRIDE);
    assert_eq!(tipped.rc.unwrap().sticks(), Sticks::IDLE);
    let mut landed = Bench::piloted(Stage::Flight, Stage::Flight);
    landed.give(Input::FlightCommand(FlightCommand::Land));
    landed.pass(20_000, ARM | OVERRIDE);
    assert_eq!(landed.rc.unwrap().sticks(), Sticks::IDLE);
    // Sticks that are taken and given back there turn no motor.
    landed.pass(300, ARM);
    landed.pass(300, ARM | OVERRIDE);
    assert_eq!(landed.rc.unwrap().sticks(), Sticks::IDLE);
}

#[test]
fn vehicle_that_a_pilot_flies_after_its_landing_is_not_dropped_when_it_is_handed_over() {
    let mut bench = Bench::piloted(Stage::Flight, Stage::Flight);
    bench.give(Input::FlightCommand(FlightCommand::Land));
    bench.pass(20_000, ARM | OVERRIDE);
    assert_eq!(bench.throttle(), 1_000);
    bench.pass(500, 0);
    for altitude_cm in 0..1_000 {
        bench.rise(altitude_cm, 50, ARM);
    }
    for _ in 0..200 {
        bench.rise(1_000, 0, ARM);
    }
    for _ in 0..50 {
        bench.rise(1_000, 0, ARM | OVERRIDE);
        assert!(bench.throttle() > 1_080, "{:?}", bench.rc);
    }
}
