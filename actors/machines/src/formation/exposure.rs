//! Closest approaches of drones in each phase: all in lockstep, one of two out of it, or both.

mod both_apart;

use std::collections::BTreeSet;

use super::phases::{Phase, PhaseKind};
use super::tube::Bounds;
use super::{Clearance, FlightPlan, Path, Separation, Tube};
use crate::identity::NodeId;

/// How a drone, or two, may be out of lockstep with the others.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Exposure {
    /// It stops anywhere on its paths for a while and then continues: a process that hangs or restarts.
    Late,
    /// It flies to its own altitude layer and continues in it: cut off, or restarted. The other is in lockstep, in the same
    /// phase.
    Apart,
    /// Both fly as [`Self::Apart`], in whichever phases: an election, or a swarm in parts.
    BothApart,
    /// It lands on the spot and announces it: critical battery or lost position. The others continue.
    Descends,
    /// Its process dies: the flight controller hovers, then lands on the spot. The others wait until the link timeout,
    /// then fly to their own altitude layers.
    Killed,
}

impl Exposure {
    /// All exposures, in the order of reports.
    pub const ALL: [Self; 5] = [
        Self::Late,
        Self::Apart,
        Self::BothApart,
        Self::Descends,
        Self::Killed,
    ];

    /// Name in files and reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Late => "late",
            Self::Apart => "apart",
            Self::BothApart => "both-apart",
            Self::Descends => "descends",
            Self::Killed => "killed",
        }
    }

    /// Whether the right of way still separates the affected drone from those near it. A drone that flies apart may be
    /// cut off from those that would give way.
    #[must_use]
    pub const fn is_resolved_by_right_of_way(self) -> bool {
        matches!(self, Self::Late)
    }
}

/// Closest approach of two drones.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClosestApproach {
    /// The two drones; the affected one first, if there is one.
    pub drones: [NodeId; 2],
    /// Smallest distances of the two.
    pub clearance: Clearance,
}

/// Closest approach and conflicts of a set of drones.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Proximity {
    /// Closest approach; `None` for fewer than two drones.
    pub closest: Option<ClosestApproach>,
    /// Pairs that may violate the separation; the affected drone first, if there is one.
    pub conflicts: BTreeSet<[NodeId; 2]>,
}

/// A phase with its closest approaches in lockstep.
#[derive(Debug)]
pub struct PhaseSeparation {
    /// The phase.
    pub phase: Phase,
    /// All drones in lockstep.
    pub lockstep: Proximity,
    /// Pairs that are separated only because they start at the same time: one comes near a path that the other flies
    /// earlier or later. They count as separated in `lockstep`.
    pub time_separated: BTreeSet<[NodeId; 2]>,
}

impl FlightPlan<'_> {
    /// Closest approaches in each phase with all drones in lockstep.
    pub fn in_lockstep(self) -> impl Iterator<Item = PhaseSeparation> {
        let separation = self.layout.separation();
        self.phases().map(move |phase| {
            let is_translation = phase.is_translation();
            let drones = (0..).map(NodeId).zip(&phase.paths);
            let entries = drones.flat_map(|(id, paths)| {
                paths.iter().enumerate().map(move |(stage, path)| {
                    let path = if is_translation {
                        Path::stationary(path.from)
                    } else {
                        *path
                    };
                    let entry = Entry::new(Side::Both, id, path.into());
                    Entry { stage, ..entry }
                })
            });
            let (lockstep, time_separated) = search(entries.collect(), separation);
            PhaseSeparation {
                phase,
                lockstep,
                time_separated,
            }
        })
    }

    /// Closest approaches for each phase and exposure. One affected drone is compared with others in lockstep; its exposure
    /// happens in that phase, or earlier if the drone is still descending. Of two drones apart, both affected, one is in that phase
    /// and the other then or before; the closest approach is known for those that may violate the separation.
    pub fn exposures(self) -> impl Iterator<Item = Vec<(Exposure, Proximity)>> {
        let separation = self.layout.separation();
        let landing_places = self.landing_places_alone();
        let mut still_descending: Vec<(NodeId, Tube)> = Vec::new();
        let mut both_apart = self.both_apart(&landing_places).into_iter();
        self.phases().map(move |phase| {
            let in_lockstep: Vec<(NodeId, Tube)> =
                tubes(&phase).map(|(id, path)| (id, path.into())).collect();
            let alone = self.tubes_alone(&phase, &landing_places);
            let mut apart = alone.clone();
            apart.extend(self.landings_elsewhere(&phase));
            let descending = in_lockstep
                .iter()
                .map(|(id, tube)| (*id, tube.extended_to(0.0)));
            let descending: Vec<(NodeId, Tube)> = descending.collect();
            let between = |affected: &[(NodeId, Tube)], others: &[(NodeId, Tube)]| {
                if affected.is_empty() {
                    return Proximity::default();
                }
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
            // The descent may have begun before this phase: steps of a change take less time than a descent.
            let earlier = std::mem::take(&mut still_descending);
            let all_descending: Vec<_> = earlier.iter().chain(&descending).copied().collect();
            let found = Exposure::ALL.map(|exposure| {
                let nearness = match exposure {
                    Exposure::Late => between(&in_lockstep, &in_lockstep),
                    Exposure::Apart => between(&apart, &in_lockstep),
                    Exposure::BothApart => both_apart.next().expect("one for each phase"),
                    Exposure::Descends => between(&all_descending, &in_lockstep),
                    Exposure::Killed => {
                        between(&descending, &in_lockstep).merge(between(&all_descending, &alone))
                    }
                };
                (exposure, nearness)
            });
            if let PhaseKind::Climb { .. } | PhaseKind::Cross { .. } | PhaseKind::Descend { .. } =
                phase.kind
            {
                still_descending = all_descending;
            } else {
                still_descending = descending;
            }
            found.into()
        })
    }
}

impl Proximity {
    /// Merges two results.
    fn merge(mut self, other: Self) -> Self {
        let ratio =
            |it: &Option<ClosestApproach>| it.map_or(f64::INFINITY, |it| it.clearance.ratio);
        if ratio(&other.closest) < ratio(&self.closest) {
            self.closest = other.closest;
        }
        self.conflicts.extend(other.conflicts);
        self
    }
}

fn tubes(phase: &Phase) -> impl Iterator<Item = (NodeId, Path)> {
    let drones = (0..).map(NodeId).zip(&phase.paths);
    drones.flat_map(|(id, paths)| paths.iter().map(move |path| (id, *path)))
}

/// Which entries an entry is compared with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Side {
    /// Every other entry.
    Both,
    /// Entries of unaffected drones.
    Affected,
    /// Entries of affected drones.
    Other,
}

#[derive(Debug)]
struct Entry {
    side: Side,
    id: NodeId,
    /// Drones in lockstep are in the same stage at the same time.
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

    fn comes_within(&self, ratio: f64, other: &Self, separation: Separation) -> bool {
        let (horizontal_m, vertical_m) = (
            ratio * separation.horizontal_m,
            ratio * separation.vertical_m,
        );
        self.bounds
            .is_within(&other.bounds, horizontal_m, vertical_m)
            && self.tube.comes_within(ratio, other.tube, separation)
    }

    /// The pair, the affected drone first if there is one.
    fn pair(&self, other: &Self) -> [NodeId; 2] {
        if self.side == Side::Affected || self.side == Side::Both && self.id < other.id {
            [self.id, other.id]
        } else {
            [other.id, self.id]
        }
    }
}

/// Finds the closest approach, the conflicts, and the pairs that would conflict in different stages only. Compares only
/// entries that overlap along the axis of the widest spread, closer than the closest approach so far or than the
/// separation.
fn search(mut entries: Vec<Entry>, separation: Separation) -> (Proximity, BTreeSet<[NodeId; 2]>) {
    let along = sort_along_widest_axis(&mut entries, |entry| &entry.bounds);
    let (mut found, mut time_separated) = (Proximity::default(), BTreeSet::new());
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
            let is_conflict = one.comes_within(1.0, other, separation);
            if is_conflict && one.stage != other.stage {
                time_separated.insert(one.pair(other));
                continue;
            }
            if is_conflict {
                found.conflicts.insert(one.pair(other));
            }
            if one.comes_within(best, other, separation) {
                let clearance = one.tube.clearance(other.tube, separation);
                best = clearance.ratio;
                found.closest = Some(ClosestApproach {
                    drones: one.pair(other),
                    clearance,
                });
            }
        }
    }
    (found, time_separated)
}

/// Sorts entries by their lower bounds along the axis, north or east, along which these are spread the most. Returns the axis.
fn sort_along_widest_axis<T>(entries: &mut [T], bounds: impl Fn(&T) -> &Bounds) -> usize {
    let spread = |axis: usize| {
        let low = entries.iter().map(|entry| bounds(entry).low[axis]);
        let (low, high) = low.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| {
            (low.min(at), high.max(at))
        });
        high - low
    };
    let along = usize::from(spread(1) > spread(0));
    entries.sort_by(|a, b| bounds(a).low[along].total_cmp(&bounds(b).low[along]));
    along
}

#[cfg(test)]
mod tests;
