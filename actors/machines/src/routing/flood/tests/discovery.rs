//! Neighbour discovery and hop update.

use super::*;

#[test]
fn three_consecutive_hellos_make_a_neighbour_stable() {
    let mut drone = routing(1);
    let remaining = Duration::from_secs(8);
    let mut stable_at = None;
    for now in [0.0, 0.5, 1.3, 1.8, 2.3] {
        let outputs = receive(&mut drone, at(now), 2, &Packet::Hello { remaining });
        if outputs.events.contains(&Event::NeighbourStable(NodeId(2))) {
            stable_at = Some(now);
        }
    }
    assert_eq!(
        stable_at,
        Some(2.3),
        "the gap of 0.8 s at 1.3 s restarts the count"
    );
}

#[test]
fn late_discovery_ends_with_the_others() {
    let mut drone = routing(1);
    let remaining = Duration::from_secs(3);
    let outputs = receive(&mut drone, at(5.0), 2, &Packet::Hello { remaining });
    assert!(outputs.notices.contains(&Notice::DiscoveryStarted));
    let phase = drone.policy.durable.phase;
    assert_eq!(phase, Phase::Discovery { until: at(8.0) });
}

#[test]
fn first_stable_neighbour_heard_becomes_parent() {
    let (mut drone, now) = in_hop_update();
    let hop_update = |hops| Packet::HopUpdate {
        hops,
        routing_list: vec![NodeId(1)],
    };
    receive(&mut drone, now, 3, &hop_update(0));
    assert_eq!(drone.policy.durable.routes.parent, None, "3 is not stable");
    receive(&mut drone, now, 0, &hop_update(0));
    receive(&mut drone, now, 2, &hop_update(4));
    let routes = &drone.policy.durable.routes;
    assert_eq!((routes.hops, routes.parent), (Some(1), Some(NodeId(0))));
    assert_eq!(routes.routing_list, [NodeId(1), NodeId(2)]);
    assert!(routes.relay, "1 is listed and reaches 2, which is not");
    assert!(!routes.out_of_range);
}

#[test]
fn hop_update_ends_when_all_stable_neighbours_are_reheard_or_on_timeout() {
    let (mut drone, now) = in_hop_update();
    let hop_update = Packet::HopUpdate {
        hops: 0,
        routing_list: vec![NodeId(1)],
    };
    let outputs = receive(&mut drone, now, 0, &hop_update);
    assert!(
        !outputs.notices.contains(&Notice::RoutesReady),
        "2 was not heard yet"
    );
    let mut patient = drone.policy.durable.clone();
    let follows = Packet::Flood(flood(1, 0));
    let outputs = receive(&mut drone, now, 2, &follows);
    assert!(
        outputs.notices.contains(&Notice::RoutesReady),
        "a neighbour with routes counts as heard"
    );
    patient.phase = Phase::HopUpdate { since: now };
    let mut waiting = with(
        config(1),
        now,
        Some((drone.shared.durable.clone(), patient)),
    );
    let outputs = wait(&mut waiting, now + Duration::from_millis(5_400));
    assert!(outputs.notices.contains(&Notice::RoutesReady));
}

#[test]
fn only_a_master_is_notified_of_its_neighbours() {
    for (id, is_notified) in [(0, true), (1, false)] {
        let checkpoint = Checkpoint {
            phase: Phase::Following,
            stable: vec![NodeId(2), NodeId(3)],
            ..Checkpoint::default()
        };
        let common = Durable {
            epoch: LeaderEpoch::of(MASTER),
            ..Durable::default()
        };
        let mut routing = with(config(id), Timestamp::ZERO, Some((common, checkpoint)));
        let outputs = stimulate(&mut routing, at(1.0), Stimulus::Input(Input::Resync));
        let received = Notice::Neighbours([NodeId(2), NodeId(3)].into_iter().collect());
        let ready = |notice: &Notice| *notice == Notice::RoutesReady;
        let before = outputs.notices.iter().take_while(|notice| !ready(notice));
        assert_eq!(
            before.filter(|notice| **notice == received).count() == 1,
            is_notified
        );
        assert!(outputs.notices.iter().any(ready));
    }
}
