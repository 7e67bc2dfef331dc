//! Cost of a step of the particle filter: `cargo bench -p muster-indoor --bench localisation`. Beside it the same step in
//! numpy, if Python has it.
//!
//! A step moves, weighs and draws all particles. The number of particles is fixed. The map is as large as a floor of a
//! university: 75 m × 31 m at 6 cm, with rooms of 5 m × 4 m.

#![expect(
    clippy::print_stdout,
    clippy::disallowed_methods,
    reason = "this is a program that measures times and prints a table"
)]

use std::error::Error;
use std::f64::consts::PI;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::time::{Duration, Instant};

use muster_indoor::filter::{Config, Filter, Moved, Tables};
use muster_indoor::frames::{BodyXy, MapPose, Motion};
use muster_indoor::map::Map;
use muster_indoor::reading::{Echo, Mounting, Reading};
use nalgebra::{Matrix3, Vector3};

/// Particles and rays of each row; the first two have a target in milliseconds.
const ROWS: [(usize, usize, Option<f64>); 5] = [
    (1_000, 8, Some(0.2)),
    (1_000, 60, Some(0.4)),
    (10_000, 60, None),
    (30_000, 60, None),
    (100_000, 60, None),
];
/// Steps behind a figure; the median counts.
const STEPS: usize = 101;
const RESOLUTION_M: f64 = 0.06;

fn main() -> Result<(), Box<dyn Error>> {
    let map = Map::from_text(&rooms(), RESOLUTION_M)?;
    let config = Config {
        cone_range_max_m: 0.0,
        lookups_max: usize::MAX,
        ..Config::default()
    };
    let tables = Arc::new(Tables::new(&map, &config)?);
    println!("Milliseconds for a step of the particle filter, median of {STEPS}\n");
    println!(
        "{:>9} {:>6} {:>10} {:>10} {:>10}",
        "particles", "beams", "muster", "target", "numpy"
    );
    let mut is_missed = false;
    for (particles, beams, target_ms) in ROWS {
        let ours_ms = ours(&map, &tables, config, particles, beams);
        is_missed |= target_ms.is_some_and(|target_ms| ours_ms > target_ms);
        let target = target_ms.map_or_else(String::new, |it| format!("{it:.1}"));
        let numpy = numpy(particles, beams).map_or_else(|why| why, |ms| format!("{ms:.3}"));
        println!("{particles:>9} {beams:>6} {ours_ms:>10.3} {target:>10} {numpy:>10}");
    }
    if is_missed {
        return Err("a step takes longer than its target".into());
    }
    Ok(())
}

/// A plan of rooms with doors, one character a cell.
fn rooms() -> String {
    let (columns, rows) = (1_250, 517);
    let is_wall = |at: usize, pitch: usize| at % pitch < 2;
    let is_door = |at: usize, pitch: usize| (pitch / 2..pitch / 2 + 16).contains(&(at % pitch));
    let cell = |column: usize, row: usize| {
        let edge = column < 2 || row < 2 || column + 2 >= columns || row + 2 >= rows;
        let across = is_wall(column, 84) && !is_door(row, 67);
        let along = is_wall(row, 67) && !is_door(column, 84);
        if edge || across || along { '#' } else { '.' }
    };
    let line = |row: usize| {
        (0..columns)
            .map(|column| cell(column, row))
            .collect::<String>()
    };
    (0..rows).map(line).collect::<Vec<_>>().join("\n")
}

fn ours(map: &Map, tables: &Arc<Tables>, config: Config, particles: usize, beams: usize) -> f64 {
    let config = Config {
        min_particles: particles,
        max_particles: particles,
        max_beams: beams,
        ..config
    };
    let mut pose = MapPose::new(32.0, 14.0, 0.3);
    let mut filter = Filter::new(Arc::clone(tables), config, 1);
    filter.start_at(pose, Matrix3::from_diagonal(&Vector3::new(0.1, 0.1, 0.01)));
    let motion = Motion {
        forward_m: 0.02,
        left_m: 0.0,
        turn_rad: 0.02,
    };
    let mut times: Vec<f64> = (0..STEPS)
        .map(|_| {
            pose = pose.moved(motion);
            let readings = readings(map, pose, beams);
            let start = Instant::now();
            filter.step(Moved::Odometry(motion), &readings, Duration::ZERO);
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[STEPS / 2]
}

fn readings(map: &Map, pose: MapPose, beams: usize) -> Vec<Reading> {
    let reading = |beam: usize| {
        let bearing_rad = (beam as f64 / beams as f64 - 0.5) * PI;
        let range_m = map.cast(pose.at, pose.heading_rad + bearing_rad, 30.0);
        Reading {
            mounting: Mounting::laser(BodyXy::new(0.0, 0.0), bearing_rad, 30.0),
            echo: range_m.map_or(Echo::Silence, Echo::At),
            taken: Duration::ZERO,
            expires: Duration::from_secs(1),
        }
    };
    (0..beams).map(reading).collect()
}

/// The same in numpy.
fn numpy(particles: usize, beams: usize) -> Result<f64, String> {
    let program = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/localisation/step.py");
    let arguments = [particles, beams, STEPS].map(|it| it.to_string());
    let output = Command::new("python3")
        .arg(program)
        .args(arguments)
        .output();
    let output = output.map_err(|_| "no python3".to_owned())?;
    let text = String::from_utf8_lossy(&output.stdout);
    text.trim().parse().map_err(|_| "no numpy".to_owned())
}
