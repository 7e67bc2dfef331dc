//! What must hold in the scenarios that are shipped to show that it does.

use muster_scenarios::engine::Engine;
use muster_scenarios::report::Report;

use crate::support::{assert_finished, fly, masters, scenario};

fn flown(name: &str) -> Report {
    let report = fly(&scenario(&format!("{name}.toml"), &[]), Engine::Events);
    assert_eq!(report.violations, [], "{name}");
    report
}

/// Whoever lives has flown all there was to fly, and landed because it was over.
fn assert_flown(name: &str, report: &Report, lost: &[u32]) {
    assert!(report.mission_completed, "{name}: not flown to its end");
    assert_finished(report, lost, name);
}

#[test]
fn a_master_killed_on_the_ground_leaves_its_swarm_there() {
    let report = flown("kill-on-ground");
    for drone in &report.drones {
        assert_eq!(drone.flight_time_s, None, "{drone:?}");
    }
}

#[test]
fn a_master_killed_in_the_air_is_replaced_in_each_part() {
    for (name, lost, after) in [
        ("kill-at-waypoint", &[3][..], &[&[2, 4][..]][..]),
        ("kill-while-landing", &[3], &[]),
        ("kill-successor", &[2, 3], &[&[1, 4]]),
    ] {
        let report = flown(name);
        assert_flown(name, &report, lost);
        assert_eq!(masters(&report), after, "{name}");
    }
}

#[test]
pub(crate) fn clusters_without_their_master_are_swarms_of_their_own() {
    for clusters in [2, 3, 5] {
        let name = format!("split-up-{clusters}");
        let report = flown(&name);
        assert_eq!(
            masters(&report)[0].len(),
            clusters,
            "{name}: how many swarms"
        );
        assert_flown(&name, &report, &[0]);
    }
}

#[test]
pub(crate) fn swarms_that_meet_again_are_one_and_all_fly_every_waypoint() {
    for name in ["cut-in-two", "cut-two-apart"] {
        let report = flown(name);
        assert_flown(name, &report, &[]);
        assert_eq!(masters(&report), [vec![2, 3], vec![2]], "{name}");
        let met = report.elections[1].settled_after_s.unwrap();
        assert!(met <= 2.0, "{name}: {met} s");
        for drone in &report.drones {
            let waypoints = report.barriers.len();
            assert_eq!(drone.waypoints, waypoints, "{name}, {drone:?}");
        }
    }
}

#[test]
fn links_that_come_and_go_or_carry_one_way_cost_nobody() {
    for name in ["flapping-link", "one-way-link"] {
        assert_flown(name, &flown(name), &[]);
    }
}

#[test]
fn a_master_that_hangs_is_replaced_and_rejoins() {
    let report = flown("hung-master");
    assert_flown("hung-master", &report, &[]);
    assert_eq!(
        masters(&report).last().unwrap(),
        &[2],
        "not the one that hung"
    );
}

#[test]
pub(crate) fn a_drone_that_returns_is_waited_for() {
    let report = flown("returning-drone");
    assert_flown("returning-drone", &report, &[]);
    assert_eq!(masters(&report), [vec![3, 6], vec![6]]);
}

#[test]
pub(crate) fn a_master_whose_mission_hangs_is_mended_and_goes_on() {
    let report = flown("hung-mission");
    assert_flown("hung-mission", &report, &[]);
    assert_eq!(report.drones[3].restarts, 1);
    assert_eq!(report.elections, []);
}

#[test]
pub(crate) fn nobody_heeds_strangers_and_other_swarms() {
    let report = flown("other-swarm");
    assert_flown("other-swarm", &report, &[]);
    assert_eq!(report.elections, []);
    for reason in ["forged", "other swarm", "replayed", "stranger"] {
        assert!(report.dropped.contains_key(reason), "{:?}", report.dropped);
    }
}

#[test]
pub(crate) fn two_swarms_that_pass_each_other_obey_their_own_masters_and_nobody_else() {
    let report = flown("two-swarms");
    let [other] = &report.others[..] else {
        panic!("{} other swarms", report.others.len());
    };
    assert_flown("two-swarms", &report, &[3]);
    assert_flown("southbound", other, &[]);
    let [led_by] = &masters(&report)[..] else {
        panic!("{:?}", masters(&report));
    };
    assert!(
        led_by.len() == 1 && led_by[0] < 7,
        "one of their own leads them"
    );
    assert_eq!(other.elections, []);
    assert_eq!(other.drones[0].id, 7, "drones are numbered through");
    for swarm in [&report, other] {
        let strange = swarm.dropped.keys().map(String::as_str);
        assert_eq!(strange.collect::<Vec<_>>(), ["other swarm"]);
    }
    assert!(report.min_separation_m.unwrap() < 60.0, "they met");
}

#[test]
fn a_swarm_that_flies_into_another_is_found() {
    // Where one was elected, all fly in layers of their own, above the other swarm.
    let mut collision = scenario("two-swarms.toml", &["faults=[]"]);
    collision.others[0].1.home = muster_machines::geometry::Ned::new(300.0, 0.0, 0.0);
    let report = fly(&collision, Engine::Events);
    let found = &report.violations[0];
    assert_eq!(found.rule, 4);
    assert!(found.drones.iter().any(|id| *id >= 7) && found.drones.iter().any(|id| *id < 7));
}

#[test]
pub(crate) fn a_swarm_takes_off_without_whoever_is_dead() {
    assert_flown("dead-on-ground", &flown("dead-on-ground"), &[6]);
}

#[test]
pub(crate) fn forty_drones_have_forty_places() {
    let layout = scenario("big-matrix.toml", &[]).plan.layout;
    assert_eq!(layout.take_off_waves(), 1, "big-matrix: waves to take off");
    let report = flown("big-matrix");
    assert_flown("big-matrix", &report, &[]);
    assert!(report.min_separation_m.unwrap() >= 5.0);
}

#[test]
fn an_outlook_tells_who_is_out_of_the_masters_reach_and_who_else_flies() {
    let preview = |name, overrides| scenario(name, overrides).preview().join("\n");
    let apart = "out of the master's reach";
    let told = preview("split-up-5.toml", &[]);
    assert!(!told.contains(apart), "{told}");
    let told = preview("split-up-5.toml", &["radio.range_m=50"]);
    assert!(told.contains(apart), "{told}");
    let told = preview("split-up-5.toml", &["limits.separation_vertical_m=0.6"]);
    assert!(told.contains("+3.3 m "), "no digits of a sum: {told}");
    let told = preview("two-swarms.toml", &[]);
    assert!(told.contains("drones 7–12 of"), "{told}");
}

#[test]
fn an_outlook_tells_where_flooding_does_not_carry_far_enough() {
    let preview = |more: &str| {
        let fields = ["radio.loss=0.3", "formation.drones=30", more];
        scenario("barrier-line.toml", &fields).preview().join("\n")
    };
    let told = preview("protocol.policy=flood");
    assert!(told.contains("settles in no known time"), "{told}");
    let told = preview("protocol.policy=tree");
    assert!(!told.contains("no known time"), "{told}");
}

#[test]
fn where_layers_would_lead_out_of_reach_drones_fly_in_waves() {
    let preview = |overrides: &[&str]| {
        let fields = ["formation.drones=37", "formation.spacing_m=40"];
        let high = ["radio.range_m=60", "limits.altitude_max_m=400"];
        let fields = [&fields[..], &high, overrides].concat();
        scenario("barrier-mesh.toml", &fields).preview().join("\n")
    };
    let unreached = "out of the master's reach";
    let told = preview(&[]);
    assert!(told.contains("waves: 2 to take off"), "{told}");
    assert!(!told.contains(unreached), "{told}");
}

#[test]
fn check_tells_whom_layers_lead_out_of_reach() {
    let scattered = [
        "formation.kind=random",
        "formation.seed=36",
        "formation.drones=46",
        "formation.spacing_m=50",
        "radio.range_m=70",
        "limits.altitude_max_m=500",
    ];
    let told = scenario("barrier-mesh.toml", &scattered)
        .preview()
        .join("\n");
    let on_the_way_up =
        "out of the master's reach in their layers on the way up: drones 24, 29, 38, 43";
    assert!(told.contains(on_the_way_up), "{told}");
}
