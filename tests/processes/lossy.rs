//! Waiting times at waypoints with 20 % frame loss, over an emulated radio and over a lossy network of namespaces.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;
use tempfile::TempDir;

use super::hosts::in_namespaces;
use super::network::{Network, are_adjacent};
use super::swarm::{complete_report, scenario_with, swarm};

/// Number of drones in the scenario.
const DRONES: u32 = 5;
/// Barriers of a flight: one after take-off and one per waypoint.
const BARRIERS: usize = 21;
/// Frame loss on the network, in percent; the same as the scenario's.
const LOSS: u32 = 20;
/// Most attempts if waits are too long, since other processes may slow the machine down. Other failures are not retried.
const FLIGHTS_MAX: u32 = 3;

/// Topology: the scenario's line, or a full mesh.
#[derive(Debug, Clone, Copy)]
enum Shape {
    Line,
    Mesh,
}

impl Shape {
    /// Hops from the master to the farthest drone.
    const fn hops(self) -> u32 {
        match self {
            Self::Line => 2,
            Self::Mesh => 1,
        }
    }

    const fn hears(self, from: u32, to: u32) -> bool {
        match self {
            Self::Line => are_adjacent(from, to),
            Self::Mesh => true,
        }
    }

    /// Writes the scenario with this topology and a parameter set into a folder.
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

    /// Accepted median and longest wait, in milliseconds. A flight has too few waits for a 99th percentile, so the longest
    /// stands for it.
    fn bounds_ms(self) -> [f64; 2] {
        let (hops, drones) = (f64::from(self.hops()), f64::from(DRONES));
        [
            10.0 + 8.0 * hops + drones,
            60.0 + 30.0 * hops + 3.0 * drones,
        ]
    }
}

/// Median and longest wait at a waypoint, in milliseconds.
fn waits_ms(report: &Value) -> [f64; 2] {
    let barriers = report["barriers"].as_array().unwrap();
    assert_eq!(barriers.len(), BARRIERS, "{barriers:#?}");
    let second = |it: &Value, field: &str| it[field].as_f64().unwrap();
    let wait_ms = |it| (second(it, "moving_s") - second(it, "arrived_s")) * 1e3;
    let mut waits: Vec<_> = barriers.iter().map(wait_ms).collect();
    waits.sort_by(f64::total_cmp);
    [waits[BARRIERS / 2], waits[BARRIERS - 1]]
}

/// A folder in memory, if available. A drone sends nothing before its journal is written, which may take seconds on a busy
/// disk.
fn folder() -> TempDir {
    let memory = Path::new("/dev/shm");
    if memory.is_dir() {
        tempfile::tempdir_in(memory).unwrap()
    } else {
        tempfile::tempdir().unwrap()
    }
}

/// Repeats the flight until its waits are within the bounds, up to [`FLIGHTS_MAX`] times.
fn assert_waits_are_short(shape: Shape, folder: &Path, fly: impl Fn(&Path) -> Command) {
    let bounds = shape.bounds_ms();
    let mut waits = Vec::new();
    for nth in 0..FLIGHTS_MAX {
        let out = folder.join(format!("flight-{nth}"));
        let report = complete_report(&fly(&out).arg("--json").output().unwrap(), &out);
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
    network.set_losses(|from, to| if shape.hears(from, to) { LOSS } else { 100 });
    let folder = folder();
    let scenario = shape.scenario(parameters, folder.path());
    let hosts = folder.path().join("hosts.toml");
    fs::write(&hosts, in_namespaces(&network, DRONES)).unwrap();
    assert_waits_are_short(shape, folder.path(), |out| {
        let mut command = swarm(scenario.to_str().unwrap(), out);
        command.arg("--unlimited-range").arg("--hosts").arg(&hosts);
        // The folder of the hosts' journals.
        command.env("TMPDIR", folder.path());
        command
    });
    assert!(network.processes(0..DRONES).is_empty());
}

#[test]
fn line_over_a_lossy_emulated_radio_waits_briefly_without_election() {
    assert_waits_are_short_by_emulation(Shape::Line, "fast");
}

#[test]
fn mesh_over_a_lossy_emulated_radio_waits_briefly_without_election() {
    assert_waits_are_short_by_emulation(Shape::Mesh, "quiet");
}

#[test]
fn line_over_a_lossy_network_waits_briefly_without_election() {
    assert_waits_are_short_in_namespaces(Shape::Line, "quiet");
}

#[test]
fn mesh_over_a_lossy_network_waits_briefly_without_election() {
    assert_waits_are_short_in_namespaces(Shape::Mesh, "fast");
}
