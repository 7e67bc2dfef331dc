use std::collections::BTreeSet;

use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;

use crate::vehicle::Vehicle;

/// Whom radios of a range reach from a drone, over others that pass on too; itself among them.
pub(super) fn part_of(
    drone: NodeId,
    range_m: f64,
    now: Timestamp,
    vehicles: &[Vehicle],
    passes_on: impl Fn(NodeId) -> bool,
) -> BTreeSet<NodeId> {
    let places: Vec<_> = vehicles
        .iter()
        .map(|vehicle| vehicle.motion().position(now))
        .collect();
    let mut part = BTreeSet::from([drone]);
    let mut to_look_at = vec![drone];
    while let Some(id) = to_look_at.pop() {
        let here = places[id.0 as usize];
        for (other, place) in (0..).map(NodeId).zip(&places) {
            if place.distance_m(here) <= range_m && passes_on(other) && part.insert(other) {
                to_look_at.push(other);
            }
        }
    }
    part
}
