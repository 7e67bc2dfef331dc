//! Lost positions, low batteries and restarts.

use super::*;

fn position_lost_for_s(seconds: f64, telemetry: Telemetry) -> Input {
    Input::Telemetry(Telemetry {
        position_lost_for: Some(Duration::from_secs_f64(seconds)),
        ..telemetry
    })
}

#[test]
fn drone_without_position_holds_at_hold_altitude_until_it_is_regained() {
    let mut navigation = Navigation::new(NodeId(0), CONFIG, None);
    let to = Ned::new(500.0, 0.0, -25.0);
    handle(&mut navigation, Input::Goal(fly_to(to)));
    let start = Ned::new(0.0, 0.0, -25.0);
    handle(&mut navigation, at_rest_at(start));
    let on_the_way = Telemetry {
        armed: true,
        at_rest: false,
        target: Some(to),
        stop: start,
        ..ON_THE_GROUND
    };
    assert_eq!(
        handle(&mut navigation, position_lost_for_s(0.5, on_the_way)),
        []
    );
    let held = handle(&mut navigation, position_lost_for_s(1.0, on_the_way));
    let hold = Setpoint::Hold {
        altitude_m: 30.0,
        vertical_mps: 1.5,
        acceleration_mps2: 1.0,
    };
    assert_eq!(held, [Transmit::FlightCommand(FlightCommand::Fly(hold))]);
    // It stays there, at rest, whatever the goal.
    let hold = Ned::new(100.0, 0.0, -30.0);
    let at_rest = Telemetry {
        armed: true,
        stop: hold,
        position: hold,
        ..ON_THE_GROUND
    };
    assert_eq!(
        handle(&mut navigation, position_lost_for_s(3.0, at_rest)),
        []
    );
    assert_eq!(
        handle(&mut navigation, Input::Goal(MOVING)).len(),
        1,
        "requests telemetry"
    );
    handle(&mut navigation, Input::Goal(fly_to(to)));
    assert_eq!(
        handle(&mut navigation, position_lost_for_s(4.0, at_rest)),
        []
    );
    // A goal with another hold altitude changes the altitude.
    let hold_altitude_m = 40.0;
    let higher = Goal::FlyTo {
        to,
        hold_altitude_m,
    };
    handle(&mut navigation, Input::Goal(higher));
    let held = handle(&mut navigation, position_lost_for_s(5.0, at_rest));
    let hold = Setpoint::Hold {
        altitude_m: hold_altitude_m,
        vertical_mps: 1.5,
        acceleration_mps2: 1.0,
    };
    assert_eq!(held, [Transmit::FlightCommand(FlightCommand::Fly(hold))]);
    handle(&mut navigation, Input::Goal(fly_to(to)));
    // It descends only once it is above its slot.
    let output = handle(&mut navigation, Input::Telemetry(at_rest));
    assert_eq!(leg(&output).0, to.at_altitude(30.0));
    assert_eq!(
        leg(&handle(&mut navigation, at_rest_at(to.at_altitude(30.0)))).0,
        to
    );
}

#[test]
fn landing_needs_no_position() {
    let mut navigation = Navigation::new(NodeId(0), CONFIG, None);
    let hovering = Telemetry {
        armed: true,
        ..ON_THE_GROUND
    };
    handle(&mut navigation, position_lost_for_s(5.0, hovering));
    handle(&mut navigation, Input::Goal(Goal::Land));
    let output = handle(&mut navigation, position_lost_for_s(5.0, hovering));
    assert_eq!(output, [Transmit::FlightCommand(FlightCommand::Land)]);
}

#[test]
fn pilot_regains_control_with_the_position() {
    let mut navigation = Navigation::new(NodeId(0), CONFIG, None);
    let hovering = Telemetry {
        armed: true,
        ..ON_THE_GROUND
    };
    handle(&mut navigation, Input::Goal(Goal::Yield));
    let held = handle(&mut navigation, position_lost_for_s(2.0, hovering));
    assert!(matches!(
        held[..],
        [Transmit::FlightCommand(FlightCommand::Fly(
            Setpoint::Hold { .. }
        ))]
    ));
    let output = handle(&mut navigation, Input::Telemetry(hovering));
    assert_eq!(output, [Transmit::FlightCommand(FlightCommand::Yield)]);
}

fn arming_take_off() -> Goal {
    Goal::TakeOff {
        to: Ned::new(0.0, 100.0, -25.0),
        transit_altitude_m: 30.0,
        arm: true,
    }
}

#[test]
fn drone_without_position_or_with_low_battery_is_not_armed() {
    let take_off = arming_take_off();
    let mut navigation = Navigation::new(NodeId(0), CONFIG, None);
    handle(&mut navigation, Input::Goal(take_off));
    assert_eq!(
        handle(&mut navigation, position_lost_for_s(0.1, ON_THE_GROUND)),
        []
    );
    let found = handle(&mut navigation, Input::Telemetry(ON_THE_GROUND));
    assert_eq!(found, [Transmit::FlightCommand(FlightCommand::Arm)]);
    let mut navigation = Navigation::new(NodeId(0), CONFIG, None);
    handle(&mut navigation, Input::Goal(take_off));
    let output = handle(
        &mut navigation,
        Input::Telemetry(Telemetry {
            charge: 0.1,
            ..ON_THE_GROUND
        }),
    );
    let failing = Notice::Failing {
        failure: Failure::BatteryLow,
        stop: Ned::HOME,
        is_airborne: false,
    };
    assert_eq!(output, [Transmit::Inform(failing)]);
}

#[test]
fn drone_that_is_armed_without_a_position_stays_on_the_ground() {
    let mut navigation = Navigation::new(NodeId(0), CONFIG, None);
    handle(&mut navigation, Input::Goal(arming_take_off()));
    let armed = Telemetry {
        armed: true,
        ..ON_THE_GROUND
    };
    for (seconds, telemetry) in [(2.0, ON_THE_GROUND), (3.0, armed), (4.0, armed)] {
        let output = handle(&mut navigation, position_lost_for_s(seconds, telemetry));
        assert_eq!(output, [], "{seconds} s");
    }
    // It takes off once its position is known.
    let output = handle(&mut navigation, Input::Telemetry(armed));
    assert_eq!(leg(&output).0, Ned::HOME.at_altitude(30.0));
}

#[test]
fn navigation_restarted_before_its_first_goal_requests_the_goal() {
    let mut navigation = Navigation::new(NodeId(0), CONFIG, None);
    let Output::Event(Event::Checkpoint(checkpoint)) = navigation.poll_output() else {
        panic!("a checkpoint is written");
    };
    let mut rebuilt = Navigation::new(NodeId(0), CONFIG, Some(*checkpoint));
    let requested = Output::Transmit(Transmit::Inform(Notice::Resync));
    assert_eq!(rebuilt.poll_output(), requested);
}

#[test]
fn drone_that_lands_beyond_its_fence_goes_on_landing() {
    let fence = Fence::cylinder(50.0, 100.0);
    let failsafe = Failsafe {
        fence: Some(fence.into()),
        ..FAILSAFE
    };
    let config = Config { failsafe, ..CONFIG };
    let mut navigation = Navigation::new(NodeId(0), config, None);
    handle(&mut navigation, Input::Goal(Goal::Land));
    let output = handle(&mut navigation, at_rest_at(Ned::new(60.0, 0.0, -20.0)));
    let land = Transmit::FlightCommand(FlightCommand::Land);
    assert_eq!(output.last(), Some(&land), "{output:?}");
}

#[test]
fn vehicle_with_an_order_to_arm_is_commanded_to_land_before_it_arms() {
    let take_off = arming_take_off();
    let mut navigation = Navigation::new(NodeId(0), CONFIG, None);
    handle(&mut navigation, Input::Goal(take_off));
    handle(&mut navigation, Input::Telemetry(ON_THE_GROUND));
    handle(&mut navigation, Input::Goal(Goal::Land));
    let output = handle(&mut navigation, Input::Telemetry(ON_THE_GROUND));
    let landed = [
        Transmit::FlightCommand(FlightCommand::Land),
        Transmit::Inform(Notice::Landed),
    ];
    assert_eq!(output, landed);
}
