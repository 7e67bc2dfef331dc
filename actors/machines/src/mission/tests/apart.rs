//! A swarm that misses members climbs out of lockstep before it flies on.

use super::*;

/// A master at waypoint 1 whose member 2 fell silent on the leg, and what it did on arrival.
fn master_missing_a_member() -> (Mission, Vec<Transmit>) {
    let mut master = master_taking_off();
    for member in [0, 2] {
        notify(&mut master, 20.0, progress(member, 2));
    }
    arrive(&mut master, 20.0);
    notify(&mut master, 30.0, RoutingNotice::RoutesReady);
    for member in [0, 2] {
        notify(&mut master, 32.0, progress(member, 3));
    }
    notify(&mut master, 40.0, RoutingNotice::Silent(NodeId(2).into()));
    let transmits = arrive(&mut master, 60.0);
    (master, transmits)
}

/// A member on its leg to waypoint 1, by order 4.
fn member_on_first_leg() -> Mission {
    let mut member = member_at_waypoint_0(Liveness::Heartbeat);
    deliver(&mut member, 3, &open_waypoint(0));
    deliver(&mut member, 4, &open_waypoint(1));
    assert_eq!(
        member.durable.state,
        State::MovingToWaypoint { waypoint: 1 }
    );
    member
}

/// Height of a goal above the drone's slot at waypoint 1, straight above it; in metres.
fn height_above_slot_m(mission: &Mission, goal: Goal) -> f64 {
    let Goal::TransitTo { to } = goal else {
        panic!("{goal:?}");
    };
    let slot = mission.layout().slot(mission.config.id, waypoints()[1]);
    assert!(to.horizontal_distance_m(slot) < 0.01, "{to:?}");
    to.altitude_m() - slot.altitude_m()
}

#[test]
fn master_that_misses_a_member_leaves_once_all_others_have_climbed() {
    let (mut master, transmits) = master_missing_a_member();
    assert_eq!(orders(&transmits), [move_apart(1)]);
    let height_m = height_above_slot_m(&master, goal(&transmits).unwrap());
    assert!(height_m > 5.0, "{height_m} m");
    assert_eq!(orders(&notify(&mut master, 62.0, progress(0, 5))), []);
    assert_eq!(orders(&arrive(&mut master, 64.0)), [move_apart(2)]);
    let (mut master, _) = master_missing_a_member();
    assert_eq!(orders(&arrive(&mut master, 62.0)), []);
    let transmits = notify(&mut master, 64.0, progress(0, 5));
    assert_eq!(orders(&transmits), [move_apart(2)]);
}

#[test]
fn member_acknowledges_that_it_has_climbed_once_it_is_in_its_layer() {
    let mut waiting = member_on_first_leg();
    arrive(&mut waiting, 60.0);
    let transmits = deliver(&mut waiting, 5, &move_apart(1));
    assert!(height_above_slot_m(&waiting, goal(&transmits).unwrap()) > 5.0);
    assert!(!transmits.contains(&acknowledgement(5)));
    assert!(arrive(&mut waiting, 64.0).contains(&acknowledgement(5)));

    let mut on_leg = member_on_first_leg();
    let transmits = deliver(&mut on_leg, 5, &move_apart(1));
    assert_eq!(goal(&transmits), None, "in lockstep to the end of the leg");
    let transmits = arrive_at_end_of_leg(&mut on_leg, 60.0);
    assert!(height_above_slot_m(&on_leg, goal(&transmits).unwrap()) > 5.0);
    assert!(!transmits.contains(&acknowledgement(5)));
    assert!(arrive(&mut on_leg, 64.0).contains(&acknowledgement(5)));
}

#[test]
fn restarted_drone_goes_on_climbing() {
    let mut member = member_on_first_leg();
    arrive(&mut member, 60.0);
    deliver(&mut member, 5, &move_apart(1));
    let mut restarted = Mission::new(member.config.clone(), Some(member.durable));
    let transmits = notify(&mut restarted, 62.0, RoutingNotice::MasterReturned);
    assert!(height_above_slot_m(&restarted, goal(&transmits).unwrap()) > 5.0);
    assert!(!transmits.contains(&acknowledgement(5)));
    assert!(arrive(&mut restarted, 64.0).contains(&acknowledgement(5)));
}

/// A drone elected at waypoint 1 in place of drone 1, and in its layer there.
fn elected() -> Mission {
    let config = Config {
        succession: Succession::Elect,
        spreading_grace: 6 * SECOND,
        ..config(0, Liveness::Heartbeat)
    };
    let mut elected = member_at_open_waypoint(config);
    deliver(&mut elected, 4, &open_waypoint(1));
    arrive(&mut elected, 50.0);
    let transmits = notify(&mut elected, 60.0, RoutingNotice::MasterSilent);
    assert_eq!(orders(&transmits), [move_apart(1)]);
    assert_eq!(orders(&arrive(&mut elected, 62.0)), []);
    elected
}

#[test]
fn elected_master_waits_until_others_that_it_misses_have_climbed_under_their_own() {
    let mut master = elected();
    let both = NodeSet::from(1..3);
    assert_eq!(
        orders(&notify(&mut master, 64.0, RoutingNotice::Silent(both))),
        []
    );
    // The others' grace, and their climb.
    assert_eq!(
        orders(&stimulate(&mut master, 75.9, Stimulus::Timeout).0),
        []
    );
    let (transmits, _) = stimulate(&mut master, 76.0, Stimulus::Timeout);
    assert_eq!(orders(&transmits), [move_apart(2)]);
}

#[test]
fn elected_master_does_not_wait_for_the_one_that_it_replaced() {
    let mut master = elected();
    notify(&mut master, 62.0, progress(2, 1));
    let replaced = RoutingNotice::Silent(NodeId(1).into());
    let transmits = notify(&mut master, 64.0, replaced);
    assert_eq!(orders(&transmits), [move_apart(2)]);
}

/// Whether a drone leaves lockstep by this.
fn leaves(mission: &mut Mission, at_s: f64, input: Input) -> bool {
    let (_, events) = stimulate(mission, at_s, Stimulus::Input(input));
    events.contains(&Event::LeftLockstep)
}

fn ordered(sequence: u32, order: &Order) -> Input {
    Input::Routing(RoutingNotice::Order {
        ballot: INITIAL_BALLOT,
        sequence,
        order: wire::encode_order(order).into(),
    })
}

#[test]
fn drone_has_left_lockstep_once_it_flies_so_and_not_when_it_is_told_to() {
    let mut on_leg = member_on_first_leg();
    assert!(!leaves(&mut on_leg, 50.0, ordered(5, &move_apart(1))));
    let leg = on_leg.given_goal.unwrap();
    let arrived = Input::Navigation(NavigationNotice::Arrived(leg));
    assert!(leaves(&mut on_leg, 60.0, arrived));
    assert!(
        !leaves(&mut on_leg, 70.0, ordered(6, &move_apart(2))),
        "once"
    );
}

#[test]
fn drone_that_lands_leaves_no_lockstep() {
    let mut lands = member_on_first_leg();
    send(&mut lands, 50.0, Input::GiveUp);
    assert_eq!(lands.durable.state, State::Landing);
    assert!(!leaves(&mut lands, 60.0, ordered(5, &move_apart(2))));
}

#[test]
fn part_that_lands_around_an_earlier_waypoint_leaves_lockstep() {
    let land = |at: usize| {
        let at = waypoints()[at];
        let (changes, wave) = (0, 0);
        ordered(
            5,
            &Order::Land {
                at,
                changes,
                wave,
                apart: false,
            },
        )
    };
    let mut last = member_on_first_leg();
    arrive(&mut last, 60.0);
    assert!(!leaves(&mut last, 70.0, land(2)));
    let mut earlier = member_on_first_leg();
    arrive(&mut earlier, 60.0);
    assert!(leaves(&mut earlier, 70.0, land(1)));
    assert_eq!(earlier.durable.state, State::MovingToLand);
}
