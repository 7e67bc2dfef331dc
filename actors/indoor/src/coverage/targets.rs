//! Targets, and which of them a camera sees.

use super::{PlanError, Seen, TARGET_M, TARGETS_MAX, View};
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
    ///
    /// # Errors
    /// If the map is larger than [`TARGETS_MAX`] squares.
    pub fn new(map: &Map) -> Result<Self, PlanError> {
        let squares = |cells: usize| {
            let edge_m = cells as f64 * map.resolution_m();
            (edge_m / TARGET_M).ceil() as usize
        };
        let (columns, rows) = (squares(map.columns()), squares(map.rows()));
        PlanError::limit(
            "squares of 20 cm",
            columns.saturating_mul(rows),
            TARGETS_MAX,
        )?;
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
        Ok(targets)
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

/// The targets that are seen from one place: few of all, so only words with one of them are kept.
#[derive(Debug, Clone)]
pub(super) struct Sight {
    words: Vec<(u32, u64)>,
    len: usize,
}

impl Sight {
    /// All of a set.
    pub(super) fn new(seen: &Seen) -> Self {
        let words = (0..).zip(seen.words().iter().copied());
        Self {
            words: words.filter(|(_, word)| *word != 0).collect(),
            len: seen.len(),
        }
    }

    /// Number of targets.
    pub(super) const fn len(&self) -> usize {
        self.len
    }

    /// Adds them to a set.
    pub(super) fn add_to(&self, seen: &mut Seen) {
        for (at, word) in &self.words {
            seen.add_word(*at as usize, *word);
        }
    }

    /// How many of them are not in a set.
    pub(super) fn missing_in(&self, seen: &Seen) -> usize {
        let words = self.words.iter();
        words
            .map(|(at, want)| (want & !seen.words()[*at as usize]).count_ones() as usize)
            .sum()
    }
}
