use std::collections::BTreeMap;

use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;

/// Link faults and jammers.
#[derive(Debug, Default)]
pub(super) struct Disturbance {
    /// Additional loss probabilities of links, by sender and receiver.
    links: BTreeMap<(NodeId, NodeId), f64>,
    jammers: BTreeMap<u32, Disc>,
}

/// An area of all altitudes within a horizontal distance of its centre.
#[derive(Debug, Clone, Copy)]
struct Disc {
    centre: Ned,
    radius_m: f64,
}

impl Disturbance {
    pub(super) fn set_loss(&mut self, from: NodeId, to: NodeId, loss: Option<f64>) {
        match loss {
            Some(loss) => self.links.insert((from, to), loss),
            None => self.links.remove(&(from, to)),
        };
    }

    pub(super) fn jam(&mut self, jammer: u32, centre: Ned, radius_m: f64) {
        self.jammers.insert(jammer, Disc { centre, radius_m });
    }

    pub(super) fn stop_jamming(&mut self, jammer: u32) {
        self.jammers.remove(&jammer);
    }

    /// Additional loss probability from one radio to another; 0 by default.
    pub(super) fn loss(&self, from: NodeId, to: NodeId) -> f64 {
        self.links.get(&(from, to)).copied().unwrap_or(0.0)
    }

    /// Whether a position is within a jammed area.
    pub(super) fn is_jammed(&self, position: Ned) -> bool {
        self.jammers
            .values()
            .any(|disc| disc.centre.horizontal_distance_m(position) <= disc.radius_m)
    }

    /// Whether there are neither link faults nor jammers.
    pub(super) fn is_empty(&self) -> bool {
        self.links.is_empty() && self.jammers.is_empty()
    }
}
