//! Landing places of drones out of lockstep, clear of the paths of all others.

use nalgebra::Vector2;

use super::crossings::segment_to_point_m;
use super::phases::PhaseKind;
use super::{FlightPlan, Path};
use crate::geometry::Ned;
use crate::identity::NodeId;

/// Step of the search for a landing place, as a multiple of the required distance from paths.
const SEARCH_STEP: f64 = 0.5;

/// Largest offset of a landing place from the slot, as a multiple of the required distance from paths.
const SEARCH_REACH: f64 = 4.0;

/// Directions in which places at the largest offset are looked for, if none nearer will do.
const RIM_DIRECTIONS: i32 = 16;

impl FlightPlan<'_> {
    /// Centre that puts the slot of drone `id` on the nearest place to land that no other drone's path leads over, in
    /// any phase.
    ///
    /// The offset is so small that no other drone that does the same around the same centre comes too close. Without
    /// such a place, the slot is the place farthest from all paths.
    ///
    /// # Panics
    /// If there are fewer changes, or no such drone.
    #[must_use]
    pub fn landing_centre(&self, id: NodeId, changes: u16, centre: Ned) -> Ned {
        self.landing_centre_among(&self.tracks(), id, changes, centre)
    }

    /// Where the drones land in lockstep, by number.
    ///
    /// # Panics
    /// Without a waypoint.
    pub fn landing_places(self) -> impl Iterator<Item = Ned> {
        let centre = self.waypoints[self.waypoints.len() - 1];
        let layout = self.layout_after(self.changes_before(self.waypoints.len()));
        let drones = (0..layout.formation().drones()).map(NodeId);
        drones.map(move |id| layout.landing_place(id, centre))
    }

    /// Where each drone lands around the last waypoint that is out of lockstep.
    ///
    /// # Panics
    /// Without a waypoint.
    #[must_use]
    pub fn landing_places_alone(self) -> Vec<Ned> {
        let changes = self.changes_before(self.waypoints.len());
        let centre = self.waypoints[self.waypoints.len() - 1];
        let layout = self.layout_after(changes);
        let drones = (0..layout.formation().drones()).map(NodeId);
        if !layout.lands_below_slot() {
            return drones.map(|id| layout.landing_place(id, centre)).collect();
        }
        let paths = self.tracks();
        let centre_of = |id| self.landing_centre_among(&paths, id, changes, centre);
        drones.map(|id| layout.slot(id, centre_of(id))).collect()
    }

    fn landing_centre_among(&self, paths: &[Track], id: NodeId, changes: u16, centre: Ned) -> Ned {
        let layout = self.layout_after(changes);
        let min_m = layout.separation().horizontal_with_margin_m();
        let slots = layout.formation().slots();
        let own = slots[id.0 as usize];
        let others = (slots.iter().zip(0..)).filter(|(_, other)| *other != id.0);
        let nearest_m = others
            .map(|(slot, _)| own.horizontal_distance_m(*slot))
            .fold(f64::INFINITY, f64::min);
        let reach_m = ((nearest_m - min_m) / 2.0).min(SEARCH_REACH * min_m);
        let target = (centre + own).0.xy();
        let paths: Vec<_> = (paths.iter())
            .filter(|(other, _)| *other != id)
            .map(|(_, path)| *path)
            .filter(|path| segment_to_point_m(*path, target) < min_m + reach_m)
            .collect();
        let offset = clear_offset(target, reach_m, min_m, &paths);
        centre + Ned::new(offset.x, offset.y, 0.0)
    }

    /// Horizontal tracks of all drones, in lockstep or not.
    fn tracks(self) -> Vec<Track> {
        let mut tracks = Vec::new();
        let mut add =
            |id: NodeId, path: Path| tracks.push((id, (path.from.0.xy(), path.to.0.xy())));
        for phase in self.phases() {
            for (id, paths) in (0..).map(NodeId).zip(&phase.paths) {
                let level = paths.iter().filter(|path| !path.is_vertical());
                level.for_each(|path| add(id, *path));
                if let PhaseKind::Leg { to } = phase.kind {
                    self.legs_alone(id, to).for_each(|path| add(id, path));
                }
            }
        }
        tracks
    }
}

/// Drone and the ends of its track.
type Track = (NodeId, (Vector2<f64>, Vector2<f64>));

/// Shortest offset from `target`, of at most `reach_m`, to a place at least `min_m` from all `paths`. Without one, the
/// offset to the place farthest from them.
fn clear_offset(
    target: Vector2<f64>,
    reach_m: f64,
    min_m: f64,
    paths: &[(Vector2<f64>, Vector2<f64>)],
) -> Vector2<f64> {
    let clearance_m = |offset: &Vector2<f64>| {
        let distances_m = paths
            .iter()
            .map(|path| segment_to_point_m(*path, target + offset));
        distances_m.fold(f64::INFINITY, f64::min).min(min_m)
    };
    let mut best = (Vector2::zeros(), clearance_m(&Vector2::zeros()));
    for offset in offsets(reach_m, SEARCH_STEP * min_m).chain(rim(reach_m)) {
        if best.1 >= min_m {
            break;
        }
        let clearance_m = clearance_m(&offset);
        if clearance_m > best.1 {
            best = (offset, clearance_m);
        }
    }
    best.0
}

/// Points of a lattice around the origin within `reach_m`, nearest first.
fn offsets(reach_m: f64, step_m: f64) -> impl Iterator<Item = Vector2<f64>> {
    let steps = (0..)
        .take_while(|steps| f64::from(*steps) * step_m <= reach_m)
        .last();
    let steps: i32 = steps.unwrap_or(0);
    let mut lattice: Vec<_> = (-steps..=steps)
        .flat_map(|north| (-steps..=steps).map(move |east| (north, east)))
        .filter(|at| *at != (0, 0))
        .collect();
    lattice.sort_by_key(|(north, east)| (north * north + east * east, *north, *east));
    lattice
        .into_iter()
        .map(move |(north, east)| Vector2::new(f64::from(north), f64::from(east)) * step_m)
        .filter(move |offset| offset.norm() <= reach_m)
}

/// Points around the origin at `reach_m`, if that is a distance.
fn rim(reach_m: f64) -> impl Iterator<Item = Vector2<f64>> {
    let directions = if reach_m > 0.0 { RIM_DIRECTIONS } else { 0 };
    (0..directions).map(move |direction| {
        let angle_rad = std::f64::consts::TAU * f64::from(direction) / f64::from(RIM_DIRECTIONS);
        Vector2::new(libm::cos(angle_rad), libm::sin(angle_rad)) * reach_m
    })
}

#[cfg(test)]
mod tests {
    use std::num::NonZeroU32;

    use super::*;
    use crate::formation::{Change, Formation, Kind, Layering, Layout, Separation};

    const SEPARATION: Separation = Separation {
        horizontal_m: 5.0,
        vertical_m: 2.5,
    };

    fn formation(kind: Kind) -> Formation {
        Formation::new(kind, NonZeroU32::new(7).unwrap(), 40.0, 0.0)
    }

    /// North, then east, then half the way back, with a change at the corner.
    fn waypoints() -> Vec<Ned> {
        [(0.0, 0.0), (33.0, 0.0), (33.0, 33.0), (16.5, 33.0)]
            .map(|(north_m, east_m)| Ned::new(north_m, east_m, -12.0))
            .into()
    }

    #[test]
    fn landing_places_are_clear_of_paths_and_of_each_other() {
        for kind in [Kind::CompactMesh, Kind::Linear, Kind::RegularMatrix] {
            let layout =
                Layout::new(formation(kind), 10.0, SEPARATION).with_layers(Layering::PerDrone);
            let changes = [Change::new(2, &layout, formation(Kind::Circular))];
            let waypoints = waypoints();
            let plan = FlightPlan {
                layout: &layout,
                changes: &changes,
                waypoints: &waypoints,
            };
            let last = plan.layout_after(1);
            let places: Vec<Ned> = (0..7)
                .map(NodeId)
                .map(|id| last.slot(id, plan.landing_centre(id, 1, waypoints[3])))
                .collect();
            for (id, place) in (0..).map(NodeId).zip(&places) {
                for other in (0..7).map(NodeId).filter(|other| *other != id) {
                    let apart_m = place.horizontal_distance_m(places[other.0 as usize]);
                    assert!(apart_m >= 5.0, "{kind:?}: {id} and {other}: {apart_m}");
                    let paths = plan.tracks();
                    for (_, path) in paths.into_iter().filter(|(drone, _)| *drone == other) {
                        let apart_m = segment_to_point_m(path, place.0.xy());
                        assert!(
                            apart_m >= 5.0,
                            "{kind:?}: {id}, the path of {other}: {apart_m}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn landing_place_is_the_slot_if_clear_else_the_farthest_from_paths() {
        let path = |east_m: f64| (Vector2::new(-100.0, east_m), Vector2::new(100.0, east_m));
        let target = Vector2::zeros();
        assert_eq!(
            clear_offset(target, 20.0, 5.0, &[path(6.0)]),
            Vector2::zeros()
        );
        let offset = clear_offset(target, 20.0, 5.0, &[path(1.0)]);
        assert_eq!(offset, Vector2::new(0.0, -5.0));
        let between = clear_offset(target, 20.0, 40.0, &[path(1.0), path(-19.0)]);
        assert_eq!(between, Vector2::new(0.0, 20.0));
    }

    /// The lattice alone would find a place 4.9 m from the corner.
    #[test]
    fn landing_place_is_as_far_from_a_corner_as_may_be() {
        let corner = Vector2::zeros();
        let paths = [
            (corner, Vector2::new(-20.0, 0.0)),
            (corner, Vector2::new(0.0, 20.0)),
        ];
        let offset = clear_offset(corner, 6.5, 6.9, &paths);
        assert!((offset.norm() - 6.5).abs() < 1e-9, "{offset}");
        for path in paths {
            assert!(segment_to_point_m(path, offset) > 6.4, "{offset}");
        }
    }
}
