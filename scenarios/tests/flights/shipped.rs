//! Results of the shipped scenarios.

use muster_scenarios::engine::Engine;
use muster_scenarios::report::Report;
use muster_scenarios::scenario::{Override, load};

use crate::support::{assert_finished, fly, masters, scenario, shipped};

fn flown(name: &str) -> Report {
    let report = fly(&scenario(&format!("{name}.toml"), &[]), Engine::Events);
    assert_eq!(report.violations, [], "{name}");
    report
}

/// Checks that all drones but the lost ones completed the mission.
fn assert_flown(name: &str, report: &Report, lost: &[u32]) {
    assert!(report.mission_completed, "{name}: mission not completed");
    assert_finished(report, lost, name);
}

#[test]
fn swarm_stays_on_the_ground_if_its_master_is_killed_there() {
    let report = flown("kill-on-ground");
    for drone in &report.drones {
        assert_eq!(drone.flight_time_s, None, "{drone:?}");
    }
}

#[test]
fn master_killed_in_flight_is_replaced_in_each_segment() {
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
pub(crate) fn clusters_without_the_master_become_separate_swarms() {
    for clusters in [2, 3, 5] {
        let name = format!("split-up-{clusters}");
        let report = flown(&name);
        assert_eq!(
            masters(&report)[0].len(),
            clusters,
            "{name}: number of swarms"
        );
        assert_flown(&name, &report, &[0]);
    }
}

#[test]
pub(crate) fn segments_merge_and_all_drones_fly_every_waypoint() {
    for name in ["cut-in-two", "cut-two-apart"] {
        let report = flown(name);
        assert_flown(name, &report, &[]);
        assert_eq!(masters(&report), [vec![2, 3], vec![2]], "{name}");
        let merged_s = report.elections[1].settled_after_s.unwrap();
        assert!(merged_s <= 2.0, "{name}: {merged_s} s");
        for drone in &report.drones {
            let waypoints = report.barriers.len();
            assert_eq!(drone.waypoints, waypoints, "{name}, {drone:?}");
        }
    }
}

#[test]
fn flapping_and_one_way_links_lose_no_drone() {
    for name in ["flapping-link", "one-way-link"] {
        assert_flown(name, &flown(name), &[]);
    }
}

#[test]
fn hung_master_is_replaced_and_rejoins() {
    let report = flown("hung-master");
    assert_flown("hung-master", &report, &[]);
    assert_eq!(
        masters(&report).last().unwrap(),
        &[2],
        "not the one that hung"
    );
}

#[test]
pub(crate) fn master_waits_for_a_returned_drone() {
    let report = flown("returning-drone");
    assert_flown("returning-drone", &report, &[]);
    assert_eq!(masters(&report), [vec![3, 6], vec![6]]);
}

#[test]
pub(crate) fn master_with_a_hung_mission_actor_recovers() {
    let report = flown("hung-mission");
    assert_flown("hung-mission", &report, &[]);
    assert_eq!(report.drones[3].restarts, 1);
    assert_eq!(report.elections, []);
}

#[test]
pub(crate) fn frames_of_strangers_and_other_swarms_are_dropped() {
    let report = flown("other-swarm");
    assert_flown("other-swarm", &report, &[]);
    assert_eq!(report.elections, []);
    for reason in ["forged", "other swarm", "replayed", "stranger"] {
        assert!(report.dropped.contains_key(reason), "{:?}", report.dropped);
    }
}

#[test]
pub(crate) fn two_passing_swarms_each_follow_their_own_master() {
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
        "the new master is one of their own"
    );
    assert_eq!(other.elections, []);
    assert_eq!(other.drones[0].id, 7, "ids continue across swarms");
    for swarm in [&report, other] {
        let strange = swarm.dropped.keys().map(String::as_str);
        assert_eq!(strange.collect::<Vec<_>>(), ["other swarm"]);
    }
    assert!(
        report.min_separation_m.unwrap() < 60.0,
        "the swarms pass close to each other"
    );
}

#[test]
fn collision_of_two_swarms_is_detected() {
    // Without faults: after an election all drones would fly in layers above the other swarm.
    let mut collision = scenario("two-swarms.toml", &["faults=[]"]);
    collision.others[0].1.home = muster_machines::geometry::Ned::new(300.0, 0.0, 0.0);
    let report = fly(&collision, Engine::Events);
    let found = &report.violations[0];
    assert_eq!(found.rule, 4);
    assert!(found.drones.iter().any(|id| *id >= 7) && found.drones.iter().any(|id| *id < 7));
}

#[test]
pub(crate) fn swarm_takes_off_without_a_dead_drone() {
    assert_flown("dead-on-ground", &flown("dead-on-ground"), &[6]);
}

#[test]
pub(crate) fn forty_drones_have_forty_slots() {
    let layout = scenario("big-matrix.toml", &[]).plan.layout.clone();
    assert_eq!(layout.take_off_waves(), 1, "big-matrix: waves to take off");
    let report = flown("big-matrix");
    assert_flown("big-matrix", &report, &[]);
    assert!(report.min_separation_m.unwrap() >= 5.0);
}

#[test]
fn preview_shows_drones_out_of_range_and_other_swarms() {
    let preview = |name, overrides| scenario(name, overrides).preview().join("\n");
    let out_of_range = "out of the master's reach";
    let text = preview("split-up-5.toml", &[]);
    assert!(!text.contains(out_of_range), "{text}");
    let cut_off = ["radio.range_m=50", "protocol.succession=land"];
    let text = preview("split-up-5.toml", &cut_off);
    assert!(text.contains(out_of_range), "{text}");
    let text = preview("split-up-5.toml", &["limits.separation_vertical_m=0.6"]);
    assert!(text.contains("+3.3 m "), "no digits of a sum: {text}");
    let text = preview("two-swarms.toml", &[]);
    assert!(text.contains("drones 7–12 of"), "{text}");
}

#[test]
fn preview_shows_if_flooding_does_not_reach_all_drones() {
    let preview = |more: &str| {
        let fields = ["radio.loss=0.3", "formation.drones=30", more];
        scenario("barrier-line.toml", &fields).preview().join("\n")
    };
    let text = preview("protocol.policy=flood");
    assert!(text.contains("time to re-elect: none"), "{text}");
    let text = preview("protocol.policy=tree");
    assert!(!text.contains("time to re-elect: none"), "{text}");
}

#[test]
fn drones_fly_in_waves_if_layers_would_exceed_the_radio_range() {
    let preview = |overrides: &[&str]| {
        let fields = ["formation.drones=37", "formation.spacing_m=40"];
        let high = ["radio.range_m=60", "limits.altitude_max_m=400"];
        let fields = [&fields[..], &high, overrides].concat();
        scenario("barrier-mesh.toml", &fields).preview().join("\n")
    };
    let unreached = "out of the master's reach";
    let text = preview(&[]);
    assert!(text.contains("waves: 2 to take off"), "{text}");
    assert!(!text.contains(unreached), "{text}");
}

#[test]
fn preview_shows_drones_that_layers_take_out_of_range() {
    let scattered = [
        "formation.kind=random",
        "formation.seed=36",
        "formation.drones=46",
        "formation.spacing_m=50",
        "radio.range_m=70",
        "limits.altitude_max_m=500",
        "protocol.succession=land",
    ];
    let scattered = scenario("barrier-mesh.toml", &scattered);
    let text = scattered.preview().join("\n");
    let alone = "out of the master's reach in their layers out of lockstep: drones 24, 29, 38;";
    assert!(text.contains(alone), "{text}");
    assert!(!text.contains("on the way up"), "{text}");
}

#[test]
fn check_warns_of_a_relay_in_the_way() {
    let verdict = |relay: &str| {
        let relay = format!("relays=[{relay}]");
        scenario("barrier-line.toml", &[&relay]).verdict()
    };
    let first = scenario("barrier-line.toml", &[]).plan.waypoints[1];
    let [north_m, east_m, altitude_m] = [first.north_m(), first.east_m(), first.altitude_m()];
    let in_the_way = verdict(&format!(
        "{{ north_m = {north_m}, east_m = {east_m}, altitude_m = {altitude_m} }}"
    ));
    let warned = "comes too near relay";
    assert!(
        in_the_way.starts_with("WARNING") && in_the_way.contains(warned),
        "{in_the_way}"
    );
    let above = verdict("{ north_m = 0, east_m = 0, altitude_m = 110 }");
    assert!(!above.contains(warned), "{above}");
}

#[test]
fn check_warns_of_drones_that_are_out_of_reach_on_the_way() {
    let verdict = |overrides: &[&str]| scenario("mesh-in-waves.toml", overrides).verdict();
    let text = verdict(&[]);
    assert!(text.starts_with("OK"), "{text}");
    let far = [
        "formation.kind=linear",
        "formation.drones=80",
        "formation.spacing_m=30",
        "radio.range_m=63",
        "limits.altitude_max_m=200",
    ];
    // They share layers: where they elect, that has to be accepted.
    let overrides: Vec<Override> = far.iter().map(|it| it.parse().unwrap()).collect();
    let refused = load(&shipped("mesh-in-waves.toml"), &overrides).unwrap_err();
    let warned =
        "can't reach the master for 45 s while those of wave 2 cross for change 0 of formation";
    let message = refused.to_string();
    assert!(
        message.contains(warned) && message.contains("out-of-reach"),
        "{message}"
    );
    let text = verdict(&[&far[..], &["protocol.succession=land"]].concat());
    assert!(text.starts_with("WARNING"), "{text}");
    assert!(text.contains(warned), "{text}");
    // Where there is room for a layer for each drone, they have one, though waves would leave them out of reach for less long.
    let text = verdict(&[
        "formation.kind=linear",
        "formation.ground=grid",
        "formation.drones=12",
        "formation.spacing_m=130",
        "changes=[{ waypoint = 0, kind = \"compact-mesh\" }]",
        "mission.file=missions/far.waypoints",
        "radio.range_m=150",
        "protocol.parameters=quiet",
        "vehicle.speed_mps=20",
        "vehicle.acceleration_mps2=8",
        "vehicle.climb_mps=8",
        "vehicle.descent_mps=5",
        "limits.separation_vertical_m=0.6",
        "limits.altitude_max_m=1000",
    ]);
    assert!(
        text.starts_with("WARNING") && text.contains("while all cross"),
        "{text}"
    );
}
