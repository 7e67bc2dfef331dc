//! When and where a drone comes down among others.

use super::*;

const LANDING: Ned = Ned::new(0.0, 0.0, -25.0);
const BELOW: Ned = Ned::new(0.0, 1.0, -10.0);

/// A drone that waits to land at [`LANDING`] above drone 2 at [`BELOW`].
fn waiting_to_land() -> Navigation {
    let mut navigation = avoiding();
    traffic(&mut navigation, 2, BELOW, BELOW);
    handle(&mut navigation, Input::Goal(Goal::Land));
    let output = handle(&mut navigation, at_rest_at(LANDING));
    assert!(!lands(&output));
    navigation
}

/// At rest at `place`, without a position for these seconds.
fn without_position(place: Ned, seconds: u64) -> Input {
    let Input::Telemetry(at_rest) = at_rest_at(place) else {
        panic!("it is telemetry");
    };
    Input::Telemetry(Telemetry {
        position_lost_for: Some(Duration::from_secs(seconds)),
        ..at_rest
    })
}

fn announces_descent(from: Ned) -> Transmit {
    announces(descent(from), true)
}

fn descent(from: Ned) -> Intent {
    Intent::of(Path::new(from, from.at_altitude(0.0)), 0.0, true)
}

fn lands(output: &[Transmit]) -> bool {
    output.contains(&Transmit::FlightCommand(FlightCommand::Land))
}

/// Drone 2 is still at [`BELOW`].
fn still_below(navigation: &mut Navigation, now: Timestamp) {
    let path = Path {
        from: BELOW,
        to: BELOW,
    };
    handle_at(navigation, now, heard(now, 2, Intent::of(path, 0.0, false)));
}

#[test]
fn drone_lands_once_the_column_below_is_clear() {
    let mut navigation = waiting_to_land();
    let far = Ned::new(0.0, 90.0, -10.0);
    traffic(&mut navigation, 2, BELOW, far);
    traffic(&mut navigation, 2, far, far);
    assert!(lands(&handle(&mut navigation, at_rest_at(LANDING))));
}

#[test]
fn drone_lands_beside_traffic_that_stays_below() {
    let mut navigation = waiting_to_land();
    let detour_at = Timestamp::ZERO + DETOUR_AFTER;
    still_below(&mut navigation, detour_at);
    let output = handle_at(&mut navigation, detour_at, at_rest_at(LANDING));
    let side = leg(&output[1..]).0;
    assert!(side.horizontal_distance_m(LANDING) > 10.0);
    let output = handle_at(&mut navigation, detour_at, at_rest_at(side));
    assert!(lands(&output));
}

#[test]
fn drone_does_not_land_beside_traffic_that_passes_below() {
    let mut navigation = waiting_to_land();
    let far = Ned::new(0.0, 90.0, -10.0);
    let passing = Intent::of(Path::new(BELOW, far), 0.0, false);
    let due = Timestamp::ZERO + DETOUR_AFTER;
    handle_at(&mut navigation, due, heard(due, 2, passing));
    let output = handle_at(&mut navigation, due, at_rest_at(LANDING));
    assert!(!lands(&output));
    assert!(
        output.contains(&announces_descent(LANDING)),
        "those below may stop: {output:?}"
    );
}

#[test]
fn drone_to_land_below_one_that_comes_down_sidesteps_first() {
    let mut navigation = avoiding();
    let above = descent(Ned::new(0.0, 1.0, -40.0));
    handle(&mut navigation, heard(Timestamp::ZERO, 2, above));
    handle(&mut navigation, Input::Goal(Goal::Land));
    let output = handle(&mut navigation, at_rest_at(LANDING));
    let side = leg(&output[1..]).0;
    assert!(side.horizontal_distance_m(LANDING) > 10.0);
    assert!(lands(&handle(&mut navigation, at_rest_at(side))));
}

#[test]
fn drone_lands_after_the_longest_wait() {
    let mut navigation = waiting_to_land();
    let latest = Timestamp::ZERO + LANDING_WAIT_MAX;
    still_below(&mut navigation, latest);
    let output = handle_at(&mut navigation, latest, at_rest_at(LANDING));
    assert!(lands(&output));
}

#[test]
fn drone_without_position_waits_to_land_and_flies_nowhere() {
    let mut navigation = avoiding();
    traffic(&mut navigation, 2, BELOW, BELOW);
    let lost = || without_position(LANDING, 31);
    handle(&mut navigation, lost());
    handle(&mut navigation, Input::Goal(Goal::Land));
    let output = handle(&mut navigation, lost());
    assert!(!lands(&output));
    assert!(
        output.contains(&announces_descent(LANDING)),
        "those below may make room: {output:?}"
    );
    let detour_at = Timestamp::ZERO + DETOUR_AFTER;
    still_below(&mut navigation, detour_at);
    assert_eq!(
        handle_at(&mut navigation, detour_at, lost()),
        [announces(descent(LANDING), false)]
    );
    let latest = Timestamp::ZERO + LANDING_WAIT_MAX;
    still_below(&mut navigation, latest);
    assert!(lands(&handle_at(&mut navigation, latest, lost())));
}

#[test]
fn drone_that_loses_its_position_on_its_way_to_land_announces_its_descent_until_it_is_regained() {
    let mut navigation = avoiding();
    let to = Ned::new(100.0, 0.0, -25.0);
    handle(&mut navigation, Input::Goal(Goal::TransitTo { to }));
    let output = handle(&mut navigation, without_position(LANDING, 2));
    assert!(
        output.contains(&announces_descent(LANDING)),
        "none may land below it: {output:?}"
    );
    let output = handle(&mut navigation, at_rest_at(LANDING));
    assert!(output.contains(&announces_path(LANDING, to)), "{output:?}");
}

#[test]
fn drone_with_critical_battery_waits_until_those_below_could_sidestep_and_stays() {
    let mut navigation = waiting_to_land();
    let Input::Telemetry(charged) = at_rest_at(LANDING) else {
        panic!("it is telemetry");
    };
    let critical = || {
        Input::Telemetry(Telemetry {
            charge: 0.05,
            ..charged
        })
    };
    let output = handle(&mut navigation, critical());
    assert!(!lands(&output));
    assert!(output.contains(&announces_descent(LANDING)), "{output:?}");
    let latest = Timestamp::ZERO + URGENT_LANDING_WAIT_MAX;
    still_below(&mut navigation, latest);
    assert!(lands(&handle_at(&mut navigation, latest, critical())));
}
