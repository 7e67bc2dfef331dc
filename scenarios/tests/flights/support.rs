//! Helpers of the scenario tests.

use std::path::PathBuf;

use muster_scenarios::engine::{Engine, run};
use muster_scenarios::report::Report;
use muster_scenarios::scenario::{Override, Scenario, load};

/// Path of a shipped file.
pub(crate) fn shipped(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(name)
}

/// A shipped scenario with overrides.
pub(crate) fn scenario(name: &str, overrides: &[&str]) -> Scenario {
    let overrides: Vec<Override> = overrides.iter().map(|it| it.parse().unwrap()).collect();
    load(&shipped(name), &overrides).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// Which flights of a sweep are flown: an eighth, or all if the variable `MUSTER_SWEEPS` is set, as in `.ci/nightly`.
#[derive(Default)]
pub(crate) struct Sweep {
    flights: u32,
}

impl Sweep {
    /// Those of these flights that are flown; counts on from the flights before.
    pub(crate) fn of<I: IntoIterator>(&mut self, flights: I) -> impl Iterator<Item = I::Item> {
        let is_whole = std::env::var_os("MUSTER_SWEEPS").is_some();
        flights.into_iter().filter(move |_| {
            // Multiples of the golden ratio are spread evenly whatever the length of the lists that are combined.
            let place = self.flights.wrapping_mul(0x9E37_79B9);
            self.flights += 1;
            is_whole || place < u32::MAX / 8
        })
    }
}

pub(crate) fn fly(scenario: &Scenario, engine: Engine) -> Report {
    run(scenario, engine, None).unwrap().0
}

/// Checks that all drones but the lost ones finished at the end of the mission.
pub(crate) fn assert_finished(report: &Report, lost: &[u32], what: &str) {
    for drone in &report.drones {
        let is_lost = lost.contains(&drone.id);
        assert_eq!(drone.state == "finished", !is_lost, "{what}, {drone:?}");
        assert_eq!(drone.landed_because, None, "{what}, {drone:?}");
    }
}

/// The masters after each election.
pub(crate) fn masters(report: &Report) -> Vec<Vec<u32>> {
    let elections = report.elections.iter();
    elections.map(|election| election.masters.clone()).collect()
}

/// The rows of a CSV file, without its header.
pub(crate) fn rows(name: &str) -> Vec<Vec<String>> {
    let path = shipped("tests/data").join(name);
    let mut reader = csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .from_path(path)
        .unwrap();
    reader
        .records()
        .map(|row| row.unwrap().iter().map(str::to_owned).collect())
        .collect()
}
