//! Changes of formation.

use super::*;
use crate::formation::Layering;
use crate::mission::Step;

/// Drone `id` of a line of three that becomes a matrix at waypoint 0.
fn config_with_change(id: u32) -> Config {
    let mut config = config(id, Liveness::Heartbeat);
    let drones = NonZeroU32::new(3).unwrap();
    let matrix = Formation::new(Kind::CompactMatrix, drones, 100.0, 0.0);
    config.changes = Arc::new([Change::new(0, &config.layout, matrix)]);
    config
}

fn step_order(step: Step) -> Order {
    Order::Reform {
        change: 0,
        step,
        apart: false,
        wave: 0,
    }
}

fn member_in_slot() -> Mission {
    member_in_slot_of(config_with_change(0))
}

fn member_in_slot_of(config: Config) -> Mission {
    let mut member = Mission::new(config, None);
    deliver(&mut member, 1, &complete_plan());
    deliver(&mut member, 2, &Order::TakeOff { wave: 0 });
    arrive(&mut member, 20.0);
    deliver(&mut member, 3, &open_waypoint(0));
    member
}

#[test]
fn member_acknowledges_each_step_once_it_is_done() {
    let mut member = member_in_slot();
    let corners = member.config.changes[0].path(NodeId(0), waypoints()[0]);
    let steps = [Step::Climb, Step::Cross, Step::Descend];
    for ((sequence, step), to) in (4..).zip(steps).zip(corners) {
        let transmits = deliver(&mut member, sequence, &step_order(step));
        let hold_altitude_m = to.altitude_m();
        assert_eq!(
            goal(&transmits),
            Some(Goal::FlyTo {
                to,
                hold_altitude_m
            })
        );
        assert!(!transmits.contains(&acknowledgement(sequence)));
        let transmits = arrive(&mut member, 30.0);
        assert!(transmits.contains(&acknowledgement(sequence)));
    }
    assert_eq!(member.durable.state, State::WaypointReached { waypoint: 0 });
    let transmits = deliver(&mut member, 7, &open_waypoint(1));
    let slot = member.config.changes[0]
        .layout()
        .slot(NodeId(0), waypoints()[1]);
    assert_eq!(goal(&transmits), Some(fly_to(slot)));
}

#[test]
fn member_that_missed_a_step_lands() {
    let mut member = member_in_slot();
    let transmits = deliver(&mut member, 5, &step_order(Step::Cross));
    assert_eq!(goal(&transmits), Some(Goal::Land), "no climb before");
    let mut member = member_in_slot();
    deliver(&mut member, 4, &step_order(Step::Climb));
    let transmits = deliver(&mut member, 5, &step_order(Step::Cross));
    assert_eq!(goal(&transmits), Some(Goal::Land), "climb not completed");
    let mut member = member_in_slot();
    let transmits = deliver(&mut member, 7, &open_waypoint(1));
    assert_eq!(goal(&transmits), Some(Goal::Land), "change not made");
}

#[test]
fn unknown_change_is_refused() {
    for change in [1, u16::MAX] {
        let mut member = member_in_slot();
        let step = Step::Climb;
        assert_eq!(
            deliver(
                &mut member,
                4,
                &Order::Reform {
                    change,
                    step,
                    apart: false,
                    wave: 0
                }
            ),
            []
        );
    }
    let mut member = member_in_slot();
    let at = waypoints()[0];
    let changes = 2;
    assert_eq!(
        deliver(
            &mut member,
            4,
            &Order::Land {
                at,
                changes,
                apart: false,
                wave: 0
            }
        ),
        []
    );
}

#[test]
fn master_orders_each_step_once_all_have_done_the_last() {
    let mut master = Mission::new(config_with_change(1), None);
    send(&mut master, 0.0, Input::Fly);
    notify(&mut master, 1.0, progress(0, 1));
    notify(&mut master, 1.0, progress(2, 1));
    arrive(&mut master, 20.0);
    notify(&mut master, 20.0, progress(0, 2));
    notify(&mut master, 20.0, progress(2, 2));
    let transmits = notify(&mut master, 30.0, RoutingNotice::RoutesReady);
    assert_eq!(orders(&transmits), [open_waypoint(0)]);
    notify(&mut master, 31.0, progress(0, 3));
    let mut transmits = notify(&mut master, 31.0, progress(2, 3));
    for (sequence, step) in (4..).zip([Step::Climb, Step::Cross, Step::Descend]) {
        assert_eq!(orders(&transmits), [step_order(step)]);
        assert_eq!(orders(&arrive(&mut master, 40.0)), []);
        notify(&mut master, 41.0, progress(0, sequence));
        transmits = notify(&mut master, 41.0, progress(2, sequence));
    }
    assert_eq!(orders(&transmits), [open_waypoint(1)]);
}

#[test]
fn master_leaves_out_member_that_never_completes_a_step() {
    let mut master = Mission::new(config_with_change(1), None);
    send(&mut master, 0.0, Input::Fly);
    notify(&mut master, 1.0, progress(0, 1));
    notify(&mut master, 1.0, progress(2, 1));
    arrive(&mut master, 20.0);
    notify(&mut master, 20.0, progress(0, 2));
    notify(&mut master, 20.0, progress(2, 2));
    notify(&mut master, 30.0, RoutingNotice::RoutesReady);
    notify(&mut master, 31.0, progress(0, 3));
    notify(&mut master, 31.0, progress(2, 3));
    arrive(&mut master, 40.0);
    notify(&mut master, 41.0, progress(0, 4));
    let (transmits, events) = stimulate(&mut master, 140.0, Stimulus::Timeout);
    // The member left out may be on their paths: all leave lockstep.
    let (change, step, apart) = (0, Step::Cross, true);
    let cross = Order::Reform {
        change,
        step,
        apart,
        wave: 0,
    };
    assert_eq!(orders(&transmits), [cross]);
    assert!(events.contains(&Event::LeftOut(NodeId(2))));
}

#[test]
fn member_with_silent_master_waits_in_layer_after_climb_step() {
    let mut member = member_in_slot();
    member.config.succession = Succession::Elect;
    member.config.spreading_grace = 6 * SECOND;
    deliver(&mut member, 4, &step_order(Step::Climb));
    assert_eq!(notify(&mut member, 10.0, RoutingNotice::MasterSilent), []);
    let transmits = arrive(&mut member, 11.0);
    assert!(member.durable.lockstep.in_layer && transmits.contains(&Transmit::TopologyChanges));
}

/// One layer per drone, and a change of formation at `waypoint`.
fn config_in_layers(waypoint: u16) -> Config {
    let mut config = config_with_change(0);
    let matrix = config.changes[0].layout().formation().clone();
    let layout = Arc::into_inner(config.layout).unwrap();
    let layout = layout.with_layers(Layering::PerDrone);
    config.changes = Arc::new([Change::new(waypoint, &layout, matrix)]);
    config.layout = Arc::new(layout);
    config
}

#[test]
fn member_in_own_layer_takes_a_step_without_waiting_for_routes() {
    for state in [
        State::TakingOff,
        State::NeighbourDiscovery,
        State::HopUpdate,
    ] {
        let mut member = Mission::new(config_in_layers(0), None);
        deliver(&mut member, 1, &complete_plan());
        deliver(&mut member, 2, &Order::TakeOff { wave: 0 });
        arrive(&mut member, 20.0);
        member.durable.lockstep.in_layer = true;
        member.durable.state = state;
        let transmits = deliver(&mut member, 4, &step_order(Step::Cross));
        assert!(goal(&transmits).is_some(), "{state:?}");
        assert!(arrive(&mut member, 30.0).contains(&acknowledgement(4)));
    }
}

#[test]
fn member_that_still_climbs_into_its_layer_takes_a_step_and_is_there() {
    let mut member = member_in_slot_of(config_in_layers(0));
    member.durable.state = State::WaypointReached { waypoint: 0 };
    deliver(&mut member, 4, &move_apart(0));
    deliver(&mut member, 5, &step_order(Step::Descend));
    assert!(arrive(&mut member, 40.0).contains(&acknowledgement(5)));
    assert!(deliver(&mut member, 6, &move_apart(0)).contains(&acknowledgement(6)));
}

#[test]
fn member_in_own_layer_that_missed_a_step_catches_up() {
    let mut member = member_in_slot_of(config_in_layers(1));
    member.durable.lockstep.in_layer = true;
    // The member is at waypoint 0; the others change formation at waypoint 1.
    let transmits = deliver(&mut member, 4, &step_order(Step::Cross));
    assert!(!transmits.contains(&acknowledgement(4)));
    let moves = State::MovingToWaypoint { waypoint: 1 };
    assert_eq!(member.durable.state, moves);
    let transmits = arrive(&mut member, 30.0);
    assert!(transmits.contains(&Transmit::Resync), "{transmits:?}");
    let transmits = deliver(&mut member, 4, &step_order(Step::Cross));
    assert!(goal(&transmits).is_some());
    assert!(arrive(&mut member, 40.0).contains(&acknowledgement(4)));
}

/// A step by another master than the one whose orders 1 to 4 were executed, and its acknowledgement.
fn step_of_better_master() -> (RoutingNotice, Transmit) {
    let (sequence, step) = (1, step_order(Step::Cross));
    let ballot = Ballot {
        term: 2,
        ..INITIAL_BALLOT
    };
    let order = RoutingNotice::Order {
        ballot,
        sequence,
        order: wire::encode_order(&step).into(),
    };
    (order, Transmit::Acknowledge { ballot, sequence })
}

#[test]
fn member_that_skips_a_change_acknowledges_its_steps_only_at_the_waypoint() {
    let mut member = member_in_slot_of(config_in_layers(1));
    // One master is beyond the change and orders the leg after it. Another, which still changes formation, takes over.
    deliver(&mut member, 4, &move_apart(2));
    let moves = State::MovingToWaypoint { waypoint: 1 };
    assert_eq!(member.durable.state, moves);
    let (order, acknowledged) = step_of_better_master();
    let transmits = notify(&mut member, 31.0, order.clone());
    assert!(!transmits.contains(&acknowledged), "{transmits:?}");
    let transmits = arrive(&mut member, 40.0);
    let reached = State::WaypointReached { waypoint: 1 };
    assert_eq!(member.durable.state, reached);
    assert!(!transmits.contains(&acknowledged));
    assert!(transmits.contains(&Transmit::Resync), "{transmits:?}");
    assert!(notify(&mut member, 41.0, order).contains(&acknowledged));
}

#[test]
fn member_that_skips_a_change_and_climbs_at_its_waypoint_acknowledges_the_steps_in_its_layer() {
    let mut member = member_in_slot_of(config_in_layers(1));
    deliver(&mut member, 4, &open_waypoint(1));
    deliver(&mut member, 5, &move_apart(2));
    let (order, acknowledged) = step_of_better_master();
    let mut transmits = notify(&mut member, 31.0, order.clone());
    assert!(
        matches!(member.given_goal, Some(Goal::FlyTo { .. })),
        "in lockstep to its end"
    );
    transmits.extend(arrive_at_end_of_leg(&mut member, 40.0));
    assert!(transmits.contains(&Transmit::Resync), "{transmits:?}");
    assert!(matches!(goal(&transmits), Some(Goal::TransitTo { .. })));
    transmits.extend(notify(&mut member, 41.0, order));
    assert!(!transmits.contains(&acknowledged), "{transmits:?}");
    assert!(arrive(&mut member, 44.0).contains(&acknowledged));
}

#[test]
fn member_ordered_to_land_during_a_step_completes_it_first() {
    let mut member = member_in_slot();
    deliver(&mut member, 4, &step_order(Step::Climb));
    let transmits = deliver(&mut member, 5, &land_at(waypoints()[0]));
    assert_eq!(goal(&transmits), None, "the step continues");
    let arrival_transmits = arrive(&mut member, 30.0);
    assert_eq!(member.durable.state, State::Landing);
    assert_eq!(goal(&arrival_transmits), Some(Goal::Land));
}
