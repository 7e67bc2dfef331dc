use std::collections::BTreeMap;

use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;

/// What spoils links besides distance and chance.
#[derive(Debug, Default)]
pub(super) struct Disturbance {
    /// The share of frames lost from one radio to another, where it is not as configured.
    links: BTreeMap<(NodeId, NodeId), f64>,
    jammers: BTreeMap<u32, Disc>,
}

/// Whatever is within a distance of a place over ground, however high.
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

    /// The share of frames lost on the way from one radio to another; 0 where nothing spoils the link.
    pub(super) fn loss(&self, from: NodeId, to: NodeId) -> f64 {
        self.links.get(&(from, to)).copied().unwrap_or(0.0)
    }

    /// Whether nothing can be made out at a place.
    pub(super) fn is_jammed(&self, place: Ned) -> bool {
        self.jammers
            .values()
            .any(|disc| disc.centre.horizontal_distance_m(place) <= disc.radius_m)
    }

    /// Whether there is nothing of the kind, as is the rule.
    pub(super) fn is_none(&self) -> bool {
        self.links.is_empty() && self.jammers.is_empty()
    }
}
