//! Deconfliction of a drone that follows a master.

use super::*;
use crate::identity::NodeSet;

const COMPANION: u32 = 2;
const FAR_AWAY: u32 = 3;

fn second(seconds: f64) -> Timestamp {
    Timestamp::from_secs_f64(seconds)
}

/// Above a place 15 m ahead of [`MOVING`], where that is after 1.5 s.
fn above_ahead() -> Ned {
    Ned::new(15.0, 0.0, -20.0)
}

fn stands_at(place: Ned) -> Intent {
    Intent::of(Path::stationary(place), 0.0, false)
}

/// A drone that follows, having heard what a companion ahead announced, and another one far away.
fn following(companion: Intent) -> Navigation {
    let mut navigation = avoiding_others(true, None, None);
    handle(&mut navigation, Input::Goal(MOVING));
    hear(&mut navigation, 0.0, COMPANION, companion);
    hear_far_away(&mut navigation, 0.0);
    navigation
}

fn hear(navigation: &mut Navigation, time_s: f64, id: u32, intent: Intent) {
    let at = second(time_s);
    handle_at(navigation, at, heard(at, id, intent));
}

fn hear_far_away(navigation: &mut Navigation, time_s: f64) {
    let far = Ned::new(0.0, 200.0, -20.0);
    hear(navigation, time_s, FAR_AWAY, stands_at(far));
}

/// The setpoint that a drone in flight at home gets with its next goal.
fn next_setpoint(navigation: &mut Navigation, time_s: f64) -> Option<Setpoint> {
    let flying = Telemetry {
        armed: true,
        at_rest: false,
        stop: Ned::new(5.0, 0.0, 0.0),
        ..ON_THE_GROUND
    };
    let mut output = handle_at(navigation, second(time_s), Input::Goal(MOVING));
    output.extend(handle_at(
        navigation,
        second(time_s),
        Input::Telemetry(flying),
    ));
    output.into_iter().rev().find_map(|it| match it {
        Transmit::FlightCommand(FlightCommand::Fly(setpoint)) => Some(setpoint),
        _ => None,
    })
}

/// Whether a drone in flight at home is told to follow with its next goal, and not to hold.
fn goes_on(navigation: &mut Navigation, time_s: f64) -> bool {
    match next_setpoint(navigation, time_s) {
        Some(Setpoint::Track { .. }) => true,
        Some(hold) => {
            assert_eq!(hold, CONFIG.hold(10.0));
            false
        }
        None => panic!("no setpoint at {time_s} s"),
    }
}

#[test]
fn follower_stops_before_a_companion_that_falls_silent_until_that_is_down_or_heard() {
    let mut navigation = following(stands_at(above_ahead()));
    assert!(goes_on(&mut navigation, 2.9), "it is heard");
    hear_far_away(&mut navigation, 3.1);
    assert!(!goes_on(&mut navigation, 3.2), "it may come down");
    hear(&mut navigation, 4.0, COMPANION, stands_at(above_ahead()));
    assert!(goes_on(&mut navigation, 4.1), "it is heard again");
    hear_far_away(&mut navigation, 7.5);
    assert!(!goes_on(&mut navigation, 7.6));
    // From 20 m at 1.5 m/s, after 5 s without a command.
    hear_far_away(&mut navigation, 40.0);
    assert!(goes_on(&mut navigation, 40.1), "it is on the ground");
}

#[test]
fn follower_stops_before_a_companion_that_lands() {
    let column = Path::new(above_ahead(), above_ahead().at_altitude(0.0));
    let mut navigation = following(Intent::of(column, 0.0, true));
    assert!(!goes_on(&mut navigation, 0.1));
}

#[test]
fn follower_stops_before_a_companion_that_may_not_hear_it_only_if_that_has_stopped() {
    let deaf: NodeSet = [NodeId(COMPANION)].into_iter().collect();
    let level = Ned::new(15.0, 0.0, 0.0);
    let ahead = Path::new(level, Ned::new(25.0, 0.0, 0.0));
    let mut navigation = following(Intent::of(ahead, 0.0, true));
    handle(&mut navigation, Input::Deaf(deaf));
    assert!(goes_on(&mut navigation, 0.1), "it follows, too");
    hear(&mut navigation, 0.2, COMPANION, stands_at(above_ahead()));
    assert!(!goes_on(&mut navigation, 0.3));
}

#[test]
fn follower_with_nobody_as_far_away_in_reach_takes_a_silent_companion_for_one_out_of_range() {
    let mut navigation = following(stands_at(above_ahead()));
    assert!(goes_on(&mut navigation, 3.2));
}

#[test]
fn follower_that_left_its_place_announces_its_way_and_that_it_stands() {
    let mut navigation = following(stands_at(above_ahead()));
    hear_far_away(&mut navigation, 3.1);
    assert!(!goes_on(&mut navigation, 3.2));
    let away = Ned::new(5.0, 0.0, -10.0);
    let halfway = Telemetry {
        armed: true,
        at_rest: false,
        position: Ned::new(2.5, 0.0, -5.0),
        stop: away,
        ..ON_THE_GROUND
    };
    let output = handle_at(&mut navigation, second(4.3), Input::Telemetry(halfway));
    let way = Path::new(Ned::HOME, away);
    assert_eq!(output, [announces(Intent::of(way, 0.5, false), false)]);
    let output = handle_at(&mut navigation, second(5.3), at_rest_at(away));
    assert_eq!(output, [announces_path(away, away)]);
    let again = handle_at(&mut navigation, second(5.4), at_rest_at(away));
    assert_eq!(again, []);
}
