//! Where a recorded drive was on a map: a particle filter over a log, its track as a table and as a page.

mod drawing;
mod html;
mod plot;
mod table;
mod write;

use std::sync::Arc;
use std::time::{Duration, Instant};

use muster_indoor::filter::{Config, Estimate, Filter, Moved, NowhereFree, Tables};
use muster_indoor::frames::{MapPose, MapXy, wrapped_rad};
use muster_indoor::log::Step;
use muster_indoor::map::Map;
use muster_indoor::reading::{Mounting, Reading};
use nalgebra::{Matrix3, Vector3};
use serde::Serialize;
pub use table::table;
pub use write::{LOCATED_HTML, LOCATED_JSON, write};

/// Particles that are drawn of a moment.
const DRAWN_MAX: usize = 2_000;
/// Deviations of a given start, metres and radians.
const START_SPREAD: (f64, f64) = (0.3, 0.15);

/// Where the filter starts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Start {
    /// Anywhere on the map.
    Anywhere,
    /// Anywhere between two corners.
    Within(MapXy, MapXy),
    /// Near a given pose: deviations of 0.3 m along each axis and 0.15 rad.
    At(MapPose),
}

/// What is asked of a log.
#[derive(Debug, Clone)]
pub struct Question {
    /// The map's name, for the output.
    pub map_name: String,
    /// The log's name, for the output.
    pub log_name: String,
    /// The filter's parameters.
    pub config: Config,
    /// The filter's seed.
    pub seed: u64,
    /// Where the filter starts.
    pub start: Start,
    /// The laser's place, direction and range.
    pub laser: Mounting,
    /// True pose at the last scan, if the log does not record it.
    pub end: Option<MapPose>,
}

/// The filter's answer to one scan.
#[derive(Debug, Clone, Serialize)]
pub struct Located {
    /// Of the scan, from 0.
    pub scan: usize,
    /// Metres on the map.
    pub x_m: f64,
    /// Metres on the map.
    pub y_m: f64,
    /// Degrees counter-clockwise from the map's x axis.
    pub heading_deg: f64,
    /// Deviation of the place, metres.
    pub deviation_m: f64,
    /// Whether the filter says that it is lost.
    pub is_lost: bool,
    /// Share of readings that fit the map.
    pub fit: f64,
    /// Number of particles.
    pub particles: usize,
    /// Distance to the true place, metres, if it is known.
    pub error_m: Option<f64>,
    /// Difference to the true heading, degrees, if it is known.
    pub error_deg: Option<f64>,
    /// What the step took, milliseconds.
    #[serde(skip)]
    pub took_ms: f64,
}

/// Particles at a moment, for a picture.
#[derive(Debug, Clone)]
pub(crate) struct Moment {
    scan: usize,
    particles: Vec<MapPose>,
}

/// Where a drive was.
#[derive(Debug, Clone, Serialize)]
pub struct Track {
    /// The map's name.
    pub map: String,
    /// The log's name.
    pub log: String,
    /// The filter's seed.
    pub seed: u64,
    /// The answers to all scans.
    pub scans: Vec<Located>,
    #[serde(skip)]
    moments: Vec<Moment>,
}

impl Track {
    /// Index of the first scan after which the filter is never lost.
    #[must_use]
    pub fn found_at(&self) -> Option<usize> {
        let lost = self.scans.iter().rposition(|scan| scan.is_lost);
        let found = lost.map_or(0, |lost| lost + 1);
        (found < self.scans.len()).then_some(found)
    }

    /// Mean number of particles once found.
    fn particles_mean(&self) -> Option<f64> {
        let scans = &self.scans[self.found_at()?..];
        let sum: usize = scans.iter().map(|scan| scan.particles).sum();
        Some(sum as f64 / scans.len() as f64)
    }

    fn took_ms_median(&self) -> Option<f64> {
        let mut took_ms: Vec<f64> = self.scans.iter().map(|scan| scan.took_ms).collect();
        took_ms.sort_by(f64::total_cmp);
        took_ms.get(took_ms.len() / 2).copied()
    }
}

/// Runs the filter over a log. `watch` is told the number of scans done after each.
///
/// # Errors
/// If no cell of the map is free where the filter is to start.
pub fn locate(
    question: &Question,
    map: &Map,
    log: &[Step],
    mut watch: impl FnMut(usize),
) -> Result<Track, NowhereFree> {
    let tables = Arc::new(Tables::new(map, &question.config)?);
    let mut filter = Filter::new(tables, question.config, question.seed);
    match question.start {
        Start::Anywhere => {}
        Start::Within(low, high) => filter.start_within(low, high)?,
        Start::At(pose) => {
            let (metres, radians) = START_SPREAD;
            let deviations = Vector3::new(metres, metres, radians);
            let covariance = Matrix3::from_diagonal(&deviations.component_mul(&deviations));
            filter.start_at(pose, covariance);
        }
    }
    let mut track = Track {
        map: question.map_name.clone(),
        log: question.log_name.clone(),
        seed: question.seed,
        scans: Vec::with_capacity(log.len()),
        moments: Vec::new(),
    };
    let mut all = Vec::with_capacity(log.len());
    for (scan, step) in log.iter().enumerate() {
        let readings: Vec<Reading> = step.scan.readings(question.laser, Duration::ZERO).collect();
        let start = Instant::now();
        let estimate = filter.step(Moved::Odometry(step.motion), &readings, Duration::ZERO);
        let took_ms = start.elapsed().as_secs_f64() * 1e3;
        let is_last = scan + 1 == log.len();
        let truth = step.truth.or(question.end.filter(|_| is_last));
        track.scans.push(located(scan, &estimate, truth, took_ms));
        if is_power_of_two_or_zero(scan) || is_last {
            let every = (estimate.particles / DRAWN_MAX).max(1);
            all.push(Moment {
                scan,
                particles: filter.particles().step_by(every).collect(),
            });
        }
        watch(scan + 1);
    }
    track.moments = all;
    Ok(track)
}

/// Moments lie closer together at the beginning, where particles move most.
fn is_power_of_two_or_zero(scan: usize) -> bool {
    scan == 0 || scan.is_power_of_two()
}

fn located(scan: usize, estimate: &Estimate, truth: Option<MapPose>, took_ms: f64) -> Located {
    let pose = estimate.pose;
    let turn = |truth: MapPose| {
        wrapped_rad(pose.heading_rad - truth.heading_rad)
            .abs()
            .to_degrees()
    };
    Located {
        scan,
        x_m: pose.at.x_m,
        y_m: pose.at.y_m,
        heading_deg: pose.heading_rad.to_degrees(),
        deviation_m: (estimate.covariance[(0, 0)] + estimate.covariance[(1, 1)])
            .max(0.0)
            .sqrt(),
        is_lost: estimate.is_lost,
        fit: estimate.fit,
        particles: estimate.particles,
        error_m: truth.map(|truth| pose.at.distance_m(truth.at)),
        error_deg: truth.map(turn),
        took_ms,
    }
}
