//! Where particles begin.

use std::f32::consts::TAU;

use nalgebra::{Cholesky, Matrix3, Vector3};

use super::recovery::Recovery;
use super::{Filter, NowhereFree};
use crate::frames::{MapPose, MapXy};

impl Filter {
    /// Forgets the pose: particles are anywhere on the map.
    pub fn start_anywhere(&mut self) {
        self.forget();
        self.scatter(self.config.max_particles);
        self.particles.turn();
    }

    /// Forgets the pose: particles are anywhere in the free cells between two corners.
    ///
    /// # Errors
    /// If no cell is free there. Then nothing is changed.
    pub fn start_within(&mut self, low: MapXy, high: MapXy) -> Result<(), NowhereFree> {
        let cells = self.tables.free_within(low, high);
        if cells.is_empty() {
            return Err(NowhereFree);
        }
        self.forget();
        for _ in 0..self.config.max_particles {
            let cell = cells[self.noise.below(cells.len())];
            self.push_in(cell);
        }
        self.particles.turn();
        Ok(())
    }

    /// Starts at a pose with the covariance of x, y and heading (m², m rad, rad²), as an [`Estimate`](super::Estimate) has them:
    /// a checkpoint is these two, and never the particles.
    pub fn start_at(&mut self, pose: MapPose, covariance: Matrix3<f64>) {
        self.forget();
        self.is_searching = false;
        self.is_lost = false;
        // Covariances of few particles may be flat in a direction.
        let floor = Matrix3::from_diagonal(&Vector3::new(1e-6, 1e-6, 1e-6));
        let deviation = Cholesky::new(covariance + floor).map_or_else(
            || Matrix3::from_diagonal(&covariance.map_diagonal(|variance| variance.abs().sqrt())),
            |cholesky| cholesky.l(),
        );
        for _ in 0..self.config.max_particles {
            let noise = &mut self.noise;
            let off = Vector3::from_fn(|_, _| f64::from(noise.normal()));
            let off = deviation * off;
            let at = MapPose::new(
                pose.at.x_m + off.x,
                pose.at.y_m + off.y,
                pose.heading_rad + off.z,
            );
            let (x, y, heading) = self.tables.in_grid(at);
            self.particles.push(x as f32, y as f32, heading as f32);
        }
        self.particles.turn();
    }

    /// Adds particles anywhere on the map.
    pub(super) fn scatter(&mut self, count: usize) {
        for _ in 0..count {
            let free = self.tables.free();
            let cell = free[self.noise.below(free.len())];
            self.push_in(cell);
        }
    }

    fn push_in(&mut self, cell: u32) {
        let (column, row) = self.tables.corner(cell);
        let (x, y) = (column + self.noise.uniform(), row + self.noise.uniform());
        let heading = TAU * self.noise.uniform();
        self.particles.push(x, y, heading);
    }

    fn forget(&mut self) {
        self.particles.clear();
        self.recovery = Recovery::default();
        self.is_searching = true;
        self.is_lost = true;
    }
}
