//! What a filter looks up on a map, computed once.

use nalgebra::Matrix3;

use super::cone::Cones;
use super::config::Config;
use super::field::Field;
use crate::frames::{MapPose, MapXy};
use crate::map::{Cell, Map, State};

/// A map as filters need it; several can share it.
#[derive(Debug, Clone)]
pub struct Tables {
    pub(super) resolution_m: f64,
    pub(super) field: Field,
    /// `None` if the configuration has no cones.
    pub(super) cones: Option<Cones>,
    origin: MapPose,
    columns: usize,
    free: Vec<u32>,
}

/// A map on which no drone can be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("no cell of the map is free there")]
pub struct NowhereFree;

impl Tables {
    /// Tables for a map. Costs a pass over the map, and if there are cones a hundred rays for each free place: 0.1 s for a flat.
    ///
    /// # Errors
    /// If no cell of the map is free.
    pub fn new(map: &Map, config: &Config) -> Result<Self, NowhereFree> {
        let free = map.cells().filter(|cell| map.state(*cell) == State::Free);
        let free: Vec<u32> = free
            .filter_map(|cell| Some(map.index(cell)? as u32))
            .collect();
        if free.is_empty() {
            return Err(NowhereFree);
        }
        let has_cones = config.cone_range_max_m > 0.0;
        Ok(Self {
            resolution_m: map.resolution_m(),
            field: Field::new(map, config.laser_likelihood_max_dist),
            cones: has_cones.then(|| Cones::new(map, config)),
            origin: map.origin(),
            columns: map.columns(),
            free,
        })
    }

    /// The free cells, by their index.
    pub(super) fn free(&self) -> &[u32] {
        &self.free
    }

    /// The free cells with their centre between two corners.
    pub(super) fn free_within(&self, low: MapXy, high: MapXy) -> Vec<u32> {
        let is_within = |index: &&u32| {
            let (column, row) = self.corner(**index);
            let centre = self
                .pose(f64::from(column) + 0.5, f64::from(row) + 0.5, 0.0)
                .at;
            let x = (low.x_m.min(high.x_m)..=low.x_m.max(high.x_m)).contains(&centre.x_m);
            let y = (low.y_m.min(high.y_m)..=low.y_m.max(high.y_m)).contains(&centre.y_m);
            x && y
        };
        self.free.iter().filter(is_within).copied().collect()
    }

    /// The lower left corner of a cell, in cells.
    pub(super) fn corner(&self, index: u32) -> (f32, f32) {
        let index = index as usize;
        let Cell { column, row } = Cell {
            column: index % self.columns,
            row: index / self.columns,
        };
        (column as f32, row as f32)
    }

    /// A pose of the grid in the map's frame.
    pub(super) fn pose(&self, x: f64, y: f64, heading_rad: f64) -> MapPose {
        let (x_m, y_m) = (x * self.resolution_m, y * self.resolution_m);
        let at = self.origin.place(crate::frames::BodyXy::new(x_m, y_m));
        MapPose::new(at.x_m, at.y_m, self.origin.heading_rad + heading_rad)
    }

    /// A pose of the map's frame in the grid: cells and radians.
    pub(super) fn in_grid(&self, pose: MapPose) -> (f64, f64, f64) {
        let at = self.origin.sight(pose.at);
        let heading_rad = pose.heading_rad - self.origin.heading_rad;
        (
            at.x_m / self.resolution_m,
            at.y_m / self.resolution_m,
            heading_rad,
        )
    }

    /// A covariance of x, y and heading in the grid, in the map's frame and in metres.
    pub(super) fn covariance(&self, in_grid: Matrix3<f64>) -> Matrix3<f64> {
        let (sin, cos) = (
            libm::sin(self.origin.heading_rad),
            libm::cos(self.origin.heading_rad),
        );
        let scale = self.resolution_m;
        let turn = Matrix3::new(
            scale * cos,
            -scale * sin,
            0.0,
            scale * sin,
            scale * cos,
            0.0,
            0.0,
            0.0,
            1.0,
        );
        turn * in_grid * turn.transpose()
    }
}
