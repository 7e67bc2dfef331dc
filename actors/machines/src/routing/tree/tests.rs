mod liveness;
mod loops;
pub(super) mod neighbourhood;

use std::collections::BTreeMap;

use bytes::Bytes;
use proptest::prelude::*;

use self::liveness::beacon_of_the_master;
use super::*;
use crate::machine::{Emitted, Stimulus, step};
use crate::routing::{Dissemination, ETX_UNIT, Input, Packet, Transmit, Tree};

const MASTER: Ballot = Ballot {
    term: 1,
    rank: 0,
    master: NodeId(0),
};

/// Four drones, 0 the master, and a pure relay, 4.
fn config(id: u32) -> Config {
    Config {
        id: NodeId(id),
        drones: 4,
        relays: 1,
        beacon: Duration::from_secs(1),
        repair: Duration::from_millis(8),
        repair_max: Duration::from_millis(200),
        link_time_to_live: Duration::from_secs(5),
        time_to_live: Duration::from_secs(10),
        patience: Duration::from_secs(10),
    }
}

fn ids<const N: usize>(ids: [u32; N]) -> NodeSet {
    ids.into_iter().map(NodeId).collect()
}

fn routing(config: Config) -> Dissemination<TreePolicy> {
    let core = Core::new(config.id, config.drones, 1);
    Dissemination::new(core, |core| {
        TreePolicy::new(config, core, Timestamp::ZERO, None)
    })
}

/// A routing whose clock the test turns.
struct Node {
    routing: Dissemination<TreePolicy>,
    now: Timestamp,
    deadline: Option<Timestamp>,
    numbers: BTreeMap<u32, u32>,
    sent: Vec<Tree>,
    notices: Vec<Notice>,
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
        }
    }

    /// What it says at once to `stimulus`.
    fn stimulate(&mut self, stimulus: Stimulus<Input>) -> Vec<Tree> {
        let (sent, notices) = (&mut self.sent, &mut self.notices);
        let Ok(deadline) = step(&mut self.routing, self.now, stimulus, |said| match said {
            Emitted::Transmit(Transmit::Send { to, payload, .. }) => {
                let Ok(Packet::Tree(said)) = wire::decode_packet(&payload) else {
                    panic!("policy `tree` says nothing else");
                };
                assert_eq!(said.to, to, "a frame tells for whom it is");
                sent.push(said);
            }
            Emitted::Transmit(Transmit::Inform(notice)) => notices.push(notice),
            Emitted::Event(_) => {}
        });
        self.deadline = deadline;
        std::mem::take(&mut self.sent)
    }

    fn parent(&self) -> Option<NodeId> {
        self.routing.policy.route.parent()
    }

    fn tell(&mut self, input: Input) -> Vec<Tree> {
        self.stimulate(Stimulus::Input(input))
    }

    fn hear(&mut self, from: u32, said: Tree) -> Vec<Tree> {
        let number = self.numbers.entry(from).or_default();
        *number += 1;
        let said = Tree {
            number: *number,
            ..said
        };
        self.tell(Input::Heard {
            sender: NodeId(from),
            ballot: MASTER,
            payload: wire::encode_packet(&Packet::Tree(said)).into(),
        })
    }

    /// What became of a frame of its own.
    fn outcome(&mut self, frame: &Tree, delivered: bool) -> Vec<Tree> {
        self.tell(Input::Outcome {
            to: frame.to.expect("it was for one drone"),
            payload: wire::encode_packet(&Packet::Tree(frame.clone())).into(),
            delivered,
        })
    }

    /// What it says within so many milliseconds by itself, beacons left out.
    fn wait(&mut self, millis: u64) -> Vec<Tree> {
        let until = self.now + Duration::from_millis(millis);
        let mut said = Vec::new();
        while let Some(deadline) = self.deadline.filter(|deadline| *deadline <= until) {
            self.now = deadline;
            said.extend(self.stimulate(Stimulus::Timeout));
        }
        self.now = until;
        said.retain(|it| it.hears.is_none());
        said
    }

    /// A drone whose parent is `parent`, that many hops from the master, with these children.
    fn placed(id: u32, parent: u32, hops: u16, children: &[u32]) -> Self {
        let mut node = Self::new(id);
        node.hear(
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
            node.hear(*child, beacon_of_child(*child, id, hops + 1));
        }
        assert_eq!(node.parent(), Some(NodeId(parent)));
        node.wait(20);
        node
    }
}

fn beacon_of_child(child: u32, parent: u32, hops: u16) -> Tree {
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

/// What a parent that many hops from the master says of order 1.
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

/// What a child says that has carried order 1 out with all of `acknowledged`, which are all below it.
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
fn acknowledgements_come_from_the_farthest_inwards_merged_on_the_way() {
    let mut node = Node::placed(1, 0, 1, &[]);
    node.hear(
        2,
        Tree {
            alive: ids([2, 3]),
            ..beacon_of_child(2, 1, 2)
        },
    );
    let relayed = node.hear(0, order(0, ids([1, 2, 3])));
    assert_eq!(relayed.len(), 1);
    assert_eq!(relayed[0].to, Some(NodeId(2)), "nobody else needs it");
    assert_eq!(relayed[0].pending, ids([1, 2, 3]), "the master's words");
    node.outcome(&relayed[0], true);
    assert_eq!(
        node.tell(ACKNOWLEDGE),
        [],
        "drones 2 and 3 are still on the way"
    );
    let half = Tree {
        alive: ids([2, 3]),
        ..done(1, 2, ids([2]))
    };
    assert_eq!(node.hear(2, half), []);
    let merged = node.hear(2, done(1, 2, ids([2, 3])));
    assert_eq!(merged.len(), 1);
    assert_eq!(merged[0].to, Some(NodeId(0)));
    assert_eq!(merged[0].acknowledged, ids([1, 2, 3]));
    assert!(merged[0].order.is_none() || node.routing.policy.route.routes().relay);
}

#[test]
fn who_is_missing_below_is_not_waited_for_for_ever() {
    let mut node = Node::placed(1, 0, 1, &[2]);
    let relayed = node.hear(0, order(0, ids([1, 2, 3])));
    node.outcome(&relayed[0], true);
    assert_eq!(node.tell(ACKNOWLEDGE), []);
    let alone = node.wait(200);
    assert_eq!(alone[0].acknowledged, ids([1]));
    assert_eq!(alone[0].to, Some(NodeId(0)));
}

#[test]
fn hearing_the_parent_pass_it_on_acknowledges_an_acknowledgement() {
    for overheard in [true, false] {
        let mut node = Node::placed(2, 1, 2, &[]);
        node.hear(1, order(1, ids([1, 2])));
        let said = node.tell(ACKNOWLEDGE);
        assert_eq!(said.len(), 1);
        if overheard {
            let merged = done(0, 1, ids([1, 2]));
            assert_eq!(node.hear(1, merged), []);
        }
        assert_eq!(node.wait(100).is_empty(), overheard);
    }
}

#[test]
fn what_the_medium_says_has_arrived_is_not_said_again() {
    let mut node = Node::placed(2, 1, 2, &[]);
    node.hear(1, order(1, ids([1, 2])));
    let said = node.tell(ACKNOWLEDGE);
    node.outcome(&said[0], true);
    assert_eq!(node.wait(500), []);
    // A parent that shows that it does not know restarted.
    let said = node.hear(
        1,
        Tree {
            order: None,
            ..order(1, ids([1, 2]))
        },
    );
    assert_eq!(said[0].acknowledged, ids([2]));
}

#[test]
fn only_whoever_the_master_names_as_pending_answers() {
    for (pending, answers) in [(ids([2, 3]), true), (ids([1, 3]), false)] {
        let mut node = Node::placed(2, 1, 2, &[]);
        node.hear(1, order(1, pending));
        assert_eq!(!node.tell(ACKNOWLEDGE).is_empty(), answers);
        assert_eq!(!node.wait(100).is_empty(), answers);
    }
}

#[test]
fn a_master_names_all_from_the_first_order_on_and_only_those_that_are_missing_after() {
    let mut node = Node::new(0);
    node.tell(Input::Lead(MASTER));
    let first = node.tell(Input::Publish {
        ballot: MASTER,
        sequence: 1,
        order: Bytes::from_static(b"go"),
    });
    assert_eq!(first[0].to, None, "whoever there is hears it");
    assert!(first[0].pending.is_superset(&ids([1, 2, 3])));
    assert!(
        !first[0].pending.contains(NodeId(4)),
        "a relay is not awaited"
    );
    node.tell(ACKNOWLEDGE);
    node.hear(1, beacon_of_child(1, 0, 1));
    node.hear(1, done(0, 1, ids([1, 2])));
    assert!(node.notices.contains(&Notice::Progress {
        sequence: 1,
        acknowledged: ids([1, 2]),
        landing: NodeSet::default()
    }));
    let beacon = node.stimulate_next_beacon();
    assert_eq!(beacon.pending, ids([3]));
}

#[test]
fn only_those_with_drones_below_them_pass_orders_on() {
    let mut leaf = Node::placed(2, 1, 2, &[]);
    assert_eq!(leaf.hear(1, order(1, ids([2]))), []);
    assert_eq!(leaf.wait(200), []);
    let mut relay = Node::placed(1, 0, 1, &[2, 3]);
    let passed_on = relay.hear(0, order(0, ids([1, 2, 3])));
    assert_eq!(passed_on[0].order, Some(Bytes::from_static(b"go")));
    assert_eq!(passed_on[0].to, None, "two are to hear it");
}

#[test]
fn what_was_not_seen_to_arrive_is_said_again_ever_more_rarely_by_that_drone_only() {
    let mut node = Node::placed(1, 0, 1, &[2]);
    // A leaf whose frames are missed is not trusted to have heard.
    node.numbers.insert(2, 40);
    node.hear(2, beacon_of_child(2, 1, 2));
    node.hear(0, order(0, ids([1, 2])));
    let (early, late) = (node.wait(100).len(), node.wait(100).len());
    assert!(early > late && late > 0, "{early}, then {late}");
    node.hear(
        2,
        Tree {
            sequence: 1,
            ..beacon_of_child(2, 1, 2)
        },
    );
    assert_eq!(node.wait(500), [], "the child knows");
}

#[test]
fn a_repair_goes_to_the_one_that_needs_it() {
    let mut node = Node::placed(1, 0, 1, &[2, 3]);
    node.numbers.extend([(2, 40), (3, 40)]);
    for child in [2, 3] {
        node.hear(child, beacon_of_child(child, 1, 2));
    }
    node.hear(0, order(0, ids([1, 2, 3])));
    node.hear(
        2,
        Tree {
            sequence: 1,
            ..beacon_of_child(2, 1, 2)
        },
    );
    let repair = node.wait(20);
    assert_eq!(repair[0].to, Some(NodeId(3)));
    assert!(repair[0].order.is_some());
}

#[test]
fn what_was_not_delivered_is_repaired_sooner() {
    let said_again_within = |delivered: Option<bool>, millis: u64| {
        let mut node = Node::placed(2, 1, 2, &[]);
        node.hear(1, order(1, ids([1, 2])));
        let said = node.tell(ACKNOWLEDGE);
        if let Some(delivered) = delivered {
            node.outcome(&said[0], delivered);
        }
        !node.wait(millis).is_empty()
    };
    assert!(!said_again_within(None, 3) && said_again_within(None, 12));
    assert!(said_again_within(Some(false), 3));
    assert!(!said_again_within(Some(true), 500));
}

#[test]
fn a_parent_that_the_medium_gave_up_twice_is_left_for_one_that_has_heard_more() {
    let mut node = Node::placed(3, 1, 2, &[]);
    let sibling = |heartbeat| Tree {
        parent: Some(NodeId(1)),
        hears: Some(ids([3])),
        heartbeat,
        ..order(2, ids([1, 2, 3]))
    };
    node.hear(2, sibling(1));
    node.hear(1, order(1, ids([1, 2, 3])));
    let said = node.tell(ACKNOWLEDGE);
    node.outcome(&said[0], false);
    assert_eq!(node.parent(), Some(NodeId(1)), "once is no proof");
    node.outcome(&said[0], false);
    assert_eq!(
        node.parent(),
        Some(NodeId(1)),
        "the other may think of going this way itself"
    );
    let mut said = node.hear(2, sibling(9));
    assert_eq!(node.parent(), Some(NodeId(2)));
    said.extend(node.wait(200));
    assert!(said.iter().any(|it| it.to == Some(NodeId(2))), "{said:?}");
}

#[test]
fn a_child_that_the_medium_gave_up_holds_nothing_up() {
    let mut node = Node::placed(1, 0, 1, &[2]);
    let relayed = node.hear(0, order(0, ids([1, 2])));
    node.tell(ACKNOWLEDGE);
    node.outcome(&relayed[0], false);
    let alone = node.outcome(&relayed[0], false);
    assert_eq!(alone[0].acknowledged, ids([1]));
    assert_eq!(alone[0].to, Some(NodeId(0)));
}

#[test]
fn only_those_that_a_child_asks_answer_it() {
    for (asked, is_answered) in [(3, false), (1, true)] {
        let mut node = Node::placed(1, 0, 1, &[2]);
        node.hear(0, order(0, ids([1, 2, 3])));
        let repeated = Tree {
            alive: ids([2, 3]),
            ..done(1, 2, ids([2]))
        };
        node.hear(2, repeated.clone());
        assert_eq!(node.wait(20), []);
        node.hear(
            2,
            Tree {
                asks: ids([asked]),
                to: None,
                ..repeated
            },
        );
        let answers = node.wait(20);
        assert_eq!(!answers.is_empty(), is_answered);
        assert!(answers.iter().all(|answer| answer.to == Some(NodeId(2))));
    }
}

#[test]
fn two_without_a_route_ask_each_other_in_vain_unless_one_has_missed_an_order() {
    for (hops, sequence, is_answered) in [(None, 0, false), (Some(1), 0, true), (None, 1, true)] {
        let mut node = Node::new(1);
        node.hear(2, Tree::default());
        node.wait(2_000);
        assert_eq!(node.parent(), None);
        let asks = Tree {
            hops,
            sequence,
            asks: ids([1]),
            ..Tree::default()
        };
        node.hear(2, asks);
        let answers = node.wait(20).iter().any(|said| said.asks.is_empty());
        assert_eq!(answers, is_answered, "{hops:?}, {sequence}");
    }
}

#[test]
fn a_pure_relay_passes_on_what_others_say_and_is_awaited_by_nobody() {
    let mut relay = Node::placed(4, 0, 1, &[2]);
    let passed_on = relay.hear(0, order(0, ids([2])));
    assert_eq!(passed_on[0].to, Some(NodeId(2)));
    assert!(passed_on[0].order.is_some());
    relay.outcome(&passed_on[0], true);
    let merged = relay.hear(2, done(4, 2, ids([2])));
    assert_eq!(merged[0].to, Some(NodeId(0)));
    assert_eq!(merged[0].acknowledged, ids([2]));
    assert_eq!(merged[0].alive, ids([2]), "it does not count itself");
    relay.wait(60_000);
    assert_eq!(
        relay.notices,
        [],
        "it flies no mission, whoever falls silent"
    );
}

#[test]
fn who_is_neither_drone_nor_relay_is_not_heard() {
    let mut node = Node::new(1);
    node.hear(5, beacon_of_child(5, 1, 1));
    assert_eq!(node.routing.policy.occupancy(), (0, 5));
    node.hear(4, beacon_of_child(4, 1, 1));
    assert_eq!(node.routing.policy.occupancy(), (1, 5));
}

impl Node {
    fn stimulate_next_beacon(&mut self) -> Tree {
        loop {
            self.now = self.deadline.expect("a master always has a next beacon");
            let said = self.stimulate(Stimulus::Timeout).pop();
            if let Some(beacon) = said.filter(|said| said.hears.is_some()) {
                return beacon;
            }
        }
    }
}

/// Every other drone of ten thousand.
fn every_other() -> NodeSet {
    (0..10_000).step_by(2).map(NodeId).collect()
}

#[test]
fn what_does_not_fit_a_datagram_is_said_in_several() {
    let drones = 10_000;
    let config = |id| Config {
        drones,
        relays: 0,
        ..config(id)
    };
    let mut child = Node::new(1);
    child.routing = routing(config(1));
    child.hear(0, beacon_of_the_master(1));
    child.hear(0, order(0, every_other()));
    let mut below = done(1, 2, every_other());
    below.hops = Some(2);
    // What is said of it would outgrow a datagram, so it comes in two.
    for span in [0..5_000, 5_000..drones] {
        child.hear(2, below.cut_to(span));
    }
    let mut parent = Node::new(0);
    parent.routing = routing(config(0));
    parent.tell(Input::Lead(MASTER));
    parent.tell(Input::Publish {
        ballot: MASTER,
        sequence: 1,
        order: Bytes::from_static(b"go"),
    });
    parent.stimulate(Stimulus::Timeout);
    let acknowledged = |parent: &Node| parent.routing.policy.links.below(1).acknowledged.clone();
    for frames in 1.. {
        assert!(frames < 20, "they get through");
        let Dissemination { core, policy, .. } = &mut child.routing;
        policy.say(core, child.now, Reason::News);
        for said in child.stimulate(Stimulus::Timeout) {
            assert!(wire::encode_packet(&Packet::Tree(said.clone())).len() <= wire::PAYLOAD_MAX);
            assert!(said.span.is_some());
            parent.hear(1, said);
        }
        if acknowledged(&parent) == every_other() {
            break;
        }
    }
    // In the next order's first frame nothing of this one is taken for it.
    let next = Tree {
        sequence: 2,
        ..done(0, 1, ids([7]))
    };
    parent.hear(1, next.cut_to(0..100));
    assert_eq!(acknowledged(&parent), NodeSet::default());
}

#[test]
fn who_is_not_told_of_in_a_datagram_is_neither_heard_nor_left_out() {
    let mut node = Node::placed(1, 0, 1, &[]);
    for _ in 0..5 {
        node.hear(
            0,
            Tree {
                span: Some(2..4),
                hears: Some(ids([2])),
                ..beacon_of_the_master(1)
            },
        );
        node.now += Duration::from_secs(1);
    }
    assert!(
        node.routing
            .policy
            .links
            .get(NodeId(0))
            .is_some_and(|link| link.symmetric)
    );
}

/// Something that may happen to drone 2 of the four.
#[derive(Debug, Clone)]
enum Step {
    Hear {
        from: u32,
        /// Which of the packets that it may say.
        packet: usize,
        /// How many of its frames are missed before; none is an old one that comes again.
        numbers: u32,
        heartbeat: u32,
        term: u32,
    },
    Wait(u64),
    Acknowledge(u32),
    GivenUp(u32),
}

fn step_of_drone_2() -> impl Strategy<Value = Step> {
    let hear = (
        prop_oneof![Just(0_u32), Just(1), Just(3), Just(4)],
        0..9_usize,
        0..3_u32,
        0..30_u32,
        prop_oneof![9 => Just(1_u32), 1 => Just(2)],
    );
    let hear = hear.prop_map(|(from, packet, numbers, heartbeat, term)| Step::Hear {
        from,
        packet,
        numbers,
        heartbeat,
        term,
    });
    prop_oneof![
        8 => hear,
        2 => (1..2_000_u64).prop_map(Step::Wait),
        1 => (1..3_u32).prop_map(Step::Acknowledge),
        1 => (0..4_u32).prop_map(Step::GivenUp),
    ]
}

fn packet(from: u32, which: usize) -> Tree {
    let beacon = beacon_of_child(from, 2, 3);
    let of_neighbour = Tree {
        parent: Some(NodeId(0)),
        hops: Some(1),
        hears: Some(ids([2])),
        ..Tree::default()
    };
    match which {
        0 => beacon,
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
    /// Takes a step, and all that came of it: what was said, what the protocol was told, when it wants to act next.
    fn take(&mut self, step: &Step) -> (Vec<Tree>, Vec<Notice>, Option<Timestamp>) {
        let said = match *step {
            Step::Hear {
                from,
                packet: which,
                numbers,
                heartbeat,
                term,
            } => {
                let number = self.numbers.entry(from).or_insert(1);
                *number += numbers;
                let said = Tree {
                    number: *number,
                    heartbeat,
                    ..packet(from, which)
                };
                self.tell(Input::Heard {
                    sender: NodeId(from),
                    ballot: Ballot { term, ..MASTER },
                    payload: wire::encode_packet(&Packet::Tree(said)).into(),
                })
            }
            Step::Wait(millis) => self.wait(millis),
            Step::Acknowledge(sequence) => self.tell(Input::Acknowledge {
                ballot: MASTER,
                sequence,
            }),
            Step::GivenUp(to) => self.outcome(
                &Tree {
                    to: Some(NodeId(to)),
                    ..Tree::default()
                },
                false,
            ),
        };
        (said, std::mem::take(&mut self.notices), self.deadline)
    }
}

proptest! {
    #[test]
    fn words_that_are_known_do_what_they_would_do_if_they_were_read_again(
        steps in prop::collection::vec(step_of_drone_2(), 1..120),
    ) {
        let (mut node, mut forgetful) = (Node::new(2), Node::new(2));
        for step in &steps {
            forgetful.routing.policy.links.forget_words();
            prop_assert_eq!(node.take(step), forgetful.take(step), "{:?}", step);
        }
    }
}
