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
    landing_cause: None,
    target: None,
    charge: 1.0,
};

fn at(seconds: f64) -> Timestamp {
    Timestamp::from_secs_f64(seconds)
}

fn check(monitor: &mut HealthMonitor, at_s: f64, telemetry: Telemetry) -> HealthReport {
    monitor.check(at(at_s), &telemetry, &failsafe(), (false, SPEED_MPS))
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
fn battery_failures_are_reported_once_and_again_after_clearing() {
    let mut monitor = HealthMonitor::default();
    for (charge, failures) in [
        (0.3, vec![]),
        (0.2, vec![Failure::BatteryLow]),
        (0.15, vec![]),
        (0.1, vec![Failure::BatteryCritical]),
        (0.05, vec![]),
    ] {
        assert_eq!(check(&mut monitor, 0.0, charged(charge)).failures, failures);
    }
    monitor.clear_reported();
    let again = check(&mut monitor, 0.0, charged(0.05)).failures;
    assert_eq!(again, [Failure::BatteryCritical]);
}

#[test]
fn lost_position_is_regained_only_once_it_is_known() {
    let mut monitor = HealthMonitor::default();
    check(&mut monitor, 50.0, lost_for(5.0));
    let restarted = check(&mut monitor, 50.1, lost_for(0.1));
    assert!(!restarted.position_regained && monitor.is_position_lost());
    let found = check(&mut monitor, 50.2, FLYING);
    assert!(found.position_regained && !monitor.is_position_lost());
}

#[test]
fn position_may_be_missing_for_one_second() {
    let mut monitor = HealthMonitor::default();
    let report = check(&mut monitor, 50.0, lost_for(0.0));
    assert_eq!(report, HealthReport::default());
    assert_eq!(monitor.next_check(), Some(at(51.0)));
    assert_eq!(
        check(&mut monitor, 51.0, lost_for(1.0)),
        HealthReport::default()
    );
    assert!(monitor.is_position_lost());
    assert_eq!(monitor.next_check(), Some(at(61.0)));
    check(&mut monitor, 55.0, lost_for(5.0));
    assert!(monitor.is_position_lost());
    let lands = check(&mut monitor, 61.0, lost_for(11.0));
    assert_eq!(lands.failures, [Failure::PositionLost]);
}

#[test]
fn regained_position_ends_the_hold() {
    let mut monitor = HealthMonitor::default();
    check(&mut monitor, 51.0, lost_for(1.0));
    assert!(monitor.is_position_lost());
    assert!(check(&mut monitor, 53.0, FLYING).position_regained);
    assert!(!monitor.is_position_lost());
    assert!(!check(&mut monitor, 54.0, FLYING).position_regained, "once");
}

#[test]
fn breach_is_reported_before_the_stop_leaves_the_fence() {
    let mut monitor = HealthMonitor::default();
    // The stopping point moves by up to 2 m between two checks.
    for (inside, beyond) in [
        (stops_at(97.9, 20.0), stops_at(98.1, 20.0)),
        (stops_at(0.0, 47.9), stops_at(0.0, 48.1)),
        (stops_at(-97.9, 47.9), stops_at(-98.1, 47.9)),
    ] {
        assert_eq!(check(&mut monitor, 0.0, inside).failures, []);
        let breach = check(&mut monitor, 0.0, beyond).failures;
        assert_eq!(breach, [Failure::Geofence]);
        assert_eq!(check(&mut monitor, 0.0, beyond).failures, [], "once");
        assert_eq!(check(&mut monitor, 0.0, inside).failures, []);
        assert_eq!(check(&mut monitor, 0.0, beyond).failures.len(), 1, "again");
    }
}

#[test]
fn moving_farther_out_is_another_breach() {
    let mut monitor = HealthMonitor::default();
    check(&mut monitor, 0.0, stops_at(98.1, 20.0));
    assert_eq!(check(&mut monitor, 0.1, stops_at(98.3, 20.0)).failures, []);
    let farther = check(&mut monitor, 0.2, stops_at(99.0, 20.0)).failures;
    assert_eq!(farther, [Failure::Geofence]);
}

#[test]
fn check_interval_grows_with_the_distance_from_the_fence() {
    let mut monitor = HealthMonitor::default();
    check(&mut monitor, 0.0, stops_at(98.0, 20.0));
    assert_eq!(monitor.next_check(), Some(at(0.1)));
    check(&mut monitor, 0.0, stops_at(58.0, 20.0));
    assert_eq!(
        monitor.next_check(),
        Some(at(1.4)),
        "28 m below it, at 20 m/s"
    );
}

#[test]
fn on_the_ground_and_while_landing_only_the_battery_is_checked() {
    for (armed, landing) in [(false, false), (true, true)] {
        let telemetry = Telemetry {
            armed,
            landing,
            charge: 0.05,
            ..lost_for(100.0)
        };
        let mut monitor = HealthMonitor::default();
        let report = check(&mut monitor, 0.0, telemetry);
        assert_eq!(report.failures, [Failure::BatteryCritical]);
        assert!(!monitor.is_position_lost());
        assert_eq!(monitor.next_check(), None);
    }
}

#[test]
fn lost_position_is_reported_on_the_ground_before_take_off() {
    let on_the_ground = |seconds| Telemetry {
        armed: false,
        ..lost_for(seconds)
    };
    for takes_off in [false, true] {
        let mut monitor = HealthMonitor::default();
        let check_for = (takes_off, SPEED_MPS);
        monitor.check(at(51.0), &on_the_ground(1.0), &failsafe(), check_for);
        assert_eq!(monitor.next_check().is_some(), takes_off);
        let report = monitor.check(at(61.0), &on_the_ground(11.0), &failsafe(), check_for);
        assert_eq!(report.failures.contains(&Failure::PositionLost), takes_off);
    }
}

#[test]
fn path_through_an_exclusion_zone_is_a_breach_wherever_it_ends() {
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
    let mut monitor = HealthMonitor::default();
    let mut check = |from_m: f64, to_m: f64| {
        let telemetry = Telemetry {
            position: Ned::new(from_m, 0.0, -20.0),
            ..stops_at(to_m, 20.0)
        };
        let report = monitor.check(at(0.0), &telemetry, &failsafe, (false, SPEED_MPS));
        report.failures
    };
    assert_eq!(check(0.0, 36.9), []);
    assert_eq!(check(1.0, 80.0), [Failure::Geofence]);
    assert_eq!(check(50.0, 80.0), [], "behind the zone");
}
