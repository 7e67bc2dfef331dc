//! Where the drone is on its map: a particle filter that needs no first pose, keeps as many particles as the uncertainty asks
//! for, finds the drone again after it was carried away, and says when it is lost.
//!
//! One [`Filter::step`] costs time in proportion to its particles. All randomness comes from the seed: the same inputs give the
//! same bits.

mod bins;
mod climb;
mod cone;
mod config;
mod estimate;
mod fast;
mod field;
mod motion;
mod noise;
mod observation;
mod particles;
mod recovery;
mod start;
mod tables;
mod weight;

use std::sync::Arc;
use std::time::Duration;

use nalgebra::Matrix3;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use crate::frames::MapPose;
use crate::reading::Reading;
use bins::kld_size;
use climb::climbed;
pub use config::{Config, OdomModel, RecoveryAlpha};
use estimate::{Cluster, Histogram};
pub use motion::Moved;
use noise::Noise;
use observation::Observation;
use particles::Particles;
use recovery::Recovery;
pub use tables::{NowhereFree, Tables};

/// Particles that search diffuse by this much a step, metres and radians: a few of them are to explore their surroundings.
const SEARCH_WALK: (f64, f64) = (0.05, 0.087);
/// From this share of weight at one pose on, particles have found it.
const SHARE_FOUND: f64 = 0.5;

/// Where the drone is, as far as the filter can tell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// The most likely pose.
    pub pose: MapPose,
    /// Of x, y and heading about that pose: m², m rad and rad².
    pub covariance: Matrix3<f64>,
    /// Whether the pose is not to be relied on: particles are in several places, or the readings don't fit.
    pub is_lost: bool,
    /// The share of the particles' weight that is at the pose.
    pub share: f64,
    /// The share of readings that fit the map where they do so best near the pose; of the last scan, or of the last few sonars'
    /// readings.
    pub fit: f64,
    /// Particles that were weighed.
    pub particles: usize,
}

/// A particle filter over poses on a map.
#[derive(Debug, Clone)]
pub struct Filter {
    config: Config,
    tables: Arc<Tables>,
    particles: Particles,
    /// The particles of the next step while they are drawn, and whence.
    next: Particles,
    drawn: Vec<u32>,
    scores: Vec<f32>,
    weights: Vec<f32>,
    histogram: Histogram,
    recovery: Recovery,
    is_searching: bool,
    is_lost: bool,
    noise: Noise,
}

impl Filter {
    /// A filter that knows nothing of the pose yet: its particles are anywhere on the map.
    #[must_use]
    pub fn new(tables: Arc<Tables>, config: Config, seed: u64) -> Self {
        let mut filter = Self {
            config,
            particles: Particles::default(),
            next: Particles::default(),
            drawn: Vec::new(),
            scores: Vec::new(),
            weights: Vec::new(),
            histogram: Histogram::new(tables.resolution_m),
            recovery: Recovery::default(),
            is_searching: true,
            is_lost: true,
            noise: Noise::new(ChaCha8Rng::seed_from_u64(seed)),
            tables,
        };
        filter.start_anywhere();
        filter
    }

    /// Moves all particles, weighs them by the readings and draws the next ones.
    pub fn step(&mut self, moved: Moved, readings: &[Reading], now: Duration) -> Estimate {
        let tables = Arc::clone(&self.tables);
        motion::advance(
            &mut self.particles,
            moved,
            &self.config,
            tables.resolution_m,
            &mut self.noise,
        );
        let count = self.particles.len();
        let beams = (self.config.lookups_max / count.max(1)).max(Config::BEAMS_MIN);
        let beams = beams.min(self.config.max_beams);
        let mut observation = Observation::new(readings, now, beams, &tables, &self.config);
        if self.is_searching {
            observation.set_sigma(self.config.sigma_search, &tables, &self.config);
        }
        observation.score(&self.particles, &tables, &mut self.scores);
        let temper_max = observation.temper_max(&self.config);
        weight::weigh(&self.scores, 1.0, &mut self.weights);
        let cluster = self
            .histogram
            .heaviest(&self.particles, &self.weights, tables.resolution_m);
        weight::temper(&self.scores, temper_max, &mut self.weights);
        if observation.len() > 0 {
            observation.set_sigma(self.config.sigma_hit, &tables, &self.config);
            let best = climbed(cluster.particle(), &observation, &tables);
            let fit = observation.fit(&best, &tables, &self.config);
            self.recovery.observe(fit, observation.len(), &self.config);
        }
        self.is_searching = cluster.share < SHARE_FOUND;
        let fit_min = if self.is_lost {
            self.config.fit_regained
        } else {
            self.config.fit_found
        };
        self.is_lost = self.is_searching || self.recovery.fit() < fit_min;
        // Readings alone tell that the drone may be elsewhere.
        let elsewhere = if observation.len() > 0 {
            self.recovery.elsewhere(self.config.fit_found)
        } else {
            0.0
        };
        self.draw(elsewhere);
        self.estimate(&cluster, count)
    }

    /// Draws as many particles as their spread asks for; a share of the most that there may be starts anywhere.
    fn draw(&mut self, elsewhere: f64) {
        let config = &self.config;
        let count = self.particles.len();
        weight::draw(&self.weights, count, self.noise.uniform(), &mut self.drawn);
        let bins = self.histogram.occupied(&self.particles, &self.drawn);
        let wanted = kld_size(bins, config.kld_err, config.kld_z);
        let wanted = wanted.clamp(config.min_particles, config.max_particles);
        let elsewhere = (elsewhere * config.max_particles as f64) as usize;
        let wanted = wanted.min(config.max_particles - elsewhere);
        weight::draw(&self.weights, wanted, self.noise.uniform(), &mut self.drawn);
        self.next.clear();
        for index in &self.drawn {
            self.next.copy(&self.particles, *index as usize);
        }
        std::mem::swap(&mut self.particles, &mut self.next);
        if self.is_searching {
            let walk = (SEARCH_WALK.0 / self.tables.resolution_m) as f32;
            motion::jitter(
                &mut self.particles,
                walk,
                SEARCH_WALK.1 as f32,
                &mut self.noise,
            );
        }
        self.scatter(elsewhere);
        self.particles.turn();
    }

    fn estimate(&self, cluster: &Cluster, particles: usize) -> Estimate {
        Estimate {
            pose: self.tables.pose(cluster.x, cluster.y, cluster.heading_rad),
            covariance: self.tables.covariance(cluster.covariance),
            is_lost: self.is_lost,
            share: cluster.share,
            fit: self.recovery.fit(),
            particles,
        }
    }

    /// The particles' poses, for pictures.
    pub fn particles(&self) -> impl Iterator<Item = MapPose> {
        (0..self.particles.len()).map(|index| {
            let (x, y, heading) = self.particles.at(index);
            self.tables
                .pose(f64::from(x), f64::from(y), f64::from(heading))
        })
    }
}
