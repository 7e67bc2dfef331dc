//! The readings of a step, prepared to be compared with the map from many poses.

use std::time::Duration;

use super::cone::Cone;
use super::config::Config;
use super::field::{BLOCK, Curve};
use super::particles::Particles;
use super::tables::Tables;
use crate::reading::{Mounting, Reading};

/// Narrower cones are rays, radians: 5°.
const RAY_APERTURE_MAX_RAD: f64 = 0.087;
/// Most cones of a step.
const CONES_MAX: usize = 64;

/// What is compared with the map.
pub(super) struct Observation {
    /// The ends of rays, in cells from the drone.
    ends: Vec<(f32, f32)>,
    curve: Curve,
    /// With a hit's likelihood at the map's own accuracy.
    cones: Vec<Cone>,
}

impl Observation {
    /// Takes at most `beams_max` rays, evenly from all that may be used, and up to [`CONES_MAX`] cones.
    pub(super) fn new(
        readings: &[Reading],
        now: Duration,
        beams_max: usize,
        tables: &Tables,
        config: &Config,
    ) -> Self {
        let is_cone = |reading: &&Reading| reading.mounting.aperture_rad > RAY_APERTURE_MAX_RAD;
        let cells = |metres: f64| (metres / tables.resolution_m) as f32;
        let rays = readings.iter().filter(|reading| !is_cone(reading));
        let rays: Vec<(f32, f32)> = rays
            .filter_map(|reading| {
                let range_m = reading.range_m(now)?;
                let end = reading
                    .mounting
                    .at
                    .towards(reading.mounting.bearing_rad, range_m);
                Some((cells(end.x_m), cells(end.y_m)))
            })
            .collect();
        let beams = rays.len().min(beams_max);
        let cone = |reading: &Reading| {
            let Mounting { range_max_m, .. } = reading.mounting;
            let range_m = reading.range_m(now);
            if range_m.is_none() && !reading.is_silent(now) {
                return None;
            }
            // What is farther away than the tables reach is as good as nothing.
            let range_m = range_m.filter(|it| *it <= config.cone_range_max_m);
            Some(Cone {
                at: (
                    cells(reading.mounting.at.x_m),
                    cells(reading.mounting.at.y_m),
                ),
                bearing: reading.mounting.bearing_rad as f32,
                curve: tables.cones.as_ref()?.curve(range_m, range_max_m, config),
            })
        };
        let cones = readings.iter().filter(is_cone).filter_map(cone);
        Self {
            ends: (0..beams)
                .map(|beam| rays[beam * rays.len() / beams])
                .collect(),
            curve: tables.field.curve(config, config.sigma_hit),
            cones: cones.take(CONES_MAX).collect(),
        }
    }

    /// The same readings, with ends of rays that may lie farther from what they hit.
    pub(super) fn set_sigma(&mut self, sigma_m: f64, tables: &Tables, config: &Config) {
        self.curve = tables.field.curve(config, sigma_m);
    }

    /// Readings that are compared.
    pub(super) fn len(&self) -> usize {
        self.ends.len() + self.cones.len()
    }

    /// Whether there are rays among them.
    pub(super) const fn has_rays(&self) -> bool {
        !self.ends.is_empty()
    }

    /// Factor of the logarithm of the likelihood with which all readings together count as `config.observations` independent ones.
    pub(super) fn temper_max(&self, config: &Config) -> f32 {
        (config.observations / self.len().max(1) as f64).min(1.0) as f32
    }

    /// Sets the logarithm of the readings' likelihood for each particle.
    pub(super) fn score(&self, particles: &Particles, tables: &Tables, scores: &mut Vec<f32>) {
        scores.clear();
        scores.resize(particles.len(), 0.0);
        let mut indices = [0_u32; BLOCK];
        for (block, scores) in scores.chunks_mut(BLOCK).enumerate() {
            let poses = particles.part(block * BLOCK, block * BLOCK + scores.len());
            tables
                .field
                .add_scores(poses, &self.ends, &self.curve, &mut indices, scores);
            for cone in &self.cones {
                if let Some(cones) = &tables.cones {
                    cones.add_scores(poses, cone, &mut indices, scores);
                }
            }
        }
    }

    /// The share of readings that are as the map says at the first of some particles, from 0 to 1.
    pub(super) fn fit(&self, at: &Particles, tables: &Tables, config: &Config) -> f64 {
        let floor = config.z_rand / (config.z_hit + config.z_rand);
        let pose = at.part(0, 1);
        let rays = self.ends.iter().map(|end| {
            let likelihood = tables.field.likelihood(pose, *end, &self.curve);
            (likelihood - floor) / (1.0 - floor)
        });
        let cones = tables.cones.iter().flat_map(|cones| {
            let fits = |cone| f64::from(u8::from(cones.fits(pose, cone)));
            self.cones.iter().map(fits)
        });
        rays.chain(cones).sum::<f64>() / self.len().max(1) as f64
    }
}
