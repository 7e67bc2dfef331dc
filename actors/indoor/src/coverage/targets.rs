//! Targets, and which of them a camera sees.

use super::{Seen, TARGET_M, View};
use crate::frames::{MapPose, MapXy, wrapped_rad};
use crate::map::{Map, State};

/// Distance that a ray may end before the target's centre, in metres: rays end at edges of cells.
const ROUNDING_M: f64 = 1e-6;

/// The squares of a map's floor that are to be seen: those with a free centre.
#[derive(Debug, Clone)]
pub struct Targets {
    columns: usize,
    rows: usize,
    /// Target of each square, row by row; `u32::MAX` if there is none.
    at: Vec<u32>,
    points: Vec<MapXy>,
}

impl Targets {
    /// The targets of a map.
    #[must_use]
    pub fn new(map: &Map) -> Self {
        let squares = |cells: usize| {
            let edge_m = cells as f64 * map.resolution_m();
            (edge_m / TARGET_M).ceil() as usize
        };
        let (columns, rows) = (squares(map.columns()), squares(map.rows()));
        let mut targets = Self {
            columns,
            rows,
            at: vec![u32::MAX; columns * rows],
            points: Vec::new(),
        };
        for square in 0..columns * rows {
            let along = ((square % columns) as f64 + 0.5) * TARGET_M;
            let across = ((square / columns) as f64 + 0.5) * TARGET_M;
            let centre = map
                .origin()
                .place(crate::frames::BodyXy::new(along, across));
            if map
                .cell(centre)
                .is_some_and(|cell| map.state(cell) == State::Free)
            {
                targets.at[square] = targets.points.len() as u32;
                targets.points.push(centre);
            }
        }
        targets
    }

    /// Number of targets.
    #[must_use]
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// The centre of a target.
    #[must_use]
    pub fn centre(&self, target: usize) -> MapXy {
        self.points[target]
    }

    /// Adds what a camera at a pose sees to `seen`. Each target in range that was not seen costs one ray.
    pub fn look(&self, map: &Map, pose: MapPose, view: View, seen: &mut Seen) {
        let from = map.origin().sight(pose.at);
        let squares = |at_m: f64, all: usize| {
            let first = ((at_m - view.range_m) / TARGET_M).floor().max(0.0) as usize;
            let end = ((at_m + view.range_m) / TARGET_M).ceil().max(0.0) as usize;
            first.min(all)..end.min(all)
        };
        for row in squares(from.y_m, self.rows) {
            for column in squares(from.x_m, self.columns) {
                let target = self.at[row * self.columns + column];
                if target != u32::MAX
                    && !seen.contains(target as usize)
                    && self.is_seen(map, pose, view, target as usize)
                {
                    seen.insert(target as usize);
                }
            }
        }
    }

    fn is_seen(&self, map: &Map, pose: MapPose, view: View, target: usize) -> bool {
        let centre = self.points[target];
        let distance_m = pose.at.distance_m(centre);
        if distance_m > view.range_m {
            return false;
        }
        let bearing_rad = pose.at.bearing_rad(centre);
        if wrapped_rad(bearing_rad - pose.heading_rad).abs() > view.cone_rad / 2.0 {
            return false;
        }
        map.cast(pose.at, bearing_rad, distance_m)
            .is_none_or(|free_m| free_m >= distance_m - ROUNDING_M)
    }
}
