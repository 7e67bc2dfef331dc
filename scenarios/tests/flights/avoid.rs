//! Deconfliction: drones report position and destination, and give way.

use muster_scenarios::engine::Engine;
use muster_scenarios::report::Report;

use crate::support::{Sweep, fly, scenario};

fn flown(name: &str, avoid: bool) -> Report {
    let avoid = format!("safety.avoid={avoid}");
    fly(&scenario(name, &[&avoid]), Engine::Events)
}

#[test]
fn drone_behind_a_blocked_drone_waits() {
    let scenario = scenario("give-way.toml", &[]);
    let report = fly(&scenario, Engine::Events);
    assert_eq!(report.violations, []);
    assert!(report.mission_completed);
    assert_eq!(fly(&scenario, Engine::Actors).trace, report.trace);
    let without = flown("give-way.toml", false);
    assert_eq!(
        without.violations[0].rule, 4,
        "the others fly through the blocked drone"
    );
}

#[test]
fn swarm_without_deconfliction_breaks_the_separation_rule() {
    let without = flown("found/lands-below-one-without-position.toml", false);
    assert_eq!(without.violations[0].rule, 4);
}

#[test]
fn deconfliction_without_faults_costs_no_time_and_few_frames() {
    let mut sweep = Sweep::default();
    for name in sweep.of([
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
    ]) {
        let [without, with] = [false, true].map(|avoid| flown(name, avoid));
        assert_eq!(with.violations, [], "{name}");
        let longer = with.simulated_s / without.simulated_s;
        assert!(longer < 1.02, "{name}: {longer} times as long");
        let sent =
            |report: &Report| -> u64 { report.drones.iter().map(|it| it.messages_sent).sum() };
        let more = sent(&with).saturating_sub(sent(&without)) / with.drones.len() as u64;
        assert!(more < 150, "{name}: {more} more frames per drone");
    }
}
