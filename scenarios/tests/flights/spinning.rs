//! Runs that would never end: a mission that does nothing when it is to take over from a silent master, and asks to be woken
//! for that again.

use muster_machines::flaw::{Flaw, plant};
use muster_scenarios::engine::Engine;
use muster_scenarios::report::Report;
use muster_scenarios::scenario::Scenario;

use crate::support::{fly, scenario};

/// A master is killed, so its neighbour is to take over. Few messages may wait, so few steps are allowed at one instant.
fn with_a_master_that_dies(more: &[&str]) -> Scenario {
    let short = ["protocol.policy=flood", "limits.waiting_max=8"];
    scenario("kill-at-waypoint.toml", &[&short, more].concat())
}

fn spun(scenario: &Scenario) -> Report {
    let _planted = plant(Flaw::DeadlineInThePast);
    let [actors, events] = [Engine::Actors, Engine::Events].map(|engine| fly(scenario, engine));
    assert_eq!(actors.trace, events.trace);
    assert_eq!(actors.violations, events.violations);
    events
}

fn assert_breaks_rule_10(report: &Report, says: &str) {
    let [found] = &report.violations[..] else {
        panic!("{:?}", report.violations);
    };
    assert_eq!((found.rule, &found.drones[..]), (10, &[4][..]), "{found:?}");
    assert!(found.what.contains(says), "{found:?}");
    assert!(found.what.contains("mission actor"), "{found:?}");
}

#[test]
fn a_deadline_that_stays_in_the_past_breaks_rule_10_on_both_engines() {
    let report = spun(&with_a_master_that_dies(&[]));
    assert_breaks_rule_10(&report, "has a deadline that is not after it");
}

#[test]
fn an_unchecked_run_ends_at_the_bound_on_steps_at_one_instant() {
    let unchecked = Scenario {
        unchecked: true,
        ..with_a_master_that_dies(&[])
    };
    let report = spun(&unchecked);
    assert_breaks_rule_10(&report, "steps at one instant");
    assert!(!report.are_missions_completed());
}

#[test]
fn a_drone_whose_clock_is_skewed_is_judged_by_its_own_clock() {
    for ppm in [-50_000, 50_000] {
        let skews = (0..7).map(|drone| format!("{{ at_s = 0, skew = {drone}, ppm = {ppm} }}"));
        let faults = format!("faults=[{}]", skews.collect::<Vec<_>>().join(", "));
        let skewed = scenario("kill-at-waypoint.toml", &["protocol.policy=flood", &faults]);
        for engine in [Engine::Actors, Engine::Events] {
            assert_eq!(fly(&skewed, engine).violations, [], "{ppm}");
        }
    }
}
