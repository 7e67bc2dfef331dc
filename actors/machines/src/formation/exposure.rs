//! How near drones come to each other in a phase: in lockstep, and with one of them out of it.

use std::collections::BTreeSet;

use super::phases::{Act, Phase};
use super::tube::Bounds;
use super::{Clearance, Flown, Path, Separation, Tube};
use crate::identity::NodeId;

/// What one drone does that is no longer in lockstep with the others.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Exposure {
    /// It stays behind for a while, anywhere on its ways, and flies on then: a process that hangs or restarts.
    Late,
    /// It flies to its own altitude and on in it: it was cut off, or restarted.
    Apart,
    /// It comes down on the spot, and says so: a battery that is all but empty, a position that is lost. The others go on.
    Descends,
    /// Its process dies: the flight controller hovers and brings it down on the spot. The others wait until they miss it, and
    /// fly to their own altitudes then.
    Killed,
}

impl Exposure {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Late, Self::Apart, Self::Descends, Self::Killed];

    /// Its name in files and reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Late => "late",
            Self::Apart => "apart",
            Self::Descends => "descends",
            Self::Killed => "killed",
        }
    }

    /// Whether the drone that it happens to, and those near it, can still give way to each other. Drones that follow a
    /// master give way to nobody, so they do not where one flies apart.
    #[must_use]
    pub const fn is_mended_by_giving_way(self, they_follow: bool) -> bool {
        match self {
            Self::Late => true,
            Self::Apart => !they_follow,
            Self::Descends | Self::Killed => false,
        }
    }
}

/// The two drones that come the nearest to each other, and how near.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Approach {
    /// Who; first the one that something happened to, if something did.
    pub drones: [NodeId; 2],
    /// How near.
    pub clearance: Clearance,
}

/// How near drones come to each other.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Nearness {
    /// The nearest two; `None` for fewer than two drones.
    pub closest: Option<Approach>,
    /// All who may come too near each other; first the one that something happened to, if something did.
    pub too_near: BTreeSet<[NodeId; 2]>,
}

/// A phase with what it exposes drones to.
#[derive(Debug)]
pub struct Exposed {
    /// The phase.
    pub phase: Phase,
    /// All in lockstep.
    pub lockstep: Nearness,
    /// Who in lockstep keeps apart only by beginning at the same time: one comes near a way that the other has flown by then,
    /// or flies later. They count as apart in lockstep.
    pub together: BTreeSet<[NodeId; 2]>,
}

impl Flown<'_> {
    /// How near drones come to each other in each phase, all in lockstep.
    pub fn in_lockstep(self) -> impl Iterator<Item = Exposed> {
        let separation = self.layout.separation();
        self.phases().map(move |phase| {
            let is_translation = phase.is_translation();
            let drones = (0..).map(NodeId).zip(&phase.paths);
            let entries = drones.flat_map(|(id, paths)| {
                paths.iter().enumerate().map(move |(stage, path)| {
                    let path = if is_translation {
                        Path::standing(path.from)
                    } else {
                        *path
                    };
                    let entry = Entry::new(Side::Both, id, path.into());
                    Entry { stage, ..entry }
                })
            });
            let (lockstep, together) = search(entries.collect(), separation);
            Exposed {
                phase,
                lockstep,
                together,
            }
        })
    }

    /// How near one drone may come to others that are in lockstep, in each phase, by what happens to it: in that phase, or
    /// earlier if it is still coming down.
    pub fn exposures(self) -> impl Iterator<Item = Vec<(Exposure, Nearness)>> {
        let separation = self.layout.separation();
        let mut falling: Vec<(NodeId, Tube)> = Vec::new();
        self.phases().map(move |phase| {
            let in_lockstep: Vec<(NodeId, Tube)> =
                tubes(&phase).map(|(id, path)| (id, path.into())).collect();
            let alone = self.tubes_alone(&phase);
            let down = in_lockstep
                .iter()
                .map(|(id, tube)| (*id, tube.stretched_to(0.0)));
            let down: Vec<(NodeId, Tube)> = down.collect();
            let between = |affected: &[(NodeId, Tube)], others: &[(NodeId, Tube)]| {
                let entries = |side: Side, tubes: &[(NodeId, Tube)]| -> Vec<Entry> {
                    let tubes = tubes.iter();
                    tubes
                        .map(|(id, tube)| Entry::new(side, *id, *tube))
                        .collect()
                };
                let mut all = entries(Side::Affected, affected);
                all.extend(entries(Side::Other, others));
                search(all, separation).0
            };
            // A drone that comes down may have begun before this phase; steps of a change take less time than that.
            let fallen = std::mem::take(&mut falling);
            let both: Vec<_> = fallen.iter().chain(&down).copied().collect();
            let found = Exposure::ALL.map(|exposure| {
                let nearness = match exposure {
                    Exposure::Late => between(&in_lockstep, &in_lockstep),
                    Exposure::Apart => between(&alone, &in_lockstep),
                    Exposure::Descends => between(&both, &in_lockstep),
                    Exposure::Killed => between(&down, &in_lockstep).and(between(&both, &alone)),
                };
                (exposure, nearness)
            });
            if let Act::Climbs { .. } | Act::Crosses { .. } | Act::Descends { .. } = phase.act {
                falling = both;
            } else {
                falling = down;
            }
            found.into()
        })
    }
}

impl Nearness {
    /// Both.
    fn and(mut self, other: Self) -> Self {
        let room = |it: &Option<Approach>| it.map_or(f64::INFINITY, |it| it.clearance.room);
        if room(&other.closest) < room(&self.closest) {
            self.closest = other.closest;
        }
        self.too_near.extend(other.too_near);
        self
    }
}

fn tubes(phase: &Phase) -> impl Iterator<Item = (NodeId, Path)> {
    let drones = (0..).map(NodeId).zip(&phase.paths);
    drones.flat_map(|(id, paths)| paths.iter().map(move |path| (id, *path)))
}

/// With whom a drone in a tube is compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Side {
    /// With each other one.
    Both,
    /// With those to whom nothing happened.
    Affected,
    /// With those to whom something happened.
    Other,
}

#[derive(Debug)]
struct Entry {
    side: Side,
    id: NodeId,
    /// Who are in lockstep are in the same one at the same time.
    stage: usize,
    tube: Tube,
    bounds: Bounds,
}

impl Entry {
    fn new(side: Side, id: NodeId, tube: Tube) -> Self {
        Self {
            side,
            id,
            stage: 0,
            tube,
            bounds: tube.bounds(),
        }
    }

    fn is_compared_with(&self, other: &Self) -> bool {
        self.id != other.id && (self.side == Side::Both || self.side != other.side)
    }

    fn comes_within(&self, room: f64, other: &Self, separation: Separation) -> bool {
        let (horizontal_m, vertical_m) =
            (room * separation.horizontal_m, room * separation.vertical_m);
        self.bounds
            .is_within(&other.bounds, horizontal_m, vertical_m)
            && self.tube.comes_within(room, other.tube, separation)
    }

    /// The two, the one that something happened to first, if something did.
    fn pair(&self, other: &Self) -> [NodeId; 2] {
        if self.side == Side::Affected || self.side == Side::Both && self.id < other.id {
            [self.id, other.id]
        } else {
            [other.id, self.id]
        }
    }
}

/// Who comes near whom. Looks only at those that overlap along the axis on which they are spread the most, nearer than
/// the nearest so far or too near. Beside that those who would come too near in different stages.
fn search(mut entries: Vec<Entry>, separation: Separation) -> (Nearness, BTreeSet<[NodeId; 2]>) {
    let along = widest_axis(&entries);
    entries.sort_by(|a, b| a.bounds.low[along].total_cmp(&b.bounds.low[along]));
    let (mut found, mut together) = (Nearness::default(), BTreeSet::new());
    let mut best = f64::INFINITY;
    for (position, one) in entries.iter().enumerate() {
        for other in &entries[position + 1..] {
            let reach_m = best.max(1.0) * separation.horizontal_m;
            if other.bounds.low[along] > one.bounds.high[along] + reach_m {
                break;
            }
            if !one.is_compared_with(other) || !one.comes_within(best.max(1.0), other, separation) {
                continue;
            }
            let is_too_near = one.comes_within(1.0, other, separation);
            if is_too_near && one.stage != other.stage {
                together.insert(one.pair(other));
                continue;
            }
            if is_too_near {
                found.too_near.insert(one.pair(other));
            }
            if one.comes_within(best, other, separation) {
                let clearance = one.tube.clearance(other.tube, separation);
                best = clearance.room;
                found.closest = Some(Approach {
                    drones: one.pair(other),
                    clearance,
                });
            }
        }
    }
    (found, together)
}

/// North or east, as the lower ends are spread the farther.
fn widest_axis(entries: &[Entry]) -> usize {
    let spread = |axis: usize| {
        let low = entries.iter().map(|entry| entry.bounds.low[axis]);
        let (low, high) = low.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| {
            (low.min(at), high.max(at))
        });
        high - low
    };
    usize::from(spread(1) > spread(0))
}

#[cfg(test)]
mod tests;
