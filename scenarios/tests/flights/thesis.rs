//! Agreement of the protocol with the thesis.

use muster_scenarios::engine::Engine;
use muster_scenarios::report::Bridge;

use crate::support::{Sweep, fly, rows, scenario};

#[test]
fn protocol_reproduces_table_8() {
    for seed in 1..=20 {
        let seed = format!("seed={seed}");
        let scenario = scenario("thesis-1.toml", &["formation.drones=7", &seed]);
        let report = fly(&scenario, Engine::Events);
        let ours: Vec<Vec<String>> = report
            .drones
            .iter()
            .map(|drone| {
                let list: Vec<_> = drone.routing_list.iter().map(u32::to_string).collect();
                let hops = drone.hops.unwrap().to_string();
                vec![drone.id.to_string(), hops, list.join(" ")]
            })
            .collect();
        assert_eq!(ours, rows("table-8.csv"), "{seed}");
    }
}

#[test]
fn master_knows_drones_out_of_range_and_their_bridges() {
    let report = fly(
        &scenario("thesis-1.toml", &["formation.drones=7"]),
        Engine::Events,
    );
    let bridge = |bridge, out_of_range| Bridge {
        bridge,
        out_of_range,
    };
    assert_eq!(
        report.bridges,
        [bridge(2, vec![0, 1]), bridge(4, vec![5, 6])]
    );
    let relays: Vec<_> = report
        .drones
        .iter()
        .filter(|drone| drone.relay)
        .map(|drone| drone.id)
        .collect();
    assert_eq!(relays, [1, 2, 4, 5]);
    let out_of_range = report.drones.iter().filter(|drone| drone.out_of_range);
    assert_eq!(
        out_of_range.map(|drone| drone.id).collect::<Vec<_>>(),
        [0, 1, 5, 6]
    );
}

fn assert_within(share: f64, ours: f64, theirs: f64, what: &str) {
    let off = (ours / theirs - 1.0).abs();
    assert!(
        off <= share,
        "{what}: {ours:.2}, in the thesis {theirs}, difference {:.1} %",
        off * 100.0
    );
}

/// Mean wait at a waypoint over drones, waypoints and a sweep of the seeds 1 to 20.
fn mean_wait_s(name: &str, fields: &[&str]) -> f64 {
    let mut sweep = Sweep::default();
    let (mut sum_s, mut flights) = (0.0, 0.0);
    for seed in sweep.of(1..=20) {
        let seed = format!("seed={seed}");
        let fields: Vec<_> = fields.iter().copied().chain([&*seed]).collect();
        let report = fly(&scenario(name, &fields), Engine::Events);
        assert_eq!(report.violations, [], "{name}, {fields:?}");
        sum_s += report.mean_waypoint_delay_s().unwrap();
        flights += 1.0;
    }
    sum_s / flights
}

#[test]
fn wait_for_all_drones_takes_a_round_trip_to_the_farthest_drone() {
    let strict_s = mean_wait_s("thesis-2.toml", &[]);
    assert!((1.0..=1.6).contains(&strict_s), "{strict_s} s");
}

#[test]
fn wait_for_neighbours_takes_at_most_two_periods() {
    let neighbours_s = mean_wait_s("thesis-2.toml", &["protocol.barrier=neighbours"]);
    assert!((0.1..=0.4).contains(&neighbours_s), "{neighbours_s} s");
}

#[test]
fn settling_time_reproduces_the_waits_of_the_ancestor_and_the_thesis() {
    let one_hop_s = mean_wait_s("ancestor.toml", &[]);
    assert_within(0.05, one_hop_s, 0.504, "the ancestor");
    let settle_ms = scenario("ancestor.toml", &[]).plan.settle.as_millis();
    let fields = [
        "protocol.barrier=neighbours",
        &*format!("vehicle.settle_ms={settle_ms}"),
    ];
    assert_within(
        0.2,
        mean_wait_s("thesis-2.toml", &fields),
        0.43,
        "figure 36",
    );
}

#[test]
fn drones_beyond_the_neighbours_miss_no_waypoint() {
    for policy in ["flood", "tree"] {
        for loss in ["0", "0.2"] {
            let fields = [
                "protocol.barrier=neighbours",
                &*format!("protocol.policy={policy}"),
                &*format!("radio.loss={loss}"),
            ];
            let report = fly(&scenario("thesis-2.toml", &fields), Engine::Events);
            assert_eq!(report.violations, [], "{fields:?}");
            assert!(report.mission_completed, "{fields:?}");
            assert_eq!(report.barriers.len(), 8, "{fields:?}");
            for drone in &report.drones {
                assert_eq!(drone.landed_because, None, "{fields:?}, drone {}", drone.id);
            }
        }
    }
}

#[test]
fn drones_keep_separation_for_any_seed() {
    let mut sweep = Sweep::default();
    for experiment in 1..=5 {
        let name = format!("thesis-{experiment}.toml");
        for seed in sweep.of(0..20) {
            let report = fly(&scenario(&name, &[&format!("seed={seed}")]), Engine::Events);
            assert_eq!(report.violations, [], "{name}, seed {seed}");
            assert!(
                report.min_separation_m.unwrap() >= 5.0,
                "{name}, seed {seed}"
            );
            assert!(report.drones.iter().all(|drone| drone.state == "finished"));
        }
    }
}
