//! A link table that tests fill with reports.

use super::*;

/// The link table of drone `own`.
pub(in crate::routing::tree) struct Neighbourhood {
    pub(in crate::routing::tree) links: LinkTable,
    pub(in crate::routing::tree) now: Timestamp,
    own: u32,
    parent: Option<NodeId>,
    numbers: BTreeMap<u32, u32>,
}

impl Neighbourhood {
    pub(in crate::routing::tree) const HEARTBEAT_PERIOD: Duration = Duration::from_secs(1);

    pub(in crate::routing::tree) fn of(own: u32) -> Self {
        Self {
            links: LinkTable::new(
                NodeId(own),
                16,
                Self::HEARTBEAT_PERIOD,
                Self::HEARTBEAT_PERIOD,
            ),
            now: Timestamp::ZERO,
            own,
            parent: None,
            numbers: BTreeMap::new(),
        }
    }

    /// Makes a neighbour the parent for later reports.
    pub(in crate::routing::tree) fn follow(&mut self, parent: u32) {
        self.parent = Some(NodeId(parent));
    }

    /// Loses a frame of a neighbour.
    pub(in crate::routing::tree) fn miss(&mut self, from: u32) {
        *self.numbers.entry(from).or_default() += 1;
    }

    /// Receives a broadcast of a neighbour that hears the drone, and has it in its subtree.
    pub(in crate::routing::tree) fn receive(&mut self, from: u32, report: Tree) {
        let hears = report.hears.clone().unwrap_or_else(|| ids([self.own]));
        let hears = Some(hears);
        let mut alive = report.alive.clone();
        if report.parent != Some(NodeId(self.own)) {
            alive.insert(NodeId(self.own));
        }
        let report = Tree {
            hears,
            alive,
            ..report
        };
        self.receive_unmodified(from, report);
    }

    /// Receives a broadcast of a neighbour; the report is not modified.
    pub(in crate::routing::tree) fn receive_unmodified(&mut self, from: u32, report: Tree) {
        self.miss(from);
        let report = Tree {
            number: self.numbers[&from],
            ..report
        };
        let report = wire::encode_packet(&Packet::Tree(report));
        let report = wire::decode_tree(&report).unwrap();
        let sender = Sender {
            id: NodeId(from),
            is_parent: self.parent == Some(NodeId(from)),
            master: Some(NodeId(0)),
        };
        self.links.receive(sender, &report, Bytes::new(), self.now);
    }

    /// Receives the same report often enough that the link quality is known.
    pub(in crate::routing::tree) fn receive_well(&mut self, from: u32, report: &Tree) {
        for _ in 0..60 {
            self.receive(from, report.clone());
        }
    }
}

/// A report with a route of this cost and heartbeat sequence.
pub(in crate::routing::tree) fn with_route(hops: u16, cost: u16, heartbeat: u32) -> Tree {
    Tree {
        hops: Some(hops),
        cost,
        heartbeat,
        parent: (hops > 0).then_some(NodeId(15)),
        ..Tree::default()
    }
}

/// The state of one of sixteen drones, with master 0.
pub(in crate::routing::tree) fn member(id: u32) -> SharedState {
    let mut shared = SharedState::new(NodeId(id), 16, 1);
    assert_eq!(
        shared.observe_ballot(MASTER, LinkSymmetry::Symmetric),
        BallotDecision::Adopted
    );
    shared
}

/// The drone receives an order.
pub(in crate::routing::tree) fn order_of(shared: &mut SharedState, sequence: u32) {
    assert!(shared.accept_order(sequence, Some(b"go")));
}

/// The drone carries an order out.
pub(in crate::routing::tree) fn carry_out(shared: &mut SharedState, sequence: u32) {
    assert!(shared.durable.epoch.acknowledge(MASTER, sequence));
}
