//! Agreement of the protocol with the thesis's tables of flights.

use muster_experiments::thesis::{Experiment, Flights};
use muster_scenarios::engine::Engine;
use muster_scenarios::report::DroneReport;
use muster_scenarios::scenario::Override;

fn assert_within(share: f64, ours: f64, theirs: f64, what: &str) {
    let off = (ours / theirs - 1.0).abs();
    assert!(
        off <= share,
        "{what}: {ours:.2}, in the thesis {theirs}, difference {:.1} %",
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
    for seed in ["1", "2", "3"] {
        for experiment in fly_all(seed) {
            let name = &experiment.report.scenario;
            let [master, maximum, mean, received] = experiment.quantities;
            for (quantity, share) in [
                (master, 0.02),
                (maximum, 0.02),
                (mean, 0.02),
                (received, 0.15),
            ] {
                let what = format!("{name}, seed {seed}, {}", quantity.name);
                assert_within(share, quantity.ours.unwrap(), quantity.thesis, &what);
            }
        }
    }
}

fn fly_all(seed: &str) -> Vec<Experiment> {
    let flights = Flights::load(&[Override::seed(seed)], 1).unwrap();
    flights.fly_experiments(Engine::Events, |_| None).unwrap()
}

#[test]
fn every_flight_time_follows_the_law_of_the_five_experiments() {
    for experiment in fly_all("1") {
        for (drone, law_s) in experiment.report.drones.iter().zip(experiment.law_s) {
            let what = format!("{} drone {}", experiment.report.scenario, drone.id);
            assert_within(0.03, flight_time_s(drone), law_s, &what);
        }
    }
}
