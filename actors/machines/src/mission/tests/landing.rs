//! What ends a flight.

use super::*;

#[test]
fn member_not_in_slot_when_the_swarm_leaves_lands() {
    let mut member = mission(0, Liveness::Heartbeat);
    deliver(&mut member, 1, &complete_plan());
    deliver(&mut member, 2, &Order::TakeOff { wave: 0 });
    let transmits = deliver(&mut member, 3, &open_waypoint(0));
    assert_eq!(transmits, [], "others may be below its path");
    assert_eq!(member.durable.state, State::TakingOff);
    arrive(&mut member, 20.0);
    assert_eq!(member.durable.state, State::MovingToLand);
    let transmits = arrive(&mut member, 30.0);
    assert!(transmits.contains(&Transmit::Goal(Goal::Land)));
    assert_eq!(member.durable.state, State::Landing);
}

#[test]
fn landing_drone_ignores_orders() {
    let mut member = member_at_waypoint_0(Liveness::Heartbeat);
    send(&mut member, 35.0, Input::GiveUp);
    assert_eq!(member.durable.state, State::Landing);
    assert!(deliver(&mut member, 9, &open_waypoint(1)).is_empty());
    assert_eq!(member.durable.state, State::Landing);
}

#[test]
fn silent_master_is_detected_in_flight_except_with_thesis_liveness() {
    // Detected during the leg or at its end.
    for (liveness, reason_on_leg, arrival_transmits) in [
        (
            Liveness::Heartbeat,
            Some(LandingReason::MasterSilent),
            State::MovingToLand,
        ),
        (Liveness::Thesis, None, State::Landing),
    ] {
        let mut member = member_at_waypoint_0(liveness);
        deliver(&mut member, 5, &open_waypoint(1));
        notify(&mut member, 40.0, RoutingNotice::MasterSilent);
        let moving = State::MovingToWaypoint { waypoint: 1 };
        assert_eq!(member.durable.state, moving);
        assert_eq!(member.durable.landing.reason, reason_on_leg);
        arrive(&mut member, 50.0);
        assert_eq!(member.durable.state, arrival_transmits);
    }
}

#[test]
fn overdue_leg_ends_in_a_landing() {
    let mut member = member_at_waypoint_0(Liveness::Heartbeat);
    deliver(&mut member, 5, &open_waypoint(1));
    stimulate(&mut member, 100.9, Stimulus::Timeout);
    assert_eq!(
        member.durable.state,
        State::MovingToWaypoint { waypoint: 1 }
    );
    stimulate(&mut member, 101.0, Stimulus::Timeout);
    assert_eq!(member.durable.state, State::Landing);
}

#[test]
fn take_off_and_leg_to_landing_place_have_limits() {
    let mut member = mission(0, Liveness::Heartbeat);
    deliver(&mut member, 1, &complete_plan());
    deliver(&mut member, 2, &Order::TakeOff { wave: 0 });
    stimulate(&mut member, 61.0, Stimulus::Timeout);
    assert_eq!(member.durable.state, State::Landing);
    let mut member = member_at_waypoint_0(Liveness::Heartbeat);
    deliver(&mut member, 5, &land_at(waypoints()[0]));
    assert_eq!(member.durable.state, State::MovingToLand);
    stimulate(&mut member, 101.0, Stimulus::Timeout);
    assert_eq!(member.durable.state, State::Landing);
}

#[test]
fn master_without_elections_lands_with_its_swarm() {
    let mut master = master_taking_off();
    let transmits = send(&mut master, 20.0, Input::GiveUp);
    assert_eq!(orders(&transmits), [land_at(waypoints()[0])]);
    assert_eq!(master.durable.state, State::Landing);
}

#[test]
fn leg_to_landing_place_is_flown_in_own_layer() {
    let mut config = config(0, Liveness::Heartbeat);
    let drones = NonZeroU32::new(40).unwrap();
    let separation = Separation {
        horizontal_m: 5.0,
        vertical_m: 5.0,
    };
    let formation = Formation::new(Kind::CompactMatrix, drones, 40.0, 0.0);
    config.layout = Arc::new(Layout::new(formation, 10.0, separation));
    let layers_m = config.layout.landing_layers_m();
    let (id, layer_m) = (0..)
        .zip(layers_m)
        .find(|(id, layer_m)| *id != INITIAL_BALLOT.master.0 && **layer_m > 0.0)
        .expect("a matrix of 40 has landing layers");
    config.id = NodeId(id);
    let expected_m = 25.0 + layer_m;
    let mut member = Mission::new(config, None);
    deliver(&mut member, 1, &complete_plan());
    deliver(&mut member, 2, &Order::TakeOff { wave: 0 });
    arrive(&mut member, 20.0);
    let at = waypoints()[2];
    let transmits = deliver(&mut member, 3, &land_at(at));
    let goal = transmits.iter().find_map(|transmit| match transmit {
        Transmit::Goal(Goal::TransitTo { to }) => Some(to.altitude_m()),
        _ => None,
    });
    assert_eq!(goal, Some(expected_m));
}
