//! Every formation takes off, flies a mission and lands with the required separation.

use muster_scenarios::engine::Engine;
use muster_scenarios::report::Report;
use muster_scenarios::scenario::Scenario;

use crate::support::{Sweep, fly, scenario};

/// Each formation, connected with a radio range of 300 m. The master in the middle of a circle must hear the circle.
const KINDS: [&[&str]; 8] = [
    &["formation.kind=linear"],
    &["formation.kind=circular", "formation.spacing_m=40"],
    &["formation.kind=random"],
    &["formation.kind=split-up", "formation.clusters=2"],
    &["formation.kind=split-up", "formation.clusters=5"],
    &["formation.kind=compact-mesh"],
    &["formation.kind=regular-matrix"],
    &["formation.kind=compact-matrix"],
];

fn with(kind: &[&str], drones: u32, more: &[&str]) -> Scenario {
    let drones = format!("formation.drones={drones}");
    let overrides = [
        &[
            &drones,
            "formation.spacing_m=80",
            "protocol.liveness=heartbeat",
        ],
        kind,
        more,
    ];
    scenario("thesis-1.toml", &overrides.concat())
}

fn assert_flown(report: &Report, what: &str) {
    assert_eq!(report.violations, [], "{what}");
    for drone in &report.drones {
        assert_eq!(drone.state, "finished", "{what}, drone {}", drone.id);
        assert_eq!(drone.landed_because, None, "{what}, drone {}", drone.id);
    }
}

#[test]
fn every_formation_flies_and_lands_without_violation() {
    let mut sweep = Sweep::default();
    for kind in KINDS {
        for drones in sweep.of([6, 9, 14, 21]) {
            let what = format!("{kind:?}, {drones} drones");
            assert_flown(&fly(&with(kind, drones, &[]), Engine::Events), &what);
        }
    }
}

#[test]
fn forty_drones_fly_in_the_densest_formations() {
    let mut sweep = Sweep::default();
    for kind in sweep.of(&KINDS[5..]) {
        let what = format!("{kind:?}, 40 drones");
        assert_flown(&fly(&with(kind, 40, &[]), Engine::Events), &what);
    }
}

#[test]
fn mesh_without_room_for_its_layers_flies_in_waves() {
    let mesh = scenario("mesh-in-waves.toml", &[]);
    assert!(mesh.plan.layout.take_off_waves() > 1);
    assert!(mesh.plan.changes[0].layout().landing_waves() > 1);
    let reports = [Engine::Events, Engine::Actors].map(|engine| fly(&mesh, engine));
    for report in &reports {
        assert_flown(report, "mesh-in-waves");
        assert_eq!(report.elections, []);
    }
    assert_eq!(reports[0].trace, reports[1].trace);
}

/// With the places of seed 83, a wave that landed once left others without a link to the master; with those of seed 102, a
/// drone lost its parent, which flew to land, and elected itself beside neighbours with routes.
#[test]
fn random_places_of_any_seed_hold_no_election_without_a_fault() {
    for seed in ["seed=83", "seed=102"] {
        let set = [
            seed,
            "mission.file=paddock",
            "formation.kind=random",
            "formation.drones=60",
            "formation.spacing_m=50",
            "radio.range_m=100",
            "protocol.policy=tree",
            "limits.altitude_max_m=500",
        ];
        let report = fly(&scenario("thesis-1.toml", &set), Engine::Events);
        assert_flown(&report, seed);
        assert_eq!(report.elections, [], "{seed}");
    }
}

/// Nobody is out of the master's reach for so long that another takes over, whatever way the slots lie.
#[test]
fn swarms_with_a_range_of_about_two_spacings_hold_no_election_without_a_fault() {
    let kinds: [&[&str]; 4] = [
        &["formation.kind=random", "formation.drones=60"],
        &["formation.kind=compact-mesh", "formation.drones=61"],
        &["formation.kind=regular-matrix", "formation.drones=80"],
        &["formation.kind=linear", "formation.drones=40"],
    ];
    let mut sweep = Sweep::default();
    for kind in kinds {
        for ground in sweep.of(["gathered", "line", "grid"]) {
            let ground = format!("formation.ground={ground}");
            let more = [
                "seed=2",
                "changes=[]",
                "formation.spacing_m=50",
                "radio.range_m=102",
                "limits.altitude_max_m=120",
                &ground,
            ];
            let what = format!("{kind:?}, {ground}");
            let flown = scenario("mesh-in-waves.toml", &[kind, &more].concat());
            assert!(flown.verdict().starts_with("OK"), "{}", flown.verdict());
            let report = fly(&flown, Engine::Events);
            assert_flown(&report, &what);
            assert_eq!(report.elections, [], "{what}");
        }
    }
}

/// Runs a swarm in waves with one fault.
fn fly_in_waves(seed: u64, fault: &str) -> Report {
    let (seed, fault) = (format!("seed={seed}"), format!("faults=[{fault}]"));
    let overrides = [
        &*seed,
        &*fault,
        "formation.drones=30",
        "limits.altitude_max_m=47",
        "safety.avoid=true",
    ];
    fly(&scenario("mesh-in-waves.toml", &overrides), Engine::Events)
}

#[test]
fn master_lost_between_waves_leaves_the_later_waves_on_the_ground() {
    let report = fly_in_waves(3, "{ at_s = 12, kind = \"kill\", drone = \"master\" }");
    assert_eq!(report.violations, []);
    let (flew, stayed): (Vec<_>, Vec<_>) =
        (report.drones.iter()).partition(|drone| drone.flight_time_s.is_some());
    assert!(
        !flew.is_empty() && !stayed.is_empty(),
        "{} flew",
        flew.len()
    );
}

#[test]
fn hung_or_restarted_drone_in_any_takeoff_wave_breaks_no_rule() {
    let mut sweep = Sweep::default();
    for (seed, at_s) in (0..).zip([8, 20, 35, 50, 70, 100, 130, 150, 180]) {
        for what in sweep.of([
            "kind = \"hang\", drone = 20, for_s = 4",
            "kind = \"restart\", drone = 25, for_s = 1",
        ]) {
            let report = fly_in_waves(seed, &format!("{{ at_s = {at_s}, {what} }}"));
            assert_eq!(report.violations, [], "{what} at {at_s} s");
        }
    }
}

#[test]
fn swarms_of_one_to_five_drones_fly() {
    let any_number = KINDS.iter().filter(|kind| !kind[0].ends_with("split-up"));
    for kind in any_number {
        for drones in 1..=5 {
            let what = format!("{kind:?}, {drones} drones");
            assert_flown(&fly(&with(kind, drones, &[]), Engine::Events), &what);
        }
    }
}

#[test]
fn drones_in_lines_and_grids_take_off_to_every_formation() {
    let mut sweep = Sweep::default();
    for kind in KINDS {
        for ground in ["line", "grid"] {
            for assignment in sweep.of(["optimal", "greedy"]) {
                let ground = format!("formation.ground={ground}");
                let assignment = format!("formation.assignment={assignment}");
                let standing = with(kind, 14, &[&ground, &assignment]);
                let what = format!("{kind:?}, {ground}, {assignment}");
                assert_flown(&fly(&standing, Engine::Events), &what);
            }
        }
    }
}

#[test]
fn formations_keep_separation_for_any_seed_heading_and_loss() {
    let mut sweep = Sweep::default();
    for (seed, heading) in [(1, 30), (2, 75), (3, -120)] {
        for kind in sweep.of(KINDS) {
            let more = [
                &*format!("seed={seed}"),
                &*format!("formation.heading_deg={heading}"),
                "radio.loss=0.2",
            ];
            let what = format!("{kind:?}, {more:?}");
            let report = fly(&with(kind, 12, &more), Engine::Events);
            assert_eq!(report.violations, [], "{what}");
        }
    }
}

#[test]
fn both_engines_agree_on_all_formations() {
    for kind in KINDS {
        let scenario = with(kind, 8, &["formation.ground=grid"]);
        let actors = fly(&scenario, Engine::Actors);
        let events = fly(&scenario, Engine::Events);
        assert_eq!(actors.trace, events.trace, "{kind:?}");
        assert_flown(&actors, &format!("{kind:?}"));
    }
}

#[test]
fn only_the_master_connects_the_clusters_of_a_split_up_swarm() {
    for clusters in 2..=5 {
        let clusters = format!("formation.clusters={clusters}");
        let kind = ["formation.kind=split-up", &clusters];
        let report = fly(&with(&kind, 17, &[]), Engine::Events);
        assert_flown(&report, &clusters);
        let heads = report.drones.iter().filter(|drone| drone.parent == Some(0));
        assert!(heads.count() >= 2, "{clusters}");
        for drone in report.drones.iter().skip(1) {
            let cluster = |id: u32| {
                (1..)
                    .zip(cluster_bounds(16, &clusters))
                    .find(|(_, ids)| ids.contains(&id))
            };
            let parent = drone.parent.unwrap();
            assert!(
                parent == 0 || cluster(parent) == cluster(drone.id),
                "{clusters}: drone {} has parent {parent} in another cluster",
                drone.id
            );
        }
    }
}

/// The ids of each cluster.
fn cluster_bounds(members: u32, clusters: &str) -> Vec<std::ops::Range<u32>> {
    let count: u32 = clusters.rsplit('=').next().unwrap().parse().unwrap();
    let mut first = 1;
    (0..count)
        .map(|cluster| {
            let ids = first..first + members / count + u32::from(cluster < members % count);
            first = ids.end;
            ids
        })
        .collect()
}
