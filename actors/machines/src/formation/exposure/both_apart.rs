//! Two drones that are both out of lockstep, in whichever phases.

use std::collections::BTreeMap;

use super::{ClosestApproach, Entry, Proximity, Side, sort_along_widest_axis};
use crate::formation::phases::{Phase, PhaseKind};
use crate::formation::{FlightPlan, Tube};
use crate::geometry::Ned;
use crate::identity::NodeId;

/// Tubes of all phases. A tube that a drone flies in several phases is there once.
#[derive(Default)]
struct Flown {
    tubes: Vec<(NodeId, Tube)>,
    /// Phases in which each tube is flown, by number.
    phases: Vec<Vec<usize>>,
    /// Places of each drone's tubes.
    places: BTreeMap<NodeId, Vec<usize>>,
}

impl Flown {
    fn add(&mut self, phase: usize, (id, tube): (NodeId, Tube)) {
        let places = self.places.entry(id).or_default();
        let known = places.iter().find(|place| self.tubes[**place].1 == tube);
        let place = known.copied().unwrap_or(self.tubes.len());
        if place == self.tubes.len() {
            places.push(place);
            self.tubes.push((id, tube));
            self.phases.push(Vec::new());
        }
        if self.phases[place].last() != Some(&phase) {
            self.phases[place].push(phase);
        }
    }

    /// The phases in which one of two tubes is flown, and the other then or before.
    fn phases_of(&self, one: usize, other: usize) -> impl Iterator<Item = usize> + '_ {
        let [one, other] = [one, other].map(|place| &self.phases[place]);
        let (first, other_first) = (one[0], other[0]);
        let of_one = one.iter().filter(move |at| **at >= other_first);
        // A phase of both counts once.
        let of_other = other
            .iter()
            .filter(move |at| **at >= first && one.binary_search(at).is_err());
        of_one.chain(of_other).copied()
    }
}

impl FlightPlan<'_> {
    /// Pairs of drones out of lockstep that may violate the separation, for each phase: one is in that phase and the other then or
    /// before. Both are affected. The closest approach is one of these pairs; `None` without any.
    pub(super) fn both_apart(self, landing_places: &[Ned]) -> Vec<Proximity> {
        let mut flown = Flown::default();
        let mut found = Vec::new();
        for (index, phase) in self.phases().enumerate() {
            let alone = self.tubes_alone(&phase, landing_places);
            for tube in alone.into_iter().chain(self.landings_on_the_way(&phase)) {
                flown.add(index, tube);
            }
            found.push(Proximity::default());
        }
        let separation = self.layout.separation();
        let entries = flown.tubes.iter().zip(0..);
        let mut entries: Vec<(Entry, usize)> = entries
            .map(|((id, tube), place)| (Entry::new(Side::Both, *id, *tube), place))
            .collect();
        let along = sort_along_widest_axis(&mut entries, |(entry, _)| &entry.bounds);
        for (position, (one, place)) in entries.iter().enumerate() {
            let reach_m = one.bounds.high[along] + separation.horizontal_m;
            let near = entries[position + 1..].iter();
            for (other, other_place) in
                near.take_while(|(other, _)| other.bounds.low[along] <= reach_m)
            {
                if !one.is_compared_with(other) || !one.comes_within(1.0, other, separation) {
                    continue;
                }
                for phase in flown.phases_of(*place, *other_place) {
                    let Proximity { closest, conflicts } = &mut found[phase];
                    let drones = one.pair(other);
                    conflicts.extend([drones, [drones[1], drones[0]]]);
                    let best = closest.map_or(1.0, |it| it.clearance.ratio);
                    if best > 0.0 && one.comes_within(best, other, separation) {
                        let clearance = one.tube.clearance(other.tube, separation);
                        *closest = Some(ClosestApproach { drones, clearance });
                    }
                }
            }
        }
        found
    }

    /// The level path and the descent of drones that land out of lockstep around the waypoint of a phase, with a part of the
    /// swarm. Where drones out of lockstep land below their slots, those are kept clear.
    fn landings_on_the_way(self, phase: &Phase) -> Vec<(NodeId, Tube)> {
        let layout = self.layout_after(phase.changes);
        if layout.lands_below_slot() || matches!(phase.kind, PhaseKind::Land { .. }) {
            return Vec::new();
        }
        let centre = self.waypoints[phase.waypoint];
        let drones = (0..layout.formation().drones()).map(NodeId);
        let land = |id: NodeId| {
            let altitude_m = self.altitude_alone_m(id, phase.changes, centre);
            let place = layout.landing_place(id, centre);
            Tube::level_then_down(phase.end(id), place, altitude_m).map(|tube| (id, tube))
        };
        drones.flat_map(land).collect()
    }
}
