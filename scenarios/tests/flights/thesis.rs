//! What the running protocol has in common with the thesis.

use muster_scenarios::engine::Engine;
use muster_scenarios::report::{Bridge, DroneReport, Role};

use crate::support::{fly, rows, scenario};

#[test]
fn table_8_comes_out_of_the_running_protocol() {
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
fn the_master_knows_who_is_out_of_its_range_and_who_bridges_to_them() {
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
        "{what}: {ours:.2} where the thesis has {theirs}, {:.1} % off",
        off * 100.0
    );
}

fn flight_time_s(drone: &DroneReport) -> f64 {
    drone
        .flight_time_s
        .unwrap_or_else(|| panic!("drone {} has not landed", drone.id))
}

#[test]
fn flight_times_and_messages_agree_with_tables_9_to_13() {
    for row in rows("tables-9-13.csv") {
        let name = row[0].as_str();
        let [master_s, maximum_s, mean_s, received] =
            [1, 2, 3, 4].map(|column| row[column].parse::<f64>().unwrap());
        for seed in ["seed=1", "seed=2", "seed=3"] {
            let report = fly(&scenario(name, &[seed]), Engine::Events);
            let master = report
                .drones
                .iter()
                .find(|drone| drone.role == Role::Master)
                .unwrap();
            assert_within(0.02, flight_time_s(master), master_s, name);
            let ours = report.drones.iter().map(flight_time_s).fold(0.0, f64::max);
            assert_within(0.02, ours, maximum_s, name);
            assert_within(0.02, report.means.flight_time_s.unwrap(), mean_s, name);
            assert_within(0.15, report.means.messages_received, received, name);
        }
    }
}

#[test]
fn every_flight_time_obeys_the_law_of_the_five_experiments() {
    // A slave d metres from the master takes d / 10 + 12.4 s longer than it.
    for row in rows("tables-9-13.csv") {
        let master_s: f64 = row[1].parse().unwrap();
        let scenario = scenario(&row[0], &[]);
        let slots = scenario.layout.formation().slots().iter();
        let report = fly(&scenario, Engine::Events);
        for (drone, slot) in report.drones.iter().zip(slots) {
            let law_s = match drone.role {
                Role::Master => master_s,
                Role::Slave => master_s + slot.0.norm() / 10.0 + 12.4,
            };
            let what = format!("{} drone {}", row[0], drone.id);
            assert_within(0.03, flight_time_s(drone), law_s, &what);
        }
    }
}

#[test]
fn no_two_drones_come_too_close_whatever_the_seed() {
    for name in rows("tables-9-13.csv").iter().map(|row| row[0].as_str()) {
        for seed in 0..100 {
            let report = fly(&scenario(name, &[&format!("seed={seed}")]), Engine::Events);
            assert_eq!(report.violations, [], "{name}, seed {seed}");
            assert!(
                report.min_separation_m.unwrap() >= 5.0,
                "{name}, seed {seed}"
            );
            assert!(report.drones.iter().all(|drone| drone.state == "finished"));
        }
    }
}
