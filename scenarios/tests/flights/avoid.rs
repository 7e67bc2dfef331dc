//! Drones that say where they are and go, and give way to each other.

use muster_scenarios::engine::Engine;
use muster_scenarios::report::Report;

use crate::support::{fly, scenario};

fn flown(name: &str, avoid: bool) -> Report {
    let avoid = format!("safety.avoid={avoid}");
    fly(&scenario(name, &[&avoid]), Engine::Events)
}

#[test]
fn whoever_is_behind_one_that_does_not_go_waits_for_it() {
    let scenario = scenario("give-way.toml", &[]);
    let report = fly(&scenario, Engine::Events);
    assert_eq!(report.violations, []);
    assert!(report.mission_completed);
    assert_eq!(fly(&scenario, Engine::Actors).trace, report.trace);
    let heedless = flown("give-way.toml", false);
    assert_eq!(heedless.violations[0].rule, 4, "the others fly through it");
}

#[test]
fn what_gave_way_to_nobody_broke_the_rule() {
    let heedless = flown("found/several-lost-at-once.toml", false);
    assert_eq!(heedless.violations[0].rule, 4);
}

#[test]
fn where_nothing_goes_wrong_giving_way_takes_no_time_and_few_frames() {
    for name in [
        "thesis-1.toml",
        "thesis-2.toml",
        "thesis-3.toml",
        "thesis-4.toml",
        "thesis-5.toml",
        "ancestor.toml",
        "barrier-line.toml",
        "barrier-mesh.toml",
        "shake-up.toml",
        "southbound.toml",
        "split-up-3.toml",
    ] {
        let [without, with] = [false, true].map(|avoid| flown(name, avoid));
        assert_eq!(with.violations, [], "{name}");
        let longer = with.simulated_s / without.simulated_s;
        assert!(longer < 1.02, "{name}: {longer} times as long");
        let sent =
            |report: &Report| -> u64 { report.drones.iter().map(|it| it.messages_sent).sum() };
        let more = sent(&with).saturating_sub(sent(&without)) / with.drones.len() as u64;
        assert!(more < 150, "{name}: {more} frames more a drone");
    }
}
