//! The master is killed; the remaining drones elect new masters, continue and land.

use muster_scenarios::engine::Engine;
use muster_scenarios::report::{Report, Role};

use crate::support::{Sweep, assert_finished, fly, scenario};

const ELECT: &str = "protocol.succession=elect";

/// Checks that all drones but the killed ones completed the mission.
fn assert_flown(report: &Report, killed: &[u32], what: &str) {
    assert_eq!(report.violations, [], "{what}");
    assert!(report.mission_completed, "{what}");
    assert_finished(report, killed, what);
}

#[test]
pub(crate) fn each_half_of_the_line_elects_a_master_and_continues() {
    let mut sweep = Sweep::default();
    for (set, loss, limit_s) in [
        ("fast", "0", 1.5),
        ("fast", "0.2", 3.0),
        ("quiet", "0", 4.0),
        ("quiet", "0.2", 8.0),
    ] {
        for seed in sweep.of(0..4) {
            let fields = [
                &*format!("protocol.parameters={set}"),
                &*format!("radio.loss={loss}"),
                &*format!("seed={seed}"),
            ];
            let report = fly(&scenario("election-line.toml", &fields), Engine::Events);
            assert_flown(&report, &[7], &format!("{fields:?}"));
            let [election] = &report.elections[..] else {
                panic!("one election: {:?}", report.elections);
            };
            assert_eq!(election.masters, [6, 8], "{fields:?}");
            let after_s = election.settled_after_s.unwrap();
            assert!(after_s <= limit_s, "{fields:?}: {after_s} s");
            let sent = report.drones[0].messages_sent;
            let frames = u32::try_from(sent).unwrap();
            let rate = f64::from(frames) / report.drones[0].flight_time_s.unwrap();
            assert!(rate <= 12.0, "{fields:?}: {rate} frames per second");
        }
    }
}

#[test]
fn single_routing_crash_causes_no_election() {
    let mut sweep = Sweep::default();
    for (set, loss, drones) in [
        ("quiet", "0.1", [4, 5, 6, 9]),
        ("fast", "0.1", [5, 6, 8, 9]),
        ("lan", "0", [5, 6, 8, 9]),
    ] {
        for drone in sweep.of(drones) {
            let fields = [
                &*format!(
                    r#"faults=[{{ at_s = 130, kind = "crash-actor", drone = {drone}, actor = "routing" }}]"#
                ),
                &*format!("protocol.parameters={set}"),
                &*format!("radio.loss={loss}"),
                &*format!("seed={drone}"),
            ];
            let report = fly(&scenario("follow.toml", &fields), Engine::Events);
            assert_eq!(report.violations, [], "{fields:?}");
            assert_eq!(report.elections, [], "{fields:?}");
        }
    }
}

#[test]
fn no_election_without_a_lost_master() {
    let mut sweep = Sweep::default();
    for set in ["fast", "quiet"] {
        for loss in ["0", "0.2"] {
            for seed in sweep.of(0..3) {
                let fields = [
                    "faults=[]",
                    &*format!("protocol.parameters={set}"),
                    &*format!("radio.loss={loss}"),
                    &*format!("seed={seed}"),
                ];
                let report = fly(&scenario("election-line.toml", &fields), Engine::Events);
                assert_flown(&report, &[], &format!("{fields:?}"));
                assert_eq!(report.elections, [], "{fields:?}");
            }
        }
    }
}

#[test]
fn master_killed_at_any_time_is_replaced_under_both_policies() {
    for policy in ["flood", "tree"] {
        // Set-up, take-off, in its slot, discovery, hop update, legs and waypoints, moving to land.
        for at_s in [
            0.3, 5.0, 40.0, 58.0, 62.0, 66.5, 80.0, 111.6, 112.0, 300.0, 420.0, 440.0,
        ] {
            let fields = [
                &*format!("protocol.policy={policy}"),
                "protocol.liveness=heartbeat",
                ELECT,
                &*format!("faults=[{{ at_s = {at_s}, kind = \"kill\", drone = \"master\" }}]"),
            ];
            let scenario = scenario("thesis-1.toml", &fields);
            let report = fly(&scenario, Engine::Events);
            let what = format!("{policy}, {at_s} s");
            assert_eq!(report.violations, [], "{what}");
            let others = report.drones.iter().filter(|drone| drone.id != 2);
            for drone in others {
                assert!(at_s < 1.0 || drone.state == "finished", "{what}: {drone:?}");
            }
            assert_eq!(report.trace, fly(&scenario, Engine::Actors).trace, "{what}");
        }
    }
}

#[test]
fn master_and_successor_killed_in_sequence_are_both_replaced() {
    let faults = r#"faults=[{ at_s = 150, kind = "kill", drone = "master" }, { at_s = 150.1, kind = "kill", drone = 6 }]"#;
    let report = fly(&scenario("election-line.toml", &[faults]), Engine::Events);
    assert_flown(&report, &[6, 7], faults);
    assert_eq!(report.elections[0].masters, [5, 8]);
}

#[test]
fn clusters_that_lost_the_master_elect_one_master_each() {
    for clusters in [2, 3, 5] {
        let fields = [
            "formation.kind=split-up",
            &*format!("formation.clusters={clusters}"),
            "formation.drones=16",
            "formation.spacing_m=60",
            "limits.altitude_max_m=300",
            r#"faults=[{ at_s = 150, kind = "kill", drone = "master" }]"#,
        ];
        let report = fly(&scenario("election-line.toml", &fields), Engine::Events);
        assert_flown(&report, &[0], &format!("{clusters} clusters"));
        let masters = &report.elections[0].masters;
        assert_eq!(masters.len(), clusters, "{masters:?}");
    }
}

#[test]
fn election_works_during_a_formation_change_and_while_following() {
    for at_s in [150, 160, 172] {
        let fault = format!("faults=[{{ at_s = {at_s}, kind = \"kill\", drone = \"master\" }}]");
        let report = fly(&scenario("shake-up.toml", &[ELECT, &fault]), Engine::Events);
        assert_flown(&report, &[4], &fault);
    }
    let fault = r#"faults=[{ at_s = 200, kind = "kill", drone = "master" }]"#;
    let report = fly(&scenario("follow.toml", &[ELECT, fault]), Engine::Events);
    assert_eq!(report.violations, []);
    for drone in report.drones.iter().filter(|drone| drone.id != 7) {
        assert_eq!(drone.state, "finished", "{drone:?}");
        assert_eq!(drone.landed_because, None, "{drone:?}");
    }
}

#[test]
fn ten_masters_killed_in_sequence_in_a_grid_are_all_replaced() {
    let scenario = scenario("scale/grid-10000.toml", &["formation.drones=64"]);
    let report = fly(&scenario, Engine::Events);
    assert_eq!(report.violations, []);
    assert!(
        report.mission_completed,
        "the remaining drones complete the mission"
    );
    assert_eq!(report.elections.len(), 10);
    for election in &report.elections {
        assert!(election.settled_after_s.is_some(), "{election:?}");
        assert_eq!(election.masters.len(), 1, "{election:?}");
    }
}

/// Masters of a report, and its bridges with the drones behind each.
fn led(report: &Report) -> (Vec<u32>, Vec<(u32, Vec<u32>)>) {
    let masters = report.drones.iter().filter(|it| it.role == Role::Master);
    let bridges = report.bridges.iter();
    (
        masters.map(|it| it.id).collect(),
        bridges
            .map(|it| (it.bridge, it.out_of_range.clone()))
            .collect(),
    )
}

#[test]
fn report_shows_who_leads_and_relays_after_elections() {
    let report = |name: &str, fields: &[&str]| fly(&scenario(name, fields), Engine::Events);
    // The killed master led until then.
    let halves = led(&report("election-line.toml", &[]));
    let bridges = vec![(5, (0..5).collect()), (9, (10..15).collect())];
    assert_eq!(halves, (vec![6, 7, 8], bridges));
    let (masters, _) = led(&report("cut-two-apart.toml", &[]));
    assert_eq!(masters, [2], "the segments have merged");
    for name in [
        "election-line.toml",
        "cut-two-apart.toml",
        "split-up-3.toml",
    ] {
        for drone in report(name, &[]).drones {
            let leads = drone.role == Role::Master;
            assert_eq!(drone.hops == Some(0), leads, "{name}, drone {}", drone.id);
        }
    }
}

#[test]
fn bridges_are_those_of_the_flight_with_either_policy() {
    for policy in ["flood", "tree"] {
        let policy = format!("protocol.policy={policy}");
        let report = fly(&scenario("thesis-2.toml", &[&policy]), Engine::Events);
        let bridges = vec![(6, (0..6).collect()), (8, (9..15).collect())];
        assert_eq!(led(&report), (vec![7], bridges), "{policy}");
    }
}

#[test]
fn drones_that_never_hear_each_other_do_not_complete_the_mission() {
    for policy in ["flood", "tree"] {
        let policy = format!("protocol.policy={policy}");
        let apart = ["formation.spacing_m=350", &policy];
        let report = fly(&scenario("thesis-1.toml", &apart), Engine::Events);
        assert!(!report.mission_completed, "{policy}");
        assert_eq!(report.never_met.len(), 5, "{policy}");
        let connected = fly(&scenario("thesis-1.toml", &[&policy]), Engine::Events);
        assert!(connected.never_met.is_empty() && connected.are_missions_completed());
    }
}
