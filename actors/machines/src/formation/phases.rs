//! What a swarm does in lockstep, one phase after the other, and where each drone may be meanwhile.

use std::cmp::Ordering;

use smallvec::{SmallVec, smallvec};

use super::{Flown, Path, Tube};
use crate::geometry::Ned;
use crate::identity::NodeId;

/// What all do in a phase, which nobody begins before all have done with the one before.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Act {
    /// From where they stand straight up, level in their layers to above their slots, and down into them.
    TakesOff {
        /// Which wave does so, the first being 0; later ones are still on the ground.
        wave: u16,
    },
    /// From the waypoint before this one straight to it.
    Flies {
        /// The number of the waypoint.
        to: usize,
    },
    /// First step of a change of formation: straight up into their sectors.
    Climbs {
        /// The number of the change.
        change: u16,
    },
    /// Second step: level to above their new slots.
    Crosses {
        /// The number of the change.
        change: u16,
        /// Which wave does so, the first being 0; later ones wait where they have climbed to.
        wave: u16,
    },
    /// Third step: straight down into their new slots.
    Descends {
        /// The number of the change.
        change: u16,
    },
    /// Level in their layers to above where they land, and straight down.
    Lands {
        /// Which wave does so, the first being 0; later ones wait in their slots.
        wave: u16,
    },
}

/// The straight ways of one drone in one phase, in order; a drone that does nothing stands at a point.
pub type Paths = SmallVec<[Path; 3]>;

/// What all do at a time. Nothing tells when within a phase a drone is where on its ways: those who are in lockstep may
/// be anywhere on them.
#[derive(Debug, Clone)]
pub struct Phase {
    /// What they do.
    pub act: Act,
    /// How many changes of formation have been made by its end.
    pub changes: u16,
    /// At or around which waypoint it ends.
    pub waypoint: usize,
    /// Each drone's ways, drone 0 first.
    pub paths: Vec<Paths>,
}

impl Phase {
    /// Where a drone is at its end.
    ///
    /// # Panics
    /// When there is no such drone.
    #[must_use]
    pub fn end(&self, id: NodeId) -> Ned {
        let last = self.paths[id.0 as usize].last();
        last.expect("each drone has a path").to
    }

    /// Whether all fly the same straight way elsewhere, beginning by the same order: they stay as far apart as they are.
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

/// Two displacements that differ by less, in metres, are the same but for rounding.
const SAME_M: f64 = 1e-6;

impl<'a> Flown<'a> {
    /// All that is flown in lockstep, in order. Each costs a few ways a drone.
    pub fn phases(self) -> impl Iterator<Item = Phase> + use<'a> {
        self.acts()
            .into_iter()
            .map(move |(act, changes, waypoint)| {
                let drones = (0..self.layout.formation().drones()).map(NodeId);
                Phase {
                    act,
                    changes,
                    waypoint,
                    paths: drones.map(|id| self.ways_in(act, id)).collect(),
                }
            })
    }

    /// The acts, with how many changes have been made by the end of each and the waypoint that it ends at.
    fn acts(self) -> Vec<(Act, u16, usize)> {
        let mut acts = Vec::new();
        let Some(last) = self.waypoints.len().checked_sub(1) else {
            return acts;
        };
        let up = 0..self.layout.take_off_waves();
        acts.extend(up.map(|wave| (Act::TakesOff { wave }, 0, 0)));
        for at in 0..=last {
            let (first, after) = (self.changes_before(at), self.changes_before(at + 1));
            if at > 0 {
                acts.push((Act::Flies { to: at }, first, at));
            }
            for change in first..after {
                acts.push((Act::Climbs { change }, change, at));
                let waves = 0..self.changes[usize::from(change)].waves();
                acts.extend(waves.map(|wave| (Act::Crosses { change, wave }, change, at)));
                acts.push((Act::Descends { change }, change + 1, at));
            }
        }
        let changes = self.changes_before(last + 1);
        let down = 0..self.layout_after(changes).landing_waves();
        acts.extend(down.map(|wave| (Act::Lands { wave }, changes, last)));
        acts
    }

    /// How the wave of a drone goes with the one whose turn it is: earlier, the same, or later.
    fn turn(self, act: Act, id: NodeId) -> Ordering {
        let changes = self.changes_before(self.waypoints.len());
        match act {
            Act::TakesOff { wave } => self.layout.take_off_wave(id).cmp(&wave),
            Act::Crosses { change, wave } => self.changes[usize::from(change)].wave(id).cmp(&wave),
            Act::Lands { wave } => self.layout_after(changes).landing_wave(id).cmp(&wave),
            Act::Flies { .. } | Act::Climbs { .. } | Act::Descends { .. } => Ordering::Equal,
        }
    }

    /// The ways of a drone, which stands at an end of them while other waves fly.
    fn ways_in(self, act: Act, id: NodeId) -> Paths {
        let slot = |changes: u16, at: usize| {
            let layout = self.layout_after(changes);
            layout.slot(id, self.waypoints[at])
        };
        let corners: SmallVec<[Ned; 4]> = match act {
            Act::TakesOff { .. } => {
                let to = slot(0, 0);
                let stand = self.layout.stand(id, self.waypoints[0].at_altitude(0.0));
                let layer_m = self.layout.take_off_layers_m()[id.0 as usize];
                let transit_m = to.altitude_m() + layer_m;
                let above = [stand.at_altitude(transit_m), to.at_altitude(transit_m)];
                smallvec![stand, above[0], above[1], to]
            }
            Act::Flies { to } => {
                let changes = self.changes_before(to);
                smallvec![slot(changes, to - 1), slot(changes, to)]
            }
            Act::Climbs { change } | Act::Crosses { change, .. } | Act::Descends { change } => {
                let made = &self.changes[usize::from(change)];
                let at = usize::from(made.waypoint());
                let [above_old, above_new, new] = made.path(id, self.waypoints[at]);
                match act {
                    Act::Climbs { .. } => smallvec![slot(change, at), above_old],
                    Act::Crosses { .. } => smallvec![above_old, above_new],
                    _ => smallvec![above_new, new],
                }
            }
            Act::Lands { .. } => {
                let last = self.waypoints.len() - 1;
                let changes = self.changes_before(last + 1);
                let layout = self.layout_after(changes);
                let from = slot(changes, last);
                let transit_m = from.altitude_m() + layout.landing_layers_m()[id.0 as usize];
                let place = layout.place(id, self.waypoints[last]);
                let [above, over] = [from, place].map(|it| it.at_altitude(transit_m));
                smallvec![from, above, over, place.at_altitude(0.0)]
            }
        };
        match self.turn(act, id) {
            Ordering::Less => return smallvec![Path::standing(corners[corners.len() - 1])],
            Ordering::Equal => {}
            Ordering::Greater => return smallvec![Path::standing(corners[0])],
        }
        let pairs = corners.windows(2);
        pairs
            .map(|pair| Path {
                from: pair[0],
                to: pair[1],
            })
            .collect()
    }

    /// The legs of a drone that flies alone and takes no steps to change formation: from each slot that it may have had at
    /// the waypoint before straight to the one that it has in the end.
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

    /// Where each drone may be that falls out of lockstep in a phase: between its ways and its own altitude, in which it
    /// flies on, and, at the end, down where it lands then. On the way up it does so in its slot only.
    #[must_use]
    pub fn tubes_alone(self, phase: &Phase) -> Vec<(NodeId, Tube)> {
        let centre = self.waypoints[phase.waypoint];
        let layout = self.layout_after(phase.changes);
        let drones = (0..layout.formation().drones()).map(NodeId);
        let is_in_slot = |id: &NodeId| match self.turn(phase.act, *id) {
            // On the ground once it has landed, or until it takes off.
            Ordering::Less => !matches!(phase.act, Act::Lands { .. }),
            Ordering::Equal => true,
            Ordering::Greater => !matches!(phase.act, Act::TakesOff { .. }),
        };
        let drones = drones.filter(is_in_slot);
        let stretched = |id: NodeId, path: Path| {
            let altitude_m = self.altitude_alone_m(id, phase.changes, centre);
            (id, Tube::from(path).stretched_to(altitude_m))
        };
        match phase.act {
            Act::TakesOff { .. } => drones
                .map(|id| stretched(id, Path::standing(phase.end(id))))
                .collect(),
            Act::Flies { to } => drones
                .flat_map(|id| self.legs_alone(id, to).map(move |path| (id, path)))
                .map(|(id, path)| stretched(id, path))
                .collect(),
            Act::Climbs { .. } | Act::Crosses { .. } | Act::Descends { .. } => drones
                .map(|id| stretched(id, phase.paths[id.0 as usize][0]))
                .collect(),
            Act::Lands { .. } => {
                let clearings = layout
                    .lands_apart()
                    .then(|| self.clearings(phase.changes, centre));
                let land = |id: NodeId| {
                    let from = phase.paths[id.0 as usize][0].from;
                    let place = match &clearings {
                        Some(centres) => layout.slot(id, centres[id.0 as usize]),
                        None => layout.place(id, centre),
                    };
                    let altitude_m = self.altitude_alone_m(id, phase.changes, centre);
                    let [above, over] = [from, place].map(|it| it.at_altitude(altitude_m));
                    let level = Path {
                        from: above,
                        to: over,
                    };
                    let down = Tube::from(Path::standing(over)).stretched_to(0.0);
                    let up = stretched(id, Path::standing(from));
                    [up, (id, level.into()), (id, down)]
                };
                drones.flat_map(land).collect()
            }
        }
    }
}

#[cfg(test)]
mod tests;
