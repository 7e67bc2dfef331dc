//! Whether the parent, and the master, are still there.

use super::*;
use crate::routing::heartbeat::RESTART_GAP;
use crate::routing::tree::quality::{PROBES_MAX, Quality};

/// Drone 1, which has heard its parent, the master, once a second for long enough to trust the link.
fn child_of_a_master_that_it_hears_well() -> Node {
    let mut child = Node::new(1);
    for heartbeat in 1..=50 {
        child.hear(0, beacon_of_the_master(heartbeat));
        child.wait(1_000);
    }
    child.notices.clear();
    child
}

pub(super) fn beacon_of_the_master(heartbeat: u32) -> Tree {
    Tree {
        hops: Some(0),
        heartbeat,
        hears: Some(ids([1])),
        alive: ids([0, 1]),
        ..Tree::default()
    }
}

#[test]
fn a_parent_that_is_silent_is_asked_and_only_then_missed() {
    let mut child = child_of_a_master_that_it_hears_well();
    // Two beacons without a word are more than chance by now. It hears nobody else, and asks as often as it may.
    let asked = child.wait(3_000);
    let (probes, inquiries) = asked.split_at(PROBES_MAX as usize);
    assert!(probes.iter().all(|it| it.to == Some(NodeId(0))));
    // Then all that may be near, and the one that it left.
    let asks_left = |it: &Tree| it.to.is_none() && it.asks == ids([0]);
    assert!(inquiries.iter().all(asks_left), "{inquiries:?}");
    let asked = child.wait(15_000);
    assert!((20..80).contains(&asked.len()), "{}", asked.len());
    assert_eq!(child.notices, []);
    let asked = child.wait(5_000);
    assert_eq!(child.notices, [Notice::MasterSilent]);
    assert!(asked.len() < 10, "{}", asked.len());
    assert_eq!(child.wait(15_000), [], "there is nobody left to ask");
}

impl Node {
    /// Drone 1, whose parent is the master, where beacons are quick; what it has heard the master say so far.
    fn quick() -> (Self, u32) {
        let mut node = Self::new(1);
        let config = Config {
            beacon: Duration::from_millis(40),
            ..config(1)
        };
        node.routing = routing(config);
        let heard = 60;
        node.beacons_of_quick_numbers(1..=heard);
        node.notices.clear();
        (node, heard)
    }

    /// How many beacons it says while it hears these numbers of the master's.
    fn beacons_of_quick_numbers(&mut self, numbers: impl IntoIterator<Item = u32>) -> usize {
        let mut beacons = 0;
        for number in numbers {
            self.hear(0, beacon_of_the_master(number));
            beacons += self.beacons_within(40);
        }
        beacons
    }

    /// How many beacons it says within so many milliseconds by itself.
    fn beacons_within(&mut self, millis: u64) -> usize {
        let until = self.now + Duration::from_millis(millis);
        let mut beacons = 0;
        while let Some(deadline) = self.deadline.filter(|deadline| *deadline <= until) {
            self.now = deadline;
            let said = self.stimulate(Stimulus::Timeout);
            beacons += said.iter().filter(|it| it.hears.is_some()).count();
        }
        self.now = until;
        beacons
    }
}

#[test]
fn who_is_nobodys_parent_passes_on_each_third_quick_number_and_a_parent_each() {
    let (mut node, heard) = Node::quick();
    assert_eq!(node.beacons_of_quick_numbers(heard + 1..=heard + 60), 20);
    node.hear(2, beacon_of_child(2, 1, 2));
    assert_eq!(node.beacons_within(40), 1, "it learns that it is heard");
    assert_eq!(node.beacons_of_quick_numbers(heard + 61..=heard + 80), 20);
}

#[test]
fn who_asks_its_parent_lets_all_hear_it() {
    let (mut node, _) = Node::quick();
    // Two numbers that do not come are more than chance.
    assert_eq!(node.beacons_within(55), 1);
}

#[test]
fn a_neighbour_that_has_missed_numbers_of_the_master_is_told() {
    let (mut node, heard) = Node::quick();
    let from_another = |behind: u32| Tree {
        heartbeat: heard - behind,
        ..beacon_of_child(2, 0, 1)
    };
    node.hear(2, from_another(0));
    node.beacons_within(5);
    node.hear(2, from_another(1));
    assert_eq!(node.beacons_within(5), 0, "it is on its way");
    node.hear(2, from_another(2));
    assert_eq!(node.beacons_within(5), 1);
}

#[test]
fn who_speaks_seldom_is_left_out_for_a_moment_and_has_a_way_all_the_same() {
    let (mut node, heard) = Node::quick();
    let says = |behind: u32, hears: NodeSet| Tree {
        heartbeat: heard + behind,
        hears: Some(hears),
        ..beacon_of_child(2, 0, 1)
    };
    for _ in 0..5 {
        node.hear(2, says(0, ids([1])));
    }
    node.beacons_within(45);
    node.hear(2, says(1, ids([])));
    assert_eq!(node.parent(), Some(NodeId(2)));
    // Not for longer than what it says is missed by chance, as little as is known of that link.
    node.beacons_within(200);
    node.hear(2, says(2, ids([])));
    assert_eq!(node.parent(), Some(NodeId(2)));
    node.beacons_within(200);
    node.hear(2, says(3, ids([])));
    assert_eq!(node.parent(), None);
}

/// How well drone 1 hears drone 0, of which it has heard frames of these numbers, and of as many to one alone since.
fn quality(frames: impl IntoIterator<Item = (u32, u32)>) -> Quality {
    let mut links = LinkTable::new(NodeId(1), 4, Duration::from_secs(1), Duration::from_secs(1));
    let speaker = Speaker {
        id: NodeId(0),
        is_parent: false,
        master: None,
    };
    for (number, unicasts) in frames {
        let said = wire::encode_packet(&Packet::Tree(Tree {
            number,
            to: (unicasts > 0).then_some(NodeId(3)),
            unicasts,
            ..Tree::default()
        }));
        let said = wire::decode_tree(&said).unwrap();
        links.hear(speaker, &said, Bytes::new(), Timestamp::ZERO);
    }
    links.get(NodeId(0)).unwrap().quality
}

#[test]
fn a_parent_over_a_lossy_link_is_asked_more_often() {
    // One in five is lost.
    let questions = quality(
        (1..250)
            .filter(|number| number % 5 != 0)
            .map(|number| (number, 0)),
    )
    .probes();
    assert!((18..25).contains(&questions), "{questions}");
}

#[test]
fn what_is_said_to_another_alone_and_what_a_restart_skips_are_no_losses() {
    let heard = |numbers: std::ops::Range<u32>| numbers.map(|number| (number, 0));
    let loss = |frames: Vec<(u32, u32)>| quality(frames).loss().to_bits();
    let none = 0.0_f64.to_bits();
    assert_eq!(loss(heard(1..60).collect()), none);
    let with_asides = heard(1..60).chain([(59, 3), (59, 7)]).chain(heard(60..70));
    assert_eq!(loss(with_asides.collect()), none);
    let restarted = heard(1..60).chain(heard(59 + RESTART_GAP + 1..200));
    assert_eq!(loss(restarted.collect()), none);
    // What was for all and is missed is a loss, whatever is heard next.
    let missed = |next| quality(heard(1..60).chain([next])).loss();
    assert!(missed((61, 0)) > 0.01);
    assert!(missed((60, 1)) > 0.01);
}

#[test]
fn questions_raise_no_number_that_others_would_miss() {
    let mut child = child_of_a_master_that_it_hears_well();
    let asked = child.wait(1_100);
    let numbers: Vec<_> = asked.iter().map(|it| (it.number, it.unicasts)).collect();
    let first = numbers[0].0;
    let expected: Vec<_> = (1..11).map(|unicasts| (first, unicasts)).collect();
    assert_eq!(numbers, expected);
}

#[test]
fn a_leaf_that_asks_is_answered_however_well_it_is_heard_and_whatever_else_comes_in() {
    let mut parent = Node::placed(1, 0, 1, &[2]);
    for heartbeat in 2..60 {
        parent.hear(0, beacon_of_the_master(heartbeat));
        for child in [2, 3] {
            parent.hear(
                child,
                beacon_of_child(child, if child == 2 { 1 } else { 0 }, 2),
            );
        }
        parent.wait(1_000);
    }
    let asks = Tree {
        asks: ids([1]),
        hears: None,
        ..beacon_of_child(2, 1, 2)
    };
    parent.hear(2, asks);
    parent.hear(3, beacon_of_child(3, 0, 2));
    let said = parent.wait(8);
    assert_eq!(said.len(), 1, "{said:?}");
    assert_eq!(said[0].to, Some(NodeId(2)));
}

#[test]
fn a_parent_that_answers_is_asked_no_more() {
    let mut child = child_of_a_master_that_it_hears_well();
    let asked = child.wait(1_020);
    assert!((1..7).contains(&asked.len()), "{asked:?}");
    child.hear(0, beacon_of_the_master(51));
    assert_eq!(child.wait(900), []);
    assert_eq!(child.notices, []);
}

#[test]
fn a_better_ballot_is_turned_to_over_a_link_that_carries_both_ways_only() {
    let better = Ballot {
        term: 2,
        rank: 2,
        master: NodeId(2),
    };
    let claim = |hears: NodeSet, number: u32| Input::Heard {
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
    let mut child = child_of_a_master_that_it_hears_well();
    child.tell(claim(ids([3]), 1));
    assert_eq!(child.notices, []);
    child.tell(claim(ids([1, 3]), 2));
    assert_eq!(child.notices, [Notice::Leader(better)]);
    child.hear(0, beacon_of_the_master(51));
    assert_eq!(
        child.routing.core.durable.epoch.ballot(),
        Some(better),
        "it never falls"
    );
    assert_eq!(child.parent(), Some(NodeId(2)));
}

#[test]
fn a_drone_whose_host_stalled_asks_before_it_misses_anybody() {
    let mut child = child_of_a_master_that_it_hears_well();
    // Nothing is handled for 30 s, then its timers are.
    child.now += Duration::from_secs(30);
    child.stimulate(Stimulus::Timeout);
    child.wait(1_500);
    assert_eq!(child.notices, [], "one more period");
    child.hear(0, beacon_of_the_master(80));
    child.wait(1_500);
    assert_eq!(child.notices, [], "it was there all the time");
    // A master that is not is missed all the same, if later.
    child.now += Duration::from_secs(30);
    child.stimulate(Stimulus::Timeout);
    child.wait(25_000);
    assert_eq!(child.notices, [Notice::MasterSilent]);
}

#[test]
fn a_master_whose_host_stalled_gives_its_members_their_time_to_live_anew() {
    let mut master = Node::new(0);
    master.tell(Input::Lead(MASTER));
    master.tell(Input::Discover);
    for _ in 0..3 {
        master.hear(1, beacon_of_child(1, 0, 1));
        master.wait(1_000);
    }
    master.notices.clear();
    // Of the others nothing has been heard at all.
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
fn a_master_that_lands_is_told_of_by_whoever_hears_it_to_whoever_does_not() {
    let landing = Tree {
        landing: ids([0]),
        ..beacon_of_the_master(51)
    };
    let mut child = child_of_a_master_that_it_hears_well();
    child.hear(2, beacon_of_child(2, 1, 2));
    child.hear(0, landing.clone());
    assert_eq!(child.notices, [Notice::MasterLands]);
    child.hear(0, landing.clone());
    assert_eq!(child.notices.len(), 1, "once");
    let said = child.stimulate_next_beacon();
    assert!(said.landing.contains(NodeId(0)));
    // Whoever lacks the last order can't tell whether that was to land.
    let mut child = child_of_a_master_that_it_hears_well();
    let unknown = Tree {
        sequence: 7,
        ..landing
    };
    child.hear(0, unknown);
    assert_eq!(child.notices, []);
    // Nor may it tell so, under an order that others know, though a drone below it does.
    let below = Tree {
        sequence: 7,
        landing: ids([0, 2]),
        ..beacon_of_child(2, 1, 2)
    };
    child.hear(2, below);
    assert_eq!(child.stimulate_next_beacon().landing, ids([2]));
}
