use super::*;

/// Drone `id` of three, which elect, at waypoint 0 or on its way to 1.
fn elects(id: u32, moves: bool) -> Mission {
    let config = Config {
        succession: Succession::Elect,
        ..config(id, Liveness::Heartbeat)
    };
    let mut slave = Mission::new(config, None);
    ordered(&mut slave, 1, &whole_plan());
    ordered(&mut slave, 2, &Order::TakeOff { wave: 0 });
    arrives(&mut slave, 20.0);
    hears(&mut slave, 30.0, RoutingNotice::RoutesReady);
    ordered(
        &mut slave,
        3,
        &Order::Move {
            waypoint: 0,
            apart: false,
        },
    );
    if moves {
        ordered(
            &mut slave,
            4,
            &Order::Move {
                waypoint: 1,
                apart: false,
            },
        );
    }
    slave
}

fn arrives(mission: &mut Mission, at_s: f64) -> Vec<Transmit> {
    told(mission, at_s, Input::Navigation(NavigationNotice::Arrived))
}

fn failing(failure: Failure, stop: Ned, is_airborne: bool) -> Input {
    Input::Navigation(NavigationNotice::Failing {
        failure,
        stop,
        is_airborne,
    })
}

/// What a drone says and shows to a failure in the air.
fn fails(mission: &mut Mission, failure: Failure) -> (Vec<Transmit>, Vec<LandingReason>) {
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
fn a_drone_whose_battery_is_low_flies_its_leg_to_the_end_and_lands_from_there() {
    let mut slave = elects(0, true);
    assert_eq!(fails(&mut slave, Failure::BatteryLow), (vec![], vec![]));
    assert_eq!(
        slave.durable.state,
        State::MovingToWaypoint { waypoint: 1 },
        "in lockstep: stopping would put it in others' way"
    );
    let said = arrives(&mut slave, 60.0);
    let slot = slave.config.layout.slot(NodeId(0), waypoints()[1]);
    let to = slot.at_altitude(25.0 - PITCH_M);
    assert_eq!(
        said,
        [Transmit::Goal(Goal::TransitTo { to })],
        "the others wait until it is below them"
    );
    // It never rejoins.
    ordered(
        &mut slave,
        5,
        &Order::Move {
            waypoint: 2,
            apart: false,
        },
    );
    assert_eq!(slave.durable.state, State::MovingToLand);
    let said = arrives(&mut slave, 80.0);
    assert!(
        said.contains(&Transmit::Land),
        "nobody waits for it any more"
    );
    assert_eq!(slave.durable.state, State::Landing);
}

#[test]
fn a_drone_that_waits_at_a_waypoint_with_a_low_battery_goes_at_once() {
    let mut slave = elects(0, false);
    let (_, reasons) = fails(&mut slave, Failure::BatteryLow);
    assert_eq!(reasons, [LandingReason::BatteryLow]);
    assert_eq!(slave.durable.state, State::MovingToLand);
}

#[test]
fn of_several_failures_the_most_severe_decides() {
    let mut slave = elects(0, false);
    fails(&mut slave, Failure::BatteryLow);
    let (said, reasons) = fails(&mut slave, Failure::BatteryCritical);
    assert!(said.contains(&Transmit::Goal(Goal::Land)));
    assert_eq!(reasons, [LandingReason::BatteryCritical]);
    for milder in [
        Failure::BatteryLow,
        Failure::Geofence,
        Failure::PositionLost,
    ] {
        assert_eq!(fails(&mut slave, milder), (vec![], vec![]));
        assert_eq!(slave.durable.state, State::Landing);
    }
}

#[test]
fn a_drone_that_does_not_know_where_it_is_lands_on_the_spot() {
    let mut slave = elects(0, true);
    let (said, reasons) = fails(&mut slave, Failure::PositionLost);
    assert!(said.contains(&Transmit::Goal(Goal::Land)));
    assert_eq!(reasons, [LandingReason::PositionLost]);
    assert!(
        !said.contains(&Transmit::Land),
        "the swarm waits until it is down"
    );
    let said = told(
        &mut slave,
        80.0,
        Input::Navigation(NavigationNotice::Landed),
    );
    assert!(said.contains(&Transmit::Stop));
}

#[test]
fn a_drone_stopped_at_its_fence_lands_around_where_it_was_stopped_and_at_a_second_breach_on_the_spot()
 {
    let mut slave = elects(0, true);
    let (said, reasons) = fails(&mut slave, Failure::Geofence);
    let to = Ned::new(50.0, -100.0, -25.0 + PITCH_M);
    assert!(said.contains(&Transmit::Goal(Goal::TransitTo { to })));
    assert_eq!(reasons, [LandingReason::Geofence]);
    let (said, _) = fails(&mut slave, Failure::Geofence);
    assert!(said.contains(&Transmit::Goal(Goal::Land)));
}

#[test]
fn a_low_battery_on_the_ground_never_takes_off() {
    let mut slave = mission(0, Liveness::Heartbeat);
    ordered(&mut slave, 1, &whole_plan());
    let said = told(
        &mut slave,
        5.0,
        failing(Failure::BatteryLow, Ned::HOME, false),
    );
    assert_eq!(said, [Transmit::Land, Transmit::Stop]);
    ordered(&mut slave, 2, &Order::TakeOff { wave: 0 });
    assert_eq!(slave.durable.state, State::Finished);
    // Nor does one that was told to and has not armed yet.
    let mut slave = mission(0, Liveness::Heartbeat);
    ordered(&mut slave, 1, &whole_plan());
    ordered(&mut slave, 2, &Order::TakeOff { wave: 0 });
    let said = told(
        &mut slave,
        5.0,
        failing(Failure::BatteryLow, Ned::HOME, false),
    );
    assert!(said.contains(&Transmit::Goal(Goal::Land)));
}

/// A master that elections may replace, on its way to waypoint 1.
fn master() -> Mission {
    let mut master = elects(1, true);
    hears(&mut master, 40.0, RoutingNotice::MasterSilent);
    assert!(master.durable.lead.is_some());
    master
}

#[test]
fn a_master_that_must_land_leaves_its_swarm_to_another_where_there_are_elections() {
    for input in [
        Input::GiveUp,
        failing(Failure::BatteryCritical, waypoints()[1], true),
    ] {
        let mut master = master();
        let said = told(&mut master, 41.0, input);
        assert_eq!(orders(&said), [], "the others fly on");
        assert!(said.contains(&Transmit::Land), "and know at once");
        assert_eq!(master.durable.state, State::Landing);
    }
}

#[test]
fn a_drone_that_is_called_down_lands_where_it_is_or_stays_on_the_ground_and_no_order_changes_that()
{
    let come_down = || Input::ComeDown(LandingReason::Recalled);
    let mut slave = elects(0, true);
    let said = told(&mut slave, 41.0, come_down());
    assert!(said.contains(&Transmit::Goal(Goal::Land)));
    assert!(said.contains(&Transmit::Land), "nobody is to wait for it");
    assert_eq!(told(&mut slave, 42.0, come_down()), [], "it is on its way");
    assert_eq!(slave.durable.state, State::Landing);
    let mut slave = mission(0, Liveness::Heartbeat);
    told(&mut slave, 0.0, come_down());
    assert_eq!(slave.durable.state, State::Finished);
    ordered(&mut slave, 1, &whole_plan());
    ordered(&mut slave, 2, &Order::TakeOff { wave: 0 });
    assert_eq!(slave.durable.state, State::Finished);
}

#[test]
fn whoever_hears_that_the_master_lands_claims_at_once_unless_it_was_told_to_land_itself() {
    let mut slave = elects(0, true);
    let said = hears(&mut slave, 41.0, RoutingNotice::MasterLands);
    assert!(matches!(said[0], Transmit::Lead(_)), "{said:?}");
    let mut slave = elects(0, true);
    ordered(&mut slave, 5, &land_at(waypoints()[1]));
    assert_eq!(hears(&mut slave, 41.0, RoutingNotice::MasterLands), []);
    // Without elections a master takes its swarm down with it.
    let mut slave = slave_at_waypoint_0(Liveness::Heartbeat);
    assert_eq!(hears(&mut slave, 41.0, RoutingNotice::MasterLands), []);
}

#[test]
fn a_drone_alone_flies_on_or_goes_to_land_as_it_was_told() {
    for (alone, state) in [
        (Alone::CarryOn, State::MovingToWaypoint { waypoint: 2 }),
        (Alone::Land, State::MovingToLand),
    ] {
        let mut master = master();
        master.config.alone = alone;
        hears(&mut master, 50.0, RoutingNotice::Silent(NodeId(0).into()));
        hears(&mut master, 50.0, RoutingNotice::Silent(NodeId(2).into()));
        assert_eq!(
            master.durable.state,
            State::MovingToWaypoint { waypoint: 1 }
        );
        arrives(&mut master, 60.0);
        assert_eq!(master.durable.state, state, "{alone:?}");
    }
}

#[test]
fn a_drone_is_not_alone_while_it_hears_one_other_nor_if_there_never_was_any() {
    let mut master = master();
    master.config.alone = Alone::Land;
    hears(&mut master, 50.0, RoutingNotice::Silent(NodeId(0).into()));
    arrives(&mut master, 60.0);
    assert_eq!(
        master.durable.state,
        State::WaypointReached { waypoint: 1 },
        "it waits for the other"
    );
    // On the way alone, but no longer when it arrives.
    let mut master = self::master();
    master.config.alone = Alone::Land;
    hears(&mut master, 50.0, RoutingNotice::Silent(NodeId(0).into()));
    hears(&mut master, 50.0, RoutingNotice::Silent(NodeId(2).into()));
    hears(&mut master, 55.0, RoutingNotice::Returned(NodeId(2).into()));
    arrives(&mut master, 60.0);
    assert_eq!(master.durable.state, State::WaypointReached { waypoint: 1 });
}

#[test]
fn a_leg_that_a_stalled_host_was_late_to_look_at_gets_as_much_time_again() {
    let mut slave = elects(0, true);
    // Its limit was at 101 s.
    stimulate(&mut slave, 104.0, Stimulus::Timeout);
    assert_eq!(slave.durable.state, State::MovingToWaypoint { waypoint: 1 });
    stimulate(&mut slave, 107.0, Stimulus::Timeout);
    assert_eq!(slave.durable.state, State::Landing);
}

#[test]
fn the_way_to_a_landing_of_ones_own_has_its_limit() {
    let mut slave = elects(0, false);
    fails(&mut slave, Failure::BatteryLow);
    stimulate(&mut slave, 142.0, Stimulus::Timeout);
    assert_eq!(slave.durable.state, State::Landing);
}

#[test]
fn a_drone_that_has_flown_for_as_long_as_it_may_goes_to_land_from_its_slot() {
    for moves in [false, true] {
        let mut slave = elects(0, moves);
        let until = slave.durable.flies_until.unwrap();
        assert_eq!(until, Timestamp::from_secs_f64(1.0) + 2_000 * SECOND);
        // The legs that it flew meanwhile were in time.
        slave.durable.limit = None;
        stimulate(&mut slave, 2_001.0, Stimulus::Timeout);
        if moves {
            let bound_for = State::MovingToWaypoint { waypoint: 1 };
            assert_eq!(slave.durable.state, bound_for, "it flies its leg");
            arrives(&mut slave, 2_010.0);
        }
        assert_eq!(slave.durable.state, State::MovingToLand);
        assert_eq!(slave.durable.leaving, Some(LandingReason::FlightTime));
    }
}

#[test]
fn a_drone_that_does_not_get_to_its_slot_after_its_flight_time_lands_on_the_spot() {
    let mut slave = elects(0, true);
    slave.durable.limit = None;
    stimulate(&mut slave, 2_001.0, Stimulus::Timeout);
    let (said, events) = stimulate(&mut slave, 2_101.0, Stimulus::Timeout);
    assert!(said.contains(&Transmit::Goal(Goal::Land)), "{said:?}");
    assert!(events.contains(&Event::Landing(LandingReason::FlightTime)));
}

#[test]
fn whoever_lands_in_a_layer_of_its_own_does_so_where_nobody_s_way_leads() {
    // One behind the other, and all ways lead north.
    let drones = NonZeroU32::new(3).unwrap();
    let formation = Formation::new(Kind::Linear, drones, 50.0, std::f64::consts::FRAC_PI_2);
    let mut config = config(0, Liveness::Heartbeat);
    let layout = Layout::new(formation, 10.0, config.layout.separation());
    config.layout = Arc::new(layout.with_layers(Layering::Each));
    let flies_apart = || {
        let mut slave = Mission::new(config.clone(), None);
        ordered(&mut slave, 1, &whole_plan());
        ordered(&mut slave, 2, &Order::TakeOff { wave: 0 });
        let arrived = Input::Navigation(NavigationNotice::Arrived);
        told(&mut slave, 20.0, arrived);
        let (waypoint, apart) = (0, true);
        ordered(&mut slave, 3, &Order::Move { waypoint, apart });
        slave
    };
    let aside_m = |said: &[Transmit]| match goal(said) {
        Some(Goal::TransitTo { to }) => {
            assert!(to.altitude_m() > 25.0, "it makes for it in its layer");
            to.0.y.abs()
        }
        other => panic!("{other:?}"),
    };
    let said = ordered(&mut flies_apart(), 4, &land_at(waypoints()[2]));
    assert!((5.0..=10.0).contains(&aside_m(&said)), "{said:?}");
    let battery_low = NavigationNotice::Failing {
        failure: Failure::BatteryLow,
        stop: Ned::HOME,
        is_airborne: true,
    };
    let said = told(&mut flies_apart(), 40.0, Input::Navigation(battery_low));
    assert!((5.0..=10.0).contains(&aside_m(&said)), "{said:?}");
}

#[test]
fn told_to_land_on_its_way_up_a_member_flies_that_to_its_end_and_lands_below_its_slot() {
    let config = config(1, Liveness::Heartbeat);
    let mut slave = Mission::new(config, None);
    ordered(&mut slave, 1, &whole_plan());
    ordered(&mut slave, 2, &Order::TakeOff { wave: 0 });
    let said = ordered(&mut slave, 3, &land_at(waypoints()[0]));
    assert_eq!((slave.durable.state, goal(&said)), (State::TakingOff, None));
    assert_eq!(slave.durable.leaving, Some(LandingReason::MissionOver));
    hears(&mut slave, 15.0, RoutingNotice::MasterSilent);
    let there = arrives(&mut slave, 20.0);
    assert_eq!(slave.durable.state, State::MovingToLand);
    let Some(Goal::TransitTo { to }) = goal(&there) else {
        panic!("{there:?}");
    };
    let slot = slave.layout().slot(NodeId(1), waypoints()[0]);
    assert!(to.horizontal_distance_m(slot) < 1e-9 && to.altitude_m() < slot.altitude_m());
}
