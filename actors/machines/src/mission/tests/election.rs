use super::*;

const fn ballot(term: u32, rank: u32, master: u32) -> Ballot {
    Ballot {
        term,
        rank,
        master: NodeId(master),
    }
}

fn elects(id: u32) -> Mission {
    defers(id, Duration::ZERO)
}

/// On its way to waypoint 0, a drone that leaves it to others to lead for so long.
fn defers(id: u32, candidacy_back_off: Duration) -> Mission {
    let config = Config {
        succession: Succession::Elect,
        candidacy_back_off,
        ..config(id, Liveness::Heartbeat)
    };
    let mut slave = Mission::new(config, None);
    ordered(&mut slave, 1, &whole_plan());
    ordered(&mut slave, 2, &Order::TakeOff { wave: 0 });
    told(
        &mut slave,
        20.0,
        Input::Navigation(NavigationNotice::Arrived),
    );
    hears(&mut slave, 30.0, RoutingNotice::RoutesReady);
    ordered(
        &mut slave,
        3,
        &Order::Move {
            waypoint: 0,
            apart: false,
        },
    );
    slave
}

fn order_of(master: Ballot, sequence: u32, order: &Order) -> RoutingNotice {
    RoutingNotice::Order {
        ballot: master,
        sequence,
        order: wire::encode_order(order).into(),
    }
}

fn acknowledged(transmits: &[Transmit]) -> Vec<u32> {
    let sequences = transmits.iter().filter_map(|transmit| match transmit {
        Transmit::Acknowledge { sequence, .. } => Some(*sequence),
        _ => None,
    });
    sequences.collect()
}

#[test]
fn whoever_misses_the_master_leads_under_a_better_ballot_and_gives_its_own_order_again() {
    let mut slave = elects(0);
    ordered(
        &mut slave,
        4,
        &Order::Move {
            waypoint: 1,
            apart: false,
        },
    );
    let said = hears(&mut slave, 40.0, RoutingNotice::MasterSilent);
    // Next to the centre, with the smaller number: the first in succession.
    assert_eq!(said[0], Transmit::Lead(ballot(2, 1, 0)));
    assert_eq!(
        orders(&said),
        [Order::Move {
            waypoint: 1,
            apart: false
        }]
    );
    assert!(ballot(2, 1, 0).beats(&ballot(1, 0, 1)));
    // On its way it acknowledges nothing; once there it waits for the others.
    assert!(acknowledged(&said).is_empty());
    let said = told(
        &mut slave,
        60.0,
        Input::Navigation(NavigationNotice::Arrived),
    );
    assert_eq!(acknowledged(&said), [1]);
    assert_eq!(orders(&said), []);
    hears(&mut slave, 61.0, RoutingNotice::Silent(NodeId(1).into()));
    let said = hears(&mut slave, 62.0, progress(2, 1));
    let (waypoint, apart) = (2, true);
    assert_eq!(orders(&said), [Order::Move { waypoint, apart }]);
}

#[test]
fn whoever_claims_once_its_patience_has_ended_climbs_at_once() {
    let config = Config {
        succession: Succession::Elect,
        spreading_patience: Duration::from_secs(6),
        ..config(0, Liveness::Heartbeat)
    };
    let mut slave = Mission::new(config, None);
    ordered(&mut slave, 1, &whole_plan());
    ordered(&mut slave, 2, &Order::TakeOff { wave: 0 });
    let arrived = Input::Navigation(NavigationNotice::Arrived);
    told(&mut slave, 20.0, arrived);
    assert_eq!(hears(&mut slave, 21.0, RoutingNotice::MasterSilent), []);
    let (said, _) = stimulate(&mut slave, 27.0, Stimulus::Timeout);
    assert!(said.contains(&Transmit::Lead(ballot(2, 1, 0))));
    assert!(matches!(goal(&said), Some(Goal::TransitTo { .. })));
}

#[test]
fn whoever_would_lead_rather_is_given_time_to_say_so() {
    let misses_master = |id| {
        let mut slave = defers(id, Duration::from_millis(10));
        let said = hears(&mut slave, 40.0, RoutingNotice::MasterSilent);
        (slave, said)
    };
    // The master that is missed is waited for no more.
    let (_, said) = misses_master(0);
    assert_eq!(said[0], Transmit::Lead(ballot(2, 1, 0)));
    let (mut slave, said) = misses_master(2);
    assert_eq!(said, []);
    let (said, _) = stimulate(&mut slave, 40.009, Stimulus::Timeout);
    assert_eq!(said, []);
    let (said, _) = stimulate(&mut slave, 40.01, Stimulus::Timeout);
    assert_eq!(said[0], Transmit::Lead(ballot(2, 2, 2)));
    // Nor has it anything to say once another leads.
    let (mut slave, _) = misses_master(2);
    hears(&mut slave, 40.005, RoutingNotice::Leader(ballot(2, 1, 0)));
    let (said, _) = stimulate(&mut slave, 40.01, Stimulus::Timeout);
    assert_eq!(said, []);
}

#[test]
fn a_member_ahead_of_the_new_master_acknowledges_at_once_and_holds() {
    let mut slave = elects(0);
    ordered(
        &mut slave,
        4,
        &Order::Move {
            waypoint: 1,
            apart: false,
        },
    );
    // It is on its way to waypoint 1 when another leads that has not heard of that yet.
    let new = ballot(2, 2, 2);
    let said = hears(
        &mut slave,
        41.0,
        order_of(
            new,
            1,
            &Order::Move {
                waypoint: 0,
                apart: false,
            },
        ),
    );
    assert_eq!(acknowledged(&said), [1]);
    let said = told(
        &mut slave,
        60.0,
        Input::Navigation(NavigationNotice::Arrived),
    );
    let [Transmit::Scatter, Transmit::Goal(Goal::TransitTo { to })] = said[..] else {
        panic!("{said:?}");
    };
    let slot = slave.config.layout.slot(NodeId(0), waypoints()[1]);
    assert!(
        to.horizontal_distance_m(slot) < 0.01,
        "it holds there, in its layer"
    );
    assert!(to.altitude_m() > slot.altitude_m() + 5.0);
    let said = hears(
        &mut slave,
        70.0,
        order_of(
            new,
            2,
            &Order::Move {
                waypoint: 1,
                apart: false,
            },
        ),
    );
    assert_eq!(acknowledged(&said), [2]);
}

#[test]
fn a_member_behind_flies_the_opened_waypoints_in_order() {
    let mut slave = elects(0);
    let new = ballot(2, 2, 2);
    hears(
        &mut slave,
        41.0,
        order_of(
            new,
            1,
            &Order::Move {
                waypoint: 2,
                apart: false,
            },
        ),
    );
    assert_eq!(slave.durable.state, State::MovingToWaypoint { waypoint: 1 });
    told(
        &mut slave,
        60.0,
        Input::Navigation(NavigationNotice::Arrived),
    );
    assert_eq!(slave.durable.state, State::MovingToWaypoint { waypoint: 2 });
    let said = told(
        &mut slave,
        80.0,
        Input::Navigation(NavigationNotice::Arrived),
    );
    assert_eq!(acknowledged(&said), [1]);
}

#[test]
fn a_master_that_hears_of_a_better_ballot_steps_down_and_one_of_a_worse_does_not() {
    let mut master = elects(0);
    hears(&mut master, 40.0, RoutingNotice::MasterSilent);
    assert!(master.durable.lead.is_some());
    hears(&mut master, 41.0, RoutingNotice::Leader(ballot(2, 2, 2)));
    assert!(master.durable.lead.is_some(), "the smaller rank wins");
    hears(
        &mut master,
        42.0,
        order_of(
            ballot(1, 0, 1),
            9,
            &Order::Move {
                waypoint: 2,
                apart: false,
            },
        ),
    );
    assert_eq!(master.durable.leader.ballot(), Some(ballot(2, 1, 0)));
    hears(&mut master, 43.0, RoutingNotice::Leader(ballot(3, 2, 2)));
    assert!(master.durable.lead.is_none());
    assert_eq!(master.durable.leader.ballot(), Some(ballot(3, 2, 2)));
    // Whose orders it obeys from then on.
    let order = Order::Move {
        waypoint: 1,
        apart: false,
    };
    hears(&mut master, 44.0, order_of(ballot(3, 2, 2), 1, &order));
    assert_eq!(
        master.durable.state,
        State::MovingToWaypoint { waypoint: 1 }
    );
}

#[test]
fn the_ballot_that_a_drone_obeys_outlives_its_mission() {
    let mut slave = elects(0);
    let (_, events) = stimulate(
        &mut slave,
        41.0,
        Stimulus::Input(Input::Routing(RoutingNotice::Leader(ballot(4, 2, 2)))),
    );
    let checkpoint = events.into_iter().find_map(|event| match event {
        Event::Checkpoint(checkpoint) => Some(*checkpoint),
        _ => None,
    });
    let mut again = Mission::new(slave.config.clone(), checkpoint);
    let order = Order::Move {
        waypoint: 1,
        apart: false,
    };
    hears(&mut again, 42.0, order_of(ballot(1, 0, 1), 9, &order));
    assert_eq!(again.durable.leader.ballot(), Some(ballot(4, 2, 2)));
    assert_eq!(again.durable.state, State::WaypointReached { waypoint: 0 });
}

#[test]
fn whoever_is_told_that_it_leads_and_does_not_know_so_claims_anew() {
    let mut forgetful = elects(0);
    let said = hears(&mut forgetful, 41.0, RoutingNotice::Leader(ballot(4, 1, 0)));
    assert_eq!(said[0], Transmit::Lead(ballot(5, 1, 0)));
    assert_eq!(
        orders(&said),
        [Order::Move {
            waypoint: 0,
            apart: false
        }]
    );
    let mut obedient = mission(0, Liveness::Heartbeat);
    ordered(&mut obedient, 1, &whole_plan());
    let said = hears(&mut obedient, 2.0, RoutingNotice::Leader(ballot(4, 1, 0)));
    assert_eq!(said, [], "on the ground nobody claims");
}

#[test]
fn nobody_takes_off_at_the_word_of_a_master_that_was_elected() {
    let mut slave = mission(0, Liveness::Heartbeat);
    ordered(&mut slave, 1, &whole_plan());
    hears(
        &mut slave,
        5.0,
        order_of(ballot(2, 2, 2), 1, &Order::TakeOff { wave: 0 }),
    );
    assert_eq!(slave.durable.state, State::SetUp);
}

#[test]
fn nobody_claims_to_lead_on_the_ground() {
    let config = Config {
        succession: Succession::Elect,
        ..config(0, Liveness::Heartbeat)
    };
    let mut slave = Mission::new(config, None);
    ordered(&mut slave, 1, &whole_plan());
    let said = hears(&mut slave, 9.0, RoutingNotice::MasterSilent);
    assert_eq!(said, []);
}

#[test]
fn after_an_election_legs_are_flown_in_the_drones_own_layer() {
    let mut slave = elects(0);
    assert!(!slave.durable.in_layer);
    let said = hears(
        &mut slave,
        41.0,
        order_of(
            ballot(2, 2, 2),
            1,
            &Order::Move {
                waypoint: 1,
                apart: false,
            },
        ),
    );
    let transit = said
        .iter()
        .any(|it| matches!(it, Transmit::Goal(Goal::TransitTo { .. })));
    assert!(transit && slave.durable.in_layer, "{said:?}");
}
