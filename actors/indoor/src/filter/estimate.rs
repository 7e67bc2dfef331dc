//! From weighted particles to a pose.

use nalgebra::{Matrix3, Vector3};

use super::bins::Bins;
use super::particles::{Particles, wrapped};

/// Edge of the bins in which particles are counted, metres; AMCL's.
const BIN_M: f64 = 0.5;
/// Bins of a turn, 10° each; AMCL's.
const BINS_PER_TURN: f32 = 36.0;
/// Particles within this distance of the heaviest bin belong to its pose, metres.
const REACH_M: f64 = 1.0;
/// The same for the cosine of the difference in heading: 37°.
const REACH_COS: f32 = 0.8;

/// The heaviest cluster of particles, in cells.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cluster {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) heading_rad: f64,
    /// Of x, y and heading: cells² and rad².
    pub(super) covariance: Matrix3<f64>,
    /// Of all weight.
    pub(super) share: f64,
}

impl Cluster {
    /// Its pose as the only particle.
    pub(super) fn particle(&self) -> Particles {
        Particles::one((self.x as f32, self.y as f32, self.heading_rad as f32))
    }
}

/// Counts particles by place and heading.
#[derive(Debug, Clone, Default)]
pub(super) struct Histogram {
    bins: Bins,
    weights: Vec<f32>,
    /// Bins to a cell.
    scale: f32,
}

impl Histogram {
    pub(super) fn new(metres_per_cell: f64) -> Self {
        Self {
            scale: (metres_per_cell / BIN_M) as f32,
            ..Self::default()
        }
    }

    /// How many bins some of the particles occupy.
    pub(super) fn occupied(&mut self, particles: &Particles, drawn: &[u32]) -> usize {
        self.bins.clear(drawn.len());
        for index in drawn {
            let key = self.key(particles, *index as usize);
            self.bins.insert(key);
        }
        self.bins.count()
    }

    /// The pose about the bin with the greatest weight.
    pub(super) fn heaviest(
        &mut self,
        particles: &Particles,
        weights: &[f32],
        metres_per_cell: f64,
    ) -> Cluster {
        self.bins.clear(particles.len());
        self.weights.clear();
        self.weights.resize(self.bins.size(), 0.0);
        let mut heaviest = (0.0, 0);
        for (index, weight) in weights.iter().enumerate() {
            let key = self.key(particles, index);
            let bin = &mut self.weights[self.bins.insert(key)];
            *bin += weight;
            if *bin > heaviest.0 {
                heaviest = (*bin, index);
            }
        }
        about(
            particles,
            weights,
            heaviest.1,
            (REACH_M / metres_per_cell) as f32,
        )
    }

    fn key(&self, particles: &Particles, index: usize) -> u64 {
        let turns = particles.heading[index] * (1.0 / std::f32::consts::TAU);
        let direction = (turns - libm::floorf(turns)) * BINS_PER_TURN;
        // Casts of floats saturate; a place is at most a few thousand bins from the corner.
        let column = (particles.x[index] * self.scale + 32_768.0) as u64;
        let row = (particles.y[index] * self.scale + 32_768.0) as u64;
        (direction as u64) << 40 | column << 20 | row
    }
}

fn about(particles: &Particles, weights: &[f32], middle: usize, reach: f32) -> Cluster {
    let (x0, y0) = (particles.x[middle], particles.y[middle]);
    let (sin0, cos0) = (particles.sin[middle], particles.cos[middle]);
    let mut share = 0.0_f64;
    let mut first = Vector3::zeros();
    let mut second = Matrix3::zeros();
    for (index, weight) in weights.iter().enumerate() {
        let (dx, dy) = (particles.x[index] - x0, particles.y[index] - y0);
        let (sin, cos) = (particles.sin[index], particles.cos[index]);
        if dx.abs() < reach && dy.abs() < reach && cos * cos0 + sin * sin0 > REACH_COS {
            let turn = wrapped(particles.heading[index] - particles.heading[middle]);
            let off = Vector3::new(f64::from(dx), f64::from(dy), f64::from(turn));
            let weight = f64::from(*weight);
            share += weight;
            first += weight * off;
            second += weight * off * off.transpose();
        }
    }
    let mean = first / share;
    Cluster {
        x: f64::from(x0) + mean.x,
        y: f64::from(y0) + mean.y,
        heading_rad: f64::from(particles.heading[middle]) + mean.z,
        covariance: second / share - mean * mean.transpose(),
        share,
    }
}
