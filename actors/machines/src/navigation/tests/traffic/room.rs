//! Drones below one that comes down make room.

use super::*;

const HERE: Ned = Ned::new(0.0, 0.0, -12.0);
const ABOVE: Ned = Ned::new(1.0, 0.0, -25.0);

/// Stands at its slot below drone 2.
fn standing() -> Navigation {
    standing_within(None)
}

/// The same, within a fence.
fn standing_within(fence: Option<Fence>) -> Navigation {
    let mut navigation = avoiding_within(fence, None);
    handle(&mut navigation, Input::Goal(fly_to(HERE)));
    traffic(&mut navigation, 2, ABOVE, ABOVE);
    handle(&mut navigation, at_rest_at(HERE));
    handle(&mut navigation, at_rest_at(HERE));
    navigation
}

fn announces_descent(from: Ned) -> Input {
    let descent = Path::new(from, from.at_altitude(0.0));
    heard(Timestamp::ZERO, 2, Intent::of(descent, 0.0, true))
}

#[test]
fn drone_below_one_that_lands_sidesteps_and_returns() {
    let mut navigation = standing();
    assert_eq!(handle(&mut navigation, announces_descent(ABOVE)), [REPORT]);
    let output = handle(&mut navigation, at_rest_at(HERE));
    let side = leg(&output[1..]).0;
    assert_eq!(output[0], announces_path(HERE, side));
    assert!(side.horizontal_distance_m(ABOVE) > 5.0);
    assert!(side.vertical_distance_m(HERE) < 0.1);
    let waiting = handle(&mut navigation, at_rest_at(side));
    assert_eq!(waiting, [announces_path(side, side)], "until it has landed");
    handle(&mut navigation, announces_descent(ABOVE.at_altitude(0.0)));
    let output = handle(&mut navigation, at_rest_at(side));
    assert_eq!(leg(&output[1..]).0, HERE);
    let output = handle(&mut navigation, at_rest_at(HERE));
    let arrives = |it: &Transmit| matches!(it, Transmit::Inform(Notice::Arrived(_)));
    assert!(output.iter().any(arrives));
}

#[test]
fn drone_below_one_that_falls_silent_sidesteps() {
    let mut navigation = standing();
    let mut now = Timestamp::ZERO;
    // Farther away, so that silence is no matter of distance.
    let far = Ned::new(60.0, 0.0, -12.0);
    loop {
        now += PROGRESS_INTERVAL;
        assert!(now < Timestamp::ZERO + Duration::from_secs(5));
        let stands = Intent::of(Path::stationary(far), 0.0, false);
        handle_at(&mut navigation, now, heard(now, 3, stands));
        assert_eq!(step_at(&mut navigation, now, Stimulus::Timeout), [REPORT]);
        let output = handle_at(&mut navigation, now, at_rest_at(HERE));
        if now <= Timestamp::ZERO + Duration::from_secs(3) {
            assert_eq!(output, [], "it may still be heard");
        } else {
            assert!(leg(&output[1..]).0.horizontal_distance_m(ABOVE) > 5.0);
            break;
        }
    }
}

#[test]
fn drone_makes_room_only_within_its_fence() {
    for (radius_m, is_wide) in [(11.0, false), (15.0, true)] {
        let mut navigation = standing_within(Some(Fence::cylinder(radius_m, 120.0)));
        handle(&mut navigation, announces_descent(ABOVE));
        let output = handle(&mut navigation, at_rest_at(HERE));
        assert_eq!(output.is_empty(), !is_wide, "{radius_m} m: {output:?}");
    }
}

#[test]
fn drone_stays_below_one_that_only_stands() {
    let mut navigation = standing();
    traffic(&mut navigation, 2, ABOVE, ABOVE + Ned::new(1.0, 0.0, 0.0));
    assert_eq!(handle(&mut navigation, at_rest_at(HERE)), []);
}

#[test]
fn drone_on_the_ground_does_not_sidestep() {
    let mut navigation = avoiding();
    let ground = HERE.at_altitude(0.0);
    handle(&mut navigation, Input::Goal(fly_to(HERE)));
    traffic(&mut navigation, 2, HERE, HERE);
    handle(&mut navigation, at_rest_at(ground));
    handle(&mut navigation, announces_descent(ABOVE));
    let output = handle(&mut navigation, at_rest_at(ground));
    let sidesteps = |it: &Transmit| match it {
        Transmit::FlightCommand(FlightCommand::Fly(Setpoint::Leg { to, .. })) => {
            to.horizontal_distance_m(ground) > 1.0
        }
        _ => false,
    };
    assert!(!output.iter().any(sidesteps), "{output:?}");
}
