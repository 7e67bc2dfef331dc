mod acknowledgements;
mod datagrams;
mod liveness;
mod loops;
pub(super) mod neighbourhood;
mod orders;
mod unchanged;

use std::collections::BTreeMap;
use std::time::Duration;

use bytes::Bytes;
use proptest::prelude::*;

use self::liveness::master_heartbeat;
use super::link::Sender;
use super::link_table::LinkTable;
use super::*;
use crate::identity::NodeSet;
use crate::leader::LinkSymmetry;
use crate::machine::{Emitted, Stimulus, step};
use crate::routing::{Dissemination, ETX_UNIT, Input, Packet, Transmit, Tree};

const MASTER: Ballot = Ballot {
    term: 1,
    rank: 0,
    master: NodeId(0),
};

/// Four drones, with master 0, and pure relay 4.
pub(super) fn config(id: u32) -> Config {
    Config {
        id: NodeId(id),
        drones: 4,
        relays: 1,
        heartbeat_period: Duration::from_secs(1),
        landing_period: Duration::from_secs(4),
        repair: Duration::from_millis(8),
        repair_max: Duration::from_millis(200),
        link_time_to_live: Duration::from_secs(5),
        time_to_live: Duration::from_secs(10),
        route_timeout: Duration::from_secs(10),
    }
}

fn ids<const N: usize>(ids: [u32; N]) -> NodeSet {
    ids.into_iter().map(NodeId).collect()
}

fn routing(config: Config) -> Dissemination<TreePolicy> {
    let shared = SharedState::new(config.id, config.drones, 1);
    Dissemination::new(shared, |shared| {
        TreePolicy::new(config, shared, Timestamp::ZERO, None)
    })
}

/// A routing with a simulated clock.
struct Node {
    routing: Dissemination<TreePolicy>,
    now: Timestamp,
    deadline: Option<Timestamp>,
    numbers: BTreeMap<u32, u32>,
    sent: Vec<Tree>,
    notices: Vec<Notice>,
    /// The last report of neighbours that may not hear this drone.
    deaf: Option<NodeSet>,
}

impl Node {
    fn new(id: u32) -> Self {
        Self {
            routing: routing(config(id)),
            now: Timestamp::ZERO,
            deadline: None,
            numbers: BTreeMap::new(),
            sent: Vec::new(),
            notices: Vec::new(),
            deaf: None,
        }
    }

    /// The frames sent in response to `stimulus`.
    fn stimulate(&mut self, stimulus: Stimulus<Input>) -> Vec<Tree> {
        let (sent, notices, deaf) = (&mut self.sent, &mut self.notices, &mut self.deaf);
        self.deadline = step(
            &mut self.routing,
            self.now,
            stimulus,
            |emitted| match emitted {
                Emitted::Transmit(Transmit::Send { to, payload, .. }) => {
                    let Ok(Packet::Tree(packet)) = wire::decode_packet(&payload.into()) else {
                        panic!("policy `tree` sends only its own packets");
                    };
                    assert_eq!(packet.to, to, "the packet names the receiver of the frame");
                    sent.push(packet);
                }
                Emitted::Transmit(Transmit::Inform(notice)) => notices.push(notice),
                Emitted::Transmit(Transmit::Deaf(ids)) => *deaf = Some(ids),
                Emitted::Event(_) => {}
            },
        );
        std::mem::take(&mut self.sent)
    }

    fn next_heartbeat(&mut self) -> Tree {
        loop {
            self.now = self.deadline.expect("a master always has a next heartbeat");
            let sent = self.stimulate(Stimulus::Timeout).pop();
            if let Some(heartbeat) = sent.filter(|sent| sent.hears.is_some()) {
                return heartbeat;
            }
        }
    }

    fn parent(&self) -> Option<NodeId> {
        self.routing.policy.topology.route.parent()
    }

    fn input(&mut self, input: Input) -> Vec<Tree> {
        self.stimulate(Stimulus::Input(input))
    }

    fn receive(&mut self, from: u32, sent: Tree) -> Vec<Tree> {
        let number = self.numbers.entry(from).or_default();
        *number += 1;
        let sent = Tree {
            number: *number,
            ..sent
        };
        self.input(Input::Received {
            sender: NodeId(from),
            ballot: MASTER,
            payload: wire::encode_packet(&Packet::Tree(sent)).into(),
        })
    }

    /// Reports the delivery of a frame that this node sent.
    fn report_delivery(&mut self, frame: &Tree, delivered: bool) -> Vec<Tree> {
        self.input(Input::Delivery {
            to: frame.to.expect("only unicasts have a delivery"),
            payload: wire::encode_packet(&Packet::Tree(frame.clone())).into(),
            delivered,
        })
    }

    /// The frames sent by timers within `millis`, without heartbeats.
    fn wait(&mut self, millis: u64) -> Vec<Tree> {
        let until = self.now + Duration::from_millis(millis);
        let mut sent = Vec::new();
        while let Some(deadline) = self.deadline.filter(|deadline| *deadline <= until) {
            self.now = deadline;
            sent.extend(self.stimulate(Stimulus::Timeout));
        }
        self.now = until;
        sent.retain(|it| it.hears.is_none());
        sent
    }

    /// A drone with a parent, `hops` from the master, and children.
    fn placed(id: u32, parent: u32, hops: u16, children: &[u32]) -> Self {
        let mut node = Self::new(id);
        node.receive(
            parent,
            Tree {
                hops: Some(hops - 1),
                cost: (hops - 1) * ETX_UNIT,
                parent: hops.checked_sub(2).map(|_| NodeId(9)),
                heartbeat: 1,
                hears: Some(ids([id])),
                ..Tree::default()
            },
        );
        for child in children {
            node.receive(*child, child_heartbeat(*child, id, hops + 1));
        }
        assert_eq!(node.parent(), Some(NodeId(parent)));
        node.wait(20);
        node
    }
}

fn child_heartbeat(child: u32, parent: u32, hops: u16) -> Tree {
    Tree {
        hops: Some(hops),
        cost: hops * ETX_UNIT,
        parent: Some(NodeId(parent)),
        heartbeat: 1,
        alive: ids([child]),
        hears: Some(ids([parent])),
        ..Tree::default()
    }
}

/// A report with order 1, of a parent `hops` from the master.
fn order(hops: u16, pending: NodeSet) -> Tree {
    Tree {
        hops: Some(hops),
        cost: hops * ETX_UNIT,
        heartbeat: 1,
        sequence: 1,
        pending,
        order: Some(Bytes::from_static(b"go")),
        ..Tree::default()
    }
}

/// A report of a child that has carried out order 1 with its subtree `acknowledged`.
fn done(parent: u32, hops: u16, acknowledged: NodeSet) -> Tree {
    Tree {
        hops: Some(hops),
        cost: hops * ETX_UNIT,
        parent: Some(NodeId(parent)),
        heartbeat: 1,
        sequence: 1,
        alive: acknowledged.clone(),
        acknowledged,
        to: Some(NodeId(parent)),
        ..Tree::default()
    }
}

const ACKNOWLEDGE: Input = Input::Acknowledge {
    ballot: MASTER,
    sequence: 1,
};

#[test]
fn frames_of_unknown_nodes_are_ignored() {
    let mut node = Node::new(1);
    node.receive(5, child_heartbeat(5, 1, 1));
    assert_eq!(node.routing.policy.occupancy(), (0, 5));
    node.receive(4, child_heartbeat(4, 1, 1));
    assert_eq!(node.routing.policy.occupancy(), (1, 5));
}

#[test]
fn frame_without_a_body_is_ignored() {
    let mut node = Node::placed(1, 0, 1, &[]);
    let receive = |node: &mut Node, ballot, payload: Bytes| {
        node.input(Input::Received {
            sender: NodeId(2),
            ballot,
            payload,
        });
    };
    // A frame of a worse ballot leaves an entry without a body.
    let worse = Ballot {
        term: 0,
        rank: 9,
        master: NodeId(3),
    };
    let frame = |number, heartbeat| Tree {
        number,
        heartbeat,
        ..Tree::default()
    };
    receive(&mut node, worse, wire::encode_tree(&frame(1, 0)).into());
    let whole = wire::encode_tree(&frame(2, 77));
    let (_, body) = wire::split_tree(&whole).unwrap();
    let header = Bytes::copy_from_slice(&whole[..whole.len() - body.len()]);
    let before = node.routing.shared.durable.heartbeats.master;
    receive(&mut node, MASTER, header);
    assert_eq!(node.routing.shared.durable.heartbeats.master, before);
}

#[test]
fn neighbour_that_does_not_list_this_drone_is_deaf_until_it_does() {
    let mut master = Node::new(0);
    master.input(Input::Lead(MASTER));
    let hears = child_heartbeat(1, 0, 1);
    let omits = Tree {
        parent: None,
        hears: Some(ids([2])),
        ..hears.clone()
    };
    for (report, at_once, repeated) in [
        (&hears, None, None),
        (&omits, Some(ids([1])), Some(ids([1]))),
        (&hears, Some(ids([])), None),
    ] {
        master.receive(1, report.clone());
        assert_eq!(master.deaf.take(), at_once);
        master.next_heartbeat();
        assert_eq!(master.deaf.take(), repeated, "with the heartbeat");
    }
}
