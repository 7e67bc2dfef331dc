use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::super::tests::config;
use super::super::tests::neighbourhood::{Neighbourhood, with_route};
use super::*;
use crate::identity::NodeSet;
use crate::routing::{Reception, Tree};

/// Drone 1, with master 0, and its neighbours.
struct Drone {
    near: Neighbourhood,
    route: ParentSelection,
}

impl Drone {
    fn new() -> Self {
        Self {
            near: Neighbourhood::of(1),
            route: ParentSelection::new(&config(1)),
        }
    }

    /// Updates the route; returns the parent.
    fn choose(&mut self) -> Option<u32> {
        let place = RouteContext {
            is_master: false,
            master: Some(NodeId(0)),
            heartbeat: u32::MAX,
            throttles_leaves: false,
        };
        self.route.update(self.near.now, place, &self.near.links);
        let parent = self.route.parent().map(|parent| parent.0);
        if let Some(parent) = parent {
            self.near.follow(parent);
        }
        parent
    }

    /// Receives a report until its link quality is known, and updates the route each time.
    fn receive_well(&mut self, from: u32, report: &Tree) -> Option<u32> {
        for _ in 0..60 {
            self.near.receive(from, report.clone());
            self.choose();
        }
        self.route.parent().map(|parent| parent.0)
    }
}

/// A report of a neighbour that receives this share of drone 1's frames, in sixteenths.
fn hearing(sixteenths: u8, report: Tree) -> Tree {
    let id = NodeId(1);
    Tree {
        weak: vec![Reception { id, sixteenths }],
        ..report
    }
}

#[test]
fn route_with_lowest_etx_beats_the_shortest() {
    let mut drone = Drone::new();
    // The master receives 3/8, so the direct route takes 2.7 transmissions; the other takes 2.
    drone.near.receive_well(0, &hearing(6, with_route(0, 0, 1)));
    drone.near.receive_well(2, &with_route(1, ETX_UNIT, 1));
    assert_eq!(drone.choose(), Some(2));
    assert_eq!(drone.route.cost(), ETX_UNIT * 2);
    assert_eq!(drone.route.routes().hops, Some(2));
    assert!(!drone.route.routes().out_of_range);
}

#[test]
fn new_parent_must_be_cheaper_by_the_hysteresis() {
    for (by, parent) in [(HYSTERESIS - 1, 2), (HYSTERESIS + 1, 3)] {
        let mut drone = Drone::new();
        assert_eq!(drone.receive_well(2, &with_route(4, 200, 1)), Some(2));
        assert_eq!(
            drone.receive_well(3, &with_route(4, 200 - by, 1)),
            Some(parent)
        );
    }
}

#[test]
fn routes_do_not_flap_between_equal_parents() {
    const HEARTBEATS: u32 = 5_000;
    let mut moves = 0;
    let mut drone = Drone::new();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut parent = None;
    for heartbeat in 1..=HEARTBEATS {
        for neighbour in [2, 3] {
            if rng.random_bool(0.1) {
                drone.near.miss(neighbour);
            } else {
                drone
                    .near
                    .receive(neighbour, with_route(1, ETX_UNIT, heartbeat));
            }
            let chosen = drone.choose();
            moves += u32::from(chosen != parent);
            parent = chosen;
        }
        drone.near.now += Neighbourhood::HEARTBEAT_PERIOD;
    }
    assert!(parent.is_some());
    assert!(moves < HEARTBEATS / 50, "{moves}");
}

#[test]
fn poor_link_is_the_last_resort() {
    let mut drone = Drone::new();
    let poor = hearing(4, with_route(0, 0, 1));
    assert_eq!(
        drone.receive_well(0, &poor),
        Some(0),
        "a poor link is better than none"
    );
    // The direct route is cheaper, but hardly any frame arrives.
    let expensive = with_route(9, 120, 1);
    assert_eq!(drone.receive_well(2, &expensive), Some(2));
    assert_eq!(drone.receive_well(0, &poor), Some(2));
    drone.near.links.forget(NodeId(2));
    drone.near.receive(0, hearing(4, with_route(0, 0, 2)));
    assert_eq!(drone.choose(), Some(0));
}

#[test]
fn unproven_link_does_not_replace_the_parent() {
    let mut drone = Drone::new();
    drone.receive_well(2, &with_route(4, 400, 1));
    for frames in 1..=5 {
        drone.near.receive(3, with_route(1, ETX_UNIT, 1));
        let parent = if frames <= 4 { 2 } else { 3 };
        assert_eq!(drone.choose(), Some(parent), "{frames}");
    }
    let mut alone = Drone::new();
    alone.near.receive(3, with_route(1, ETX_UNIT, 1));
    assert_eq!(
        alone.choose(),
        Some(3),
        "without a parent an unproven link is taken"
    );
}

#[test]
fn parent_must_satisfy_the_feasibility_condition() {
    for (cost, heartbeat, is_taken) in
        [(64, 5, false), (63, 5, true), (900, 6, true), (0, 4, false)]
    {
        let mut drone = Drone::new();
        drone.receive_well(2, &with_route(1, 32, 5));
        assert_eq!(drone.route.cost(), 64);
        drone.near.links.forget(NodeId(2));
        drone.near.receive(3, with_route(3, cost, heartbeat));
        assert_eq!(
            drone.choose(),
            is_taken.then_some(3),
            "{cost} at {heartbeat}"
        );
    }
}

#[test]
fn restarted_drone_accepts_newer_heartbeats_only() {
    let mut drone = Drone::new();
    drone.route.resume(7);
    drone.near.receive(2, with_route(1, 32, 7));
    assert_eq!(drone.choose(), None);
    drone.near.receive(2, with_route(1, 32, 8));
    assert_eq!(drone.choose(), Some(2));
}

#[test]
fn new_epoch_resets_the_route() {
    let mut drone = Drone::new();
    drone.receive_well(2, &with_route(1, 32, 700));
    drone.route.start_epoch();
    drone.near.links.forget_epoch();
    assert_eq!(drone.choose(), None);
    drone.near.receive(3, with_route(5, 500, 1));
    assert_eq!(drone.choose(), Some(3));
}

#[test]
fn child_is_never_chosen_as_parent() {
    let mut drone = Drone::new();
    let follows = Tree {
        parent: Some(NodeId(1)),
        ..with_route(1, 32, 1)
    };
    assert_eq!(drone.receive_well(2, &follows), None);
    drone.receive_well(2, &with_route(1, 32, 2));
    assert_eq!(drone.choose(), Some(2));
    drone.near.receive(2, follows);
    assert_eq!(drone.choose(), None);
}

#[test]
fn stale_parent_is_replaced_by_a_proven_neighbour_only() {
    for (frames, chosen) in [(0, 2), (1, 2), (5, 3)] {
        let mut drone = Drone::new();
        drone.receive_well(2, &with_route(1, 32, 1));
        let stale_at = drone.route.stale_at(&drone.near.links).unwrap();
        drone.near.now = stale_at;
        for _ in 0..frames {
            drone.near.receive(3, with_route(7, 300, 2));
        }
        assert_eq!(drone.choose(), Some(2), "the parent is not stale yet");
        drone.near.now = stale_at + Duration::from_nanos(1);
        assert_eq!(drone.choose(), Some(chosen));
    }
}

#[test]
fn parent_that_does_not_count_this_drone_is_replaced() {
    let mut drone = Drone::new();
    drone.receive_well(2, &with_route(1, 32, 1));
    drone.receive_well(3, &with_route(7, 300, 1));
    let max = config(1).leaf_period() * UNCOUNTED_LEAF_PERIODS;
    let (counted_at, quarter) = (drone.near.now, max / 4);
    let hears = Some(NodeSet::from(NodeId(1)));
    let mut parents = Vec::new();
    for heartbeat in 2..8 {
        drone.near.now += quarter;
        let leaves_out = Tree {
            hears: hears.clone(),
            ..with_route(1, 32, heartbeat)
        };
        drone.near.receive_unmodified(2, leaves_out);
        drone.near.receive(3, with_route(7, 300, heartbeat + 1));
        drone.route.follow_parent(&drone.near.links);
        parents.push((drone.near.now, drone.choose()));
    }
    let replaced_at = parents.iter().find(|it| it.1 == Some(3)).unwrap().0;
    assert_eq!(replaced_at, counted_at + max + quarter, "{parents:?}");
}

/// For six seconds, the parent is heard and no longer counts drone 1, while another drone has a newer route.
fn keeps_parent_that_does_not_count_it(mut drone: Drone, parent: &Tree) -> bool {
    drone.receive_well(2, &with_route(1, 32, 1));
    (2..60).all(|heartbeat| {
        let parent = Tree {
            heartbeat,
            hears: Some(NodeSet::from(NodeId(1))),
            ..parent.clone()
        };
        drone.near.receive_unmodified(2, parent);
        drone.near.receive(3, with_route(7, 300, heartbeat + 1));
        drone.route.follow_parent(&drone.near.links);
        drone.near.now += Neighbourhood::HEARTBEAT_PERIOD / 10;
        drone.choose() == Some(2)
    })
}

#[test]
fn only_a_parent_that_could_count_this_drone_must_do_so() {
    let parent = with_route(1, 32, 1);
    assert!(!keeps_parent_that_does_not_count_it(Drone::new(), &parent));
    let mut relay = Drone::new();
    relay.route = ParentSelection::new(&Config {
        drones: 1,
        ..config(1)
    });
    assert!(keeps_parent_that_does_not_count_it(relay, &parent));
    let of_others = parent.cut_to(2..9);
    assert!(keeps_parent_that_does_not_count_it(
        Drone::new(),
        &of_others
    ));
}

#[test]
fn unreachable_parent_is_replaced() {
    let mut drone = Drone::new();
    drone.receive_well(2, &with_route(1, 32, 1));
    drone.near.receive(3, with_route(7, 300, 2));
    drone
        .near
        .links
        .update_link(NodeId(2), |link| link.deliveries.mark_unreachable());
    assert_eq!(drone.choose(), Some(3));
}

#[test]
fn lag_is_the_age_of_the_route_in_heartbeats() {
    let mut drone = Drone::new();
    drone.receive_well(2, &with_route(1, 32, 5));
    drone.choose();
    assert_eq!(drone.route.lag(9), 4);
    let lagging = Tree {
        lag: 3,
        ..with_route(1, 32, 9)
    };
    drone.near.receive(2, lagging);
    drone.route.follow_parent(&drone.near.links);
    assert_eq!(drone.route.lag(9), 3);
}

proptest! {
    /// For any reports: the announced label comes from the parent, at a higher cost and with no newer sequence, and the
    /// distance is the nearest announced label.
    #[test]
    fn announced_label_is_farther_than_the_parents(
        report in prop::collection::vec((2..6_u32, 1..5_u16, any::<u16>(), 1..9_u32, any::<bool>()), 1..80),
    ) {
        let mut drone = Drone::new();
        let mut nearest = Label::FARTHEST;
        for (from, hops, cost, heartbeat, is_lost) in report {
            if is_lost {
                drone.near.links.forget(NodeId(from));
            } else {
                drone.near.receive(from, with_route(hops, cost, heartbeat));
            }
            let before = drone.route.parent();
            let parent = drone.choose().map(NodeId);
            let Some(parent) = parent else {
                prop_assert_eq!(drone.route.cost(), 0);
                continue;
            };
            let link = drone.near.links.get(parent).unwrap();
            let label = Label { heartbeat: link.route_heartbeat(), cost: link.report.cost };
            prop_assert!(before == Some(parent) || label.is_nearer_than(nearest));
            prop_assert!(!drone.route.label.is_nearer_than(label));
            if drone.route.label.is_nearer_than(nearest) {
                nearest = drone.route.label;
            }
            prop_assert_eq!(drone.route.distance, nearest);
        }
    }
}
