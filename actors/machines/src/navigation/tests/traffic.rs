//! Deconfliction with other drones.

mod landing;
mod room;

use std::sync::Arc;

use super::*;
use crate::formation::Separation;
use crate::navigation::deconfliction::{
    DETOUR_AFTER, LANDING_WAIT_MAX, PROGRESS_INTERVAL, RETRY_INTERVAL, URGENT_LANDING_WAIT_MAX,
};
use crate::traffic::{self, Intent};

/// Drone 4, with deconfliction.
fn avoiding() -> Navigation {
    avoiding_within(None, None)
}

/// Drone 4, with deconfliction, a fence, and what a navigation before it kept.
fn avoiding_within(fence: Option<Fence>, checkpoint: Option<Checkpoint>) -> Navigation {
    let separation = Separation {
        horizontal_m: 5.0,
        vertical_m: 5.0,
    };
    let avoid = traffic::Config {
        separation,
        time_to_live: Duration::from_secs(2),
        controller_timeout: Duration::from_secs(5),
        descent_mps: 1.5,
        touch_down_margin: Duration::from_secs(10),
        speed_mps: 20.0,
        climb_mps: 3.0,
        has_followers: false,
        landing_places: None,
    };
    let config = Config {
        avoid: Some(avoid),
        failsafe: Failsafe {
            fence: fence.map(Arc::new),
            ..FAILSAFE
        },
        ..CONFIG
    };
    Navigation::new(NodeId(4), config, checkpoint)
}

fn announces_path(from: Ned, to: Ned) -> Transmit {
    announces(Intent::of(Path { from, to }, 0.0, false), true)
}

fn announces(intent: Intent, immediately: bool) -> Transmit {
    Transmit::AnnounceIntent {
        intent: Some(intent),
        immediately,
    }
}

fn traffic(navigation: &mut Navigation, id: u32, from: Ned, to: Ned) -> Vec<Transmit> {
    let intent = Intent::of(Path { from, to }, 0.0, false);
    handle(navigation, heard(Timestamp::ZERO, id, intent))
}

/// The intent of another drone, heard at a time.
fn heard(heard_at: Timestamp, id: u32, intent: Intent) -> Input {
    Input::Traffic {
        sender: NodeId(id),
        intent: Some(intent),
        heard_at,
    }
}

const REPORT: Transmit = Transmit::FlightCommand(FlightCommand::Report);

#[test]
fn leg_through_a_drone_starts_once_that_has_flown_on() {
    let mut navigation = avoiding();
    let place = |north_m: f64| Ned::new(north_m, 0.0, -25.0);
    let (start, to) = (place(0.0), place(100.0));
    traffic(&mut navigation, 2, place(60.0), place(60.0));
    handle(&mut navigation, Input::Goal(fly_to(to)));
    assert_eq!(
        handle(&mut navigation, at_rest_at(start)),
        [announces_path(start, start)],
        "it announces that it is stationary"
    );
    let requested = traffic(&mut navigation, 2, place(60.0), place(160.0));
    assert_eq!(requested, [REPORT]);
    let output = handle(&mut navigation, at_rest_at(start));
    assert_eq!(output[0], announces_path(start, to));
    assert_eq!(leg(&output[1..]).0, to);
    let there = handle(&mut navigation, at_rest_at(to));
    assert_eq!(there[0], announces_path(to, to));
}

#[test]
fn blocked_leg_is_retried_on_a_timer() {
    let mut navigation = avoiding();
    let (start, to) = (Ned::new(0.0, 0.0, -25.0), Ned::new(100.0, 0.0, -25.0));
    let amid = Ned::new(60.0, 0.0, -25.0);
    traffic(&mut navigation, 2, amid, amid);
    handle(&mut navigation, Input::Goal(fly_to(to)));
    handle(&mut navigation, at_rest_at(start));
    let retry_at = Timestamp::ZERO + RETRY_INTERVAL;
    let Output::Idle { deadline } = navigation.poll_output() else {
        panic!("no output is pending");
    };
    assert!(deadline.is_some_and(|deadline| deadline <= retry_at));
    navigation.handle_timeout(retry_at);
    assert_eq!(navigation.poll_output(), Output::Transmit(REPORT));
}

#[test]
fn detour_around_a_stationary_drone_starts_after_a_while() {
    let mut navigation = avoiding();
    let (start, to) = (Ned::new(0.0, 0.0, -12.0), Ned::new(0.0, 0.0, -24.0));
    let amid = Ned::new(0.0, 0.0, -18.0);
    traffic(&mut navigation, 2, amid, amid);
    handle(&mut navigation, Input::Goal(Goal::TransitTo { to }));
    handle(&mut navigation, at_rest_at(start));
    let later = Timestamp::ZERO + DETOUR_AFTER;
    let mut output = Vec::new();
    step(
        &mut navigation,
        later,
        Stimulus::Input(at_rest_at(start)),
        |it| {
            if let Emitted::Transmit(transmit) = it {
                output.push(transmit);
            }
        },
    );
    let side = leg(&output[1..]).0;
    assert_eq!(output[0], announces_path(start, side));
    assert!(side.horizontal_distance_m(start) > 10.0);
    let up = handle(&mut navigation, at_rest_at(side));
    assert_eq!(leg(&up[1..]).0, side.at_altitude(24.0));
}

#[test]
fn drone_on_a_leg_stops_for_right_of_way() {
    let to = Ned::new(100.0, 0.0, -25.0);
    let across = [Ned::new(50.0, -50.0, -25.0), Ned::new(50.0, 50.0, -25.0)];
    for (id, is_deaf, stops) in [(3, false, true), (5, false, false), (5, true, true)] {
        let mut navigation = avoiding();
        let start = Ned::new(0.0, 0.0, -25.0);
        handle(&mut navigation, Input::Goal(fly_to(to)));
        handle(&mut navigation, at_rest_at(start));
        let mut requested = traffic(&mut navigation, id, across[0], across[1]);
        if is_deaf {
            assert_eq!(requested, []);
            requested = handle(&mut navigation, Input::Deaf(NodeId(id).into()));
        }
        assert_eq!(requested == [REPORT], stops);
        let stop = Ned::new(2.0, 0.0, -25.0);
        let on_its_way = Telemetry {
            armed: true,
            at_rest: false,
            stop,
            target: Some(to),
            ..ON_THE_GROUND
        };
        let output = handle(&mut navigation, Input::Telemetry(on_its_way));
        let holds = matches!(
            output[..],
            [
                Transmit::AnnounceIntent { .. },
                Transmit::FlightCommand(FlightCommand::Fly(Setpoint::Hold { .. }))
            ]
        );
        assert_eq!((holds, output.is_empty()), (stops, !stops), "{output:?}");
    }
}

#[test]
fn drone_that_turns_back_brakes_and_announces_the_stop_first() {
    let mut navigation = avoiding();
    let (position, stop) = (Ned::new(20.0, 0.0, -25.0), Ned::new(30.0, 0.0, -25.0));
    let back = Ned::new(-50.0, 0.0, -25.0);
    handle(&mut navigation, Input::Goal(fly_to(back)));
    let on_its_way = Telemetry {
        armed: true,
        at_rest: false,
        position,
        stop,
        target: Some(Ned::new(100.0, 0.0, -25.0)),
        ..ON_THE_GROUND
    };
    let output = handle(&mut navigation, Input::Telemetry(on_its_way));
    let braking = Intent::of(
        Path {
            from: position,
            to: stop,
        },
        0.0,
        true,
    );
    assert_eq!(output[0], announces(braking, true), "it can't give way");
    assert!(matches!(
        output[1..],
        [Transmit::FlightCommand(FlightCommand::Fly(
            Setpoint::Hold { .. }
        ))]
    ));
    let output = handle(&mut navigation, at_rest_at(stop));
    assert_eq!(leg(&output[1..]).0, back);
}

#[test]
fn braking_drone_gets_one_hold() {
    let mut navigation = avoiding();
    let (start, to) = (Ned::new(0.0, 0.0, -25.0), Ned::new(100.0, 0.0, -35.0));
    handle(&mut navigation, Input::Goal(fly_to(to)));
    handle(&mut navigation, at_rest_at(start));
    let ahead = Ned::new(80.0, 0.0, -33.0);
    traffic(&mut navigation, 2, ahead, ahead);
    let braking = |stop, target| {
        Input::Telemetry(Telemetry {
            armed: true,
            at_rest: false,
            stop,
            target,
            ..ON_THE_GROUND
        })
    };
    let first = Ned::new(12.0, 0.0, -26.2);
    let output = handle(&mut navigation, braking(first, Some(to)));
    assert!(
        output.iter().any(|it| matches!(
            it,
            Transmit::FlightCommand(FlightCommand::Fly(Setpoint::Hold { altitude_m, .. }))
                if (*altitude_m - 26.2).abs() < 1e-9
        )),
        "{output:?}"
    );
    // It climbs to that altitude as it brakes, and would come to rest higher by now.
    let higher = Ned::new(12.0, 0.0, -28.0);
    assert_eq!(handle(&mut navigation, braking(higher, None)), []);
}

#[test]
fn drone_without_position_climbs_once_no_drone_is_above() {
    let mut navigation = avoiding();
    let start = Ned::new(0.0, 0.0, -25.0);
    handle(
        &mut navigation,
        Input::Goal(fly_to(Ned::new(100.0, 0.0, -25.0))),
    );
    // Too near to climb past, and not too near to wait.
    let above = Ned::new(0.0, 1.0, -31.0);
    traffic(&mut navigation, 2, above, above);
    let lost = Telemetry {
        armed: true,
        position: start,
        stop: start,
        position_lost_for: Some(Duration::from_secs(2)),
        ..ON_THE_GROUND
    };
    let mut hold = || {
        let output = handle(&mut navigation, Input::Telemetry(lost));
        output.iter().find_map(|it| match it {
            Transmit::FlightCommand(FlightCommand::Fly(Setpoint::Hold { altitude_m, .. })) => {
                Some(*altitude_m)
            }
            _ => None,
        })
    };
    assert_eq!((hold(), hold()), (Some(25.0), None));
    let away = above + Ned::new(50.0, 0.0, 0.0);
    traffic(&mut navigation, 2, away, away);
    let output = handle(&mut navigation, Input::Telemetry(lost));
    assert!(
        output.contains(&Transmit::FlightCommand(FlightCommand::Fly(
            Setpoint::Hold {
                altitude_m: 30.0,
                vertical_mps: 1.5,
                acceleration_mps2: 1.0,
            }
        ))),
        "{output:?}"
    );
}

#[test]
fn restarted_navigation_knows_how_long_others_have_been_silent() {
    // Drone 2 may be coming down on the path. Drone 3, farther away, is heard.
    let (above, far) = (Ned::new(30.0, 0.0, -40.0), Ned::new(200.0, 0.0, -20.0));
    let path = Path::new(Ned::new(0.0, 0.0, -20.0), Ned::new(60.0, 0.0, -20.0));
    let (silent_since, now) = (Timestamp::ZERO, Timestamp::from_secs_f64(5.0));
    let stands = |place| Intent::of(Path::stationary(place), 0.0, false);
    let mut restarted = avoiding_within(None, Some(Checkpoint::default()));
    handle_at(&mut restarted, now, heard(silent_since, 2, stands(above)));
    handle_at(&mut restarted, now, heard(now, 3, stands(far)));
    assert!(!restarted.deconfliction.is_clear(now, path));
}

/// The path of the tracked place of [`MOVING`] while its velocity is valid.
fn tracked_path() -> Path {
    let Goal::Track {
        to, velocity, hold, ..
    } = MOVING
    else {
        panic!("a tracking goal");
    };
    Path::new(to, Ned(to.0 + velocity.0 * hold.as_secs_f64()))
}

#[test]
fn following_drone_announces_its_path_until_the_track_expires() {
    let mut navigation = avoiding();
    let intent = Intent::of(tracked_path(), 0.0, true);
    for immediately in [true, false] {
        let output = handle(&mut navigation, Input::Goal(MOVING));
        assert_eq!(output[0], announces(intent, immediately));
    }
    assert_eq!(
        handle(&mut navigation, Input::ResendIntent),
        [announces(intent, true)],
        "for a restarted radio"
    );
}

#[test]
fn drone_far_from_its_tracked_place_announces_the_way_there_until_it_arrives() {
    let mut navigation = avoiding();
    let start = Ned::new(0.0, 300.0, -25.0);
    handle(&mut navigation, Input::Goal(fly_to(start)));
    handle(&mut navigation, at_rest_at(start));
    let Path {
        from: to,
        to: ahead,
    } = tracked_path();
    let announced = |from, immediately| {
        let intent = Intent::of(Path::new(from, ahead), 0.0, true);
        announces(intent, immediately)
    };
    for immediately in [true, false] {
        let output = handle(&mut navigation, Input::Goal(MOVING));
        assert_eq!(output[0], announced(start, immediately));
    }
    let halfway = Path::new(start, ahead).at(0.5);
    for (time_s, place, from) in [(1, halfway, halfway), (2, ahead, to)] {
        let now = Timestamp::ZERO + Duration::from_secs(time_s);
        handle_at(&mut navigation, now, Input::Goal(MOVING));
        let due = step_at(&mut navigation, now, Stimulus::Timeout);
        assert_eq!(due, [REPORT]);
        let output = handle_at(&mut navigation, now, at_rest_at(place));
        assert_eq!(output, [announced(from, false)]);
    }
    let output = handle(&mut navigation, Input::Goal(MOVING));
    assert_eq!(output[0], announced(to, false));
}

#[test]
fn drone_under_manual_control_withdraws_its_intent() {
    let mut navigation = avoiding();
    let place = Ned::new(0.0, 0.0, -25.0);
    handle(&mut navigation, Input::Goal(fly_to(place)));
    handle(&mut navigation, at_rest_at(place));
    let mut output = handle(&mut navigation, Input::Goal(Goal::Yield));
    output.extend(handle(&mut navigation, at_rest_at(place)));
    let withdrawn = Transmit::AnnounceIntent {
        intent: None,
        immediately: true,
    };
    assert!(output.contains(&withdrawn), "{output:?}");
}

#[test]
fn restarted_navigation_announces_the_leg_in_flight_and_stops_for_right_of_way() {
    let place = |north_m: f64| Ned::new(north_m, 0.0, -25.0);
    let (here, stop, to) = (place(40.0), place(48.0), place(100.0));
    let on_its_way = Telemetry {
        armed: true,
        at_rest: false,
        position: here,
        stop,
        target: Some(to),
        ..ON_THE_GROUND
    };
    let kept = Checkpoint {
        goal: Some(fly_to(to)),
        progress: Progress::Flying([to].into()),
    };
    let mut navigation = avoiding_within(None, Some(kept));
    let start = [
        Transmit::Inform(Notice::Resync),
        Transmit::Resync,
        REPORT,
        announces_path(here, to),
    ];
    let output = handle(&mut navigation, Input::Telemetry(on_its_way));
    assert_eq!(output, start);
    assert_eq!(
        traffic(&mut navigation, 7, place(80.0), place(80.0)),
        [REPORT]
    );
    let output = handle(&mut navigation, Input::Telemetry(on_its_way));
    assert_eq!(
        output[1],
        Transmit::FlightCommand(FlightCommand::Fly(CONFIG.hold(25.0)))
    );
}

fn handle_at(navigation: &mut Navigation, now: Timestamp, input: Input) -> Vec<Transmit> {
    step_at(navigation, now, Stimulus::Input(input))
}

#[test]
fn progress_on_a_leg_is_announced_in_regular_frames() {
    let mut navigation = avoiding();
    let (start, to) = (Ned::new(0.0, 0.0, -25.0), Ned::new(100.0, 0.0, -25.0));
    handle(&mut navigation, Input::Goal(fly_to(to)));
    handle(&mut navigation, at_rest_at(start));
    let later = Timestamp::ZERO + PROGRESS_INTERVAL;
    let Output::Idle { deadline } = navigation.poll_output() else {
        panic!("no output is pending");
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
    let output = handle_at(&mut navigation, later, Input::Telemetry(half_way));
    assert_eq!(output, [announces(Intent::of(path, 0.5, false), false)]);
}
