//! Processes whose disk is slow.

use std::fs;

use super::fleet::{Fleet, MASTER, Process};
use super::rc::disturb;

#[test]
#[ignore = "measures deadlines, with nothing beside it: .ci/nightly"]
fn syncs_that_take_half_a_second_more_delay_no_step_by_20_ms() {
    let fleet = Fleet::new();
    let (library, syncs) = (disturb(&fleet.path("")), fleet.path("syncs"));
    fs::write(&syncs, "").unwrap();
    let start = |id| {
        let mut command = fleet.command(id);
        command.args((id == MASTER).then_some("--fly"));
        command.env("LD_PRELOAD", &library).env("SLOW_SYNC", &syncs);
        Process::start(id, command)
    };
    let mut drones: Vec<_> = (0..5).map(start).collect();
    for (id, drone) in drones.iter_mut().enumerate() {
        assert_eq!(drone.end(), Some(0), "drone {id}");
    }
    assert!(fs::metadata(&syncs).unwrap().len() > 5, "no sync was slow");
    for drone in &drones {
        let counted = drone.log.iter().rfind(|line| line["message"] == "counted");
        let late_ms = counted.unwrap()["late_ms_max"].as_f64().unwrap();
        assert!(late_ms > 0.0 && late_ms <= 20.0, "{late_ms} ms");
    }
}
