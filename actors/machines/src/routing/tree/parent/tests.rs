use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::super::tests::neighbourhood::{Neighbourhood, with_route};
use super::*;
use crate::routing::{Reception, Tree};

/// Drone 1, whose master is drone 0, with whom it hears.
struct Drone {
    near: Neighbourhood,
    route: ParentSelection,
}

impl Drone {
    fn new() -> Self {
        Self {
            near: Neighbourhood::of(1),
            route: ParentSelection::new(NodeId(1), Neighbourhood::BEACON),
        }
    }

    /// Chooses its parent anew.
    fn choose(&mut self) -> Option<u32> {
        let place = Place {
            is_master: false,
            master: Some(NodeId(0)),
            heartbeat: u32::MAX,
            are_beacons_quick: false,
        };
        self.route.update(self.near.now, place, &self.near.links);
        self.route.parent().map(|parent| parent.0)
    }

    /// Hears a neighbour well, and chooses its parent anew each time.
    fn hear_well(&mut self, from: u32, said: &Tree) -> Option<u32> {
        for _ in 0..60 {
            self.near.hear(from, said.clone());
            self.choose();
        }
        self.route.parent().map(|parent| parent.0)
    }
}

/// What a neighbour says that hears that share of drone 1's frames, in sixteenths.
fn hearing(sixteenths: u8, said: Tree) -> Tree {
    let id = NodeId(1);
    Tree {
        weak: vec![Reception { id, sixteenths }],
        ..said
    }
}

#[test]
fn the_route_with_the_fewest_transmissions_is_taken_not_the_shortest() {
    let mut drone = Drone::new();
    // The master hears three of eight, so that way takes 2.7 transmissions; the other takes two.
    drone.near.hear_well(0, &hearing(6, with_route(0, 0, 1)));
    drone.near.hear_well(2, &with_route(1, ETX_UNIT, 1));
    assert_eq!(drone.choose(), Some(2));
    assert_eq!(drone.route.cost(), ETX_UNIT * 2);
    assert_eq!(drone.route.routes().hops, Some(2));
    assert!(!drone.route.routes().out_of_range);
}

#[test]
fn another_parent_must_be_cheaper_by_the_hysteresis() {
    for (by, parent) in [(HYSTERESIS - 1, 2), (HYSTERESIS + 1, 3)] {
        let mut drone = Drone::new();
        assert_eq!(drone.hear_well(2, &with_route(4, 200, 1)), Some(2));
        assert_eq!(
            drone.hear_well(3, &with_route(4, 200 - by, 1)),
            Some(parent)
        );
    }
}

#[test]
fn routes_do_not_flap_between_parents_that_are_alike() {
    const BEACONS: u32 = 5_000;
    let mut moves = 0;
    let mut drone = Drone::new();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut parent = None;
    for heartbeat in 1..=BEACONS {
        for neighbour in [2, 3] {
            if rng.random_bool(0.1) {
                drone.near.miss(neighbour);
            } else {
                drone
                    .near
                    .hear(neighbour, with_route(1, ETX_UNIT, heartbeat));
            }
            let chosen = drone.choose();
            moves += u32::from(chosen != parent);
            parent = chosen;
        }
        drone.near.now += Neighbourhood::BEACON;
    }
    assert!(parent.is_some());
    assert!(moves < BEACONS / 50, "{moves}");
}

#[test]
fn a_poor_link_is_used_only_where_there_is_no_better_one() {
    let mut drone = Drone::new();
    let poor = hearing(4, with_route(0, 0, 1));
    assert_eq!(drone.hear_well(0, &poor), Some(0), "better than none");
    // Cheaper than by way of the other, but hardly anything gets through.
    let dear = with_route(9, 120, 1);
    assert_eq!(drone.hear_well(2, &dear), Some(2));
    assert_eq!(drone.hear_well(0, &poor), Some(2));
    drone.near.links.forget(NodeId(2));
    drone.near.hear(0, hearing(4, with_route(0, 0, 2)));
    assert_eq!(drone.choose(), Some(0));
}

#[test]
fn a_link_that_is_not_proven_is_not_preferred_to_one_in_use() {
    let mut drone = Drone::new();
    drone.hear_well(2, &with_route(4, 400, 1));
    for frames in 1..=5 {
        drone.near.hear(3, with_route(1, ETX_UNIT, 1));
        let parent = if frames <= 4 { 2 } else { 3 };
        assert_eq!(drone.choose(), Some(parent), "{frames}");
    }
    let mut alone = Drone::new();
    alone.near.hear(3, with_route(1, ETX_UNIT, 1));
    assert_eq!(
        alone.choose(),
        Some(3),
        "without a parent it takes what there is"
    );
}

#[test]
fn without_a_newer_heartbeat_nothing_farther_is_taken_than_was_announced() {
    for (cost, heartbeat, is_taken) in
        [(64, 5, false), (63, 5, true), (900, 6, true), (0, 4, false)]
    {
        let mut drone = Drone::new();
        drone.hear_well(2, &with_route(1, 32, 5));
        assert_eq!(drone.route.cost(), 64);
        drone.near.links.forget(NodeId(2));
        drone.near.hear(3, with_route(3, cost, heartbeat));
        assert_eq!(
            drone.choose(),
            is_taken.then_some(3),
            "{cost} at {heartbeat}"
        );
    }
}

#[test]
fn who_restarted_takes_no_route_as_old_as_what_it_remembers() {
    let mut drone = Drone::new();
    drone.route.resume(7);
    drone.near.hear(2, with_route(1, 32, 7));
    assert_eq!(drone.choose(), None);
    drone.near.hear(2, with_route(1, 32, 8));
    assert_eq!(drone.choose(), Some(2));
}

#[test]
fn under_another_master_routes_begin_anew() {
    let mut drone = Drone::new();
    drone.hear_well(2, &with_route(1, 32, 700));
    drone.route.begin_epoch();
    drone.near.links.forget_epoch();
    assert_eq!(drone.choose(), None);
    drone.near.hear(3, with_route(5, 500, 1));
    assert_eq!(drone.choose(), Some(3));
}

#[test]
fn nobody_follows_a_neighbour_that_follows_it() {
    let mut drone = Drone::new();
    let follows = Tree {
        parent: Some(NodeId(1)),
        ..with_route(1, 32, 1)
    };
    assert_eq!(drone.hear_well(2, &follows), None);
    drone.hear_well(2, &with_route(1, 32, 2));
    assert_eq!(drone.choose(), Some(2));
    drone.near.hear(2, follows);
    assert_eq!(drone.choose(), None);
}

#[test]
fn a_silent_parent_is_left_for_another_and_kept_where_there_is_none_that_is_known() {
    for (frames, chosen) in [(0, 2), (1, 2), (5, 3)] {
        let mut drone = Drone::new();
        drone.hear_well(2, &with_route(1, 32, 1));
        let stale_at = drone.route.stale_at(&drone.near.links).unwrap();
        drone.near.now = stale_at;
        for _ in 0..frames {
            drone.near.hear(3, with_route(7, 300, 2));
        }
        assert_eq!(drone.choose(), Some(2), "it is not stale yet");
        drone.near.now = stale_at + Duration::from_nanos(1);
        assert_eq!(drone.choose(), Some(chosen));
    }
}

#[test]
fn who_is_out_of_reach_is_left_for_another() {
    let mut drone = Drone::new();
    drone.hear_well(2, &with_route(1, 32, 1));
    drone.near.hear(3, with_route(7, 300, 2));
    drone.near.links.change_reach(NodeId(2), Link::suspect);
    assert_eq!(drone.choose(), Some(3));
}

#[test]
fn the_age_of_a_route_is_told_by_how_far_its_heartbeat_lags_behind() {
    let mut drone = Drone::new();
    drone.hear_well(2, &with_route(1, 32, 5));
    drone.choose();
    assert_eq!(drone.route.lag(9), 4);
    let lagging = Tree {
        lag: 3,
        ..with_route(1, 32, 9)
    };
    drone.near.hear(2, lagging);
    drone.route.follow_parent(&drone.near.links);
    assert_eq!(drone.route.lag(9), 3);
}

proptest! {
    /// Whatever neighbours say: what is announced comes from the parent, at a higher cost and no newer, and nothing nearer
    /// was announced before than what the drone takes for its distance.
    #[test]
    fn what_is_announced_is_farther_than_what_the_parent_announces(
        said in prop::collection::vec((2..6_u32, 1..5_u16, any::<u16>(), 1..9_u32, any::<bool>()), 1..80),
    ) {
        let mut drone = Drone::new();
        let mut nearest = Label::FARTHEST;
        for (from, hops, cost, heartbeat, is_lost) in said {
            if is_lost {
                drone.near.links.forget(NodeId(from));
            } else {
                drone.near.hear(from, with_route(hops, cost, heartbeat));
            }
            let before = drone.route.parent();
            let parent = drone.choose().map(NodeId);
            let Some(parent) = parent else {
                prop_assert_eq!(drone.route.cost(), 0);
                continue;
            };
            let link = drone.near.links.get(parent).unwrap();
            let label = Label { heartbeat: link.route_heartbeat(), cost: link.said.cost };
            prop_assert!(before == Some(parent) || label.is_nearer_than(nearest));
            prop_assert!(!drone.route.label.is_nearer_than(label));
            if drone.route.label.is_nearer_than(nearest) {
                nearest = drone.route.label;
            }
            prop_assert_eq!(drone.route.distance, nearest);
        }
    }
}
