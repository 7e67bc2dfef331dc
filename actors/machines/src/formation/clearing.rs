//! Where to come down while others may be anywhere on their ways.

use nalgebra::Vector2;

use super::crossings::to_point_m;
use super::phases::Act;
use super::{Change, Layout, Path};
use crate::geometry::Ned;
use crate::identity::NodeId;

/// How far apart the places are that are looked at, as a share of how far from ways they are to be.
const STEP: f64 = 0.5;

/// How far from its slot a drone looks for a place at most, counted in how far from ways it is to be.
const REACH: f64 = 4.0;

/// A mission as all drones of a formation fly it: where they may be who have lost touch with each other.
#[derive(Debug, Clone, Copy)]
pub struct Flown<'a> {
    /// The layout that the mission begins with.
    pub layout: &'a Layout,
    /// The changes of formation on the way, in order.
    pub changes: &'a [Change],
    /// The formation's centre at each waypoint.
    pub waypoints: &'a [Ned],
}

impl<'a> Flown<'a> {
    /// Who flies, stands and lands where once so many changes have been made.
    ///
    /// # Panics
    /// When there are fewer.
    #[must_use]
    pub fn layout_after(&self, changes: u16) -> &'a Layout {
        match changes.checked_sub(1) {
            Some(last) => self.changes[usize::from(last)].layout(),
            None => self.layout,
        }
    }

    /// How many changes are made before the swarm makes for a waypoint.
    #[must_use]
    pub fn changes_before(&self, waypoint: usize) -> u16 {
        let changes = self.changes.iter();
        (0..)
            .zip(changes.take_while(|change| usize::from(change.waypoint()) < waypoint))
            .last()
            .map_or(0, |(last, _)| last + 1)
    }

    /// How high drone `id` flies around `centre` whenever it is not in lockstep, after so many changes, in metres above
    /// home: level in its layer above the highest waypoint, so that it is above all that fly in lockstep wherever on their
    /// slopes they are, and each of the others that does the same is in another layer.
    ///
    /// # Panics
    /// When there are fewer changes, or no such drone.
    #[must_use]
    pub fn altitude_alone_m(&self, id: NodeId, changes: u16, centre: Ned) -> f64 {
        let altitudes_m = self.waypoints.iter().map(|it| it.altitude_m());
        altitudes_m.fold(centre.altitude_m(), f64::max)
            + self.layout_after(changes).layer_alone_m(id, self.waypoints)
    }

    /// The centre around which the slot of drone `id` after so many changes is the place nearest to its slot around `centre`
    /// that nobody else's way leads over, from the ground to where all land. It is so near that nobody else who looks for
    /// one so, around the same centre, comes too close. Where there is none, it is the one that is the farthest from all
    /// ways.
    ///
    /// # Panics
    /// When there are fewer changes, or no such drone.
    #[must_use]
    pub fn clearing(&self, id: NodeId, changes: u16, centre: Ned) -> Ned {
        self.clearing_among(&self.seen_from_above(), id, changes, centre)
    }

    /// Likewise for each drone.
    pub(super) fn clearings(&self, changes: u16, centre: Ned) -> Vec<Ned> {
        let paths = self.seen_from_above();
        let drones = (0..self.layout.formation().drones()).map(NodeId);
        drones
            .map(|id| self.clearing_among(&paths, id, changes, centre))
            .collect()
    }

    fn clearing_among(&self, paths: &[Seen], id: NodeId, changes: u16, centre: Ned) -> Ned {
        let layout = self.layout_after(changes);
        let near_m = layout.separation().near_m();
        let slots = layout.formation().slots();
        let own = slots[id.0 as usize];
        let others = (slots.iter().zip(0..)).filter(|(_, other)| *other != id.0);
        let nearest_m = others
            .map(|(slot, _)| own.horizontal_distance_m(*slot))
            .fold(f64::INFINITY, f64::min);
        let reach_m = ((nearest_m - near_m) / 2.0).min(REACH * near_m);
        let wish = (centre + own).0.xy();
        let paths: Vec<_> = (paths.iter())
            .filter(|(other, _)| *other != id)
            .map(|(_, path)| *path)
            .filter(|path| to_point_m(*path, wish) < near_m + reach_m)
            .collect();
        let offset = clear_offset(wish, reach_m, near_m, &paths);
        centre + Ned::new(offset.x, offset.y, 0.0)
    }

    /// All ways of all drones, in lockstep or not, as seen from above.
    fn seen_from_above(self) -> Vec<Seen> {
        let mut seen = Vec::new();
        let mut sees = |id: NodeId, path: Path| seen.push((id, (path.from.0.xy(), path.to.0.xy())));
        for phase in self.phases() {
            for (id, paths) in (0..).map(NodeId).zip(&phase.paths) {
                let level = paths.iter().filter(|path| !path.is_upright());
                level.for_each(|path| sees(id, *path));
                if let Act::Flies { to } = phase.act {
                    self.legs_alone(id, to).for_each(|path| sees(id, path));
                }
            }
        }
        seen
    }
}

/// Whose way it is, and its ends as seen from above.
type Seen = (NodeId, (Vector2<f64>, Vector2<f64>));

/// The shortest way from `wish`, of at most `reach_m`, to a place that is `near_m` from all `ways`, or to the one that is
/// the farthest from them.
fn clear_offset(
    wish: Vector2<f64>,
    reach_m: f64,
    near_m: f64,
    paths: &[(Vector2<f64>, Vector2<f64>)],
) -> Vector2<f64> {
    let clearance_m = |offset: &Vector2<f64>| {
        let from_ways = paths.iter().map(|path| to_point_m(*path, wish + offset));
        from_ways.fold(f64::INFINITY, f64::min).min(near_m)
    };
    let mut best = (Vector2::zeros(), clearance_m(&Vector2::zeros()));
    for offset in offsets(reach_m, STEP * near_m) {
        if best.1 >= near_m {
            break;
        }
        let clearance_m = clearance_m(&offset);
        if clearance_m > best.1 {
            best = (offset, clearance_m);
        }
    }
    best.0
}

/// The points of a lattice around the origin that are at most `reach_m` from it, the nearest first.
fn offsets(reach_m: f64, step_m: f64) -> Vec<Vector2<f64>> {
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
        .map(|(north, east)| Vector2::new(f64::from(north), f64::from(east)) * step_m)
        .filter(|offset| offset.norm() <= reach_m)
        .collect()
}

#[cfg(test)]
mod tests {
    use std::num::NonZeroU32;

    use super::*;
    use crate::formation::{Formation, Kind, Layering, Separation};

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
    fn who_comes_down_is_under_nobody_s_way_and_near_nobody_who_does_the_same() {
        for kind in [Kind::CompactMesh, Kind::Linear, Kind::RegularMatrix] {
            let layout = Layout::new(formation(kind), 10.0, SEPARATION).with_layers(Layering::Each);
            let changes = [Change::new(2, &layout, formation(Kind::Circular))];
            let waypoints = waypoints();
            let flown = Flown {
                layout: &layout,
                changes: &changes,
                waypoints: &waypoints,
            };
            let last = flown.layout_after(1);
            let places: Vec<Ned> = (0..7)
                .map(NodeId)
                .map(|id| last.slot(id, flown.clearing(id, 1, waypoints[3])))
                .collect();
            for (id, place) in (0..).map(NodeId).zip(&places) {
                for other in (0..7).map(NodeId).filter(|other| *other != id) {
                    let apart_m = place.horizontal_distance_m(places[other.0 as usize]);
                    assert!(apart_m >= 5.0, "{kind:?}: {id} and {other}: {apart_m}");
                    let paths = flown.seen_from_above();
                    for (_, path) in paths.into_iter().filter(|(whose, _)| *whose == other) {
                        let apart_m = to_point_m(path, place.0.xy());
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
    fn who_is_in_nobody_s_way_comes_down_in_its_slot_and_who_finds_no_place_as_far_as_it_can() {
        let path = |east_m: f64| (Vector2::new(-100.0, east_m), Vector2::new(100.0, east_m));
        let wish = Vector2::zeros();
        assert_eq!(
            clear_offset(wish, 20.0, 5.0, &[path(6.0)]),
            Vector2::zeros()
        );
        let unicasts = clear_offset(wish, 20.0, 5.0, &[path(1.0)]);
        assert_eq!(unicasts, Vector2::new(0.0, -5.0));
        let between = clear_offset(wish, 20.0, 40.0, &[path(1.0), path(-19.0)]);
        assert_eq!(between, Vector2::new(0.0, 20.0));
    }
}
