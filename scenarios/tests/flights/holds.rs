//! Hold times at waypoints, with and without a change of master.

use muster_scenarios::engine::Engine;
use muster_scenarios::report::Report;
use muster_scenarios::scenario::Scenario;

use crate::support::{assert_finished, fly, masters, scenario};

/// Holds for 20 s at waypoint 1, 10 s at waypoint 2 and 5 s at the last.
const MISSION: &str = "mission.file=missions/lookout.waypoints";
const HOLDS_S: [f64; 4] = [0.0, 20.0, 10.0, 5.0];

/// Upper bound of the barrier wait without the hold time.
const BARRIER_MAX_S: f64 = 3.0;

/// Seven drones in line; the outer ones are two hops from the master.
fn held(policy: &str, fields: &[&str]) -> Scenario {
    let policy = format!("protocol.policy={policy}");
    let fields = [&[MISSION, &policy, "faults=[]"], fields].concat();
    scenario("kill-at-waypoint.toml", &fields)
}

/// Runs on both engines; checks that they agree and break no rule.
fn flown(scenario: &Scenario, what: &str) -> Report {
    let report = fly(scenario, Engine::Events);
    assert_eq!(report.violations, [], "{what}");
    let actors = fly(scenario, Engine::Actors);
    assert_eq!(actors.trace, report.trace, "{what}: the engines disagree");
    report
}

/// Time at each waypoint with all there, holds included, in seconds.
fn waits_s(report: &Report) -> Vec<f64> {
    let barriers = report.barriers.iter();
    barriers.map(|it| it.moving_s - it.arrived_s).collect()
}

#[test]
fn hold_time_starts_with_the_last_arrival() {
    for policy in ["flood", "tree"] {
        let report = flown(&held(policy, &[]), policy);
        assert_finished(&report, &[], policy);
        for (barrier, hold_s) in report.barriers.iter().zip(HOLDS_S) {
            let wait_s = barrier.wait_s();
            assert!((barrier.hold_s - hold_s).abs() < 1e-9, "{barrier:?}");
            assert!((0.0..BARRIER_MAX_S).contains(&wait_s), "{barrier:?}");
        }
        let delays_s = report.drones.iter().map(|it| it.waypoint_delay_s.unwrap());
        assert!(delays_s.fold(0.0, f64::max) < BARRIER_MAX_S, "{policy}");
        let waits_s = waits_s(&report);
        assert_eq!(waits_s.len(), HOLDS_S.len(), "{policy}");
        for (wait_s, hold_s) in waits_s.iter().zip(HOLDS_S) {
            let late_s = wait_s - hold_s;
            assert!(
                (0.0..BARRIER_MAX_S).contains(&late_s),
                "{policy}: {waits_s:?}"
            );
        }
    }
}

#[test]
fn restart_of_a_process_or_an_actor_does_not_end_a_hold() {
    for policy in ["flood", "tree"] {
        for fault in [
            "kind = \"restart\", drone = \"master\"",
            "kind = \"restart\", drone = 0",
            "kind = \"crash-actor\", drone = \"master\", actor = \"mission\"",
            "kind = \"crash-actor\", drone = \"master\", actor = \"routing\"",
            "kind = \"crash-actor\", drone = 6, actor = \"mission\"",
            "kind = \"hang\", drone = \"master\", for_s = 0.5",
        ] {
            let what = format!("{policy}, {fault}");
            let faults = format!("faults=[{{ at_waypoint = 1, after_s = 9, {fault} }}]");
            let scenario = held(policy, &[&faults]);
            let report = flown(&scenario, &what);
            assert_finished(&report, &[], &what);
            assert!(report.mission_completed, "{what}");
            // A master of a new epoch starts the hold again, once all are in their layers.
            let silence_s = 3.0 * scenario.plan.protocol.time_to_live.as_secs_f64();
            let max_s = HOLDS_S[1]
                + if report.elections.is_empty() {
                    0.0
                } else {
                    20.0 + silence_s + scenario.plan.limits.climb.as_secs_f64()
                };
            let wait_s = waits_s(&report)[1];
            assert!(
                (HOLDS_S[1]..max_s + BARRIER_MAX_S).contains(&wait_s),
                "{what}: {wait_s} s, {:?}",
                report.elections
            );
        }
    }
}

#[test]
fn master_elected_during_a_hold_holds_at_most_the_full_time() {
    for policy in ["flood", "tree"] {
        for after_s in [2.0, 9.0, 18.0] {
            let faults = format!(
                "faults=[{{ at_waypoint = 1, after_s = {after_s}, kind = \"kill\", drone = \"master\" }}]"
            );
            let what = format!("{policy}, {after_s} s");
            // All drones are in range of each other, so there is one election.
            let scenario = held(policy, &["radio.range_m=500", &faults]);
            let report = flown(&scenario, &what);
            assert_finished(&report, &[3], &what);
            assert!(report.mission_completed, "{what}");
            assert_eq!(masters(&report).len(), 1, "{what}");
            let wait_s = waits_s(&report)[1];
            let election_s = report.elections[0].settled_after_s.unwrap_or_default();
            let climb_s = scenario.plan.limits.climb.as_secs_f64();
            // Time to detect the loss, to elect, to climb, and to collect acknowledgements.
            let max_s = after_s + election_s + climb_s + HOLDS_S[1] + 2.0 * BARRIER_MAX_S;
            assert!(
                wait_s >= after_s + HOLDS_S[1] - 1.0 && wait_s <= max_s,
                "{what}: {wait_s} s"
            );
        }
    }
}

#[test]
fn followed_master_holds_at_its_waypoints() {
    for policy in ["flood", "tree"] {
        let following = ["protocol.kind=follow"];
        let with_holds = flown(&held(policy, &following), policy);
        assert_finished(&with_holds, &[], policy);
        let without = [following[0], "mission.file=missions/field.waypoints"];
        let without = flown(&held(policy, &without), policy);
        let longer_s = with_holds.simulated_s - without.simulated_s;
        let holds_s: f64 = HOLDS_S.iter().sum();
        assert!((longer_s - holds_s).abs() < 1.0, "{policy}: {longer_s} s");
    }
}

#[test]
fn time_limits_include_hold_times() {
    let with_holds = held("tree", &[]).plan.limits;
    let without = held("tree", &["mission.file=missions/field.waypoints"])
        .plan
        .limits;
    let holds_s: f64 = HOLDS_S.iter().sum();
    let longer_s = |longer: std::time::Duration, than: std::time::Duration| {
        (longer.as_secs_f64() - than.as_secs_f64() - holds_s).abs()
    };
    assert!(longer_s(with_holds.flight, without.flight) < 1e-6);
    assert!(
        longer_s(
            with_holds.flight_time,
            without.flight_time + (with_holds.flight - without.flight)
        ) < 1e-6
    );
    assert!(with_holds.duration > without.duration);
    assert_eq!(with_holds.leg, without.leg, "a leg does not include a hold");
}
