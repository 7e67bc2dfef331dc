use super::{Change, Layout};
use crate::geometry::Ned;
use crate::identity::NodeId;

/// A mission as flown by all drones of a formation; gives the places of drones out of lockstep.
#[derive(Debug, Clone, Copy)]
pub struct FlightPlan<'a> {
    /// Layout at the start.
    pub layout: &'a Layout,
    /// Changes of formation, in order of the flight.
    pub changes: &'a [Change],
    /// Centre of the formation at each waypoint.
    pub waypoints: &'a [Ned],
}

impl<'a> FlightPlan<'a> {
    /// Layout after a number of changes.
    ///
    /// # Panics
    /// If there are fewer changes.
    #[must_use]
    pub fn layout_after(&self, changes: u16) -> &'a Layout {
        match changes.checked_sub(1) {
            Some(last) => self.changes[usize::from(last)].layout(),
            None => self.layout,
        }
    }

    /// Number of changes finished before the swarm starts towards a waypoint.
    #[must_use]
    pub fn changes_before(&self, waypoint: usize) -> u16 {
        let changes = self.changes.iter();
        (0..)
            .zip(changes.take_while(|change| usize::from(change.waypoint()) < waypoint))
            .last()
            .map_or(0, |(last, _)| last + 1)
    }

    /// Altitude of drone `id` out of lockstep around `centre`, after a number of changes, in metres above home: its
    /// layer above the highest waypoint. So it is above all drones in lockstep, wherever on a slope, and each other
    /// drone out of lockstep is in another layer.
    ///
    /// # Panics
    /// If there are fewer changes, or no such drone.
    #[must_use]
    pub fn altitude_alone_m(&self, id: NodeId, changes: u16, centre: Ned) -> f64 {
        let altitudes_m = self.waypoints.iter().map(|it| it.altitude_m());
        altitudes_m.fold(centre.altitude_m(), f64::max)
            + self.layout_after(changes).layer_alone_m(id, self.waypoints)
    }
}
