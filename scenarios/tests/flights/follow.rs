//! Following: drones keep formation on a moving master over several hops.

use muster_scenarios::engine::Engine;
use muster_scenarios::report::Report;

use crate::support::{Sweep, fly, scenario};

fn assert_all_down_together(report: &Report) {
    assert_eq!(report.violations, []);
    assert!(report.mission_completed);
    for drone in &report.drones {
        assert_eq!(drone.state, "finished");
        assert_eq!(drone.landed_because, None, "drone {}", drone.id);
    }
}

#[test]
fn members_up_to_seven_hops_away_keep_formation_at_10_mps() {
    let mut sweep = Sweep::default();
    for (loss, limit_m) in [("0", 2.0), ("0.1", 4.0)] {
        for seed in sweep.of(0..5) {
            let fields = [
                &*format!("radio.loss={loss}"),
                &*format!("seed={seed}"),
                // The 802.11a model adds losses.
                if loss == "0" {
                    "radio.model=range"
                } else {
                    "radio.model=80211a"
                },
            ];
            let report = fly(&scenario("follow.toml", &fields), Engine::Events);
            assert_all_down_together(&report);
            let error = report.following.unwrap();
            assert!(
                error.p95_m <= limit_m,
                "{fields:?}: 95th percentile {} m",
                error.p95_m
            );
            let members = report.drones.iter().filter(|drone| drone.id != 7);
            for member in members {
                let error = member.following.unwrap();
                assert!(error.p95_m <= limit_m, "{fields:?}: drone {}", member.id);
                assert!(
                    error.followed_s > 280.0,
                    "drone {}: following time",
                    member.id
                );
            }
        }
    }
}

#[test]
fn master_flown_by_hand_is_followed() {
    let scenario = scenario("follow-by-hand.toml", &[]);
    let report = fly(&scenario, Engine::Events);
    assert_all_down_together(&report);
    assert!(report.following.unwrap().p95_m <= 2.0);
    assert!(report.drones[0].flight_time_s.unwrap() > 150.0);
}

#[test]
fn following_works_over_flood_with_a_larger_error() {
    let overrides = ["protocol.policy=flood", "formation.drones=5"];
    let report = fly(&scenario("follow.toml", &overrides), Engine::Events);
    assert_all_down_together(&report);
    // At 10 m/s a hop costs 0.1 s in the mean, and one period at most.
    let error = report.following.unwrap();
    assert!(error.max_m <= 8.0, "{} m", error.max_m);
    assert!(error.p95_m > 0.5, "{} m", error.p95_m);
}

#[test]
fn both_engines_agree_on_following_with_and_without_crashes() {
    let faults = r#"faults=[
        { at_s = 80, kind = "crash-actor", drone = 7, actor = "mission" }, { at_s = 90, kind = "crash-actor", drone = 3, actor = "mission" },
        { at_s = 100, kind = "crash-actor", drone = 7, actor = "navigation" }, { at_s = 110, kind = "crash-actor", drone = 11, actor = "navigation" },
        { at_s = 120, kind = "crash-actor", drone = 7, actor = "routing" }, { at_s = 130, kind = "crash-actor", drone = 5, actor = "routing" },
        { at_s = 140, kind = "crash-actor", drone = 7, actor = "msp" }, { at_s = 150, kind = "crash-actor", drone = 9, actor = "msp" },
        { at_s = 160, kind = "crash-actor", drone = 7, actor = "radio" }, { at_s = 170, kind = "crash-actor", drone = 9, actor = "radio" },
    ]"#;
    for overrides in [&[][..], &[faults]] {
        let scenario = scenario("follow.toml", overrides);
        let actors = fly(&scenario, Engine::Actors);
        let events = fly(&scenario, Engine::Events);
        assert_eq!(actors.trace, events.trace);
        assert_all_down_together(&actors);
        assert!(actors.following.unwrap().p95_m <= 2.0);
    }
}

#[test]
fn members_of_a_silent_master_land_without_elections() {
    let crashes: Vec<_> = (0..8)
        .map(|times| {
            format!(
                "{{ at_s = {}, kind = \"crash-actor\", drone = 7, actor = \"radio\" }}",
                100 + times
            )
        })
        .collect();
    let faults = format!("faults=[{}]", crashes.join(", "));
    let fields = [&*faults, "protocol.succession=land"];
    let report = fly(&scenario("follow.toml", &fields), Engine::Events);
    assert_eq!(report.violations, []);
    assert!(!report.mission_completed);
    for drone in &report.drones {
        let because = match drone.id {
            7 => "an actor failed for good",
            _ => "the master was silent",
        };
        assert_eq!(drone.state, "finished", "drone {}", drone.id);
        assert_eq!(
            drone.landed_because.as_deref(),
            Some(because),
            "drone {}",
            drone.id
        );
    }
}

/// It climbs or descends to its hold altitude, returns level, and comes down at its place, however short the outage was.
#[test]
fn follower_that_was_without_position_returns_to_its_place() {
    for (drone, acceleration_mps2, outage_s) in
        [(0, 1, 5), (0, 2, 3), (0, 8, 2), (0, 8, 12), (4, 2, 5)]
    {
        let fields = [
            &*format!("vehicle.acceleration_mps2={acceleration_mps2}"),
            "vehicle.climb_mps=6",
            "vehicle.descent_mps=6",
            "formation.drones=5",
            "formation.spacing_m=40",
            "radio.range_m=1500",
            &format!(
                r#"faults=[{{ at_s = 66, kind = "lose-gps", drone = {drone}, for_s = {outage_s} }}]"#
            ),
        ];
        let report = fly(&scenario("follow.toml", &fields), Engine::Events);
        assert_all_down_together(&report);
        let error = report.drones[drone].following.unwrap();
        assert!(
            error.max_m < 300.0 && error.mean_m < 30.0,
            "{fields:?}: {error:?}"
        );
    }
}
