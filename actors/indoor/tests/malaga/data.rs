//! The data, and a reference for the poses between its ends.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use muster_indoor::frames::{BodyXy, MapPose, wrapped_rad};
use muster_indoor::log::{self, Step};
use muster_indoor::map::{Header, Map};
use muster_indoor::reading::{Mounting, Reading};

/// Where the laser is, metres ahead of the robot's centre. The data doesn't say so, but the poses that scans have on the map
/// agree with the odometry in turns for 0.7 to 0.9 m, and MRPT's final pose is 0.70 m behind that of the last scan.
const LASER: Mounting = Mounting::laser(BodyXy::new(0.7, 0.0), 0.0, 80.0);

pub(crate) struct Malaga {
    pub(crate) map: Map,
    pub(crate) log: Vec<Step>,
    pub(crate) readings: Vec<Vec<Reading>>,
    /// The robot's pose at each scan.
    pub(crate) track: Vec<MapPose>,
}

impl Malaga {
    /// `None`, and a line that says so, without the data.
    pub(crate) fn load() -> Option<Self> {
        let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
        let folder = std::env::var_os("MUSTER_MALAGA").map_or(beside, PathBuf::from);
        if !folder.is_dir() {
            let test = std::thread::current();
            let test = test.name().unwrap_or_default();
            // The test runner would capture the output of `eprintln!`.
            writeln!(
                io::stderr(),
                "skipped: {test}: {} is no folder",
                folder.display()
            )
            .unwrap();
            return None;
        }
        let header = fs::read_to_string(folder.join("malaga_map.yaml")).unwrap();
        let header = Header::parse(&header).unwrap();
        let image = fs::read(folder.join(header.image().unwrap())).unwrap();
        let map = Map::parse(&header, &image).unwrap();
        let log =
            log::parse(&fs::read_to_string(folder.join("malaga_scans.txt")).unwrap()).unwrap();
        let readings = |step: &Step| step.scan.readings(LASER, Duration::ZERO).collect();
        let readings: Vec<Vec<Reading>> = log.iter().map(readings).collect();
        let track = track(&map, &log, &readings);
        Some(Self {
            map,
            log,
            readings,
            track,
        })
    }
}

/// Whether a pose is off by more than half a metre or 15°.
pub(crate) fn is_off(pose: MapPose, reference: MapPose) -> bool {
    let turn_deg = wrapped_rad(pose.heading_rad - reference.heading_rad).to_degrees();
    pose.at.distance_m(reference.at) > 0.5 || turn_deg.abs() > 15.0
}

/// Poses at which all beams of each scan fit best, from the known end backwards. No filter takes part.
fn track(map: &Map, log: &[Step], readings: &[Vec<Reading>]) -> Vec<MapPose> {
    let mut pose = MapPose::new(15.91, -10.01, 4.9_f64.to_radians());
    let mut track = Vec::new();
    for (step, readings) in log.iter().zip(readings).rev() {
        pose = best_fit(map, readings, pose);
        track.push(pose);
        let before = pose.heading_rad - step.motion.turn_rad;
        let moved = MapPose::new(0.0, 0.0, before).moved(step.motion);
        pose = MapPose::new(
            pose.at.x_m - moved.at.x_m,
            pose.at.y_m - moved.at.y_m,
            before,
        );
    }
    track.reverse();
    track
}

/// Climbs to the nearest best fit in steps from 10 cm down.
fn best_fit(map: &Map, readings: &[Reading], start: MapPose) -> MapPose {
    let (mut best, mut step) = ((start, misfit(map, readings, start)), 0.1);
    while step > 0.002 {
        let MapPose {
            at, heading_rad, ..
        } = best.0;
        let tried = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 0.2)];
        let tried = tried
            .into_iter()
            .flat_map(|(x, y, turn)| [(x, y, turn), (-x, -y, -turn)]);
        let poses = tried.map(|(x, y, turn)| {
            MapPose::new(
                at.x_m + step * x,
                at.y_m + step * y,
                heading_rad + step * turn,
            )
        });
        let scored = poses.map(|pose| (pose, misfit(map, readings, pose)));
        match scored.min_by(|a, b| a.1.total_cmp(&b.1)) {
            Some(better) if better.1 < best.1 => best = better,
            _ => step *= 0.5,
        }
    }
    best.0
}

fn misfit(map: &Map, readings: &[Reading], pose: MapPose) -> f64 {
    let ends = readings.iter().filter_map(|reading| {
        let range_m = reading.range_m(Duration::ZERO)?;
        Some(
            pose.place(
                reading
                    .mounting
                    .at
                    .towards(reading.mounting.bearing_rad, range_m),
            ),
        )
    });
    ends.map(|end| map.distance_m(end).min(0.3)).sum()
}
