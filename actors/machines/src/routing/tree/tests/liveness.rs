//! Detection of a lost parent and a lost master.

use super::*;
use crate::routing;
use crate::routing::heartbeat::RESTART_GAP;
use crate::routing::tree::quality::{PROBES_MAX, Quality};

/// Drone 1, which has received heartbeats of its parent, the master, once a second for long enough to trust the link.
fn child_with_good_link_to_master() -> Node {
    let mut child = Node::new(1);
    for heartbeat in 1..=50 {
        child.receive(0, master_heartbeat(heartbeat));
        child.wait(1_000);
    }
    child.notices.clear();
    child
}

pub(super) fn master_heartbeat(heartbeat: u32) -> Tree {
    Tree {
        hops: Some(0),
        heartbeat,
        hears: Some(ids([1])),
        alive: ids([0, 1]),
        ..Tree::default()
    }
}

#[test]
fn silent_parent_is_probed_before_the_master_is_silent() {
    let mut child = child_with_good_link_to_master();
    // Two missing heartbeats make this link stale. The drone has no other neighbour, so it sends the most probes.
    let probes = child.wait(3_000);
    let (probes, inquiries) = probes.split_at(PROBES_MAX as usize);
    assert!(probes.iter().all(|it| it.to == Some(NodeId(0))));
    // Then it inquires, and asks the dropped parent, too.
    let asks_dropped_parent = |it: &Tree| it.to.is_none() && it.requests == ids([0]);
    assert!(inquiries.iter().all(asks_dropped_parent), "{inquiries:?}");
    let probes = child.wait(15_000);
    assert!((20..80).contains(&probes.len()), "{}", probes.len());
    assert_eq!(child.notices, []);
    let probes = child.wait(5_000);
    assert_eq!(child.notices, [Notice::MasterSilent]);
    assert!(probes.len() < 10, "{}", probes.len());
    assert_eq!(child.wait(15_000), [], "no inquiries after the notice");
}

impl Node {
    /// Drone 1 with the master as parent and a short heartbeat period; returns the last received heartbeat sequence,
    /// too.
    fn quick() -> (Self, u32) {
        let mut node = Self::new(1);
        let config = Config {
            heartbeat_period: Duration::from_millis(40),
            ..config(1)
        };
        node.routing = routing(config);
        let heard = 60;
        node.heartbeats_forwarded(1..=heard);
        node.notices.clear();
        (node, heard)
    }

    /// Number of heartbeats that it sends while it receives these sequences from the master.
    fn heartbeats_forwarded(&mut self, numbers: impl IntoIterator<Item = u32>) -> usize {
        let mut heartbeats = 0;
        for number in numbers {
            self.receive(0, master_heartbeat(number));
            heartbeats += self.heartbeats_within(40);
        }
        heartbeats
    }

    /// Number of heartbeats that its timers send within `millis`.
    fn heartbeats_within(&mut self, millis: u64) -> usize {
        let until = self.now + Duration::from_millis(millis);
        let mut heartbeats = 0;
        while let Some(deadline) = self.deadline.filter(|deadline| *deadline <= until) {
            self.now = deadline;
            let sent = self.stimulate(Stimulus::Timeout);
            heartbeats += sent.iter().filter(|it| it.hears.is_some()).count();
        }
        self.now = until;
        heartbeats
    }
}

#[test]
fn leaf_forwards_every_third_fast_heartbeat_and_parent_each() {
    let (mut node, heard) = Node::quick();
    assert_eq!(node.heartbeats_forwarded(heard + 1..=heard + 60), 20);
    node.receive(2, child_heartbeat(2, 1, 2));
    assert_eq!(
        node.heartbeats_within(40),
        1,
        "the heartbeat shows the child that it is heard"
    );
    assert_eq!(node.heartbeats_forwarded(heard + 61..=heard + 80), 20);
}

#[test]
fn first_probe_is_accompanied_by_a_heartbeat() {
    let (mut node, _) = Node::quick();
    // Two missing heartbeats make the link stale.
    assert_eq!(node.heartbeats_within(55), 1);
}

#[test]
fn neighbour_two_heartbeats_behind_gets_one() {
    let (mut node, heard) = Node::quick();
    let from_another = |behind: u32| Tree {
        heartbeat: heard - behind,
        ..child_heartbeat(2, 0, 1)
    };
    node.receive(2, from_another(0));
    node.heartbeats_within(5);
    node.receive(2, from_another(1));
    assert_eq!(
        node.heartbeats_within(5),
        0,
        "one heartbeat may be in flight"
    );
    node.receive(2, from_another(2));
    assert_eq!(node.heartbeats_within(5), 1);
}

#[test]
fn throttled_leaf_keeps_its_route_when_omitted_once() {
    let (mut node, heard) = Node::quick();
    let report = |behind: u32, hears: NodeSet| Tree {
        heartbeat: heard + behind,
        hears: Some(hears),
        ..child_heartbeat(2, 0, 1)
    };
    for _ in 0..5 {
        node.receive(2, report(0, ids([1])));
    }
    node.heartbeats_within(45);
    node.receive(2, report(1, ids([])));
    assert_eq!(node.parent(), Some(NodeId(2)));
    // The stale time of a link of which little is known.
    node.heartbeats_within(200);
    node.receive(2, report(2, ids([])));
    assert_eq!(node.parent(), Some(NodeId(2)));
    node.heartbeats_within(200);
    node.receive(2, report(3, ids([])));
    assert_eq!(node.parent(), None);
}

/// Quality of the link from drone 0 to drone 1 after frames with these packet numbers and unicast counts.
fn quality(frames: impl IntoIterator<Item = (u32, u32)>) -> Quality {
    let mut links = LinkTable::new(NodeId(1), 4, Duration::from_secs(1), Duration::from_secs(1));
    let sender = Sender {
        id: NodeId(0),
        is_parent: false,
        master: None,
    };
    for (number, unicasts) in frames {
        let sent = wire::encode_packet(&Packet::Tree(Tree {
            number,
            to: (unicasts > 0).then_some(NodeId(3)),
            unicasts,
            ..Tree::default()
        }));
        let sent = wire::decode_tree(&sent).unwrap();
        links.receive(sender, &sent, Bytes::new(), Timestamp::ZERO);
    }
    links.get(NodeId(0)).unwrap().quality
}

#[test]
fn lossy_link_gets_more_probes() {
    // 20 % loss.
    let probes = quality(
        (1..250)
            .filter(|number| number % 5 != 0)
            .map(|number| (number, 0)),
    )
    .probes();
    assert!((18..25).contains(&probes), "{probes}");
}

#[test]
fn unicasts_and_restarts_are_no_losses() {
    let heard = |numbers: std::ops::Range<u32>| numbers.map(|number| (number, 0));
    let loss = |frames: Vec<(u32, u32)>| quality(frames).loss().to_bits();
    let none = 0.0_f64.to_bits();
    assert_eq!(loss(heard(1..60).collect()), none);
    let with_unicasts = heard(1..60).chain([(59, 3), (59, 7)]).chain(heard(60..70));
    assert_eq!(loss(with_unicasts.collect()), none);
    let restarted = heard(1..60).chain(heard(59 + RESTART_GAP + 1..200));
    assert_eq!(loss(restarted.collect()), none);
    // A missed broadcast is a loss, whichever frame follows.
    let missed = |next| quality(heard(1..60).chain([next])).loss();
    assert!(missed((61, 0)) > 0.01);
    assert!(missed((60, 1)) > 0.01);
}

#[test]
fn probes_do_not_raise_the_packet_number() {
    let mut child = child_with_good_link_to_master();
    let probes = child.wait(1_100);
    let numbers: Vec<_> = probes.iter().map(|it| (it.number, it.unicasts)).collect();
    let first = numbers[0].0;
    let expected: Vec<_> = (1..11).map(|unicasts| (first, unicasts)).collect();
    assert_eq!(numbers, expected);
}

#[test]
fn requesting_leaf_is_answered() {
    let mut parent = Node::placed(1, 0, 1, &[2]);
    for heartbeat in 2..60 {
        parent.receive(0, master_heartbeat(heartbeat));
        for child in [2, 3] {
            parent.receive(
                child,
                child_heartbeat(child, if child == 2 { 1 } else { 0 }, 2),
            );
        }
        parent.wait(1_000);
    }
    let requests = Tree {
        requests: ids([1]),
        hears: None,
        ..child_heartbeat(2, 1, 2)
    };
    parent.receive(2, requests);
    parent.receive(3, child_heartbeat(3, 0, 2));
    let sent = parent.wait(8);
    assert_eq!(sent.len(), 1, "{sent:?}");
    assert_eq!(sent[0].to, Some(NodeId(2)));
}

#[test]
fn answering_parent_is_not_probed_again() {
    let mut child = child_with_good_link_to_master();
    let probes = child.wait(1_020);
    assert!((1..7).contains(&probes.len()), "{probes:?}");
    child.receive(0, master_heartbeat(51));
    assert_eq!(child.wait(900), []);
    assert_eq!(child.notices, []);
}

#[test]
fn better_ballot_needs_a_symmetric_link() {
    let better = Ballot {
        term: 2,
        rank: 2,
        master: NodeId(2),
    };
    let claim = |hears: NodeSet, number: u32| Input::Received {
        sender: NodeId(2),
        ballot: better,
        payload: wire::encode_packet(&Packet::Tree(Tree {
            number,
            hops: Some(0),
            heartbeat: 1,
            hears: Some(hears),
            ..Tree::default()
        }))
        .into(),
    };
    let mut child = child_with_good_link_to_master();
    child.input(claim(ids([3]), 1));
    assert_eq!(child.notices, []);
    child.input(claim(ids([1, 3]), 2));
    assert_eq!(child.notices, [Notice::Leader(better)]);
    child.receive(0, master_heartbeat(51));
    assert_eq!(
        child.routing.shared.durable.epoch.ballot(),
        Some(better),
        "the ballot never falls"
    );
    assert_eq!(child.parent(), Some(NodeId(2)));
}

#[test]
fn stalled_host_probes_before_it_reports_silence() {
    let mut child = child_with_good_link_to_master();
    // The host stalls for 30 s, then the timers fire.
    child.now += Duration::from_secs(30);
    child.stimulate(Stimulus::Timeout);
    child.wait(1_500);
    assert_eq!(child.notices, [], "the timeouts restart");
    child.receive(0, master_heartbeat(80));
    child.wait(1_500);
    assert_eq!(child.notices, [], "the master was alive");
    // A lost master is still detected, later.
    child.now += Duration::from_secs(30);
    child.stimulate(Stimulus::Timeout);
    child.wait(25_000);
    assert_eq!(child.notices, [Notice::MasterSilent]);
}

/// The frames that a restart of `node` sends within `millis`, heartbeats included.
fn restart(node: &Node, millis: u64) -> (Node, usize) {
    let routing = &node.routing;
    let checkpoint = (
        routing.shared.durable.clone(),
        routing.policy.durable.clone(),
    );
    let shared = SharedState::new(NodeId(1), 4, 2);
    let mut restarted = Node {
        routing: Dissemination::new(shared, |shared| {
            TreePolicy::new(config(1), shared, node.now, Some(checkpoint))
        }),
        now: node.now,
        ..Node::new(1)
    };
    let mut sent = restarted.stimulate(Stimulus::Timeout).len();
    let until = restarted.now + Duration::from_millis(millis);
    while let Some(deadline) = restarted.deadline.filter(|deadline| *deadline <= until) {
        restarted.now = deadline;
        sent += restarted.stimulate(Stimulus::Timeout).len();
    }
    restarted.now = until;
    (restarted, sent)
}

/// The checkpoints of a step, oldest first.
fn checkpoints(
    routing: &mut Dissemination<TreePolicy>,
    now: Timestamp,
) -> Vec<routing::Checkpoint> {
    let mut emitted = Vec::new();
    step(routing, now, Stimulus::Timeout, |it| {
        if let Emitted::Event(Event::Checkpoint(checkpoint)) = it {
            emitted.push(*checkpoint);
        }
    });
    emitted
}

#[test]
fn a_second_restart_knows_the_sequences_that_the_first_one_used() {
    let mut master = Node::new(0);
    master.input(Input::Lead(MASTER));
    master.next_heartbeat();
    let mut durable = master.routing.shared.durable.clone();
    for restart in 1..4 {
        let own = (durable.clone(), master.routing.policy.durable.clone());
        let shared = SharedState::new(NodeId(0), 4, restart);
        let mut restarted = Dissemination::new(shared, |shared| {
            TreePolicy::new(config(0), shared, master.now, Some(own))
        });
        let stored = checkpoints(&mut restarted, master.now).pop().unwrap();
        let (stored, used) = (
            stored.common.heartbeats,
            restarted.shared.durable.heartbeats,
        );
        assert!(used.master > durable.heartbeats.master, "a heartbeat left");
        assert!(
            stored.reserved() > used.own.max(used.master),
            "restart {restart} stored {stored:?} and used {used:?}"
        );
        durable.heartbeats = stored;
    }
}

#[test]
fn restarted_drone_is_silent_until_the_next_heartbeat() {
    let child = child_with_good_link_to_master();
    let (mut restarted, sent) = restart(&child, 1_400);
    assert_eq!(
        sent, 0,
        "a frame without a route would make its children drop it"
    );
    restarted.numbers = child.numbers.clone();
    restarted.receive(0, master_heartbeat(50));
    assert_eq!(
        restarted.parent(),
        None,
        "the route may lead through this drone"
    );
    restarted.receive(0, master_heartbeat(51));
    assert_eq!(restarted.parent(), Some(NodeId(0)));
    let heartbeat = restarted.next_heartbeat();
    assert_eq!(heartbeat.hops, Some(1));
}

#[test]
fn restarted_drone_without_heartbeats_sends_after_one_and_a_half_periods() {
    let (_, sent) = restart(&child_with_good_link_to_master(), 1_600);
    assert!(sent > 0);
}

#[test]
fn stalled_master_restarts_member_timeouts() {
    let mut master = Node::new(0);
    master.input(Input::Lead(MASTER));
    master.input(Input::Discover);
    for _ in 0..3 {
        master.receive(1, child_heartbeat(1, 0, 1));
        master.wait(1_000);
    }
    master.notices.clear();
    // The other members were never heard of.
    master.now += Duration::from_secs(30);
    master.stimulate(Stimulus::Timeout);
    master.wait(4_000);
    assert_eq!(master.notices, []);
    master.wait(40_000);
    let mut silent = NodeSet::default();
    for notice in &master.notices {
        if let Notice::Silent(members) = notice {
            silent.extend_from(members);
        }
    }
    assert_eq!(silent, ids([1, 2, 3]));
}

#[test]
fn master_landing_reaches_drones_that_do_not_hear_it() {
    let landing = Tree {
        landing: ids([0]),
        ..master_heartbeat(51)
    };
    let mut child = child_with_good_link_to_master();
    child.receive(2, child_heartbeat(2, 1, 2));
    child.receive(0, landing.clone());
    assert_eq!(child.notices, [Notice::MasterLands]);
    child.receive(0, landing.clone());
    assert_eq!(child.notices.len(), 1, "once");
    let sent = child.next_heartbeat();
    assert!(sent.landing.contains(NodeId(0)));
    // A drone without the last order cannot know whether it was to land.
    let mut child = child_with_good_link_to_master();
    let unknown = Tree {
        sequence: 7,
        ..landing
    };
    child.receive(0, unknown);
    assert_eq!(child.notices, []);
    // Nor does it forward a landing that belongs to an order that its neighbours may not know.
    let subtree = Tree {
        sequence: 7,
        landing: ids([0, 2]),
        ..child_heartbeat(2, 1, 2)
    };
    child.receive(2, subtree);
    assert_eq!(child.next_heartbeat().landing, ids([2]));
}
