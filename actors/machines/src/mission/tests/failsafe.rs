use super::*;

/// Drone `id` of three with elections, at waypoint 0 or (`moves`) on the leg to waypoint 1.
fn member_with_elections(id: u32, moves: bool) -> Mission {
    let config = Config {
        succession: Succession::Elect,
        ..config(id, Liveness::Heartbeat)
    };
    let mut member = member_at_open_waypoint(config);
    if moves {
        deliver(&mut member, 4, &open_waypoint(1));
    }
    member
}

pub(super) fn failing(failure: Failure, stop: Ned, is_airborne: bool) -> Input {
    Input::Navigation(NavigationNotice::Failing {
        failure,
        stop,
        is_airborne,
    })
}

/// Outputs and landing reasons after a failure in the air.
fn inject_failure(mission: &mut Mission, failure: Failure) -> (Vec<Transmit>, Vec<LandingReason>) {
    let stop = Ned::new(50.0, -100.0, -25.0);
    let failing = Stimulus::Input(failing(failure, stop, true));
    let (transmits, events) = stimulate(mission, 42.0, failing);
    let reasons = events.into_iter().filter_map(|event| match event {
        Event::Landing(reason) => Some(reason),
        _ => None,
    });
    (transmits, reasons.collect())
}

#[test]
fn drone_with_low_battery_completes_its_leg_and_lands() {
    let mut member = member_with_elections(0, true);
    assert_eq!(
        inject_failure(&mut member, Failure::BatteryLow),
        (vec![], vec![])
    );
    assert_eq!(
        member.durable.state,
        State::MovingToWaypoint { waypoint: 1 },
        "in lockstep, stopping would block the others"
    );
    let transmits = arrive(&mut member, 60.0);
    let slot = member.config.layout.slot(NodeId(0), waypoints()[1]);
    let to = slot.at_altitude(25.0 - LAYER_SPACING_M);
    assert_eq!(
        transmits,
        [Transmit::Goal(Goal::TransitTo { to })],
        "the others wait until it is below them"
    );
    // It never rejoins the swarm.
    deliver(&mut member, 5, &open_waypoint(2));
    assert_eq!(member.durable.state, State::MovingToLand);
    let transmits = arrive(&mut member, 80.0);
    assert!(
        transmits.contains(&Transmit::Land),
        "the others stop waiting"
    );
    assert_eq!(member.durable.state, State::Landing);
}

#[test]
fn waiting_drone_with_low_battery_leaves_at_once() {
    let mut member = member_with_elections(0, false);
    let (_, reasons) = inject_failure(&mut member, Failure::BatteryLow);
    assert_eq!(reasons, [LandingReason::BatteryLow]);
    assert_eq!(member.durable.state, State::MovingToLand);
}

#[test]
fn most_severe_failure_decides() {
    let mut member = member_with_elections(0, false);
    inject_failure(&mut member, Failure::BatteryLow);
    let (transmits, reasons) = inject_failure(&mut member, Failure::BatteryCritical);
    assert!(transmits.contains(&Transmit::Goal(Goal::Land)));
    assert_eq!(reasons, [LandingReason::BatteryCritical]);
    for milder in [
        Failure::BatteryLow,
        Failure::Geofence,
        Failure::PositionLost,
    ] {
        assert_eq!(inject_failure(&mut member, milder), (vec![], vec![]));
        assert_eq!(member.durable.state, State::Landing);
    }
}

#[test]
fn drone_without_position_lands_on_the_spot() {
    let mut member = member_with_elections(0, true);
    let (transmits, reasons) = inject_failure(&mut member, Failure::PositionLost);
    assert!(transmits.contains(&Transmit::Goal(Goal::Land)));
    assert_eq!(reasons, [LandingReason::PositionLost]);
    assert_eq!(
        member.durable.landing.reason,
        Some(LandingReason::PositionLost),
        "for a process that restarts meanwhile"
    );
    assert!(
        !transmits.contains(&Transmit::Land),
        "the swarm waits until touchdown"
    );
    let transmits = send(
        &mut member,
        80.0,
        Input::Navigation(NavigationNotice::Landed),
    );
    assert!(transmits.contains(&Transmit::Stop));
}

#[test]
fn drone_at_its_fence_lands_there_and_on_the_spot_at_a_second_breach() {
    let mut member = member_with_elections(0, true);
    let (transmits, reasons) = inject_failure(&mut member, Failure::Geofence);
    let to = Ned::new(50.0, -100.0, -25.0 + LAYER_SPACING_M);
    assert!(transmits.contains(&Transmit::Goal(Goal::TransitTo { to })));
    assert_eq!(reasons, [LandingReason::Geofence]);
    let (transmits, _) = inject_failure(&mut member, Failure::Geofence);
    assert!(transmits.contains(&Transmit::Goal(Goal::Land)));
}

#[test]
fn drone_with_low_battery_never_takes_off() {
    let mut member = mission(0, Liveness::Heartbeat);
    deliver(&mut member, 1, &complete_plan());
    let transmits = send(
        &mut member,
        5.0,
        failing(Failure::BatteryLow, Ned::HOME, false),
    );
    assert_eq!(transmits, [Transmit::Land, Transmit::Stop]);
    deliver(&mut member, 2, &Order::TakeOff { wave: 0 });
    assert_eq!(member.durable.state, State::Finished);
    // Likewise before arming, after the order to take off.
    let mut member = mission(0, Liveness::Heartbeat);
    deliver(&mut member, 1, &complete_plan());
    deliver(&mut member, 2, &Order::TakeOff { wave: 0 });
    let transmits = send(
        &mut member,
        5.0,
        failing(Failure::BatteryLow, Ned::HOME, false),
    );
    assert!(transmits.contains(&Transmit::Goal(Goal::Land)));
}

/// A master with elections, on the leg to waypoint 1.
fn master() -> Mission {
    let mut master = member_with_elections(1, true);
    notify(&mut master, 40.0, RoutingNotice::MasterSilent);
    assert!(master.durable.lead.is_some());
    master
}

#[test]
fn master_with_elections_lands_without_its_swarm() {
    for input in [
        Input::GiveUp,
        failing(Failure::BatteryCritical, waypoints()[1], true),
    ] {
        let mut master = master();
        let transmits = send(&mut master, 41.0, input);
        assert_eq!(orders(&transmits), [], "the others fly on");
        assert!(transmits.contains(&Transmit::Land), "the others are told");
        assert_eq!(master.durable.state, State::Landing);
    }
}

#[test]
fn aborted_drone_lands_on_the_spot_or_stays_on_the_ground() {
    let come_down = || Input::Abort(LandingReason::Recalled);
    let mut member = member_with_elections(0, true);
    let transmits = send(&mut member, 41.0, come_down());
    assert!(transmits.contains(&Transmit::Goal(Goal::Land)));
    assert!(
        transmits.contains(&Transmit::Land),
        "the others stop waiting"
    );
    assert_eq!(send(&mut member, 42.0, come_down()), [], "already landing");
    assert_eq!(member.durable.state, State::Landing);
    let mut member = mission(0, Liveness::Heartbeat);
    send(&mut member, 0.0, come_down());
    assert_eq!(member.durable.state, State::Finished);
    deliver(&mut member, 1, &complete_plan());
    deliver(&mut member, 2, &Order::TakeOff { wave: 0 });
    assert_eq!(member.durable.state, State::Finished);
}

#[test]
fn landing_master_is_replaced_at_once_unless_the_swarm_lands_too() {
    let mut member = member_with_elections(0, true);
    let transmits = notify(&mut member, 41.0, RoutingNotice::MasterLands);
    assert!(matches!(transmits[0], Transmit::Lead(_)), "{transmits:?}");
    let mut member = member_with_elections(0, true);
    deliver(&mut member, 5, &land_at(waypoints()[1]));
    assert_eq!(notify(&mut member, 41.0, RoutingNotice::MasterLands), []);
    // Without elections the master orders the swarm to land.
    let mut member = member_at_waypoint_0(Liveness::Heartbeat);
    assert_eq!(notify(&mut member, 41.0, RoutingNotice::MasterLands), []);
}

#[test]
fn lone_drone_flies_on_or_lands_as_configured() {
    for (alone, state) in [
        (Alone::CarryOn, State::MovingToWaypoint { waypoint: 2 }),
        (Alone::Land, State::MovingToLand),
    ] {
        let mut master = master();
        master.config.alone = alone;
        notify(&mut master, 50.0, RoutingNotice::Silent(NodeId(0).into()));
        notify(&mut master, 50.0, RoutingNotice::Silent(NodeId(2).into()));
        assert_eq!(
            master.durable.state,
            State::MovingToWaypoint { waypoint: 1 }
        );
        arrive(&mut master, 60.0);
        if alone == Alone::CarryOn {
            // In its layer.
            arrive(&mut master, 61.0);
        }
        assert_eq!(master.durable.state, state, "{alone:?}");
    }
}

#[test]
fn drone_that_hears_one_other_is_not_alone() {
    let mut master = master();
    master.config.alone = Alone::Land;
    notify(&mut master, 50.0, RoutingNotice::Silent(NodeId(0).into()));
    arrive(&mut master, 60.0);
    assert_eq!(
        master.durable.state,
        State::WaypointReached { waypoint: 1 },
        "it waits for drone 2"
    );
    // Alone on the leg, but not on arrival.
    let mut master = self::master();
    master.config.alone = Alone::Land;
    notify(&mut master, 50.0, RoutingNotice::Silent(NodeId(0).into()));
    notify(&mut master, 50.0, RoutingNotice::Silent(NodeId(2).into()));
    notify(&mut master, 55.0, RoutingNotice::Returned(NodeId(2).into()));
    arrive(&mut master, 60.0);
    assert_eq!(master.durable.state, State::WaypointReached { waypoint: 1 });
}

#[test]
fn leg_limit_is_extended_by_a_stall() {
    let mut member = member_with_elections(0, true);
    // The limit was 101 s.
    stimulate(&mut member, 104.0, Stimulus::Timeout);
    assert_eq!(
        member.durable.state,
        State::MovingToWaypoint { waypoint: 1 }
    );
    stimulate(&mut member, 107.0, Stimulus::Timeout);
    assert_eq!(member.durable.state, State::Landing);
}

#[test]
fn leg_to_separate_landing_has_a_limit() {
    let mut member = member_with_elections(0, false);
    inject_failure(&mut member, Failure::BatteryLow);
    stimulate(&mut member, 142.0, Stimulus::Timeout);
    assert_eq!(member.durable.state, State::Landing);
}

#[test]
fn drone_lands_from_its_slot_after_its_flight_time() {
    for moves in [false, true] {
        let mut member = member_with_elections(0, moves);
        let until = member.durable.deadlines.flight_ends_at.unwrap();
        assert_eq!(until, Timestamp::from_secs_f64(1.0) + 2_000 * SECOND);
        // No overdue leg before.
        member.durable.deadlines.limit = None;
        stimulate(&mut member, 2_001.0, Stimulus::Timeout);
        if moves {
            let bound_for = State::MovingToWaypoint { waypoint: 1 };
            assert_eq!(member.durable.state, bound_for, "it completes its leg");
            arrive(&mut member, 2_010.0);
        }
        assert_eq!(member.durable.state, State::MovingToLand);
        assert_eq!(
            member.durable.landing.reason,
            Some(LandingReason::FlightTime)
        );
    }
}

#[test]
fn drone_not_in_slot_one_leg_after_its_flight_time_lands_on_the_spot() {
    let mut member = member_with_elections(0, true);
    member.durable.deadlines.limit = None;
    stimulate(&mut member, 2_001.0, Stimulus::Timeout);
    let (transmits, events) = stimulate(&mut member, 2_101.0, Stimulus::Timeout);
    assert!(
        transmits.contains(&Transmit::Goal(Goal::Land)),
        "{transmits:?}"
    );
    assert!(events.contains(&Event::Landing(LandingReason::FlightTime)));
}

#[test]
fn landing_out_of_lockstep_avoids_the_others_paths() {
    // In a line along the direction of flight.
    let drones = NonZeroU32::new(3).unwrap();
    let formation = Formation::new(Kind::Linear, drones, 50.0, std::f64::consts::FRAC_PI_2);
    let mut config = config(0, Liveness::Heartbeat);
    let layout = Layout::new(formation, 10.0, config.layout.separation());
    config.layout = Arc::new(layout.with_layers(Layering::PerDrone));
    let member_out_of_lockstep = || {
        let mut member = Mission::new(config.clone(), None);
        deliver(&mut member, 1, &complete_plan());
        deliver(&mut member, 2, &Order::TakeOff { wave: 0 });
        arrive(&mut member, 20.0);
        let (waypoint, apart) = (0, true);
        deliver(&mut member, 3, &Order::Move { waypoint, apart });
        member
    };
    let offset_m = |transmits: &[Transmit]| match goal(transmits) {
        Some(Goal::TransitTo { to }) => {
            assert!(to.altitude_m() > 25.0, "it flies there in its layer");
            to.0.y.abs()
        }
        other => panic!("{other:?}"),
    };
    let transmits = deliver(&mut member_out_of_lockstep(), 4, &land_at(waypoints()[2]));
    assert!(
        (5.0..=10.0).contains(&offset_m(&transmits)),
        "{transmits:?}"
    );
    let battery_low = NavigationNotice::Failing {
        failure: Failure::BatteryLow,
        stop: Ned::HOME,
        is_airborne: true,
    };
    let transmits = send(
        &mut member_out_of_lockstep(),
        40.0,
        Input::Navigation(battery_low),
    );
    assert!(
        (5.0..=10.0).contains(&offset_m(&transmits)),
        "{transmits:?}"
    );
}

#[test]
fn member_ordered_to_land_during_take_off_lands_below_its_slot() {
    let config = config(1, Liveness::Heartbeat);
    let mut member = Mission::new(config, None);
    deliver(&mut member, 1, &complete_plan());
    deliver(&mut member, 2, &Order::TakeOff { wave: 0 });
    let transmits = deliver(&mut member, 3, &land_at(waypoints()[0]));
    assert_eq!(
        (member.durable.state, goal(&transmits)),
        (State::TakingOff, None)
    );
    assert_eq!(
        member.durable.landing.reason,
        Some(LandingReason::MissionOver)
    );
    notify(&mut member, 15.0, RoutingNotice::MasterSilent);
    let arrival_transmits = arrive(&mut member, 20.0);
    assert_eq!(member.durable.state, State::MovingToLand);
    let Some(Goal::TransitTo { to }) = goal(&arrival_transmits) else {
        panic!("{arrival_transmits:?}");
    };
    let slot = member.layout().slot(NodeId(1), waypoints()[0]);
    assert!(to.horizontal_distance_m(slot) < 1e-9 && to.altitude_m() < slot.altitude_m());
}
