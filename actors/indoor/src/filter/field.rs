//! The likelihood field: how near each place is to something that is on the map.
//!
//! Source: S. Thrun, W. Burgard, D. Fox, *Probabilistic Robotics*, 2005, section 6.4.

use super::config::Config;
use super::fast::{ROUND, whole};
use super::particles::Poses;
use crate::map::{Map, State};

/// The distance table has a border of one cell, where all that lies outside of the map ends.
const BORDER: f32 = 1.0;
/// Logarithm of how much less likely it is that a drone is where nothing is free. It is no proof, for maps are not exact.
const IN_A_WALL: f32 = 20.0;
/// Particles that are scored together, so that they stay in the first cache.
pub(super) const BLOCK: usize = 256;

/// Distances in 255 steps up to the greatest one that matters, and which cells are free. In cells of the map from its lower
/// left corner.
#[derive(Debug, Clone)]
pub(super) struct Field {
    stride: u32,
    right: f32,
    top: f32,
    near: Vec<u8>,
    is_free: Vec<bool>,
    step_m: f64,
}

/// The logarithm of a reading's likelihood for each step of distance; 0 for the best.
pub(super) type Curve = [f32; 256];

impl Field {
    pub(super) fn new(map: &Map, max_dist_m: f64) -> Self {
        let (columns, rows) = (map.columns(), map.rows());
        let stride = columns + 2;
        let step_m = max_dist_m / 255.0;
        let mut field = Self {
            stride: stride as u32,
            right: columns as f32 + BORDER,
            top: rows as f32 + BORDER,
            near: vec![255; stride * (rows + 2)],
            is_free: vec![false; stride * (rows + 2)],
            step_m,
        };
        for cell in map.cells() {
            let at = (cell.row + 1) * stride + cell.column + 1;
            let steps = map.distance_m(map.centre(cell)) / step_m;
            field.near[at] = libm::round(steps.min(255.0)) as u8;
            field.is_free[at] = map.state(cell) == State::Free;
        }
        field
    }

    /// The curve for hits with this deviation.
    pub(super) fn curve(&self, config: &Config, sigma_m: f64) -> Curve {
        let Config { z_hit, z_rand, .. } = *config;
        std::array::from_fn(|step| {
            let distance = step as f64 * self.step_m / sigma_m;
            let hit = z_hit * libm::exp(-0.5 * distance * distance);
            libm::log((hit + z_rand) / (z_hit + z_rand)) as f32
        })
    }

    /// Where a place is in the tables.
    #[inline]
    fn index(&self, x: f32, y: f32) -> u32 {
        let within = |at: f32, max: f32| {
            let at = at + 0.5 * BORDER;
            let at = if at > 0.0 { at } else { 0.0 };
            if at < max { at } else { max }
        };
        let (column, row) = (within(x, self.right), within(y, self.top));
        whole(row + ROUND) * self.stride + whole(column + ROUND)
    }

    /// Adds to each score the logarithm of the likelihood that the ends of all rays lie where they do, and that the drone is in
    /// a free cell.
    pub(super) fn add_scores(
        &self,
        poses: Poses<'_>,
        ends: &[(f32, f32)],
        curve: &Curve,
        indices: &mut [u32],
        scores: &mut [f32],
    ) {
        let indices = &mut indices[..scores.len()];
        for end in ends {
            poses.place(*end, indices, |x, y| self.index(x, y));
            for (score, at) in scores.iter_mut().zip(&*indices) {
                *score += curve[usize::from(self.near[*at as usize])];
            }
        }
        poses.place((0.0, 0.0), indices, |x, y| self.index(x, y));
        for (score, at) in scores.iter_mut().zip(&*indices) {
            *score -= if self.is_free[*at as usize] {
                0.0
            } else {
                IN_A_WALL
            };
        }
    }

    /// The likelihood that one ray's end lies where it does from the first of some poses; 1 for the best.
    pub(super) fn likelihood(&self, poses: Poses<'_>, end: (f32, f32), curve: &Curve) -> f64 {
        let mut index = [0];
        poses.place(end, &mut index, |x, y| self.index(x, y));
        libm::exp(f64::from(curve[usize::from(self.near[index[0] as usize])]))
    }
}
