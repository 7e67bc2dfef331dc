//! Places to look from, and the fewest of them that see all.

use std::collections::VecDeque;

use super::targets::Sight;
use super::{LOOKS_MAX, PLACE_M, Seen, TARGET_M, Targets, View};
use crate::digest;
use crate::frames::{MapPose, MapXy};
use crate::map::{Cell, Map};
use crate::path::Floor;

/// Why there is no plan.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PlanError {
    /// A drone can't start there: it is off the map, or too close to a wall.
    #[error("a drone can't be at {0:?}: it is off the map, or too close to a wall")]
    Start(MapXy),
    /// The starts lie in parts of the map between which there is no path.
    #[error("there is no path from {0:?} to {1:?}")]
    Apart(MapXy, MapXy),
    /// No start was given.
    #[error("there is no drone")]
    NoDrone,
    /// The map is too large for tours, or the camera sees too far or not far enough.
    #[error("the map is too large for tours: {found} {what}, at most {most}")]
    TooLarge {
        /// What there is too much of.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// The limit.
        most: usize,
    },
}

impl PlanError {
    /// What would be accepted.
    #[must_use]
    pub const fn accepted(&self) -> &'static str {
        match self {
            Self::Start(_) | Self::Apart(..) | Self::NoDrone => {
                "starts on the map that are clear of walls, with paths between them"
            }
            Self::TooLarge { .. } => {
                "a part of the map, or cells of the size that they have in fact"
            }
        }
    }

    pub(super) const fn limit(what: &'static str, found: usize, most: usize) -> Result<(), Self> {
        if found > most {
            return Err(Self::TooLarge { what, found, most });
        }
        Ok(())
    }
}

/// The places that drones can look from, with what each sees.
#[derive(Debug, Clone)]
pub struct Places {
    view: View,
    targets: Targets,
    digest: u64,
    /// The first start, then others row by row.
    places: Vec<(MapXy, Sight)>,
    visible: Seen,
}

impl Places {
    /// All places of a floor that a drone can get to from the first start.
    ///
    /// # Errors
    /// As [`super::plan`].
    pub fn new(floor: &Floor, view: View, starts: &[MapXy]) -> Result<Self, PlanError> {
        let map = floor.map();
        let first = *starts.first().ok_or(PlanError::NoDrone)?;
        for start in starts {
            if !floor.is_free(*start) {
                return Err(PlanError::Start(*start));
            }
        }
        let start = map.cell(first).ok_or(PlanError::Start(first))?;
        let reached = reachable(floor, start);
        let is_reached = |point| {
            let index = map.cell(point).and_then(|cell| map.index(cell));
            index.is_some_and(|index| reached[index])
        };
        if let Some(apart) = starts.iter().find(|it| !is_reached(**it)) {
            return Err(PlanError::Apart(first, *apart));
        }
        let targets = Targets::new(map)?;
        let pitch = ((PLACE_M / map.resolution_m()).round() as usize).max(1);
        let on_lattice =
            |cell: &Cell| cell.column % pitch == pitch / 2 && cell.row % pitch == pitch / 2;
        let lattice = map.cells().filter(on_lattice);
        let points = lattice.filter(|cell| map.index(*cell).is_some_and(|index| reached[index]));
        let points: Vec<MapXy> = std::iter::once(first)
            .chain(points.map(|cell| map.centre(cell)))
            .collect();
        let across = 2.0 * view.range_m / TARGET_M + 1.0;
        let in_range = ((across * across) as usize).min(targets.len());
        let looks = points.len().saturating_mul(in_range);
        PlanError::limit("targets to look at from all places", looks, LOOKS_MAX)?;
        let mut visible = Seen::none(targets.len());
        let mut seen = visible.clone();
        let mut places = Vec::new();
        for point in points {
            let pose = MapPose {
                at: point,
                heading_rad: 0.0,
            };
            seen.clear();
            targets.look(map, pose, view.all_round(), &mut seen);
            let sight = Sight::new(&seen);
            sight.add_to(&mut visible);
            places.push((point, sight));
        }
        let view_of = [view.range_m, view.cone_rad].map(f64::to_bits);
        let digest = view_of.into_iter().fold(map.digest(), digest::with_word);
        Ok(Self {
            view,
            targets,
            digest,
            places,
            visible,
        })
    }

    /// The targets.
    #[must_use]
    pub const fn targets(&self) -> &Targets {
        &self.targets
    }

    /// Of what map and camera the targets are.
    #[must_use]
    pub fn identity(&self) -> muster_machines::indoor::Targets {
        muster_machines::indoor::Targets {
            number: self.targets.len(),
            digest: self.digest,
        }
    }

    /// What can be seen.
    #[must_use]
    pub const fn visible(&self) -> &Seen {
        &self.visible
    }

    /// Adds what a full turn at a point sees to `seen`. What is seen from a place is stored; from elsewhere each target in range
    /// costs a ray. `map` is the floor's.
    pub fn look_round(&self, map: &Map, at: MapXy, seen: &mut Seen) {
        if let Some(sight) = self.sight(map, at) {
            return sight.add_to(seen);
        }
        let heading_rad = 0.0;
        let pose = MapPose { at, heading_rad };
        self.targets.look(map, pose, self.view.all_round(), seen);
    }

    /// How many targets that can be seen a full turn at a point would add to `seen`. It costs as much as [`Self::look_round`].
    #[must_use]
    pub fn added_from(&self, map: &Map, at: MapXy, seen: &Seen) -> usize {
        if let Some(sight) = self.sight(map, at) {
            return sight.missing_in(seen);
        }
        let mut after = seen.clone();
        self.look_round(map, at, &mut after);
        seen.missing(&self.visible) - after.missing(&self.visible)
    }

    /// What is seen from a place; `None` if the point is none.
    pub(super) fn sight(&self, map: &Map, at: MapXy) -> Option<&Sight> {
        let (first, others) = self.places.split_first()?;
        if first.0 == at {
            return Some(&first.1);
        }
        let index = |at: MapXy| map.cell(at).and_then(|cell| map.index(cell));
        let cell = index(at)?;
        let place = others.binary_search_by_key(&Some(cell), |(it, _)| index(*it));
        place
            .ok()
            .map(|it| &others[it])
            .filter(|(it, _)| *it == at)
            .map(|(_, sight)| sight)
    }

    /// The place that sees most of what `seen` lacks, with how much it adds; `None` if none adds anything. Among equals the
    /// nearest to `from`.
    #[must_use]
    pub fn best(&self, seen: &Seen, from: MapXy) -> Option<(MapXy, usize)> {
        let adding = self
            .places
            .iter()
            .map(|(at, sees)| (*at, sees.missing_in(seen)));
        let better = |a: &(MapXy, usize), b: &(MapXy, usize)| {
            let nearer = b.0.distance_m(from).total_cmp(&a.0.distance_m(from));
            a.1.cmp(&b.1).then(nearer)
        };
        adding.filter(|(_, added)| *added > 0).max_by(better)
    }

    /// The fewest places, by a greedy set cover, that see all that can be seen.
    #[must_use]
    pub(super) fn chosen(&self) -> Vec<MapXy> {
        let mut seen = Seen::none(self.targets.len());
        // What each place adds never grows, so only places that added most before are looked at again.
        let mut bounds: Vec<usize> = self.places.iter().map(|(_, sees)| sees.len()).collect();
        let mut chosen = Vec::new();
        loop {
            let mut best: Option<(usize, usize)> = None;
            for (place, (_, sees)) in self.places.iter().enumerate() {
                let most = best.map_or(0, |(_, added)| added);
                if bounds[place] <= most {
                    continue;
                }
                bounds[place] = sees.missing_in(&seen);
                if bounds[place] > most {
                    best = Some((place, bounds[place]));
                }
            }
            let Some((place, _)) = best else {
                return chosen;
            };
            chosen.push(self.places[place].0);
            self.places[place].1.add_to(&mut seen);
        }
    }
}

/// Which cells a drone can get to, row by row.
fn reachable(floor: &Floor, start: Cell) -> Vec<bool> {
    let map = floor.map();
    let mut reached = vec![false; floor.costs().len()];
    let mut open: VecDeque<Cell> = VecDeque::new();
    let mut enter = |cell: Cell, open: &mut VecDeque<Cell>| {
        if let Some(index) = map.index(cell)
            && floor.costs()[index] > 0
            && !reached[index]
        {
            reached[index] = true;
            open.push_back(cell);
        }
    };
    enter(start, &mut open);
    while let Some(Cell { column, row }) = open.pop_front() {
        for (dx, dy) in [(-1, 0), (1, 0), (0, -1), (0, 1)] {
            let (column, row) = (column.checked_add_signed(dx), row.checked_add_signed(dy));
            if let (Some(column), Some(row)) = (column, row) {
                enter(Cell { column, row }, &mut open);
            }
        }
    }
    reached
}
