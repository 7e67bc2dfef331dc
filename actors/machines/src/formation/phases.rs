//! Phases of a flight in lockstep, one after the other, and where each drone may be in each phase.

use std::cmp::Ordering;

use smallvec::{SmallVec, smallvec};

use super::{FlightPlan, Path, Tube};
use crate::geometry::Ned;
use crate::identity::NodeId;

/// What all drones do in a phase. No drone starts a phase before all have finished the one before.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum PhaseKind {
    /// Climb vertically, fly level in the layers to above the slots, and descend into the slots.
    TakeOff {
        /// The wave that flies, from 0; later waves are still on the ground.
        wave: u16,
    },
    /// Fly straight from the previous waypoint.
    Leg {
        /// Number of the waypoint at the end.
        to: usize,
    },
    /// First step of a change of formation: climb vertically into the sectors.
    Climb {
        /// The number of the change.
        change: u16,
    },
    /// Second step: fly level to above the new slots.
    Cross {
        /// The number of the change.
        change: u16,
        /// The wave that flies, from 0; later waves wait in their sectors.
        wave: u16,
    },
    /// Third step: descend vertically into the new slots.
    Descend {
        /// The number of the change.
        change: u16,
    },
    /// Fly level in the layers to above the landing places, and descend vertically.
    Land {
        /// The wave that flies, from 0; later waves wait in their slots.
        wave: u16,
    },
}

/// Straight paths of one drone in one phase, in order; one stationary path for a drone that does not fly.
pub type Paths = SmallVec<[Path; 3]>;

/// One phase. Drones in lockstep may be anywhere on their paths during the phase.
#[derive(Debug, Clone)]
pub struct Phase {
    /// What the drones do.
    pub kind: PhaseKind,
    /// Number of changes of formation finished by the end of the phase.
    pub changes: u16,
    /// Waypoint at which the phase ends.
    pub waypoint: usize,
    /// Paths of each drone, drone 0 first.
    pub paths: Vec<Paths>,
}

impl Phase {
    /// Position of a drone at the end of the phase.
    ///
    /// # Panics
    /// If there is no such drone.
    #[must_use]
    pub fn end(&self, id: NodeId) -> Ned {
        let last = self.paths[id.0 as usize].last();
        last.expect("each drone has a path").to
    }

    /// Whether all drones fly the same displacement, started by the same order: their distances stay constant.
    #[must_use]
    pub fn is_translation(&self) -> bool {
        let displacement = |paths: &Paths| match paths[..] {
            [path] => Some((path.to - path.from).0),
            _ => None,
        };
        let first = self.paths.first().and_then(displacement);
        first.is_some_and(|first| {
            let mut displacements = self.paths.iter().map(displacement);
            displacements.all(|it| it.is_some_and(|it| (it - first).norm() < SAME_M))
        })
    }
}

/// Displacements and distances that differ by less, in metres, are equal but for rounding.
pub(super) const SAME_M: f64 = 1e-6;

impl<'a> FlightPlan<'a> {
    /// All phases in lockstep, in order. Each costs a few paths per drone.
    pub fn phases(self) -> impl Iterator<Item = Phase> + use<'a> {
        self.phase_kinds()
            .into_iter()
            .map(move |(kind, changes, waypoint)| {
                let drones = (0..self.layout.formation().drones()).map(NodeId);
                Phase {
                    kind,
                    changes,
                    waypoint,
                    paths: drones.map(|id| self.paths_in(kind, id)).collect(),
                }
            })
    }

    /// Kinds of all phases, each with the number of changes finished and the waypoint at its end.
    fn phase_kinds(self) -> Vec<(PhaseKind, u16, usize)> {
        let mut kinds = Vec::new();
        let Some(last) = self.waypoints.len().checked_sub(1) else {
            return kinds;
        };
        let up = 0..self.layout.take_off_waves();
        kinds.extend(up.map(|wave| (PhaseKind::TakeOff { wave }, 0, 0)));
        for at in 0..=last {
            let (first, after) = (self.changes_before(at), self.changes_before(at + 1));
            if at > 0 {
                kinds.push((PhaseKind::Leg { to: at }, first, at));
            }
            for change in first..after {
                kinds.push((PhaseKind::Climb { change }, change, at));
                let waves = 0..self.changes[usize::from(change)].waves();
                kinds.extend(waves.map(|wave| (PhaseKind::Cross { change, wave }, change, at)));
                kinds.push((PhaseKind::Descend { change }, change + 1, at));
            }
        }
        let changes = self.changes_before(last + 1);
        let down = 0..self.layout_after(changes).landing_waves();
        kinds.extend(down.map(|wave| (PhaseKind::Land { wave }, changes, last)));
        kinds
    }

    /// The wave of a drone compared with the wave of the phase.
    fn compare_wave(self, kind: PhaseKind, id: NodeId) -> Ordering {
        let changes = self.changes_before(self.waypoints.len());
        match kind {
            PhaseKind::TakeOff { wave } => self.layout.take_off_wave(id).cmp(&wave),
            PhaseKind::Cross { change, wave } => {
                self.changes[usize::from(change)].wave(id).cmp(&wave)
            }
            PhaseKind::Land { wave } => self.layout_after(changes).landing_wave(id).cmp(&wave),
            PhaseKind::Leg { .. } | PhaseKind::Climb { .. } | PhaseKind::Descend { .. } => {
                Ordering::Equal
            }
        }
    }

    /// Paths of a drone, which is stationary at an end of them while other waves fly.
    fn paths_in(self, kind: PhaseKind, id: NodeId) -> Paths {
        let slot = |changes: u16, at: usize| {
            let layout = self.layout_after(changes);
            layout.slot(id, self.waypoints[at])
        };
        let corners: SmallVec<[Ned; 4]> = match kind {
            PhaseKind::TakeOff { .. } => {
                let to = slot(0, 0);
                let stand = self
                    .layout
                    .take_off_place(id, self.waypoints[0].at_altitude(0.0));
                let layer_m = self.layout.take_off_layers_m()[id.0 as usize];
                let transit_m = to.altitude_m() + layer_m;
                let above = [stand.at_altitude(transit_m), to.at_altitude(transit_m)];
                smallvec![stand, above[0], above[1], to]
            }
            PhaseKind::Leg { to } => {
                let changes = self.changes_before(to);
                smallvec![slot(changes, to - 1), slot(changes, to)]
            }
            PhaseKind::Climb { change }
            | PhaseKind::Cross { change, .. }
            | PhaseKind::Descend { change } => {
                let made = &self.changes[usize::from(change)];
                let at = usize::from(made.waypoint());
                let [above_old, above_new, new] = made.path(id, self.waypoints[at]);
                match kind {
                    PhaseKind::Climb { .. } => smallvec![slot(change, at), above_old],
                    PhaseKind::Cross { .. } => smallvec![above_old, above_new],
                    _ => smallvec![above_new, new],
                }
            }
            PhaseKind::Land { .. } => {
                let last = self.waypoints.len() - 1;
                let changes = self.changes_before(last + 1);
                let layout = self.layout_after(changes);
                let from = slot(changes, last);
                let transit_m = from.altitude_m() + layout.landing_layers_m()[id.0 as usize];
                let place = layout.landing_place(id, self.waypoints[last]);
                let [above, over] = [from, place].map(|it| it.at_altitude(transit_m));
                smallvec![from, above, over, place.at_altitude(0.0)]
            }
        };
        match self.compare_wave(kind, id) {
            Ordering::Less => return smallvec![Path::stationary(corners[corners.len() - 1])],
            Ordering::Equal => {}
            Ordering::Greater => return smallvec![Path::stationary(corners[0])],
        }
        let pairs = corners.windows(2);
        pairs
            .map(|pair| Path {
                from: pair[0],
                to: pair[1],
            })
            .collect()
    }

    /// Legs of a drone out of lockstep, which takes no steps of changes: straight from each slot that it may have had
    /// at the previous waypoint to its last slot at this one.
    pub(super) fn legs_alone(self, id: NodeId, to: usize) -> impl Iterator<Item = Path> + use<'a> {
        let (first, last) = (self.changes_before(to - 1), self.changes_before(to));
        let slot = move |changes: u16, at: usize| {
            let layout = self.layout_after(changes);
            layout.slot(id, self.waypoints[at])
        };
        (first..=last).map(move |changes| Path {
            from: slot(changes, to - 1),
            to: slot(last, to),
        })
    }

    /// Volumes in which drones may be that fall out of lockstep in a phase: between their paths and their own
    /// altitudes, and down to their landing places, [`Self::landing_places_alone`], in the last phases. On take-off a drone
    /// falls out of lockstep only in its slot.
    #[must_use]
    pub fn tubes_alone(self, phase: &Phase, landing_places: &[Ned]) -> Vec<(NodeId, Tube)> {
        let centre = self.waypoints[phase.waypoint];
        let layout = self.layout_after(phase.changes);
        let drones = (0..layout.formation().drones()).map(NodeId);
        let is_in_slot = |id: &NodeId| match self.compare_wave(phase.kind, *id) {
            // On the ground after landing or before take-off.
            Ordering::Less => !matches!(phase.kind, PhaseKind::Land { .. }),
            Ordering::Equal => true,
            Ordering::Greater => !matches!(phase.kind, PhaseKind::TakeOff { .. }),
        };
        let drones = drones.filter(is_in_slot);
        let stretched = |id: NodeId, path: Path| {
            let altitude_m = self.altitude_alone_m(id, phase.changes, centre);
            (id, Tube::from(path).extended_to(altitude_m))
        };
        match phase.kind {
            PhaseKind::TakeOff { .. } => drones
                .map(|id| stretched(id, Path::stationary(phase.end(id))))
                .collect(),
            PhaseKind::Leg { to } => drones
                .flat_map(|id| self.legs_alone(id, to).map(move |path| (id, path)))
                .map(|(id, path)| stretched(id, path))
                .collect(),
            PhaseKind::Climb { .. } | PhaseKind::Cross { .. } | PhaseKind::Descend { .. } => drones
                .map(|id| stretched(id, phase.paths[id.0 as usize][0]))
                .collect(),
            PhaseKind::Land { .. } => {
                let land = |id: NodeId| {
                    let from = phase.paths[id.0 as usize][0].from;
                    let place = landing_places[id.0 as usize];
                    let altitude_m = self.altitude_alone_m(id, phase.changes, centre);
                    let [level, down] = Tube::level_then_down(from, place, altitude_m);
                    let up = stretched(id, Path::stationary(from));
                    [up, (id, level), (id, down)]
                };
                drones.flat_map(land).collect()
            }
        }
    }

    /// Columns over the landing places of drones that land with a part of the swarm around an earlier waypoint, while the
    /// others land around the last.
    pub(super) fn landings_elsewhere(self, phase: &Phase) -> Vec<(NodeId, Tube)> {
        let layout = self.layout_after(phase.changes);
        let is_last = matches!(phase.kind, PhaseKind::Land { .. });
        if !is_last || layout.lands_below_slot() {
            return Vec::new();
        }
        let last = self.waypoints[phase.waypoint];
        let drones = (0..layout.formation().drones()).map(NodeId);
        let farthest_m = (drones.clone())
            .map(|id| layout.landing_place(id, Ned::HOME).0.xy().norm())
            .fold(0.0, f64::max);
        let reach_m = 2.0 * farthest_m + layout.separation().horizontal_m;
        let earlier = self.waypoints[..phase.waypoint].iter();
        let near = earlier.filter(|at| last.horizontal_distance_m(**at) < reach_m);
        near.flat_map(|at| {
            drones.clone().map(|id| {
                let over = layout.landing_place(id, *at);
                let over = over.at_altitude(self.altitude_alone_m(id, phase.changes, *at));
                (id, Tube::down_from(over))
            })
        })
        .collect()
    }
}

#[cfg(test)]
mod tests;
