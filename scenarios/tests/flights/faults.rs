//! Whatever goes wrong with links, frames, processes and clocks, the swarm flies on and no rule is broken.

use muster_scenarios::engine::Engine;
use muster_scenarios::report::Report;

use crate::support::{fly, scenario};

/// The line of fifteen, with other faults than its own; both engines fly it alike.
fn fly_with(faults: &str) -> Report {
    let fault = format!("faults=[{faults}]");
    let scenario = scenario("election-line.toml", &[&fault]);
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

fn assert_all_finished_but(report: &Report, lost: &[u32], what: &str) {
    for drone in &report.drones {
        let is_lost = lost.contains(&drone.id);
        assert_eq!(drone.state == "finished", !is_lost, "{what}, {drone:?}");
        assert_eq!(drone.landed_because, None, "{what}, {drone:?}");
    }
}

/// Who led once the swarm was whole again, after each of the elections.
fn masters(report: &Report) -> Vec<Vec<u32>> {
    let elections = report.elections.iter();
    elections.map(|election| election.masters.clone()).collect()
}

#[test]
fn a_process_that_restarts_rejoins_the_swarm_from_its_journal() {
    for (who, after) in [("3", vec![2, 7]), (r#""master""#, vec![6, 8])] {
        let faults = format!("{{ at_s = 150, restart = {who} }}");
        let report = fly_with(&faults);
        assert_all_finished_but(&report, &[], &faults);
        let masters = masters(&report);
        assert_eq!(masters[0], after, "{faults}: each part has its own");
        assert_eq!(masters[1].len(), 1, "{faults}: parts that meet are one");
    }
}

#[test]
fn a_process_that_restarts_on_the_ground_stays_there() {
    // On the ground with the mission, and after its controller has brought it down.
    for faults in [
        "{ at_s = 1, restart = 3 }",
        "{ at_s = 150, kill = 3 }, { at_s = 220, restart = 3 }",
    ] {
        let report = fly_with(faults);
        assert!(report.drones[3].landed_because.is_some(), "{faults}");
        assert_eq!(report.drones[3].state, "finished", "{faults}");
    }
}

#[test]
fn what_hangs_is_found_out_and_the_swarm_flies_on() {
    for faults in [
        r#"{ at_s = 150, hang = "master", actor = "radio" }"#,
        r#"{ at_s = 150, hang = "master", actor = "routing" }"#,
        r#"{ at_s = 150, hang = "master", actor = "mission" }"#,
        r#"{ at_s = 150, hang = "master", actor = "navigation" }"#,
        r#"{ at_s = 150, hang = "master", actor = "msp" }"#,
        r#"{ at_s = 150, hang = "master" }"#,
        "{ at_s = 150, hang = 2, for_s = 1.5 }",
        r#"{ when = "taking-off", after_s = 5, hang = 4, for_s = 2 }"#,
    ] {
        assert_all_finished_but(&fly_with(faults), &[], faults);
    }
}

#[test]
fn a_swarm_that_is_cut_in_two_is_two_swarms_and_one_again_once_it_is_healed() {
    for (faults, both) in [
        ("{ at_s = 150, cut = [6, 7], for_s = 60 }", 6),
        ("{ at_s = 150, one_way = [6, 7], for_s = 60 }", 6),
        (
            "{ at_s = 150, cut = [[0, 1, 2], [3, 4]] }, { at_waypoint = 4, heal = [2, 3] }",
            2,
        ),
    ] {
        let report = fly_with(faults);
        assert_all_finished_but(&report, &[], faults);
        assert_eq!(masters(&report), [[both]], "{faults}");
    }
}

#[test]
fn a_flapping_link_costs_no_drone() {
    let faults = "{ at_s = 150, cut = [6, 7], for_s = 2, times = 10, every_s = 5 }";
    assert_all_finished_but(&fly_with(faults), &[], faults);
}

#[test]
fn a_jammed_swarm_flies_on_in_parts() {
    let faults = "{ at_s = 150, jam = { north_m = 500, east_m = 0, radius_m = 200 }, for_s = 30 }";
    assert_all_finished_but(&fly_with(faults), &[], faults);
}

#[test]
fn the_others_fly_on_without_an_aircraft_that_fell() {
    let faults = r#"{ when = "taking-off", after_s = 100, crash_aircraft = "master" }"#;
    let report = fly_with(faults);
    assert_all_finished_but(&report, &[7], faults);
    assert!(report.drones[7].state.starts_with("fell while"));
}

#[test]
fn nothing_that_is_done_to_frames_is_obeyed() {
    for (faults, reason) in [
        (
            r#"{ at_s = 100, corrupt = "all", share = 0.2, for_s = 100 }"#,
            "forged",
        ),
        (
            r#"{ at_s = 100, duplicate = "all", for_s = 100 }"#,
            "replayed",
        ),
        (r#"{ at_s = 200, replay = "master" }"#, "replayed"),
        (
            r#"{ at_s = 200, forge = "master", times = 100, every_s = 0.1 }"#,
            "other swarm",
        ),
    ] {
        let report = fly_with(faults);
        assert_all_finished_but(&report, &[], faults);
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
fn late_and_overtaking_frames_and_wrong_clocks_cost_nothing() {
    for faults in [
        r#"{ at_s = 100, reorder = "all", by_ms = 50, for_s = 100 }"#,
        "{ at_s = 100, delay = 3, by_ms = 500, for_s = 100 }",
        "{ at_s = 100, degrade = [6, 7], loss = 0.6, for_s = 60 }",
        "{ at_s = 10, skew = 7, ppm = 50000 }",
        "{ at_s = 10, skew = 3, ppm = -50000, for_s = 200 }",
    ] {
        assert_all_finished_but(&fly_with(faults), &[], faults);
    }
}
