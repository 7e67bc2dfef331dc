use super::guard::{LANDS_AFTER, ROUND_AFTER, SAYS_EVERY, TRY_AGAIN_AFTER};
use super::*;
use crate::formation::Separation;
use crate::machine::{Emitted, Stimulus, step};

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
    target: None,
    position_lost_for: None,
    charge: 1.0,
};

/// Straight there; 5 m higher the drone is in nobody's way.
fn fly_to(to: Ned) -> Goal {
    Goal::FlyTo {
        to,
        hold_altitude_m: to.altitude_m() + 5.0,
    }
}

fn told(navigation: &mut Navigation, input: Input) -> Vec<Transmit> {
    stepped(navigation, Timestamp::ZERO, Stimulus::Input(input))
}

fn stepped(
    navigation: &mut Navigation,
    now: Timestamp,
    stimulus: Stimulus<Input>,
) -> Vec<Transmit> {
    let mut transmits = Vec::new();
    let Ok(_) = step(navigation, now, stimulus, |said| {
        if let Emitted::Transmit(transmit) = said {
            transmits.push(transmit);
        }
    });
    transmits
}

/// The target and the speed of the leg that is demanded.
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
fn a_take_off_arms_climbs_crosses_and_comes_to_its_slot() {
    let mut navigation = Navigation::new(NodeId(0), CONFIG, None);
    let to = Ned::new(0.0, 100.0, -25.0);
    let goal = Goal::TakeOff {
        to,
        transit_altitude_m: 30.0,
        arm: true,
    };
    let asks = told(&mut navigation, Input::Goal(goal));
    assert_eq!(asks, [Transmit::FlightCommand(FlightCommand::Report)]);
    let arms = told(&mut navigation, Input::Telemetry(ON_THE_GROUND));
    assert_eq!(arms, [Transmit::FlightCommand(FlightCommand::Arm)]);
    let climb = Ned::new(0.0, 0.0, -30.0);
    let cross = Ned::new(0.0, 100.0, -30.0);
    assert_eq!(
        leg(&told(&mut navigation, at_rest_at(Ned::HOME))),
        (climb, 2.5)
    );
    assert_eq!(
        leg(&told(&mut navigation, at_rest_at(climb))),
        (cross, 10.0)
    );
    assert_eq!(leg(&told(&mut navigation, at_rest_at(cross))), (to, 1.5));
    let arrived = told(&mut navigation, at_rest_at(to));
    assert_eq!(arrived, [Transmit::Inform(Notice::Arrived)]);
}

#[test]
fn a_slanting_leg_is_as_fast_as_climb_and_ground_speed_allow() {
    let navigation = Navigation::new(NodeId(0), CONFIG, None);
    let speed = |to: Ned| match navigation.leg(Ned::HOME, to) {
        Setpoint::Leg { speed_mps, .. } => speed_mps,
        other => panic!("a leg should have been laid, not {other:?}"),
    };
    // Up 3 for each 4 ahead: 2.5 m/s up is 5/3 of that along the leg.
    assert!((speed(Ned::new(4.0, 0.0, -3.0)) - 2.5 * 5.0 / 3.0).abs() < 1e-9);
    // Hardly up at all: the ground speed decides.
    let ahead = Ned::new(100.0, 0.0, -1.0);
    let over_ground = speed(ahead) * 100.0 / ahead.0.norm();
    assert!((over_ground - 10.0).abs() < 1e-9);
}

#[test]
fn a_goal_that_is_reached_already_is_told_again() {
    let mut navigation = Navigation::new(NodeId(0), CONFIG, None);
    let to = Ned::new(50.0, 0.0, -25.0);
    told(&mut navigation, Input::Goal(fly_to(to)));
    told(&mut navigation, at_rest_at(to));
    let again = told(&mut navigation, Input::Goal(fly_to(to)));
    assert_eq!(again, [Transmit::Inform(Notice::Arrived)]);
}

#[test]
fn a_vehicle_that_comes_down_by_itself_is_told_of_where_it_hovers_too() {
    let mut navigation = Navigation::new(NodeId(0), CONFIG, None);
    let to = Ned::new(50.0, 0.0, -25.0);
    told(&mut navigation, Input::Goal(fly_to(to)));
    told(&mut navigation, at_rest_at(to));
    let coming_down = Telemetry {
        armed: true,
        landing: true,
        at_rest: false,
        ..ON_THE_GROUND
    };
    let said = told(&mut navigation, Input::Telemetry(coming_down));
    assert_eq!(said, [Transmit::Inform(Notice::ComingDown)]);
    let said = told(&mut navigation, Input::Telemetry(ON_THE_GROUND));
    assert_eq!(said, [Transmit::Inform(Notice::Landed)]);
}

#[test]
fn a_restarted_navigation_leaves_a_leg_that_is_being_flown_alone() {
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
    let said = told(&mut navigation, Input::Telemetry(on_the_way));
    let start = [
        Transmit::Inform(Notice::Resync),
        Transmit::FlightCommand(FlightCommand::Report),
    ];
    assert_eq!(said, start, "nothing but what it says when it starts");
}

#[test]
fn a_landing_ends_disarmed_and_is_demanded_until_the_vehicle_lands() {
    let mut navigation = Navigation::new(NodeId(0), CONFIG, None);
    told(&mut navigation, Input::Goal(Goal::Land));
    let hovering = at_rest_at(Ned::new(0.0, 0.0, -20.0));
    let commands = told(&mut navigation, hovering);
    assert_eq!(commands, [Transmit::FlightCommand(FlightCommand::Land)]);
    let coming_down = Telemetry {
        armed: true,
        landing: true,
        at_rest: false,
        ..ON_THE_GROUND
    };
    assert!(told(&mut navigation, Input::Telemetry(coming_down)).is_empty());
    let landed = told(&mut navigation, Input::Telemetry(ON_THE_GROUND));
    assert_eq!(landed, [Transmit::Inform(Notice::Landed)]);
}

const MOVING: Goal = Goal::Track {
    to: Ned::HOME,
    hold_altitude_m: 10.0,
    velocity: Velocity::new(10.0, 0.0, 0.0),
    hold: Duration::from_secs(1),
};

#[test]
fn a_place_that_moves_is_tracked_at_once_and_never_arrived_at() {
    let mut navigation = Navigation::new(NodeId(0), CONFIG, None);
    let track = Transmit::FlightCommand(FlightCommand::Fly(Setpoint::Track {
        to: Ned::HOME,
        velocity: Velocity::new(10.0, 0.0, 0.0),
        speed_mps: CONFIG.speed_mps,
        acceleration_mps2: CONFIG.acceleration_mps2,
        hold: Duration::from_secs(1),
    }));
    // The same goal again is a newer report: the place has moved on since.
    for _ in 0..2 {
        assert_eq!(
            told(&mut navigation, Input::Goal(MOVING)),
            std::slice::from_ref(&track)
        );
    }
    assert_eq!(told(&mut navigation, at_rest_at(Ned::HOME)), []);
}

#[test]
fn a_drone_that_hears_no_more_of_a_place_that_moves_goes_out_of_the_way_until_it_does() {
    let mut navigation = Navigation::new(NodeId(0), CONFIG, None);
    told(&mut navigation, Input::Goal(MOVING));
    let at = |seconds| Timestamp::ZERO + Duration::from_secs_f64(seconds);
    let waits = stepped(&mut navigation, at(1.9), Stimulus::Timeout);
    assert_eq!(waits, []);
    let asks = stepped(&mut navigation, at(2.0), Stimulus::Timeout);
    assert_eq!(asks, [Transmit::FlightCommand(FlightCommand::Report)]);
    let holds = told(&mut navigation, at_rest_at(Ned::new(20.0, 0.0, 0.0)));
    let [Transmit::FlightCommand(FlightCommand::Fly(Setpoint::Hold { altitude_m, .. }))] =
        holds[..]
    else {
        panic!("{holds:?}");
    };
    assert!((altitude_m - 10.0).abs() < 1e-9);
    let tracks = told(&mut navigation, Input::Goal(MOVING));
    assert!(matches!(
        tracks[..],
        [Transmit::FlightCommand(FlightCommand::Fly(
            Setpoint::Track { .. }
        ))]
    ));
}

#[test]
fn a_drone_that_is_to_hold_comes_to_rest_where_it_can_and_says_so() {
    let mut navigation = Navigation::new(NodeId(0), CONFIG, None);
    told(&mut navigation, Input::Goal(MOVING));
    let asked = told(&mut navigation, Input::Goal(Goal::Hold));
    assert_eq!(asked, [Transmit::FlightCommand(FlightCommand::Report)]);
    let stop = Ned::new(50.0, 0.0, 0.0);
    let moving = Telemetry {
        velocity: Velocity::new(10.0, 0.0, 0.0),
        stop,
        at_rest: false,
        armed: true,
        ..ON_THE_GROUND
    };
    let (to, speed_mps) = leg(&told(&mut navigation, Input::Telemetry(moving)));
    assert_eq!(to, stop);
    assert!(speed_mps.is_finite());
    let arrived = told(&mut navigation, at_rest_at(stop));
    assert_eq!(arrived, [Transmit::Inform(Notice::Arrived)]);
}

#[test]
fn a_pilot_is_left_alone() {
    let mut navigation = Navigation::new(NodeId(0), CONFIG, None);
    told(&mut navigation, Input::Goal(Goal::Yield));
    assert_eq!(told(&mut navigation, at_rest_at(Ned::HOME)), []);
}

#[test]
fn whoever_asks_where_the_drone_is_is_told_once() {
    let mut navigation = Navigation::new(NodeId(0), CONFIG, None);
    let asked = told(&mut navigation, Input::Locate);
    assert_eq!(asked, [Transmit::FlightCommand(FlightCommand::Report)]);
    let at = Ned::new(1.0, 2.0, -3.0);
    let notice = Notice::At {
        position: at,
        velocity: Velocity::ZERO,
    };
    assert_eq!(
        told(&mut navigation, at_rest_at(at)),
        [Transmit::Inform(notice)]
    );
    assert_eq!(told(&mut navigation, at_rest_at(at)), []);
}

fn lost_for(seconds: f64, telemetry: Telemetry) -> Input {
    Input::Telemetry(Telemetry {
        position_lost_for: Some(Duration::from_secs_f64(seconds)),
        ..telemetry
    })
}

#[test]
fn a_drone_that_does_not_know_where_it_is_holds_above_the_others_and_goes_on_when_it_does() {
    let mut navigation = Navigation::new(NodeId(0), CONFIG, None);
    let to = Ned::new(500.0, 0.0, -25.0);
    told(&mut navigation, Input::Goal(fly_to(to)));
    let start = Ned::new(0.0, 0.0, -25.0);
    told(&mut navigation, at_rest_at(start));
    let on_the_way = Telemetry {
        armed: true,
        at_rest: false,
        target: Some(to),
        stop: start,
        ..ON_THE_GROUND
    };
    assert_eq!(told(&mut navigation, lost_for(0.5, on_the_way)), []);
    let held = told(&mut navigation, lost_for(1.0, on_the_way));
    let hold = Setpoint::Hold {
        altitude_m: 30.0,
        vertical_mps: 1.5,
        acceleration_mps2: 1.0,
    };
    assert_eq!(held, [Transmit::FlightCommand(FlightCommand::Fly(hold))]);
    // There it stays, at rest and whatever it is told.
    let hold = Ned::new(100.0, 0.0, -30.0);
    let at_rest = Telemetry {
        armed: true,
        stop: hold,
        position: hold,
        ..ON_THE_GROUND
    };
    assert_eq!(told(&mut navigation, lost_for(3.0, at_rest)), []);
    assert_eq!(told(&mut navigation, Input::Goal(MOVING)).len(), 1, "asks");
    told(&mut navigation, Input::Goal(fly_to(to)));
    assert_eq!(told(&mut navigation, lost_for(4.0, at_rest)), []);
    // But for a goal that wants it at another height then.
    let hold_altitude_m = 40.0;
    let higher = Goal::FlyTo {
        to,
        hold_altitude_m,
    };
    told(&mut navigation, Input::Goal(higher));
    let held = told(&mut navigation, lost_for(5.0, at_rest));
    let hold = Setpoint::Hold {
        altitude_m: hold_altitude_m,
        vertical_mps: 1.5,
        acceleration_mps2: 1.0,
    };
    assert_eq!(held, [Transmit::FlightCommand(FlightCommand::Fly(hold))]);
    told(&mut navigation, Input::Goal(fly_to(to)));
    // It descends only once it is over its slot.
    let said = told(&mut navigation, Input::Telemetry(at_rest));
    assert_eq!(leg(&said).0, to.at_altitude(30.0));
    assert_eq!(
        leg(&told(&mut navigation, at_rest_at(to.at_altitude(30.0)))).0,
        to
    );
}

#[test]
fn a_drone_that_comes_down_needs_no_position() {
    let mut navigation = Navigation::new(NodeId(0), CONFIG, None);
    let hovering = Telemetry {
        armed: true,
        ..ON_THE_GROUND
    };
    told(&mut navigation, lost_for(5.0, hovering));
    told(&mut navigation, Input::Goal(Goal::Land));
    let said = told(&mut navigation, lost_for(5.0, hovering));
    assert_eq!(said, [Transmit::FlightCommand(FlightCommand::Land)]);
}

#[test]
fn a_pilot_gets_a_vehicle_back_that_knows_again_where_it_is() {
    let mut navigation = Navigation::new(NodeId(0), CONFIG, None);
    let hovering = Telemetry {
        armed: true,
        ..ON_THE_GROUND
    };
    told(&mut navigation, Input::Goal(Goal::Yield));
    let held = told(&mut navigation, lost_for(2.0, hovering));
    assert!(matches!(
        held[..],
        [Transmit::FlightCommand(FlightCommand::Fly(
            Setpoint::Hold { .. }
        ))]
    ));
    let said = told(&mut navigation, Input::Telemetry(hovering));
    assert_eq!(said, [Transmit::FlightCommand(FlightCommand::Yield)]);
}

#[test]
fn a_drone_that_does_not_know_where_it_is_or_has_a_low_battery_is_not_armed() {
    let take_off = Goal::TakeOff {
        to: Ned::new(0.0, 100.0, -25.0),
        transit_altitude_m: 30.0,
        arm: true,
    };
    let mut navigation = Navigation::new(NodeId(0), CONFIG, None);
    told(&mut navigation, Input::Goal(take_off));
    assert_eq!(told(&mut navigation, lost_for(0.1, ON_THE_GROUND)), []);
    let found = told(&mut navigation, Input::Telemetry(ON_THE_GROUND));
    assert_eq!(found, [Transmit::FlightCommand(FlightCommand::Arm)]);
    let mut navigation = Navigation::new(NodeId(0), CONFIG, None);
    told(&mut navigation, Input::Goal(take_off));
    let said = told(
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
    assert_eq!(said, [Transmit::Inform(failing)]);
}

#[test]
fn a_navigation_that_fails_before_it_is_told_anything_asks_once_it_is_rebuilt() {
    let mut navigation = Navigation::new(NodeId(0), CONFIG, None);
    let Output::Event(Event::Checkpoint(checkpoint)) = navigation.poll_output() else {
        panic!("nothing is kept");
    };
    let mut rebuilt = Navigation::new(NodeId(0), CONFIG, Some(*checkpoint));
    let asks = Output::Transmit(Transmit::Inform(Notice::Resync));
    assert_eq!(rebuilt.poll_output(), asks);
}

/// Drone 4, which heeds those near it.
fn avoids() -> Navigation {
    let separation = Separation {
        horizontal_m: 5.0,
        vertical_m: 5.0,
    };
    let avoid = traffic::Config {
        separation,
        time_to_live: Duration::from_secs(2),
        controller: Duration::from_secs(5),
        descent_mps: 1.5,
        touch_down: Duration::from_secs(10),
    };
    let config = Config {
        avoid: Some(avoid),
        ..CONFIG
    };
    Navigation::new(NodeId(4), config, None)
}

fn intends(from: Ned, to: Ned) -> Transmit {
    says(Intent::of(Path { from, to }, 0.0, false), true)
}

fn says(intent: Intent, at_once: bool) -> Transmit {
    Transmit::Intend {
        intent: Some(intent),
        at_once,
    }
}

fn hears_of(navigation: &mut Navigation, id: u32, from: Ned, to: Ned) -> Vec<Transmit> {
    let traffic = Input::Traffic {
        sender: NodeId(id),
        intent: Some(Intent::of(Path { from, to }, 0.0, false)),
    };
    told(navigation, traffic)
}

const REPORT: Transmit = Transmit::FlightCommand(FlightCommand::Report);

#[test]
fn a_leg_through_another_s_place_is_begun_once_that_has_gone_on() {
    let mut navigation = avoids();
    let place = |north_m: f64| Ned::new(north_m, 0.0, -25.0);
    let (start, to) = (place(0.0), place(100.0));
    hears_of(&mut navigation, 2, place(60.0), place(60.0));
    told(&mut navigation, Input::Goal(fly_to(to)));
    assert_eq!(
        told(&mut navigation, at_rest_at(start)),
        [intends(start, start)],
        "it stands still, and says so"
    );
    let asks = hears_of(&mut navigation, 2, place(60.0), place(160.0));
    assert_eq!(asks, [REPORT]);
    let said = told(&mut navigation, at_rest_at(start));
    assert_eq!(said[0], intends(start, to));
    assert_eq!(leg(&said[1..]).0, to);
    let there = told(&mut navigation, at_rest_at(to));
    assert_eq!(there[0], intends(to, to));
}

#[test]
fn it_looks_again_by_itself_whether_its_way_is_free() {
    let mut navigation = avoids();
    let (start, to) = (Ned::new(0.0, 0.0, -25.0), Ned::new(100.0, 0.0, -25.0));
    let amid = Ned::new(60.0, 0.0, -25.0);
    hears_of(&mut navigation, 2, amid, amid);
    told(&mut navigation, Input::Goal(fly_to(to)));
    told(&mut navigation, at_rest_at(start));
    let again = Timestamp::ZERO + TRY_AGAIN_AFTER;
    let Output::Idle { deadline } = navigation.poll_output() else {
        panic!("all has been said");
    };
    assert!(deadline.is_some_and(|deadline| deadline <= again));
    navigation.handle_timeout(again);
    assert_eq!(navigation.poll_output(), Output::Transmit(REPORT));
}

#[test]
fn round_one_that_does_not_go_it_flies_after_a_while() {
    let mut navigation = avoids();
    let (start, to) = (Ned::new(0.0, 0.0, -12.0), Ned::new(0.0, 0.0, -24.0));
    let amid = Ned::new(0.0, 0.0, -18.0);
    hears_of(&mut navigation, 2, amid, amid);
    told(&mut navigation, Input::Goal(Goal::TransitTo { to }));
    told(&mut navigation, at_rest_at(start));
    let later = Timestamp::ZERO + ROUND_AFTER;
    let mut said = Vec::new();
    let Ok(_) = step(
        &mut navigation,
        later,
        Stimulus::Input(at_rest_at(start)),
        |it| {
            if let Emitted::Transmit(transmit) = it {
                said.push(transmit);
            }
        },
    );
    let side = leg(&said[1..]).0;
    assert_eq!(said[0], intends(start, side));
    assert!(side.horizontal_distance_m(start) > 10.0);
    let up = told(&mut navigation, at_rest_at(side));
    assert_eq!(leg(&up[1..]).0, side.at_altitude(24.0));
}

#[test]
fn in_mid_leg_it_stops_for_whoever_goes_first() {
    let to = Ned::new(100.0, 0.0, -25.0);
    let across = [Ned::new(50.0, -50.0, -25.0), Ned::new(50.0, 50.0, -25.0)];
    for (id, stops) in [(3, true), (5, false)] {
        let mut navigation = avoids();
        let start = Ned::new(0.0, 0.0, -25.0);
        told(&mut navigation, Input::Goal(fly_to(to)));
        told(&mut navigation, at_rest_at(start));
        let asks = hears_of(&mut navigation, id, across[0], across[1]);
        assert_eq!(asks == [REPORT], stops);
        let stop = Ned::new(2.0, 0.0, -25.0);
        let on_its_way = Telemetry {
            armed: true,
            at_rest: false,
            stop,
            target: Some(to),
            ..ON_THE_GROUND
        };
        let said = told(&mut navigation, Input::Telemetry(on_its_way));
        let holds = matches!(
            said[..],
            [
                Transmit::Intend { .. },
                Transmit::FlightCommand(FlightCommand::Fly(Setpoint::Hold { .. }))
            ]
        );
        assert_eq!((holds, said.is_empty()), (stops, !stops), "{said:?}");
    }
}

#[test]
fn a_drone_that_turns_back_brakes_first_and_says_where_to() {
    let mut navigation = avoids();
    let (position, stop) = (Ned::new(20.0, 0.0, -25.0), Ned::new(30.0, 0.0, -25.0));
    let back = Ned::new(-50.0, 0.0, -25.0);
    told(&mut navigation, Input::Goal(fly_to(back)));
    let on_its_way = Telemetry {
        armed: true,
        at_rest: false,
        position,
        stop,
        target: Some(Ned::new(100.0, 0.0, -25.0)),
        ..ON_THE_GROUND
    };
    let said = told(&mut navigation, Input::Telemetry(on_its_way));
    let braking = Intent::of(
        Path {
            from: position,
            to: stop,
        },
        0.0,
        false,
    );
    assert_eq!(said[0], says(braking, true));
    assert!(matches!(
        said[1..],
        [Transmit::FlightCommand(FlightCommand::Fly(
            Setpoint::Hold { .. }
        ))]
    ));
    let said = told(&mut navigation, at_rest_at(stop));
    assert_eq!(leg(&said[1..]).0, back);
}

#[test]
fn a_drone_that_follows_says_where_it_will_be_until_it_is_told_more() {
    let mut navigation = avoids();
    let Goal::Track {
        to, velocity, hold, ..
    } = MOVING
    else {
        panic!("it moves");
    };
    let ahead = Ned(to.0 + velocity.0 * hold.as_secs_f64());
    let intent = Intent::of(
        Path {
            from: to,
            to: ahead,
        },
        0.0,
        true,
    );
    for at_once in [true, false] {
        let said = told(&mut navigation, Input::Goal(MOVING));
        assert_eq!(said[0], says(intent, at_once));
    }
    assert_eq!(
        told(&mut navigation, Input::SayWay),
        [says(intent, true)],
        "to a radio that restarted"
    );
}

#[test]
fn a_drone_that_is_flown_by_hand_says_nothing_of_its_way() {
    let mut navigation = avoids();
    let place = Ned::new(0.0, 0.0, -25.0);
    told(&mut navigation, Input::Goal(fly_to(place)));
    told(&mut navigation, at_rest_at(place));
    let mut said = told(&mut navigation, Input::Goal(Goal::Yield));
    said.extend(told(&mut navigation, at_rest_at(place)));
    let unsaid = Transmit::Intend {
        intent: None,
        at_once: true,
    };
    assert!(said.contains(&unsaid), "{said:?}");
}

fn told_at(navigation: &mut Navigation, now: Timestamp, input: Input) -> Vec<Transmit> {
    stepped(navigation, now, Stimulus::Input(input))
}

#[test]
fn in_mid_leg_it_says_how_far_it_has_got_in_the_frames_that_it_sends_anyway() {
    let mut navigation = avoids();
    let (start, to) = (Ned::new(0.0, 0.0, -25.0), Ned::new(100.0, 0.0, -25.0));
    told(&mut navigation, Input::Goal(fly_to(to)));
    told(&mut navigation, at_rest_at(start));
    let later = Timestamp::ZERO + SAYS_EVERY;
    let Output::Idle { deadline } = navigation.poll_output() else {
        panic!("all has been said");
    };
    assert_eq!(deadline, Some(later));
    let half_way = Telemetry {
        armed: true,
        at_rest: false,
        position: Ned::new(50.0, 0.0, -25.0),
        stop: Ned::new(60.0, 0.0, -25.0),
        target: Some(to),
        ..ON_THE_GROUND
    };
    let path = Path { from: start, to };
    let said = told_at(&mut navigation, later, Input::Telemetry(half_way));
    assert_eq!(said, [says(Intent::of(path, 0.5, false), false)]);
}

#[test]
fn it_holds_above_one_below_for_a_while_goes_aside_and_comes_down_at_the_latest_then() {
    let (place, below) = (Ned::new(0.0, 0.0, -25.0), Ned::new(0.0, 1.0, -10.0));
    let lands = |navigation: &mut Navigation, now: Timestamp, telemetry: Input| {
        let said = told_at(navigation, now, telemetry);
        (
            said.contains(&Transmit::FlightCommand(FlightCommand::Land)),
            said,
        )
    };
    let waiting = || {
        let mut navigation = avoids();
        hears_of(&mut navigation, 2, below, below);
        told(&mut navigation, Input::Goal(Goal::Land));
        assert!(!lands(&mut navigation, Timestamp::ZERO, at_rest_at(place)).0);
        navigation
    };
    let mut navigation = waiting();
    hears_of(&mut navigation, 2, below, Ned::new(0.0, 90.0, -10.0));
    let far = Ned::new(0.0, 90.0, -10.0);
    hears_of(&mut navigation, 2, far, far);
    assert!(
        lands(&mut navigation, Timestamp::ZERO, at_rest_at(place)).0,
        "it has gone"
    );

    let mut navigation = waiting();
    let round = Timestamp::ZERO + ROUND_AFTER;
    let traffic = Intent::of(
        Path {
            from: below,
            to: below,
        },
        0.0,
        false,
    );
    let stays = Input::Traffic {
        sender: NodeId(2),
        intent: Some(traffic),
    };
    told_at(&mut navigation, round, stays.clone());
    let (_, said) = lands(&mut navigation, round, at_rest_at(place));
    let side = leg(&said[1..]).0;
    assert!(side.horizontal_distance_m(place) > 10.0);
    assert!(lands(&mut navigation, round, at_rest_at(side)).0);

    let mut navigation = waiting();
    let at_last = Timestamp::ZERO + LANDS_AFTER;
    told_at(&mut navigation, at_last, stays);
    assert!(lands(&mut navigation, at_last, at_rest_at(place)).0);

    let mut navigation = waiting();
    let Input::Telemetry(fit) = at_rest_at(place) else {
        panic!("it is telemetry");
    };
    let empty = Telemetry {
        charge: 0.05,
        ..fit
    };
    assert!(
        lands(&mut navigation, Timestamp::ZERO, Input::Telemetry(empty)).0,
        "it can't wait"
    );
}
