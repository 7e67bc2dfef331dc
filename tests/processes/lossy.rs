//! What waypoints cost processes whose radio loses a fifth of all frames: emulated, or on the network of hosts that are
//! namespaces.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;
use tempfile::TempDir;

use super::hosts::in_namespaces;
use super::network::{Network, next_to};
use super::swarm::{flown, scenario_with, swarm};

/// How many drones the scenario has.
const DRONES: u32 = 5;
/// Waits of a flight: where the take-off ends, and at each waypoint.
const BARRIERS: usize = 21;
/// What is lost on the network, in percent; the scenario's radio loses as much.
const LOSS: u32 = 20;
/// How often a flight is flown whose waits are too long, since others may have kept the machine busy. Nothing else is tried
/// again.
const FLIGHTS_MAX: u32 = 3;

/// Who hears whom: the scenario's line, or everybody everybody.
#[derive(Debug, Clone, Copy)]
enum Shape {
    Line,
    Mesh,
}

impl Shape {
    /// From the master to the farthest drone.
    const fn hops(self) -> u32 {
        match self {
            Self::Line => 2,
            Self::Mesh => 1,
        }
    }

    const fn hears(self, from: u32, to: u32) -> bool {
        match self {
            Self::Line => next_to(from, to),
            Self::Mesh => true,
        }
    }

    /// The scenario for it with a set of parameters, in a folder.
    fn scenario(self, parameters: &str, folder: &Path) -> PathBuf {
        let parameters = format!("parameters = \"{parameters}\"");
        let range = match self {
            Self::Line => "range_m = 30",
            Self::Mesh => "range_m = 300",
        };
        let lossy = [
            ("parameters = \"fast\"", parameters.as_str()),
            ("range_m = 30", range),
        ];
        scenario_with("swarm-lossy.toml", &lossy, folder)
    }

    /// The median wait and the longest that are accepted, in milliseconds. The longest of a flight stands for the 99th
    /// percentile, for which its waits are too few.
    fn bounds_ms(self) -> [f64; 2] {
        let (hops, drones) = (f64::from(self.hops()), f64::from(DRONES));
        [
            10.0 + 8.0 * hops + drones,
            60.0 + 30.0 * hops + 3.0 * drones,
        ]
    }
}

/// The median and the longest wait at a waypoint.
fn waits_ms(report: &Value) -> [f64; 2] {
    let barriers = report["barriers"].as_array().unwrap();
    assert_eq!(barriers.len(), BARRIERS, "{barriers:#?}");
    let second = |it: &Value, field: &str| it[field].as_f64().unwrap();
    let wait_ms = |it| (second(it, "moving_s") - second(it, "arrived_s")) * 1e3;
    let mut waits: Vec<_> = barriers.iter().map(wait_ms).collect();
    waits.sort_by(f64::total_cmp);
    [waits[BARRIERS / 2], waits[BARRIERS - 1]]
}

/// A folder in memory, where there is such: a drone says nothing before its journal has been written, and a disk that others
/// keep busy may take seconds for that.
fn folder() -> TempDir {
    let memory = Path::new("/dev/shm");
    if memory.is_dir() {
        tempfile::tempdir_in(memory).unwrap()
    } else {
        tempfile::tempdir().unwrap()
    }
}

/// Flies into a folder until a flight's waits are within their bounds.
fn assert_waits_are_short(shape: Shape, folder: &Path, fly: impl Fn(&Path) -> Command) {
    let bounds = shape.bounds_ms();
    let mut waits = Vec::new();
    for nth in 0..FLIGHTS_MAX {
        let out = folder.join(format!("flight-{nth}"));
        let report = flown(&fly(&out).arg("--json").output().unwrap(), &out);
        assert_eq!(report["elections"], Value::Array(Vec::new()));
        let flight = waits_ms(&report);
        if flight
            .iter()
            .zip(bounds)
            .all(|(wait, bound)| *wait <= bound)
        {
            return;
        }
        waits.push(flight);
    }
    panic!("median and longest wait of each flight: {waits:?} ms, accepted: {bounds:?} ms");
}

fn assert_waits_are_short_by_emulation(shape: Shape, parameters: &str) {
    let folder = folder();
    let scenario = shape.scenario(parameters, folder.path());
    assert_waits_are_short(shape, folder.path(), |out| {
        swarm(scenario.to_str().unwrap(), out)
    });
}

fn assert_waits_are_short_in_namespaces(shape: Shape, parameters: &str) {
    let Some(network) = Network::new(DRONES) else {
        return;
    };
    network.lose(|from, to| if shape.hears(from, to) { LOSS } else { 100 });
    let folder = folder();
    let scenario = shape.scenario(parameters, folder.path());
    let hosts = folder.path().join("hosts.toml");
    fs::write(&hosts, in_namespaces(&network, DRONES)).unwrap();
    assert_waits_are_short(shape, folder.path(), |out| {
        let mut command = swarm(scenario.to_str().unwrap(), out);
        command.arg("--unlimited-range").arg("--hosts").arg(&hosts);
        // Where hosts keep their drones' journals.
        command.env("TMPDIR", folder.path());
        command
    });
    assert!(network.processes(0..DRONES).is_empty());
}

#[test]
fn a_line_over_an_emulated_radio_that_loses_a_fifth_elects_nobody_and_waits_briefly() {
    assert_waits_are_short_by_emulation(Shape::Line, "fast");
}

#[test]
fn a_mesh_over_an_emulated_radio_that_loses_a_fifth_elects_nobody_and_waits_briefly() {
    assert_waits_are_short_by_emulation(Shape::Mesh, "quiet");
}

#[test]
fn a_line_over_a_network_that_loses_a_fifth_elects_nobody_and_waits_briefly() {
    assert_waits_are_short_in_namespaces(Shape::Line, "quiet");
}

#[test]
fn a_mesh_over_a_network_that_loses_a_fifth_elects_nobody_and_waits_briefly() {
    assert_waits_are_short_in_namespaces(Shape::Mesh, "fast");
}
