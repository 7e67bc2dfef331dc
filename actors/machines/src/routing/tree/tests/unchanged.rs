//! Reports that are equal to the last one are not decoded.

use super::*;

/// A step of drone 2.
#[derive(Debug, Clone)]
enum Step {
    Receive {
        from: u32,
        /// Index of the packet.
        packet: usize,
        /// Number of frames lost before; no frame is repeated.
        numbers: u32,
        heartbeat: u32,
        term: u32,
    },
    Wait(u64),
    Acknowledge(u32),
    Undelivered(u32),
}

fn step_of_drone_2() -> impl Strategy<Value = Step> {
    let receive = (
        prop_oneof![Just(0_u32), Just(1), Just(3), Just(4)],
        0..9_usize,
        0..3_u32,
        0..30_u32,
        prop_oneof![9 => Just(1_u32), 1 => Just(2)],
    );
    let receive = receive.prop_map(|(from, packet, numbers, heartbeat, term)| Step::Receive {
        from,
        packet,
        numbers,
        heartbeat,
        term,
    });
    prop_oneof![
        8 => receive,
        2 => (1..2_000_u64).prop_map(Step::Wait),
        1 => (1..3_u32).prop_map(Step::Acknowledge),
        1 => (0..4_u32).prop_map(Step::Undelivered),
    ]
}

fn packet(from: u32, which: usize) -> Tree {
    let heartbeat = child_heartbeat(from, 2, 3);
    let of_neighbour = Tree {
        parent: Some(NodeId(0)),
        hops: Some(1),
        hears: Some(ids([2])),
        ..Tree::default()
    };
    match which {
        0 => heartbeat,
        1 => of_neighbour,
        2 => Tree {
            hears: Some(ids([1])),
            ..of_neighbour
        },
        3 => order(1, ids([2, 3])),
        4 => Tree {
            order: None,
            ..order(1, ids([2]))
        },
        5 => Tree {
            landing: ids([0]),
            ..of_neighbour
        },
        6 => done(2, 2, ids([from])),
        7 => Tree {
            hops: None,
            ..Tree::default()
        },
        _ => Tree {
            span: Some(1..3),
            pending: ids([2]),
            ..order(1, ids([2]))
        },
    }
}

impl Node {
    /// Runs a step; returns the sent frames, the notices and the next deadline.
    fn run(&mut self, step: &Step) -> (Vec<Tree>, Vec<Notice>, Option<Timestamp>) {
        let sent = match *step {
            Step::Receive {
                from,
                packet: which,
                numbers,
                heartbeat,
                term,
            } => {
                let number = self.numbers.entry(from).or_insert(1);
                *number += numbers;
                let sent = Tree {
                    number: *number,
                    heartbeat,
                    ..packet(from, which)
                };
                self.input(Input::Received {
                    sender: NodeId(from),
                    ballot: Ballot { term, ..MASTER },
                    payload: wire::encode_packet(&Packet::Tree(sent)).into(),
                })
            }
            Step::Wait(millis) => self.wait(millis),
            Step::Acknowledge(sequence) => self.input(Input::Acknowledge {
                ballot: MASTER,
                sequence,
            }),
            Step::Undelivered(to) => self.report_delivery(
                &Tree {
                    to: Some(NodeId(to)),
                    ..Tree::default()
                },
                false,
            ),
        };
        (sent, std::mem::take(&mut self.notices), self.deadline)
    }
}

proptest! {
    #[test]
    fn unchanged_report_has_the_effect_of_a_decoded_one(
        steps in prop::collection::vec(step_of_drone_2(), 1..120),
    ) {
        let (mut node, mut forgetful) = (Node::new(2), Node::new(2));
        for step in &steps {
            forgetful.routing.policy.topology.links.forget_bodies();
            prop_assert_eq!(node.run(step), forgetful.run(step), "{:?}", step);
        }
    }
}
