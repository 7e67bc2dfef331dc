//! Frames that were sent, received and dropped.

use std::collections::BTreeMap;
use std::hint::black_box;

use muster_machines::radio::DropReason;

/// Frames sent by all nodes of a swarm.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Frames {
    /// Sent because of a change or a loss.
    pub(crate) news: u64,
    /// Sent because a period elapsed.
    pub(crate) keep_alives: u64,
    /// Sent again by the medium without an acknowledgement; of all swarms.
    pub(crate) retries: u64,
}

/// Frames sent and admitted from the start of neighbour discovery to the end of the landing; by a relay, all.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Traffic {
    pub(crate) sent: u64,
    pub(crate) received: u64,
    /// Whether frames of a process that was killed are missing: those since its last report.
    pub(crate) is_cut_off: bool,
    /// Whether frames count at present.
    counts: bool,
}

/// Frames of a swarm: of each node while they count, and of all together. Nodes go by their index in the swarm.
#[derive(Debug)]
pub(super) struct TrafficCounts {
    /// By node.
    nodes: Vec<Traffic>,
    total: Frames,
    dropped: BTreeMap<DropReason, u64>,
    /// Whether the nodes are processes that report their frames from time to time.
    are_reported: bool,
}

impl TrafficCounts {
    /// For this many drones, and this many drones and relays.
    pub(super) fn new(drones: usize, nodes: usize) -> Self {
        let traffic = |node| Traffic {
            // A relay works from the start.
            counts: node >= drones,
            ..Traffic::default()
        };
        Self {
            nodes: (0..nodes).map(traffic).collect(),
            total: Frames::default(),
            dropped: BTreeMap::new(),
            are_reported: false,
        }
    }

    /// The nodes are processes that report their frames from time to time.
    pub(super) const fn are_reported(&mut self) {
        self.are_reported = true;
    }

    /// A node sends a frame.
    pub(super) fn sent(&mut self, node: usize, keep_alive: bool) {
        if keep_alive {
            self.total.keep_alives += 1;
        } else {
            self.total.news += 1;
        }
        let traffic = &mut self.nodes[node];
        traffic.sent += u64::from(traffic.counts);
    }

    /// A node admits a frame.
    pub(super) fn received(&mut self, node: usize) {
        let traffic = &mut self.nodes[node];
        traffic.received += u64::from(traffic.counts);
    }

    /// A radio does not admit a frame.
    pub(super) fn dropped(&mut self, reason: DropReason) {
        *self.dropped.entry(reason).or_default() += 1;
    }

    /// How often the medium has sent a frame again so far.
    pub(super) const fn retried(&mut self, retries: u64) {
        self.total.retries = retries;
    }

    /// Frames of a node count from now on.
    pub(super) fn begin(&mut self, node: usize) {
        self.nodes[node].counts = true;
    }

    /// Frames of a node count no more.
    pub(super) fn end(&mut self, node: usize) {
        self.nodes[node].counts = false;
    }

    /// The process of a node is killed: nobody knows the frames since its last report.
    pub(super) fn cut_off(&mut self, node: usize) {
        let traffic = &mut self.nodes[node];
        traffic.is_cut_off |= self.are_reported && traffic.counts;
    }

    /// Loads what changes with each frame of a node.
    pub(super) fn read_ahead(&self, node: usize) {
        black_box(self.nodes[node].counts);
    }

    /// Frames of a node that count.
    pub(super) fn of(&self, node: usize) -> Traffic {
        self.nodes[node]
    }

    /// Frames sent so far.
    pub(super) const fn total(&self) -> Frames {
        self.total
    }

    /// Frames that radios did not admit, by reason.
    pub(super) const fn drops_by_reason(&self) -> &BTreeMap<DropReason, u64> {
        &self.dropped
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_of_a_drone_count_between_discovery_and_landing_and_of_a_relay_always() {
        let (drone, relay, mut counts) = (0, 1, TrafficCounts::new(1, 2));
        let flown = |counts: &mut TrafficCounts| {
            counts.sent(drone, false);
            counts.sent(relay, true);
            counts.received(drone);
        };
        flown(&mut counts);
        counts.begin(drone);
        (0..2).for_each(|_| flown(&mut counts));
        counts.end(drone);
        flown(&mut counts);
        let of = |node| (counts.of(node).sent, counts.of(node).received);
        assert_eq!((of(drone), of(relay)), ((2, 2), (4, 0)));
        assert_eq!((counts.total().news, counts.total().keep_alives), (4, 4));
    }

    #[test]
    fn frames_of_a_process_that_is_killed_while_they_count_are_cut_off() {
        for are_reported in [false, true] {
            let mut counts = TrafficCounts::new(2, 2);
            if are_reported {
                counts.are_reported();
            }
            counts.begin(1);
            counts.cut_off(0);
            counts.cut_off(1);
            let cut_off = [0, 1].map(|node| counts.of(node).is_cut_off);
            assert_eq!(cut_off, [false, are_reported]);
        }
    }
}
