use super::crossings::{crossings, ground_tracks};
use super::layers::{LayerPlan, WaitingPosition};
use super::reach::Reach;
use super::{Formation, Layout};
use crate::geometry::Ned;
use crate::identity::NodeId;

/// A change of formation in flight, at a waypoint, through altitude sectors. All drones climb into their sectors,
/// cross, and descend into their new slots. Each step starts only once all drones have finished the one before.
///
/// Drones with paths that come near each other have different sectors, so delays don't matter. The lowest sector is the
/// height of the slots. A path over an end of another gets the lower sector, so a drone that descends on its path stays
/// clear of one that waits at an end.
#[derive(Debug)]
pub struct Change {
    waypoint: u16,
    from: Vec<Ned>,
    layout: Layout,
    sectors_m: Vec<f64>,
    wave_of: Vec<u16>,
    waves: u16,
}

impl Change {
    /// A change at `waypoint` from the formation of `before` to `formation`. The master keeps its place. The other
    /// slots are assigned by least squared distance. Places on the ground and separation stay as they were.
    ///
    /// # Panics
    /// If the two formations have different numbers of drones.
    #[must_use]
    pub fn new(waypoint: u16, before: &Layout, formation: Formation) -> Self {
        let formation = formation.reassigned_from(before.formation());
        let from = before.formation().slots().to_vec();
        let limits = before.limits();
        let separation = limits.separation;
        let mut crossings = crossings(
            &ground_tracks(&from, formation.slots()),
            separation.horizontal_with_margin_m(),
        );
        for crossing in &mut crossings {
            // No drone climbs or descends while others cross, but a crossing drone may have to descend.
            crossing.overflights.reverse();
        }
        let plan = match limits.waves {
            None => LayerPlan::of(from.len(), &crossings, 0),
            Some(waves) => LayerPlan::in_waves(
                &Reach::from_slots(&from, &formation, waves),
                &crossings,
                waves,
                WaitingPosition::Layer,
            ),
        };
        Self {
            waypoint,
            from,
            sectors_m: separation.heights_m(&plan).collect(),
            waves: plan.wave_count,
            wave_of: plan.waves,
            layout: Layout::within(formation, before.gap_m(), limits).layered_like(before),
        }
    }

    /// Number of the waypoint at which the centre of the formation stays.
    #[must_use]
    pub const fn waypoint(&self) -> u16 {
        self.waypoint
    }

    /// Layout after the change.
    #[must_use]
    pub const fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Sector of each drone, in metres above its slots.
    #[must_use]
    pub fn sectors_m(&self) -> &[f64] {
        &self.sectors_m
    }

    /// Wave in which a drone crosses, from 0.
    ///
    /// # Panics
    /// If the formation has no such drone.
    #[must_use]
    pub fn wave(&self, id: NodeId) -> u16 {
        self.wave_of[id.0 as usize]
    }

    /// Number of waves of the crossing.
    #[must_use]
    pub const fn waves(&self) -> u16 {
        self.waves
    }

    /// Corners of a drone's path with the formation's centre at `waypoint`: in its sector above the old slot, in its
    /// sector above the new slot, and the new slot.
    ///
    /// # Panics
    /// If the formation has no such drone.
    #[must_use]
    pub fn path(&self, id: NodeId, waypoint: Ned) -> [Ned; 3] {
        let index = id.0 as usize;
        let sector_m = waypoint.altitude_m() + self.sectors_m[index];
        let (old, new) = (
            waypoint + self.from[index],
            waypoint + self.layout.formation().slots()[index],
        );
        [old.at_altitude(sector_m), new.at_altitude(sector_m), new]
    }
}

#[cfg(test)]
mod tests {
    use std::num::NonZeroU32;

    use super::*;
    use crate::formation::{Kind, Layering, Separation};

    const KINDS: [Kind; 7] = [
        Kind::Linear,
        Kind::Circular,
        Kind::Random { seed: 3 },
        Kind::SplitUp {
            clusters: NonZeroU32::new(2).unwrap(),
            distance_m: 320.0,
        },
        Kind::CompactMesh,
        Kind::RegularMatrix,
        Kind::CompactMatrix,
    ];
    const SEPARATION: Separation = Separation {
        horizontal_m: 5.0,
        vertical_m: 5.0,
    };

    fn formation(kind: Kind, drones: u32) -> Formation {
        Formation::new(kind, NonZeroU32::new(drones).unwrap(), 40.0, 0.3)
    }

    fn layout(kind: Kind, drones: u32) -> Layout {
        Layout::new(formation(kind, drones), 10.0, SEPARATION)
    }

    fn each_pair(mut check: impl FnMut(Kind, Change)) {
        for from in KINDS {
            for to in KINDS {
                check(to, Change::new(1, &layout(from, 9), formation(to, 9)));
            }
        }
    }

    #[test]
    fn new_slots_are_those_of_the_formation_and_master_keeps_the_centre() {
        each_pair(|to, change| {
            let ours = change.layout.formation();
            let theirs = formation(to, 9);
            assert_eq!(ours.slots()[ours.centre().0 as usize], Ned::HOME);
            assert_eq!(ours.ranks()[ours.centre().0 as usize], 0);
            let sorted = |formation: &Formation| {
                let mut slots: Vec<_> = formation
                    .slots()
                    .iter()
                    .zip(formation.ranks())
                    .map(|(slot, rank)| (*rank, format!("{:?}", slot.0)))
                    .collect();
                slots.sort();
                slots
            };
            assert_eq!(sorted(ours), sorted(&theirs), "slots with their ranks");
        });
    }

    /// Distance of a place from the nearest place of a drone that crosses.
    fn horizontal_distance_m(place: Ned, [from, to, _]: &[Ned; 3]) -> f64 {
        let (way, done) = ((*to - *from).0.xy(), (place - *from).0.xy());
        let share = (done.dot(&way) / way.norm_squared().max(1e-9)).clamp(0.0, 1.0);
        (done - way * share).norm()
    }

    #[test]
    fn drones_with_close_paths_have_different_sectors() {
        each_pair(|to, change| {
            let paths: Vec<[Ned; 3]> = (0..9)
                .map(|id| change.path(NodeId(id), Ned::new(100.0, 0.0, -25.0)))
                .collect();
            for (a, one) in paths.iter().enumerate() {
                for other in &paths[..a] {
                    let apart_m = one[0].vertical_distance_m(other[0]);
                    let nearest_m = (0..=50)
                        .map(|step| one[0].0.lerp(&one[1].0, f64::from(step) / 50.0))
                        .map(|place| horizontal_distance_m(Ned(place), other))
                        .fold(f64::INFINITY, f64::min);
                    assert!(nearest_m >= 5.0 || apart_m >= 5.0, "to {to:?}");
                }
            }
        });
    }

    #[test]
    fn descending_drone_stays_clear_of_drones_waiting_at_path_ends() {
        let mut seen = 0;
        each_pair(|to, change| {
            let at = Ned::new(0.0, 0.0, -25.0);
            let paths: Vec<[Ned; 3]> = (0..9).map(|id| change.path(NodeId(id), at)).collect();
            let leads_over = |one: &[Ned; 3], end: Ned| {
                let steps = (0..=100).map(|step| f64::from(step) / 100.0);
                steps
                    .map(|share| Ned(one[0].0.lerp(&one[1].0, share)))
                    .any(|here| here.horizontal_distance_m(end) < 5.0)
            };
            for (a, one) in paths.iter().enumerate() {
                for (b, other) in paths.iter().enumerate() {
                    if a != b && leads_over(one, other[1]) && !leads_over(other, one[1]) {
                        assert!(one[0].altitude_m() < other[0].altitude_m(), "to {to:?}");
                        seen += 1;
                    }
                }
            }
        });
        assert!(seen > 0, "some path leads over an end of another");
    }

    #[test]
    fn drone_keeps_its_layer_through_a_change() {
        let before = layout(Kind::Linear, 9).with_layers(Layering::PerDrone);
        let change = Change::new(1, &before, formation(Kind::CompactMesh, 9));
        assert_eq!(change.layout().layers_m(&[]), before.layers_m(&[]));
    }

    #[test]
    fn change_to_the_same_formation_moves_no_drone() {
        for kind in KINDS {
            let change = Change::new(0, &layout(kind, 9), formation(kind, 9));
            let at = Ned::new(0.0, 0.0, -25.0);
            for id in (0..9).map(NodeId) {
                let [above_old, above_new, new] = change.path(id, at);
                assert_eq!((above_old, above_new), (new, new), "{kind:?}");
            }
        }
    }
}
