use super::*;
use crate::geometry::{Ned, Velocity};
use crate::navigation::{Area, Zone};

fn failsafe() -> Failsafe {
    Failsafe {
        position_hold: Duration::from_secs(10),
        battery_low: 0.2,
        battery_critical: 0.1,
        fence: Some(Arc::new(Fence::cylinder(100.0, 50.0))),
    }
}

const SPEED_MPS: f64 = 10.0;

const FLYING: Telemetry = Telemetry {
    position: Ned::new(0.0, 0.0, -20.0),
    position_lost_for: None,
    velocity: Velocity::ZERO,
    stop: Ned::new(0.0, 0.0, -20.0),
    at_rest: true,
    armed: true,
    landing: false,
    target: None,
    charge: 1.0,
};

fn at(seconds: f64) -> Timestamp {
    Timestamp::from_secs_f64(seconds)
}

fn judge(watch: &mut Watch, at_s: f64, telemetry: Telemetry) -> Findings {
    watch.judge(at(at_s), &telemetry, &failsafe(), (false, SPEED_MPS))
}

fn charged(charge: f64) -> Telemetry {
    Telemetry { charge, ..FLYING }
}

fn lost_for(seconds: f64) -> Telemetry {
    Telemetry {
        position_lost_for: Some(Duration::from_secs_f64(seconds)),
        ..FLYING
    }
}

fn stops_at(north_m: f64, altitude_m: f64) -> Telemetry {
    Telemetry {
        stop: Ned::new(north_m, 0.0, -altitude_m),
        ..FLYING
    }
}

#[test]
fn a_battery_is_low_and_then_critical_each_told_once_and_again_if_asked() {
    let mut watch = Watch::default();
    for (charge, failures) in [
        (0.3, vec![]),
        (0.2, vec![Failure::BatteryLow]),
        (0.15, vec![]),
        (0.1, vec![Failure::BatteryCritical]),
        (0.05, vec![]),
    ] {
        assert_eq!(judge(&mut watch, 0.0, charged(charge)).failures, failures);
    }
    watch.tell_again();
    let again = judge(&mut watch, 0.0, charged(0.05)).failures;
    assert_eq!(again, [Failure::BatteryCritical]);
}

#[test]
fn a_position_may_be_missing_for_a_second() {
    let mut watch = Watch::default();
    let verdict = judge(&mut watch, 50.0, lost_for(0.0));
    assert_eq!(verdict, Findings::default());
    assert_eq!(watch.next_look(), Some(at(51.0)));
    assert_eq!(judge(&mut watch, 51.0, lost_for(1.0)), Findings::default());
    assert!(watch.is_lost());
    assert_eq!(watch.next_look(), Some(at(61.0)));
    judge(&mut watch, 55.0, lost_for(5.0));
    assert!(watch.is_lost());
    let lands = judge(&mut watch, 61.0, lost_for(11.0));
    assert_eq!(lands.failures, [Failure::PositionLost]);
}

#[test]
fn a_position_that_comes_back_lets_the_drone_go_on() {
    let mut watch = Watch::default();
    judge(&mut watch, 51.0, lost_for(1.0));
    assert!(watch.is_lost());
    assert!(judge(&mut watch, 53.0, FLYING).is_found);
    assert!(!watch.is_lost());
    assert!(!judge(&mut watch, 54.0, FLYING).is_found, "once");
}

#[test]
fn a_drone_is_stopped_before_it_would_come_to_rest_beyond_its_fence() {
    let mut watch = Watch::default();
    // 2 m is what its resting place moves between two looks.
    for (inside, beyond) in [
        (stops_at(97.9, 20.0), stops_at(98.1, 20.0)),
        (stops_at(0.0, 47.9), stops_at(0.0, 48.1)),
        (stops_at(-97.9, 47.9), stops_at(-98.1, 47.9)),
    ] {
        assert_eq!(judge(&mut watch, 0.0, inside).failures, []);
        let breach = judge(&mut watch, 0.0, beyond).failures;
        assert_eq!(breach, [Failure::Geofence]);
        assert_eq!(judge(&mut watch, 0.0, beyond).failures, [], "once");
        assert_eq!(judge(&mut watch, 0.0, inside).failures, []);
        assert_eq!(judge(&mut watch, 0.0, beyond).failures.len(), 1, "again");
    }
}

#[test]
fn going_farther_out_is_another_breach() {
    let mut watch = Watch::default();
    judge(&mut watch, 0.0, stops_at(98.1, 20.0));
    assert_eq!(judge(&mut watch, 0.1, stops_at(98.3, 20.0)).failures, []);
    let farther = judge(&mut watch, 0.2, stops_at(99.0, 20.0)).failures;
    assert_eq!(farther, [Failure::Geofence]);
}

#[test]
fn the_farther_from_its_fence_the_rarer_a_drone_is_looked_at() {
    let mut watch = Watch::default();
    judge(&mut watch, 0.0, stops_at(98.0, 20.0));
    assert_eq!(watch.next_look(), Some(at(0.1)));
    judge(&mut watch, 0.0, stops_at(58.0, 20.0));
    assert_eq!(watch.next_look(), Some(at(1.4)), "28 m below it, at 20 m/s");
}

#[test]
fn on_the_ground_and_on_the_way_down_only_the_battery_counts() {
    for (armed, landing) in [(false, false), (true, true)] {
        let telemetry = Telemetry {
            armed,
            landing,
            charge: 0.05,
            ..lost_for(100.0)
        };
        let mut watch = Watch::default();
        let verdict = judge(&mut watch, 0.0, telemetry);
        assert_eq!(verdict.failures, [Failure::BatteryCritical]);
        assert!(!watch.is_lost());
        assert_eq!(watch.next_look(), None);
    }
}

#[test]
fn whoever_waits_on_the_ground_to_take_off_fails_without_a_position_too() {
    let on_the_ground = |seconds| Telemetry {
        armed: false,
        ..lost_for(seconds)
    };
    for takes_off in [false, true] {
        let mut watch = Watch::default();
        let fit_for = (takes_off, SPEED_MPS);
        watch.judge(at(51.0), &on_the_ground(1.0), &failsafe(), fit_for);
        assert_eq!(watch.next_look().is_some(), takes_off);
        let verdict = watch.judge(at(61.0), &on_the_ground(11.0), &failsafe(), fit_for);
        assert_eq!(verdict.failures.contains(&Failure::PositionLost), takes_off);
    }
}

#[test]
fn a_drone_is_stopped_before_an_area_to_stay_out_of_however_far_behind_it_it_would_come_to_rest() {
    let fallen_tree = Zone {
        area: Area::Circle {
            centre: Ned::new(40.0, 0.0, 0.0),
            radius_m: 1.0,
        },
        is_inclusion: false,
    };
    let failsafe = Failsafe {
        fence: Some(Arc::new(Fence::new(vec![fallen_tree], 50.0))),
        ..failsafe()
    };
    let mut watch = Watch::default();
    let mut judge = |from_m: f64, to_m: f64| {
        let telemetry = Telemetry {
            position: Ned::new(from_m, 0.0, -20.0),
            ..stops_at(to_m, 20.0)
        };
        let verdict = watch.judge(at(0.0), &telemetry, &failsafe, (false, SPEED_MPS));
        verdict.failures
    };
    assert_eq!(judge(0.0, 36.9), []);
    assert_eq!(judge(1.0, 80.0), [Failure::Geofence]);
    assert_eq!(judge(50.0, 80.0), [], "behind it");
}
