mod failsafe;
mod traffic;

use std::time::Duration;

use super::*;
use crate::geometry::Velocity;
use crate::machine::{Emitted, Stimulus, step};
use crate::msp::{LandingCause, Setpoint};

const CONFIG: Config = Config {
    speed_mps: 10.0,
    climb_mps: 2.5,
    descent_mps: 1.5,
    acceleration_mps2: 1.0,
    failsafe: FAILSAFE,
    avoid: None,
};

const FAILSAFE: Failsafe = Failsafe {
    position_hold: Duration::from_secs(30),
    battery_low: 0.15,
    battery_critical: 0.07,
    fence: None,
};

const ON_THE_GROUND: Telemetry = Telemetry {
    position: Ned::HOME,
    velocity: Velocity::ZERO,
    stop: Ned::HOME,
    at_rest: true,
    armed: false,
    landing: false,
    landing_cause: None,
    target: None,
    position_lost_for: None,
    charge: 1.0,
};

/// Flies straight to `to`; the hold altitude is 5 m higher.
fn fly_to(to: Ned) -> Goal {
    Goal::FlyTo {
        to,
        hold_altitude_m: to.altitude_m() + 5.0,
    }
}

fn handle(navigation: &mut Navigation, input: Input) -> Vec<Transmit> {
    step_at(navigation, Timestamp::ZERO, Stimulus::Input(input))
}

fn step_at(
    navigation: &mut Navigation,
    now: Timestamp,
    stimulus: Stimulus<Input>,
) -> Vec<Transmit> {
    let mut transmits = Vec::new();
    step(navigation, now, stimulus, |output| {
        if let Emitted::Transmit(transmit) = output {
            transmits.push(transmit);
        }
    });
    transmits
}

/// Target and speed of the commanded leg.
fn leg(transmits: &[Transmit]) -> (Ned, f64) {
    match transmits {
        [Transmit::FlightCommand(FlightCommand::Fly(Setpoint::Leg { to, speed_mps, .. }))] => {
            (*to, *speed_mps)
        }
        other => panic!("a leg should have been commanded, not {other:?}"),
    }
}

fn at_rest_at(position: Ned) -> Input {
    Input::Telemetry(Telemetry {
        position,
        stop: position,
        armed: true,
        target: Some(position),
        ..ON_THE_GROUND
    })
}

#[test]
fn take_off_arms_climbs_crosses_and_reaches_its_slot() {
    let mut navigation = Navigation::new(NodeId(0), CONFIG, None);
    let to = Ned::new(0.0, 100.0, -25.0);
    let goal = Goal::TakeOff {
        to,
        transit_altitude_m: 30.0,
        arm: true,
    };
    let requested = handle(&mut navigation, Input::Goal(goal));
    assert_eq!(requested, [Transmit::FlightCommand(FlightCommand::Report)]);
    let arms = handle(&mut navigation, Input::Telemetry(ON_THE_GROUND));
    assert_eq!(arms, [Transmit::FlightCommand(FlightCommand::Arm)]);
    let climb = Ned::new(0.0, 0.0, -30.0);
    let cross = Ned::new(0.0, 100.0, -30.0);
    assert_eq!(
        leg(&handle(&mut navigation, at_rest_at(Ned::HOME))),
        (climb, 2.5)
    );
    assert_eq!(
        leg(&handle(&mut navigation, at_rest_at(climb))),
        (cross, 10.0)
    );
    assert_eq!(leg(&handle(&mut navigation, at_rest_at(cross))), (to, 1.5));
    let arrived = handle(&mut navigation, at_rest_at(to));
    assert!(matches!(
        arrived[..],
        [Transmit::Inform(Notice::Arrived(_))]
    ));
}

#[test]
fn sloped_leg_is_limited_by_climb_rate_and_ground_speed() {
    let speed = |to: Ned| match CONFIG.leg(Ned::HOME, to) {
        Setpoint::Leg { speed_mps, .. } => speed_mps,
        other => panic!("a leg should have been laid, not {other:?}"),
    };
    // 3 up for 4 ahead: 2.5 m/s up is 5/3 of that along the leg.
    assert!((speed(Ned::new(4.0, 0.0, -3.0)) - 2.5 * 5.0 / 3.0).abs() < 1e-9);
    // Almost level: the ground speed is the limit.
    let ahead = Ned::new(100.0, 0.0, -1.0);
    let over_ground = speed(ahead) * 100.0 / ahead.0.norm();
    assert!((over_ground - 10.0).abs() < 1e-9);
}

#[test]
fn repeated_goal_that_is_reached_is_reported_again() {
    let mut navigation = Navigation::new(NodeId(0), CONFIG, None);
    let to = Ned::new(50.0, 0.0, -25.0);
    handle(&mut navigation, Input::Goal(fly_to(to)));
    handle(&mut navigation, at_rest_at(to));
    let again = handle(&mut navigation, Input::Goal(fly_to(to)));
    assert!(matches!(again[..], [Transmit::Inform(Notice::Arrived(_))]));
}

#[test]
fn uncommanded_landing_is_reported_while_hovering() {
    let mut navigation = Navigation::new(NodeId(0), CONFIG, None);
    let to = Ned::new(50.0, 0.0, -25.0);
    handle(&mut navigation, Input::Goal(fly_to(to)));
    handle(&mut navigation, at_rest_at(to));
    let coming_down = Telemetry {
        armed: true,
        landing: true,
        at_rest: false,
        ..ON_THE_GROUND
    };
    let output = handle(&mut navigation, Input::Telemetry(coming_down));
    assert_eq!(output, [Transmit::Inform(Notice::UncommandedLanding(None))]);
    let taken_over = Telemetry {
        landing_cause: Some(LandingCause::Pilot),
        ..coming_down
    };
    let output = handle(&mut navigation, Input::Telemetry(taken_over));
    let because = Notice::UncommandedLanding(Some(LandingCause::Pilot));
    assert_eq!(output, [Transmit::Inform(because)]);
    let output = handle(&mut navigation, Input::Telemetry(ON_THE_GROUND));
    assert_eq!(output, [Transmit::Inform(Notice::Landed)]);
}

#[test]
fn restarted_navigation_does_not_repeat_a_leg_in_flight() {
    let to = Ned::new(50.0, 0.0, -25.0);
    let checkpoint = Checkpoint {
        goal: Some(fly_to(to)),
        progress: Progress::Flying([to].into()),
    };
    let mut navigation = Navigation::new(NodeId(0), CONFIG, Some(checkpoint));
    let on_the_way = Telemetry {
        at_rest: false,
        armed: true,
        target: Some(to),
        ..ON_THE_GROUND
    };
    let output = handle(&mut navigation, Input::Telemetry(on_the_way));
    let start = [
        Transmit::Inform(Notice::Resync),
        Transmit::FlightCommand(FlightCommand::Report),
    ];
    assert_eq!(output, start, "only the output of the start");
}

#[test]
fn landing_is_commanded_until_the_vehicle_lands_and_disarms() {
    let mut navigation = Navigation::new(NodeId(0), CONFIG, None);
    handle(&mut navigation, Input::Goal(Goal::Land));
    let hovering = at_rest_at(Ned::new(0.0, 0.0, -20.0));
    let commands = handle(&mut navigation, hovering);
    assert_eq!(commands, [Transmit::FlightCommand(FlightCommand::Land)]);
    let coming_down = Telemetry {
        armed: true,
        landing: true,
        at_rest: false,
        ..ON_THE_GROUND
    };
    assert!(handle(&mut navigation, Input::Telemetry(coming_down)).is_empty());
    let landed = handle(&mut navigation, Input::Telemetry(ON_THE_GROUND));
    assert_eq!(landed, [Transmit::Inform(Notice::Landed)]);
}

const MOVING: Goal = Goal::Track {
    to: Ned::HOME,
    hold_altitude_m: 10.0,
    velocity: Velocity::new(10.0, 0.0, 0.0),
    hold: Duration::from_secs(1),
};

#[test]
fn tracked_place_expires_after_a_restart_too() {
    let mut navigation = Navigation::new(NodeId(0), CONFIG, None);
    handle(&mut navigation, Input::Goal(MOVING));
    let checkpoint = navigation.durable.clone();
    let mut restarted = Navigation::new(NodeId(0), CONFIG, Some(checkpoint));
    let at = Timestamp::from_secs_f64;
    let mut look = |time_s| {
        step_at(&mut restarted, at(time_s), Stimulus::Timeout);
        let here = at_rest_at(Ned::new(10.0, 0.0, 0.0));
        step_at(&mut restarted, at(time_s), Stimulus::Input(here))
    };
    let hold = Transmit::FlightCommand(FlightCommand::Fly(CONFIG.hold(10.0)));
    assert!(!look(1.0).contains(&hold));
    assert!(!look(2.9).contains(&hold));
    assert!(look(3.0).contains(&hold));
}

#[test]
fn moving_place_is_tracked_immediately_and_never_reached() {
    let mut navigation = Navigation::new(NodeId(0), CONFIG, None);
    let track = Transmit::FlightCommand(FlightCommand::Fly(Setpoint::Track {
        to: Ned::HOME,
        velocity: Velocity::new(10.0, 0.0, 0.0),
        speed_mps: CONFIG.speed_mps,
        acceleration_mps2: CONFIG.acceleration_mps2,
        hold: Duration::from_secs(1),
    }));
    // The same goal again is a newer report: the place has moved since.
    for _ in 0..2 {
        assert_eq!(
            handle(&mut navigation, Input::Goal(MOVING)),
            std::slice::from_ref(&track)
        );
    }
    assert_eq!(handle(&mut navigation, at_rest_at(Ned::HOME)), []);
}

#[test]
fn expired_track_goal_holds_at_its_hold_altitude_until_renewed() {
    let mut navigation = Navigation::new(NodeId(0), CONFIG, None);
    handle(&mut navigation, Input::Goal(MOVING));
    let at = |seconds| Timestamp::ZERO + Duration::from_secs_f64(seconds);
    let waits = step_at(&mut navigation, at(1.9), Stimulus::Timeout);
    assert_eq!(waits, []);
    let requested = step_at(&mut navigation, at(2.0), Stimulus::Timeout);
    assert_eq!(requested, [Transmit::FlightCommand(FlightCommand::Report)]);
    let holds = handle(&mut navigation, at_rest_at(Ned::new(20.0, 0.0, 0.0)));
    let [Transmit::FlightCommand(FlightCommand::Fly(Setpoint::Hold { altitude_m, .. }))] =
        holds[..]
    else {
        panic!("{holds:?}");
    };
    assert!((altitude_m - 10.0).abs() < 1e-9);
    // It returns level from where it rests at its hold altitude, and leaves that only where its place is.
    let climbing = Goal::Track {
        to: Ned::HOME,
        hold_altitude_m: 10.0,
        velocity: Velocity::new(10.0, 0.0, -2.0),
        hold: Duration::from_secs(1),
    };
    let mut commanded = |position: Ned, at_rest: bool| {
        let asked = handle(&mut navigation, Input::Goal(climbing));
        assert_eq!(asked, [Transmit::FlightCommand(FlightCommand::Report)]);
        let Input::Telemetry(telemetry) = at_rest_at(position) else {
            unreachable!();
        };
        let telemetry = Telemetry {
            at_rest,
            ..telemetry
        };
        match handle(&mut navigation, Input::Telemetry(telemetry))[..] {
            [] => None,
            [Transmit::FlightCommand(FlightCommand::Fly(setpoint))] => Some(setpoint),
            ref other => panic!("{other:?}"),
        }
    };
    let track = |to: Ned, down_mps: f64| {
        Some(Setpoint::Track {
            to,
            velocity: Velocity::new(10.0, 0.0, down_mps),
            speed_mps: CONFIG.speed_mps,
            acceleration_mps2: CONFIG.acceleration_mps2,
            hold: Duration::from_secs(1),
        })
    };
    let above = Ned::HOME.at_altitude(10.0);
    let climbs = commanded(Ned::new(20.0, 0.0, -9.5), false);
    assert_eq!(climbs, None, "it still climbs");
    let rests_below = commanded(Ned::new(20.0, 0.0, -5.0), true);
    assert_eq!(rests_below, Some(CONFIG.hold(10.0)));
    assert_eq!(
        commanded(Ned::new(20.0, 0.0, -10.0), true),
        track(above, 0.0)
    );
    // Whatever its height is on the way.
    assert_eq!(
        commanded(Ned::new(10.0, 0.0, -12.0), false),
        track(above, 0.0)
    );
    assert_eq!(
        commanded(Ned::new(3.0, 0.0, -10.0), false),
        track(above, 0.0)
    );
    let there = commanded(Ned::new(2.0, 0.0, -10.0), false);
    assert_eq!(there, track(Ned::HOME, -2.0));
    let tracks = handle(&mut navigation, Input::Goal(MOVING));
    assert!(matches!(
        tracks[..],
        [Transmit::FlightCommand(FlightCommand::Fly(
            Setpoint::Track { .. }
        ))]
    ));
}

#[test]
fn drone_climbs_to_a_newer_hold_altitude_before_it_returns() {
    let mut navigation = Navigation::new(NodeId(0), CONFIG, None);
    handle(&mut navigation, Input::Goal(MOVING));
    step_at(
        &mut navigation,
        Timestamp::ZERO + Duration::from_secs(2),
        Stimulus::Timeout,
    );
    let away = at_rest_at(Ned::new(20.0, 0.0, -10.0));
    handle(&mut navigation, away.clone());
    let higher = Goal::Track {
        to: Ned::HOME,
        hold_altitude_m: 15.0,
        velocity: Velocity::new(10.0, 0.0, 0.0),
        hold: Duration::from_secs(1),
    };
    handle(&mut navigation, Input::Goal(higher));
    let holds = [Transmit::FlightCommand(FlightCommand::Fly(
        CONFIG.hold(15.0),
    ))];
    assert_eq!(handle(&mut navigation, away), holds);
}

#[test]
fn drone_level_with_its_place_returns_straight_there() {
    let mut navigation = Navigation::new(NodeId(0), CONFIG, None);
    handle(&mut navigation, Input::Goal(MOVING));
    let expired = Timestamp::ZERO + Duration::from_secs(2);
    step_at(&mut navigation, expired, Stimulus::Timeout);
    let behind = at_rest_at(Ned::new(-20.0, 0.0, -0.5));
    handle(&mut navigation, behind.clone());
    handle(&mut navigation, Input::Goal(MOVING));
    let commanded = handle(&mut navigation, behind);
    let straight = Setpoint::Track {
        to: Ned::HOME,
        velocity: Velocity::new(10.0, 0.0, 0.0),
        speed_mps: CONFIG.speed_mps,
        acceleration_mps2: CONFIG.acceleration_mps2,
        hold: Duration::from_secs(1),
    };
    assert_eq!(
        commanded,
        [Transmit::FlightCommand(FlightCommand::Fly(straight))]
    );
}

#[test]
fn hold_goal_stops_the_drone_and_reports_arrival() {
    let mut navigation = Navigation::new(NodeId(0), CONFIG, None);
    handle(&mut navigation, Input::Goal(MOVING));
    let asked = handle(&mut navigation, Input::Goal(Goal::Hold));
    assert_eq!(asked, [Transmit::FlightCommand(FlightCommand::Report)]);
    let stop = Ned::new(50.0, 0.0, 0.0);
    let moving = Telemetry {
        velocity: Velocity::new(10.0, 0.0, 0.0),
        stop,
        at_rest: false,
        armed: true,
        ..ON_THE_GROUND
    };
    let (to, speed_mps) = leg(&handle(&mut navigation, Input::Telemetry(moving)));
    assert_eq!(to, stop);
    assert!(speed_mps.is_finite());
    let arrived = handle(&mut navigation, at_rest_at(stop));
    assert!(matches!(
        arrived[..],
        [Transmit::Inform(Notice::Arrived(_))]
    ));
}

#[test]
fn yield_goal_commands_nothing() {
    let mut navigation = Navigation::new(NodeId(0), CONFIG, None);
    handle(&mut navigation, Input::Goal(Goal::Yield));
    assert_eq!(handle(&mut navigation, at_rest_at(Ned::HOME)), []);
}

#[test]
fn locate_is_answered_once() {
    let mut navigation = Navigation::new(NodeId(0), CONFIG, None);
    let asked = handle(&mut navigation, Input::Locate);
    assert_eq!(asked, [Transmit::FlightCommand(FlightCommand::Report)]);
    let at = Ned::new(1.0, 2.0, -3.0);
    let notice = Notice::Position {
        position: at,
        velocity: Velocity::ZERO,
    };
    assert_eq!(
        handle(&mut navigation, at_rest_at(at)),
        [Transmit::Inform(notice)]
    );
    assert_eq!(handle(&mut navigation, at_rest_at(at)), []);
}
