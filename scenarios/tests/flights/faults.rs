//! Whatever goes wrong with links, frames, processes and clocks, the swarm flies on and no rule is broken.

use muster_scenarios::engine::Engine;
use muster_scenarios::report::Report;

use crate::support::{assert_finished, fly, masters, scenario};

/// Seven in line, on a short mission, with other faults than its own; both engines fly it alike.
fn fly_with(faults: &str) -> Report {
    fly_seed_with(1, faults)
}

fn fly_seed_with(seed: u64, faults: &str) -> Report {
    let (seed, fault) = (format!("seed={seed}"), format!("faults=[{faults}]"));
    let scenario = scenario("kill-at-waypoint.toml", &[&seed, &fault]);
    let report = fly(&scenario, Engine::Events);
    assert_eq!(report.violations, [], "{faults}");
    assert!(report.mission_completed, "{faults}");
    assert_eq!(
        report.trace,
        fly(&scenario, Engine::Actors).trace,
        "{faults}"
    );
    report
}

#[test]
fn a_process_that_restarts_rejoins_the_swarm_from_its_journal() {
    for seed in 0..20 {
        let report = fly_seed_with(seed, "{ at_s = 70, restart = 1 }");
        assert_finished(&report, &[], &format!("seed {seed}"));
        // Drone 0 hears nobody else, and bears its silence: the master leads on.
        assert_eq!(masters(&report), [[3]], "seed {seed}");
    }
    let report = fly_with(r#"{ at_s = 70, restart = "master" }"#);
    assert_finished(&report, &[], "the master restarts");
    // Each part has its own, and parts that meet are one.
    let masters = masters(&report);
    assert_eq!((masters.len(), &masters[0]), (2, &vec![2, 4]));
    assert_eq!(masters[1].len(), 1, "{masters:?}");
}

#[test]
fn an_aircraft_that_falls_over_on_the_ground_keeps_nobody_there() {
    let faults = "{ at_s = 0, crash_aircraft = 6 }";
    let report = fly_with(faults);
    assert!(report.drones[..6].iter().all(|it| it.state == "finished"));
}

#[test]
fn a_process_that_restarts_on_the_ground_stays_there() {
    // With the mission, before the take-off; and after its controller has brought it down.
    for faults in [
        "{ at_s = 0.01, restart = 5 }",
        "{ at_s = 70, kill = 5 }, { at_s = 120, restart = 5 }",
    ] {
        let report = fly_with(faults);
        assert!(report.drones[5].landed_because.is_some(), "{faults}");
        assert_eq!(report.drones[5].state, "finished", "{faults}");
    }
}

#[test]
fn what_hangs_is_found_out_and_the_swarm_flies_on() {
    for faults in [
        r#"{ at_s = 70, hang = "master", actor = "radio" }"#,
        r#"{ at_s = 70, hang = "master", actor = "routing" }"#,
        r#"{ at_s = 70, hang = "master", actor = "mission" }"#,
        r#"{ at_s = 70, hang = "master", actor = "navigation" }"#,
        r#"{ at_s = 70, hang = "master", actor = "msp" }"#,
        r#"{ at_s = 70, hang = "master" }"#,
        "{ at_s = 70, hang = 2, for_s = 1.5 }",
        r#"{ when = "taking-off", after_s = 5, hang = 4, for_s = 2 }"#,
    ] {
        assert_finished(&fly_with(faults), &[], faults);
    }
}

#[test]
fn a_swarm_that_is_cut_in_two_is_two_swarms_and_one_again_once_it_is_healed() {
    for faults in [
        "{ at_s = 70, cut = [2, 3], for_s = 20 }",
        "{ at_s = 70, one_way = [3, 2], for_s = 20 }",
        "{ at_s = 60, cut = [[0, 1, 2], [3, 4]] }, { at_waypoint = 2, heal = [2, 3] }",
    ] {
        let report = fly_with(faults);
        assert_finished(&report, &[], faults);
        let masters = masters(&report);
        assert_eq!(masters.len(), 2, "{faults}: {masters:?}");
        assert_eq!(masters[0], [2, 3], "{faults}");
        assert_eq!(masters[1].len(), 1, "{faults}: {masters:?}");
    }
}

#[test]
fn a_jammed_swarm_flies_on_in_parts() {
    let faults = "{ at_s = 66, jam = { north_m = 150, east_m = 0, radius_m = 80 }, for_s = 10 }";
    assert_finished(&fly_with(faults), &[], faults);
}

#[test]
fn the_others_fly_on_without_an_aircraft_that_fell() {
    let faults = r#"{ when = "taking-off", after_s = 65, crash_aircraft = "master" }"#;
    let report = fly_with(faults);
    assert_finished(&report, &[3], faults);
    assert!(report.drones[3].state.starts_with("fell while"));
}

#[test]
fn nothing_that_is_done_to_frames_is_obeyed() {
    for (faults, reason) in [
        (
            r#"{ at_s = 50, corrupt = "all", share = 0.2, for_s = 100 }"#,
            "forged",
        ),
        (
            r#"{ at_s = 50, duplicate = "all", for_s = 100 }"#,
            "replayed",
        ),
        (r#"{ at_s = 70, replay = "master" }"#, "replayed"),
        (
            r#"{ at_s = 50, forge = "master", times = 100, every_s = 0.1 }"#,
            "other swarm",
        ),
    ] {
        let report = fly_with(faults);
        assert_finished(&report, &[], faults);
        assert_eq!(report.elections, [], "{faults}");
        assert!(
            report
                .dropped
                .get(reason)
                .is_some_and(|dropped| *dropped > 0),
            "{faults}: {:?}",
            report.dropped
        );
    }
}

#[test]
pub(crate) fn a_radio_that_was_started_anew_obeys_no_frames_that_were_recorded_before() {
    let both = ["unproven", "replayed"].as_slice();
    for (faults, reasons) in [
        (
            r#"{ at_s = 70, restart = 4 }, { at_s = 70.9, replay = "master" }"#,
            both,
        ),
        (
            r#"{ at_s = 70, crash = 2, actor = "radio" }, { at_s = 70, replay = "master" }"#,
            both,
        ),
        (
            r#"{ at_s = 70, restart = "master" }, { at_s = 70.9, replay = 2 }, { at_s = 70.9, replay = 4 }"#,
            both,
        ),
        // Whether anybody speaks before it is proven is chance.
        (
            r#"{ at_s = 50, duplicate = "all", for_s = 100 }, { at_s = 70, hang = 4, actor = "radio" }"#,
            &["replayed"],
        ),
    ] {
        let report = fly_with(faults);
        assert_finished(&report, &[], faults);
        for reason in reasons {
            let dropped = report.dropped.get(*reason);
            assert!(
                dropped.is_some_and(|dropped| *dropped > 0),
                "{faults}: {:?}",
                report.dropped
            );
        }
    }
}

#[test]
fn late_and_overtaking_frames_and_wrong_clocks_cost_nothing() {
    for faults in [
        r#"{ at_s = 50, reorder = "all", by_ms = 50, for_s = 100 }"#,
        r#"{ at_s = 50, duplicate = "all", for_s = 50 }, { at_s = 50, reorder = "all", by_ms = 50, for_s = 50 }"#,
        "{ at_s = 50, delay = 1, by_ms = 30, for_s = 100 }",
        "{ at_s = 60, degrade = [2, 3], loss = 0.6, for_s = 60 }",
        "{ at_s = 10, skew = 3, ppm = 50000 }",
        "{ at_s = 10, skew = 1, ppm = -50000, for_s = 100 }",
    ] {
        assert_finished(&fly_with(faults), &[], faults);
    }
}
