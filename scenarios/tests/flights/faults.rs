//! Faults of links, frames, processes and clocks: the swarm continues and breaks no rule.

use muster_scenarios::engine::Engine;
use muster_scenarios::report::Report;

use crate::support::{Sweep, assert_finished, fly, masters, scenario};

/// Runs seven drones in line on a short mission with these faults; checks that both engines agree.
fn fly_with(faults: &str) -> Report {
    fly_seed_with(1, faults)
}

fn fly_seed_with(seed: u64, faults: &str) -> Report {
    let report = fly_by_both(seed, faults);
    assert!(report.mission_completed, "{faults}");
    report
}

/// As [`fly_seed_with`], where the mission need not be completed.
fn fly_by_both(seed: u64, faults: &str) -> Report {
    let (seed, fault) = (format!("seed={seed}"), format!("faults=[{faults}]"));
    let scenario = scenario("kill-at-waypoint.toml", &[&seed, &fault]);
    let report = fly(&scenario, Engine::Events);
    assert_eq!(report.violations, [], "{faults}");
    assert_eq!(
        report.trace,
        fly(&scenario, Engine::Actors).trace,
        "{faults}"
    );
    report
}

#[test]
fn restarted_process_rejoins_the_swarm_from_its_journal() {
    let mut sweep = Sweep::default();
    for seed in sweep.of(0..20) {
        let report = fly_seed_with(seed, "{ at_s = 70, kind = \"restart\", drone = 1 }");
        assert_finished(&report, &[], &format!("seed {seed}"));
        // Drone 0 hears only drone 1 and waits for it: the master stays.
        assert_eq!(masters(&report), [[3]], "seed {seed}");
    }
    let report = fly_with(r#"{ at_s = 70, kind = "restart", drone = "master" }"#);
    assert_finished(&report, &[], "the master restarts");
    // Each segment elects a master; merged segments have one.
    let masters = masters(&report);
    assert_eq!((masters.len(), &masters[0]), (2, &vec![2, 4]));
    assert_eq!(masters[1].len(), 1, "{masters:?}");
}

#[test]
fn aircraft_crashed_on_the_ground_does_not_block_the_take_off() {
    let faults = "{ at_s = 0, kind = \"crash-aircraft\", drone = 6 }";
    let report = fly_with(faults);
    assert!(report.drones[..6].iter().all(|it| it.state == "finished"));
}

#[test]
fn process_restarted_on_the_ground_stays_there() {
    // With the mission before take-off, and after its flight controller landed it.
    for faults in [
        "{ at_s = 0.01, kind = \"restart\", drone = 5 }",
        "{ at_s = 70, kind = \"kill\", drone = 5 }, { at_s = 120, kind = \"restart\", drone = 5 }",
    ] {
        // In the first, drone 6 hears nobody but drone 5 and flies alone.
        let report = fly_by_both(1, faults);
        assert_eq!(report.mission_completed, report.never_met.is_empty());
        assert!(report.drones[5].landed_because.is_some(), "{faults}");
        assert_eq!(report.drones[5].state, "finished", "{faults}");
    }
}

#[test]
fn hung_actors_and_processes_are_detected_and_the_swarm_continues() {
    for faults in [
        r#"{ at_s = 70, kind = "hang", drone = "master", actor = "radio" }"#,
        r#"{ at_s = 70, kind = "hang", drone = "master", actor = "routing" }"#,
        r#"{ at_s = 70, kind = "hang", drone = "master", actor = "mission" }"#,
        r#"{ at_s = 70, kind = "hang", drone = "master", actor = "navigation" }"#,
        r#"{ at_s = 70, kind = "hang", drone = "master", actor = "msp" }"#,
        r#"{ at_s = 70, kind = "hang", drone = "master" }"#,
        "{ at_s = 70, kind = \"hang\", drone = 2, for_s = 1.5 }",
        r#"{ when = "taking-off", after_s = 5, kind = "hang", drone = 4, for_s = 2 }"#,
    ] {
        assert_finished(&fly_with(faults), &[], faults);
    }
}

#[test]
fn partitioned_swarm_splits_and_merges_after_the_partition() {
    for faults in [
        "{ at_s = 70, kind = \"cut\", links = [2, 3], for_s = 20 }",
        "{ at_s = 70, kind = \"one-way\", links = [3, 2], for_s = 20 }",
        "{ at_s = 60, kind = \"cut\", links = [[0, 1, 2], [3, 4]] }, { at_s = 90, kind = \"heal\", links = [2, 3] }",
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
fn jammed_swarm_continues_in_segments() {
    let faults =
        "{ at_s = 66, kind = \"jam\", north_m = 150, east_m = 0, radius_m = 80, for_s = 10 }";
    assert_finished(&fly_with(faults), &[], faults);
}

#[test]
fn the_others_continue_after_an_aircraft_crash() {
    let faults =
        r#"{ when = "taking-off", after_s = 65, kind = "crash-aircraft", drone = "master" }"#;
    let report = fly_with(faults);
    assert_finished(&report, &[3], faults);
    assert!(report.drones[3].state.starts_with("fell "));
}

#[test]
fn corrupted_replayed_and_forged_frames_are_dropped() {
    for (faults, reason) in [
        (
            r#"{ at_s = 50, kind = "corrupt", from = "all", share = 0.2, for_s = 100 }"#,
            "forged",
        ),
        (
            r#"{ at_s = 50, kind = "duplicate", from = "all", for_s = 100 }"#,
            "replayed",
        ),
        (
            r#"{ at_s = 70, kind = "replay", drone = "master" }"#,
            "replayed",
        ),
        (
            r#"{ at_s = 50, kind = "forge", drone = "master", times = 100, every_s = 0.1 }"#,
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
pub(crate) fn restarted_radio_drops_frames_recorded_before_its_restart() {
    let both = ["unproven", "replayed"].as_slice();
    for (faults, reasons) in [
        (
            r#"{ at_s = 70, kind = "restart", drone = 4 }, { at_s = 70.9, kind = "replay", drone = "master" }"#,
            both,
        ),
        (
            r#"{ at_s = 70, kind = "crash-actor", drone = 2, actor = "radio" }, { at_s = 70, kind = "replay", drone = "master" }"#,
            both,
        ),
        (
            r#"{ at_s = 70, kind = "restart", drone = "master" }, { at_s = 70.9, kind = "replay", drone = 2 }, { at_s = 70.9, kind = "replay", drone = 4 }"#,
            both,
        ),
        // Whether an unproven sender transmits in time is random.
        (
            r#"{ at_s = 50, kind = "duplicate", from = "all", for_s = 100 }, { at_s = 70, kind = "hang", drone = 4, actor = "radio" }"#,
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
fn delayed_and_reordered_frames_and_clock_drift_have_no_effect() {
    for faults in [
        r#"{ at_s = 50, kind = "reorder", from = "all", by_ms = 50, for_s = 100 }"#,
        r#"{ at_s = 50, kind = "duplicate", from = "all", for_s = 50 }, { at_s = 50, kind = "reorder", from = "all", by_ms = 50, for_s = 50 }"#,
        "{ at_s = 50, kind = \"delay\", from = 1, by_ms = 30, for_s = 100 }",
        "{ at_s = 60, kind = \"degrade\", links = [2, 3], loss = 0.6, for_s = 60 }",
        "{ at_s = 10, kind = \"skew\", drone = 3, ppm = 50000 }",
        "{ at_s = 10, kind = \"skew\", drone = 1, ppm = -50000, for_s = 100 }",
    ] {
        assert_finished(&fly_with(faults), &[], faults);
    }
}

#[test]
fn deadlines_of_a_drone_are_checked_by_its_own_clock() {
    for ppm in [-50_000, 50_000] {
        let skews = (0..7)
            .map(|drone| format!("{{ at_s = 0, kind = \"skew\", drone = {drone}, ppm = {ppm} }}"));
        let faults = format!("faults=[{}]", skews.collect::<Vec<_>>().join(", "));
        let skewed = scenario("kill-at-waypoint.toml", &["protocol.policy=flood", &faults]);
        for engine in [Engine::Actors, Engine::Events] {
            assert_eq!(fly(&skewed, engine).violations, [], "{ppm}");
        }
    }
}

#[test]
fn delays_of_any_length_break_no_rule() {
    // Drones hear each other late, or not in time, and may lead segments of their own.
    for delayed in [
        r#"kind = "delay", from = "all", by_ms = 300"#,
        r#"kind = "delay", from = "all", by_ms = 60"#,
        r#"kind = "delay", from = "all", by_ms = 2500, for_s = 30"#,
        r#"kind = "delay", from = 2, by_ms = 300, share = 0.5"#,
        r#"kind = "reorder", from = "all", by_ms = 300"#,
    ] {
        for (policy, seed) in [("tree", 1), ("tree", 2), ("flood", 1)] {
            let fields = [
                format!("faults=[{{ at_s = 60, {delayed} }}]"),
                format!("protocol.policy={policy}"),
                format!("seed={seed}"),
                "protocol.parameters=fast".to_owned(),
                "protocol.liveness=heartbeat".to_owned(),
                "formation.kind=linear".to_owned(),
                "formation.drones=6".to_owned(),
                "formation.spacing_m=30".to_owned(),
                "mission.file=field".to_owned(),
                "radio.range_m=100".to_owned(),
                "radio.medium=csma".to_owned(),
                "radio.model=nakagami".to_owned(),
            ];
            let fields: Vec<_> = fields.iter().map(String::as_str).collect();
            let report = fly(&scenario("thesis-1.toml", &fields), Engine::Events);
            assert_eq!(report.violations, [], "{policy}, seed {seed}: {delayed}");
        }
    }
}
