//! Randomly drawn scenarios break no rule.

use muster_machines::identity::NodeId;
use muster_machines::node::Address;
use muster_machines::time::Timestamp;
use muster_scenarios::engine::Engine;
use muster_scenarios::scenario::{DroneFault, Fault, FaultKind, Scenario, Target};
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::support::{Sweep, fly, scenario};

const KINDS: [&str; 7] = [
    "linear",
    "circular",
    "random",
    "split-up",
    "compact-mesh",
    "regular-matrix",
    "compact-matrix",
];

/// Draws a scenario: formation, size, heading, mission, radio, protocol and actor crashes.
fn draw_scenario(draw: u64) -> Scenario {
    let mut rng = ChaCha8Rng::seed_from_u64(draw);
    let mut pick = |choices: &[&str]| (*choices.choose(&mut rng).unwrap()).to_owned();
    let kind = pick(&KINDS);
    let fields = [
        format!("formation.kind={kind}"),
        format!("formation.spacing_m={}", pick(&["20", "40", "80", "160"])),
        format!(
            "mission.file=missions/{}",
            pick(&["albufera.plan", "river.waypoints"])
        ),
        format!("radio.loss={}", pick(&["0", "0", "0.1", "0.2", "0.3"])),
        format!("radio.medium={}", pick(&["ideal", "csma"])),
        format!("protocol.policy={}", pick(&["flood", "tree"])),
        format!("protocol.liveness={}", pick(&["heartbeat", "thesis"])),
    ];
    let min_drones = if kind == "split-up" { 6 } else { 1 };
    let drones = rng.random_range(min_drones..14);
    let numbers = [
        format!("formation.drones={drones}"),
        format!("formation.heading_deg={}", rng.random_range(-90..=90)),
        format!("seed={draw}"),
    ];
    let overrides: Vec<&str> = fields.iter().chain(&numbers).map(String::as_str).collect();
    let mut scenario = scenario("thesis-1.toml", &overrides);
    scenario.faults = (0..rng.random_range(0..4))
        .map(|_| {
            let at = Timestamp::from_secs_f64(rng.random_range(0.0..400.0));
            let drone = Target::Drone(NodeId(rng.random_range(0..drones)));
            let actor = *Address::ALL.choose(&mut rng).unwrap();
            Fault::at(at, FaultKind::Drone(drone, DroneFault::CrashActor(actor)))
        })
        .collect();
    scenario
}

#[test]
fn drawn_scenarios_break_no_rule_and_both_engines_agree() {
    let mut sweep = Sweep::default();
    for draw in sweep.of(0..40) {
        let scenario = draw_scenario(draw);
        let report = fly(&scenario, Engine::Events);
        assert_eq!(report.violations, [], "draw {draw}: {scenario:?}");
        assert!(report.mission_completed, "draw {draw}: {scenario:?}");
        if draw % 4 == 0 {
            let actors = fly(&scenario, Engine::Actors);
            assert_eq!(actors.trace, report.trace, "draw {draw}: {scenario:?}");
        }
    }
}
