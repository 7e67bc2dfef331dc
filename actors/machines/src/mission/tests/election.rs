use super::*;

const fn ballot(term: u32, rank: u32, master: u32) -> Ballot {
    Ballot {
        term,
        rank,
        master: NodeId(master),
    }
}

fn member_with_elections(id: u32) -> Mission {
    member_with_back_off(id, Duration::ZERO)
}

/// A member with elections at waypoint 0.
fn member_with_back_off(id: u32, candidacy_back_off: Duration) -> Mission {
    let config = Config {
        succession: Succession::Elect,
        candidacy_back_off,
        ..config(id, Liveness::Heartbeat)
    };
    member_at_open_waypoint(config)
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
fn new_master_claims_a_better_ballot_and_repeats_its_own_order() {
    let mut member = member_with_elections(0);
    deliver(&mut member, 4, &open_waypoint(1));
    let transmits = notify(&mut member, 40.0, RoutingNotice::MasterSilent);
    // Drone 0 is next to the centre and has the smaller ID: rank 1.
    assert_eq!(transmits[0], Transmit::Lead(ballot(2, 1, 0)));
    assert_eq!(orders(&transmits), [open_waypoint(1)]);
    assert!(ballot(2, 1, 0).beats(&ballot(1, 0, 1)));
    // It acknowledges on arrival, and then waits for the others.
    assert!(acknowledged(&transmits).is_empty());
    assert_eq!(acknowledged(&arrive(&mut member, 60.0)), [0; 0]);
    let transmits = arrive(&mut member, 60.5);
    assert_eq!(acknowledged(&transmits), [1], "in its layer");
    assert_eq!(orders(&transmits), []);
    notify(&mut member, 61.0, RoutingNotice::Silent(NodeId(1).into()));
    let transmits = notify(&mut member, 62.0, progress(2, 1));
    assert_eq!(orders(&transmits), [move_apart(2)]);
}

#[test]
fn new_master_claims_after_spreading_grace_and_climbs_to_its_layer() {
    let config = Config {
        succession: Succession::Elect,
        spreading_grace: Duration::from_secs(6),
        ..config(0, Liveness::Heartbeat)
    };
    let mut member = Mission::new(config, None);
    deliver(&mut member, 1, &complete_plan());
    deliver(&mut member, 2, &Order::TakeOff { wave: 0 });
    arrive(&mut member, 20.0);
    assert_eq!(notify(&mut member, 21.0, RoutingNotice::MasterSilent), []);
    let (transmits, _) = stimulate(&mut member, 27.0, Stimulus::Timeout);
    assert!(transmits.contains(&Transmit::Lead(ballot(2, 1, 0))));
    assert!(matches!(goal(&transmits), Some(Goal::TransitTo { .. })));
}

#[test]
fn drone_backs_off_for_better_ranks_before_claiming() {
    let after_master_silence = |id| {
        let mut member = member_with_back_off(id, Duration::from_millis(10));
        let transmits = notify(&mut member, 40.0, RoutingNotice::MasterSilent);
        (member, transmits)
    };
    // No back-off for the lost master, which has the best rank.
    let (_, transmits) = after_master_silence(0);
    assert_eq!(transmits[0], Transmit::Lead(ballot(2, 1, 0)));
    let (mut member, transmits) = after_master_silence(2);
    assert_eq!(transmits, []);
    let (transmits, _) = stimulate(&mut member, 40.009, Stimulus::Timeout);
    assert_eq!(transmits, []);
    let (transmits, _) = stimulate(&mut member, 40.01, Stimulus::Timeout);
    assert_eq!(transmits[0], Transmit::Lead(ballot(2, 2, 2)));
    // No claim once another leads.
    let (mut member, _) = after_master_silence(2);
    notify(&mut member, 40.005, RoutingNotice::Leader(ballot(2, 1, 0)));
    let (transmits, _) = stimulate(&mut member, 40.01, Stimulus::Timeout);
    assert_eq!(transmits, []);
}

#[test]
fn member_ahead_of_the_new_master_acknowledges_at_once_and_waits() {
    let mut member = member_with_elections(0);
    deliver(&mut member, 4, &open_waypoint(1));
    // The new master does not know that waypoint 1 is open.
    let new = ballot(2, 2, 2);
    let transmits = notify(&mut member, 41.0, order_of(new, 1, &open_waypoint(0)));
    assert_eq!(acknowledged(&transmits), [1]);
    assert!(member.durable.orders.pending.is_some(), "its leg goes on");
    let transmits = arrive(&mut member, 60.0);
    let [
        Transmit::Goal(Goal::TransitTo { to }),
        Transmit::TopologyChanges,
    ] = transmits[..]
    else {
        panic!("{transmits:?}");
    };
    let slot = member.config.layout.slot(NodeId(0), waypoints()[1]);
    assert!(
        to.horizontal_distance_m(slot) < 0.01,
        "it waits there in its layer"
    );
    assert!(to.altitude_m() > slot.altitude_m() + 5.0);
    arrive(&mut member, 65.0);
    let transmits = notify(&mut member, 70.0, order_of(new, 2, &open_waypoint(1)));
    assert_eq!(acknowledged(&transmits), [2]);
}

#[test]
fn member_behind_the_new_master_flies_open_waypoints_in_order() {
    let mut member = member_with_elections(0);
    let new = ballot(2, 2, 2);
    notify(&mut member, 41.0, order_of(new, 1, &open_waypoint(2)));
    assert_eq!(
        member.durable.state,
        State::MovingToWaypoint { waypoint: 1 }
    );
    arrive(&mut member, 60.0);
    assert_eq!(
        member.durable.state,
        State::MovingToWaypoint { waypoint: 2 }
    );
    let transmits = arrive(&mut member, 80.0);
    assert_eq!(acknowledged(&transmits), [1]);
}

#[test]
fn master_steps_down_for_better_ballots_only() {
    let mut master = member_with_elections(0);
    notify(&mut master, 40.0, RoutingNotice::MasterSilent);
    assert!(master.durable.lead.is_some());
    notify(&mut master, 41.0, RoutingNotice::Leader(ballot(2, 2, 2)));
    assert!(master.durable.lead.is_some(), "the smaller rank wins");
    notify(
        &mut master,
        42.0,
        order_of(ballot(1, 0, 1), 9, &open_waypoint(2)),
    );
    assert_eq!(master.durable.leader.ballot(), Some(ballot(2, 1, 0)));
    notify(&mut master, 43.0, RoutingNotice::Leader(ballot(3, 2, 2)));
    assert!(master.durable.lead.is_none());
    assert_eq!(master.durable.leader.ballot(), Some(ballot(3, 2, 2)));
    // It executes the new master's orders.
    let order = open_waypoint(1);
    notify(&mut master, 44.0, order_of(ballot(3, 2, 2), 1, &order));
    assert_eq!(
        master.durable.state,
        State::MovingToWaypoint { waypoint: 1 }
    );
}

#[test]
fn ballot_survives_a_restart_of_the_mission() {
    let mut member = member_with_elections(0);
    let (_, events) = stimulate(
        &mut member,
        41.0,
        Stimulus::Input(Input::Routing(RoutingNotice::Leader(ballot(4, 2, 2)))),
    );
    let checkpoint = events.into_iter().find_map(|event| match event {
        Event::Checkpoint(checkpoint) => Some(*checkpoint),
        _ => None,
    });
    let mut restarted = Mission::new(member.config.clone(), checkpoint);
    let order = open_waypoint(1);
    notify(&mut restarted, 42.0, order_of(ballot(1, 0, 1), 9, &order));
    assert_eq!(restarted.durable.leader.ballot(), Some(ballot(4, 2, 2)));
    assert_eq!(
        restarted.durable.state,
        State::WaypointReached { waypoint: 0 }
    );
}

#[test]
fn master_that_lost_its_state_claims_a_new_term() {
    let mut member = member_with_elections(0);
    let transmits = notify(&mut member, 41.0, RoutingNotice::Leader(ballot(4, 1, 0)));
    assert!(transmits.contains(&Transmit::Lead(ballot(5, 1, 0))));
    assert_eq!(orders(&transmits), [move_apart(0)]);
    let mut on_ground = mission(0, Liveness::Heartbeat);
    deliver(&mut on_ground, 1, &complete_plan());
    let transmits = notify(&mut on_ground, 2.0, RoutingNotice::Leader(ballot(4, 1, 0)));
    assert_eq!(transmits, [], "no claim on the ground");
}

#[test]
fn elected_masters_order_to_take_off_is_refused() {
    let mut member = mission(0, Liveness::Heartbeat);
    deliver(&mut member, 1, &complete_plan());
    notify(
        &mut member,
        5.0,
        order_of(ballot(2, 2, 2), 1, &Order::TakeOff { wave: 0 }),
    );
    assert_eq!(member.durable.state, State::SetUp);
}

#[test]
fn drone_on_the_ground_does_not_claim() {
    let config = Config {
        succession: Succession::Elect,
        ..config(0, Liveness::Heartbeat)
    };
    let mut member = Mission::new(config, None);
    deliver(&mut member, 1, &complete_plan());
    let transmits = notify(&mut member, 9.0, RoutingNotice::MasterSilent);
    assert_eq!(transmits, []);
}

#[test]
fn legs_after_an_election_are_flown_in_own_layer() {
    let mut member = member_with_elections(0);
    assert!(!member.durable.lockstep.in_layer);
    let leads = |sequence, waypoint| {
        let order = order_of(ballot(2, 2, 2), sequence, &open_waypoint(waypoint));
        Stimulus::Input(Input::Routing(order))
    };
    let (transmits, events) = stimulate(&mut member, 41.0, leads(1, 1));
    assert!(events.contains(&Event::LeftLockstep));
    let transit = transmits
        .iter()
        .any(|it| matches!(it, Transmit::Goal(Goal::TransitTo { .. })));
    assert!(transit && member.durable.lockstep.in_layer, "{transmits:?}");
    arrive(&mut member, 60.0);
    let (_, events) = stimulate(&mut member, 61.0, leads(2, 2));
    assert!(events.contains(&Event::State(State::MovingToWaypoint { waypoint: 2 })));
    assert!(!events.contains(&Event::LeftLockstep), "once");
}
