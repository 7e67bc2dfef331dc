//! Runs that would never end: a mission does not take over from a silent master and repeats the same deadline.

use muster_machines::flaw::{Flaw, plant};
use muster_scenarios::engine::Engine;
use muster_scenarios::report::Report;
use muster_scenarios::scenario::Scenario;

use crate::support::{fly, scenario};

/// The master is killed, so a neighbour must take over. A small mailbox limit allows few steps at one instant.
fn with_killed_master(more: &[&str]) -> Scenario {
    let short = ["protocol.policy=flood", "limits.waiting_max=8"];
    scenario("kill-at-waypoint.toml", &[&short, more].concat())
}

fn run_with_flaw(scenario: &Scenario) -> Report {
    let _planted = plant(Flaw::SetsPastDeadline);
    let [actors, events] = [Engine::Actors, Engine::Events].map(|engine| fly(scenario, engine));
    assert_eq!(actors.trace, events.trace);
    assert_eq!(actors.violations, events.violations);
    events
}

fn assert_breaks_rule_10(report: &Report, expected: &str) {
    let [found] = &report.violations[..] else {
        panic!("{:?}", report.violations);
    };
    assert_eq!((found.rule, &found.drones[..]), (10, &[4][..]), "{found:?}");
    assert!(found.what.contains(expected), "{found:?}");
    assert!(found.what.contains("mission actor"), "{found:?}");
}

#[test]
fn deadline_in_the_past_breaks_rule_10_on_both_engines() {
    let report = run_with_flaw(&with_killed_master(&[]));
    assert_breaks_rule_10(&report, "its next deadline is not after it");
}

#[test]
fn unchecked_run_stops_at_the_limit_of_steps_per_instant() {
    let mut unchecked = with_killed_master(&[]);
    unchecked.unchecked = true;
    let report = run_with_flaw(&unchecked);
    assert_breaks_rule_10(&report, "steps at one instant");
    assert!(!report.are_missions_completed());
}
