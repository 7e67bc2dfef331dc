//! One drone's link table, filled by what its neighbours say.

use super::*;

/// What the drone with this id knows of those that are near.
pub(in crate::routing::tree) struct Neighbourhood {
    pub(in crate::routing::tree) links: LinkTable,
    pub(in crate::routing::tree) now: Timestamp,
    own: u32,
    parent: Option<NodeId>,
    numbers: BTreeMap<u32, u32>,
}

impl Neighbourhood {
    pub(in crate::routing::tree) const BEACON: Duration = Duration::from_secs(1);

    pub(in crate::routing::tree) fn of(own: u32) -> Self {
        Self {
            links: LinkTable::new(NodeId(own), 16, Self::BEACON, Self::BEACON),
            now: Timestamp::ZERO,
            own,
            parent: None,
            numbers: BTreeMap::new(),
        }
    }

    /// What is said from now on by this neighbour is said by the parent.
    pub(in crate::routing::tree) fn follow(&mut self, parent: u32) {
        self.parent = Some(NodeId(parent));
    }

    /// A frame of this neighbour's is not heard.
    pub(in crate::routing::tree) fn miss(&mut self, from: u32) {
        *self.numbers.entry(from).or_default() += 1;
    }

    /// A neighbour says this to all; it hears the drone.
    pub(in crate::routing::tree) fn hear(&mut self, from: u32, said: Tree) {
        let hears = said.hears.clone().unwrap_or_else(|| ids([self.own]));
        let hears = Some(hears);
        self.hear_as_it_is(from, Tree { hears, ..said });
    }

    /// A neighbour says this to all, and perhaps not which drones it hears.
    pub(in crate::routing::tree) fn hear_as_it_is(&mut self, from: u32, said: Tree) {
        self.miss(from);
        let said = Tree {
            number: self.numbers[&from],
            ..said
        };
        let said = wire::encode_packet(&Packet::Tree(said));
        let said = wire::decode_tree(&said).unwrap();
        let speaker = Speaker {
            id: NodeId(from),
            is_parent: self.parent == Some(NodeId(from)),
            master: Some(NodeId(0)),
        };
        self.links.hear(speaker, &said, Bytes::new(), self.now);
    }

    /// Says the same so often, a beacon apart, that its link counts as known.
    pub(in crate::routing::tree) fn hear_well(&mut self, from: u32, said: &Tree) {
        for _ in 0..60 {
            self.hear(from, said.clone());
        }
    }
}

/// What a neighbour says with a route of that cost, which rests on that heartbeat sequence.
pub(in crate::routing::tree) fn with_route(hops: u16, cost: u16, heartbeat: u32) -> Tree {
    Tree {
        hops: Some(hops),
        cost,
        heartbeat,
        parent: (hops > 0).then_some(NodeId(15)),
        ..Tree::default()
    }
}

/// A drone of the sixteen that obeys drone 0.
pub(in crate::routing::tree) fn member(id: u32) -> Core {
    let mut core = Core::new(NodeId(id), 16, 1);
    assert_eq!(
        core.hear_ballot(MASTER, LinkSymmetry::Mutual),
        BallotDecision::Turned
    );
    core
}

/// The drone is ordered something.
pub(in crate::routing::tree) fn order_of(core: &mut Core, sequence: u32) {
    assert!(core.take_order(sequence, Some(b"go")));
}

/// It carries that out.
pub(in crate::routing::tree) fn carry_out(core: &mut Core, sequence: u32) {
    assert!(core.durable.epoch.acknowledge(MASTER, sequence));
}
