//! Agents whose drone leaves the swarm.

use super::failures::{FAILURES, assert_lands};
use super::*;
use crate::mission::State;

/// A member whose agent has left the swarm.
fn independent() -> (Drone, Vec<Transmit>) {
    let mut drone = member_on_task();
    let (transmits, events) = drone.message(b"leave");
    assert!(events.contains(&Event::State(State::Independent)));
    drone.calls();
    (drone, transmits)
}

#[test]
fn drone_that_leaves_follows_no_order_and_no_leader_but_gets_messages() {
    let (mut drone, transmits) = independent();
    assert_eq!(transmits, [Transmit::Leave]);
    let land = Order::Land {
        at: Ned::HOME,
        changes: 0,
        wave: 0,
        apart: true,
    };
    for (transmits, _) in [
        drone.order(4, &land),
        drone.notice(Notice::Leader(ballot(2, 1, 1))),
        drone.notice(Notice::MasterSilent),
        drone.wait(60 * SECOND),
    ] {
        let is_of_swarm =
            |it: &Transmit| !matches!(it, Transmit::Locate | Transmit::Goal(Goal::FlyTo { .. }));
        assert!(!transmits.iter().any(is_of_swarm), "{transmits:?}");
    }
    drone.message(b"hello");
    let calls = drone.calls();
    assert!(calls.contains(&"message from 0: 5".to_owned()), "{calls:?}");
    let is_of_swarm = |call: &String| call.starts_with("Leader") || call.starts_with("Members");
    assert!(!calls.iter().any(is_of_swarm), "{calls:?}");
}

#[test]
fn restarted_routing_and_mission_stay_out_of_the_swarm() {
    let (mut drone, _) = independent();
    let (transmits, _) = drone.notice(Notice::Resync);
    assert!(transmits.contains(&Transmit::Leave), "{transmits:?}");
    assert!(!transmits.contains(&Transmit::Land), "{transmits:?}");
    drone.restart();
    let (transmits, _) = drone.wait(Duration::ZERO);
    assert!(transmits.contains(&Transmit::Leave), "{transmits:?}");
    assert!(drone.host.mission().is_independent());
}

#[test]
fn failsafes_land_a_drone_that_has_left() {
    for cause in FAILURES {
        assert_lands(independent().0, cause);
    }
    assert_lands(
        independent().0,
        (LandingReason::MissionOver, |drone| drone.message(b"land")),
    );
}
