//! Changes of formation in flight, through altitude layers.

use muster_scenarios::engine::Engine;
use muster_scenarios::report::Report;

use crate::support::{Sweep, fly, scenario};

fn assert_changed(report: &Report, what: &str) {
    assert_eq!(report.violations, [], "{what}");
    assert!(report.mission_completed, "{what}");
    assert_eq!(report.changes_made(), report.changes.len(), "{what}");
    for drone in &report.drones {
        assert_eq!(drone.state, "finished", "{what}");
        assert_eq!(drone.landed_because, None, "{what}, drone {}", drone.id);
    }
}

#[test]
fn nine_drones_change_between_all_pairs_of_formations() {
    let scenario = scenario("shake-up.toml", &[]);
    let formations = std::iter::once(&*scenario.plan.layout)
        .chain(scenario.plan.changes.iter().map(|change| change.layout()))
        .map(|layout| layout.formation().kind().name());
    let formations: Vec<_> = formations.collect();
    let mut pairs: Vec<_> = formations
        .windows(2)
        .map(|pair| (pair[0], pair[1]))
        .collect();
    pairs.sort_unstable();
    pairs.dedup();
    assert_eq!(pairs.len(), 42, "seven formations to six others each");
    let actors = fly(&scenario, Engine::Actors);
    assert_eq!(actors.changes.len(), 42);
    assert_changed(&actors, "shake-up");
    assert_eq!(actors.trace, fly(&scenario, Engine::Events).trace);
}

#[test]
fn frame_loss_delays_changes_but_keeps_separation() {
    for seed in 0..5 {
        let fields = ["radio.loss=0.3", &format!("seed={seed}")];
        let report = fly(&scenario("shake-up.toml", &fields), Engine::Events);
        assert_changed(&report, &format!("seed {seed}"));
    }
}

const CHANGES: &str = r#"changes=[
    { waypoint = 0, kind = "circular", spacing_m = 60 }, { waypoint = 2, kind = "split-up", clusters = 3 },
    { waypoint = 2, kind = "compact-matrix", heading_deg = 30 }, { waypoint = 7, kind = "random", seed = 5 },
]"#;

#[test]
fn changes_take_place_at_their_waypoints_for_any_swarm_size() {
    let mut sweep = Sweep::default();
    for drones in [4, 9, 16, 30] {
        for policy in sweep.of(["flood", "tree"]) {
            let fields = [
                &*format!("formation.drones={drones}"),
                &*format!("protocol.policy={policy}"),
                "protocol.liveness=heartbeat",
                "formation.spacing_m=40",
                "limits.altitude_max_m=400",
                "formation.kind=compact-mesh",
                CHANGES,
            ];
            let report = fly(&scenario("thesis-1.toml", &fields), Engine::Events);
            let what = format!("{drones} drones, {policy}");
            assert_changed(&report, &what);
            let at: Vec<_> = report.changes.iter().map(|it| it.waypoint).collect();
            assert_eq!(at, [0, 2, 2, 7], "{what}");
            assert_eq!(report.barriers.len(), 8, "{what}");
        }
    }
}

#[test]
fn change_completes_if_an_actor_crashes_during_it() {
    let mut sweep = Sweep::default();
    for actor in ["radio", "routing", "mission", "navigation", "msp"] {
        for drone in [0, 4] {
            // The third change lasts from 148 to 182 s.
            for at_s in sweep.of([150, 160, 172]) {
                let fault = format!(
                    "faults=[{{ at_s = {at_s}, kind = \"crash-actor\", drone = {drone}, actor = \"{actor}\" }}]"
                );
                let report = fly(&scenario("shake-up.toml", &[&fault]), Engine::Events);
                assert_changed(&report, &fault);
            }
        }
    }
}

#[test]
fn routes_broken_by_a_change_are_replaced() {
    // All drones are in range of each other until the change to a line.
    let change = r#"changes=[{ waypoint = 1, kind = "linear" }]"#;
    let fields = [
        change,
        "formation.kind=compact-mesh",
        "formation.drones=4",
        "mission.file=missions/field.waypoints",
        "protocol.liveness=heartbeat",
    ];
    for seed in 1..4 {
        let seed = format!("seed={seed}");
        let fields: Vec<&str> = fields.iter().copied().chain([&*seed]).collect();
        let report = fly(&scenario("thesis-1.toml", &fields), Engine::Events);
        assert_changed(&report, &seed);
    }
}

#[test]
fn swarm_changes_formation_before_following_its_master() {
    let changes = r#"changes=[{ waypoint = 0, kind = "regular-matrix", spacing_m = 140 }]"#;
    let report = fly(&scenario("follow.toml", &[changes]), Engine::Events);
    assert_changed(&report, changes);
    assert!(report.following.unwrap().p95_m <= 2.0);
}
