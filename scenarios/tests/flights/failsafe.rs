//! Drones that can't go on come down safely, each by itself, and the others fly on.

use muster_scenarios::engine::Engine;
use muster_scenarios::report::Report;

use crate::support::{fly, scenario};

/// A shipped scenario, flown alike on both engines without breaking a rule.
fn flown(name: &str, fields: &[&str]) -> Report {
    let scenario = scenario(name, fields);
    let report = fly(&scenario, Engine::Events);
    assert_eq!(report.violations, [], "{name}, {fields:?}");
    let actors = fly(&scenario, Engine::Actors);
    assert_eq!(actors.trace, report.trace, "{name}, {fields:?}");
    report
}

fn reasons(report: &Report) -> Vec<Option<&str>> {
    let reason = |drone: &muster_scenarios::report::DroneReport| drone.landed_because.is_some();
    assert!(
        report
            .drones
            .iter()
            .all(|it| reason(it) || it.state == "finished" || it.state.starts_with("killed"))
    );
    let reasons = report.drones.iter().map(|it| it.landed_because);
    reasons.collect()
}

const LOW: Option<&str> = Some("its battery was low");
const CRITICAL: Option<&str> = Some("its battery was all but empty");

#[test]
fn a_drone_that_hears_of_nobody_else_goes_to_land_or_flies_on() {
    let report = flown("failsafe-alone.toml", &[]);
    let alone = &report.drones[0];
    assert_eq!(alone.landed_because, Some("it heard of no other drone"));
    assert_eq!(alone.state, "finished");
    assert!(!report.mission_completed);
    let report = flown("failsafe-alone.toml", &["failsafe.alone=carry-on"]);
    assert_eq!(report.drones[0].landed_because, None);
    assert!(report.mission_completed);
}
