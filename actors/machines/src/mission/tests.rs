mod change;
mod election;
mod failsafe;
mod follow;
mod hold;
mod waves;

use std::num::NonZeroU32;

use std::sync::Arc;
use std::time::Duration;

use bytes::Bytes;

use super::*;
use crate::formation::Change;
use crate::formation::{Formation, Kind, Layering, Separation};
use crate::geometry::Ned;
use crate::identity::{Ballot, NodeId, NodeSet};
use crate::machine::{Emitted, Stimulus, step};
use crate::navigation::Failure;
use crate::navigation::Goal;
use crate::routing::Notice as RoutingNotice;
use crate::wire;

/// The leader epoch that the operator starts.
const INITIAL_BALLOT: Ballot = Ballot {
    term: 1,
    rank: 0,
    master: NodeId(1),
};

const SECOND: Duration = Duration::from_secs(1);

/// Height of the lowest layer above the slots, in metres.
const LAYER_SPACING_M: f64 = 5.5;

/// The goal of a leg to `to` in lockstep.
fn fly_to(to: Ned) -> Goal {
    Goal::FlyTo {
        to,
        hold_altitude_m: to.altitude_m() + LAYER_SPACING_M,
    }
}

fn waypoints() -> Vec<Ned> {
    [0.0, 100.0, 200.0]
        .map(|north_m| Ned::new(north_m, 0.0, -25.0))
        .into()
}

/// Drone `id` of a line of three; drone 1 is the centre.
fn mission(id: u32, liveness: Liveness) -> Mission {
    Mission::new(config(id, liveness), None)
}

fn config(id: u32, liveness: Liveness) -> Config {
    let drones = NonZeroU32::new(3).unwrap();
    let separation = Separation {
        horizontal_m: 5.0,
        vertical_m: 5.0,
    };
    let formation = Formation::new(Kind::Linear, drones, 100.0, 0.0);
    Config {
        id: NodeId(id),
        layout: Arc::new(Layout::new(formation, 10.0, separation)),
        mission: waypoints().into(),
        holds: Holds::default(),
        changes: Arc::default(),
        following: None,
        barrier: Barrier::Strict,
        liveness,
        succession: Succession::Land,
        alone: Alone::CarryOn,
        spreading_grace: Duration::ZERO,
        candidacy_back_off: Duration::ZERO,
        set_up_limit: 30 * SECOND,
        take_off_limit: 60 * SECOND,
        landing_limit: 60 * SECOND,
        leg_limit: 100 * SECOND,
        flight_time: 2_000 * SECOND,
        waypoints_max: 100,
    }
}

fn stimulate(
    mission: &mut Mission,
    at_s: f64,
    stimulus: Stimulus<Input>,
) -> (Vec<Transmit>, Vec<Event>) {
    let (mut transmits, mut events) = (Vec::new(), Vec::new());
    let now = Timestamp::from_secs_f64(at_s);
    let is_timeout = stimulus == Stimulus::Timeout;
    let deadline = step(mission, now, stimulus, |emitted| match emitted {
        Emitted::Transmit(transmit) => transmits.push(transmit),
        Emitted::Event(event) => events.push(event),
    });
    let is_overdue = is_timeout && deadline.is_some_and(|deadline| deadline <= now);
    assert!(!is_overdue, "deadline {deadline:?} is not after {now}");
    (transmits, events)
}

fn send(mission: &mut Mission, at_s: f64, input: Input) -> Vec<Transmit> {
    stimulate(mission, at_s, Stimulus::Input(input)).0
}

fn deliver(mission: &mut Mission, sequence: u32, order: &Order) -> Vec<Transmit> {
    let ballot = INITIAL_BALLOT;
    let order = wire::encode_order(order).into();
    let notice = RoutingNotice::Order {
        ballot,
        sequence,
        order,
    };
    send(mission, 1.0, Input::Routing(notice))
}

fn notify(mission: &mut Mission, at_s: f64, notice: RoutingNotice) -> Vec<Transmit> {
    send(mission, at_s, Input::Routing(notice))
}

fn arrive(mission: &mut Mission, at_s: f64) -> Vec<Transmit> {
    send(mission, at_s, Input::Navigation(NavigationNotice::Arrived))
}

fn progress(member: u32, acknowledged: u32) -> RoutingNotice {
    RoutingNotice::Progress {
        sequence: acknowledged,
        acknowledged: NodeId(member).into(),
        landing: NodeSet::default(),
    }
}

fn acknowledgement(sequence: u32) -> Transmit {
    Transmit::Acknowledge {
        ballot: INITIAL_BALLOT,
        sequence,
    }
}

fn orders(transmits: &[Transmit]) -> Vec<Order> {
    let published = transmits.iter().filter_map(|transmit| match transmit {
        Transmit::Publish { order, .. } => Some(wire::decode_order(order).unwrap()),
        _ => None,
    });
    published.collect()
}

const fn open_waypoint(waypoint: u16) -> Order {
    Order::Move {
        waypoint,
        apart: false,
    }
}

fn land_at(at: Ned) -> Order {
    Order::Land {
        at,
        changes: 0,
        apart: false,
        wave: 0,
    }
}

fn complete_plan() -> Order {
    Order::Plan {
        index: 0,
        count: 1,
        waypoints: waypoints(),
        holds: Vec::new(),
    }
}

/// A member at waypoint 0 with routes.
fn member_at_waypoint_0(liveness: Liveness) -> Mission {
    let mut member = mission(0, liveness);
    deliver(&mut member, 1, &complete_plan());
    deliver(&mut member, 2, &Order::TakeOff { wave: 0 });
    arrive(&mut member, 20.0);
    for notice in [
        RoutingNotice::DiscoveryStarted,
        RoutingNotice::HopUpdateStarted,
        RoutingNotice::RoutesReady,
    ] {
        notify(&mut member, 30.0, notice);
    }
    assert_eq!(member.durable.state, State::WaypointReached { waypoint: 0 });
    member
}

/// A master that has ordered its two members to take off.
fn master_taking_off() -> Mission {
    master_taking_off_with(Barrier::Strict)
}

fn master_taking_off_with(barrier: Barrier) -> Mission {
    let config = Config {
        barrier,
        ..config(1, Liveness::Heartbeat)
    };
    let mut master = Mission::new(config, None);
    send(&mut master, 0.0, Input::Fly);
    notify(&mut master, 1.0, progress(0, 1));
    let transmits = notify(&mut master, 1.0, progress(2, 1));
    assert_eq!(orders(&transmits), [Order::TakeOff { wave: 0 }]);
    master
}

fn goal(transmits: &[Transmit]) -> Option<Goal> {
    transmits.iter().find_map(|transmit| match transmit {
        Transmit::Goal(goal) => Some(*goal),
        _ => None,
    })
}

#[test]
fn centre_drone_leads_on_the_operators_command_only() {
    let mut member = mission(0, Liveness::Heartbeat);
    let (transmits, events) = stimulate(&mut member, 0.0, Stimulus::Input(Input::Fly));
    assert!(transmits.is_empty());
    assert_eq!(events[0], Event::Refused);
    let mut master = mission(1, Liveness::Heartbeat);
    assert!(stimulate(&mut master, 0.0, Stimulus::Timeout).0.is_empty());
    assert_eq!(
        orders(&send(&mut master, 0.0, Input::Fly)),
        [complete_plan()]
    );
}

#[test]
fn drone_without_complete_plan_stays_on_the_ground() {
    let mut member = mission(0, Liveness::Heartbeat);
    assert!(deliver(&mut member, 1, &Order::TakeOff { wave: 0 }).is_empty());
    let half = Order::Plan {
        index: 0,
        count: 2,
        waypoints: vec![Ned::HOME; wire::PLAN_PART_MAX],
        holds: Vec::new(),
    };
    assert_eq!(deliver(&mut member, 1, &half), [acknowledgement(1)]);
    assert!(deliver(&mut member, 3, &Order::TakeOff { wave: 0 }).is_empty());
    assert_eq!(member.durable.state, State::SetUp);
}

#[test]
fn member_not_ready_by_the_limit_is_left_out() {
    let mut master = mission(1, Liveness::Heartbeat);
    send(&mut master, 0.0, Input::Fly);
    assert!(
        orders(&notify(&mut master, 1.0, progress(0, 1))).is_empty(),
        "drone 2 is missing"
    );
    let (transmits, events) = stimulate(&mut master, 30.0, Stimulus::Timeout);
    assert_eq!(orders(&transmits), [Order::TakeOff { wave: 0 }]);
    assert!(events.contains(&Event::LeftOut(NodeId(2))));
}

#[test]
fn member_not_in_slot_by_the_limit_is_left_out() {
    let mut master = master_taking_off();
    arrive(&mut master, 20.0);
    notify(&mut master, 21.0, progress(0, 2));
    let (transmits, events) = stimulate(&mut master, 61.0, Stimulus::Timeout);
    assert_eq!(transmits, [Transmit::Discover]);
    assert!(events.contains(&Event::LeftOut(NodeId(2))));
}

#[test]
fn master_waits_spreading_grace_for_silent_members_during_take_off() {
    let mut master = master_taking_off();
    master.config.spreading_grace = 6 * SECOND;
    arrive(&mut master, 20.0);
    notify(&mut master, 21.0, progress(0, 2));
    let silent = RoutingNotice::Silent(NodeId(2).into());
    assert_eq!(notify(&mut master, 30.0, silent), []);
    assert_eq!(stimulate(&mut master, 35.9, Stimulus::Timeout).0, []);
    let (transmits, _) = stimulate(&mut master, 36.0, Stimulus::Timeout);
    assert_eq!(transmits, [Transmit::Discover]);
}

#[test]
fn member_with_silent_master_refuses_take_off_and_resyncs_on_return() {
    let mut member = mission(0, Liveness::Heartbeat);
    deliver(&mut member, 1, &complete_plan());
    notify(&mut member, 1.0, RoutingNotice::MasterSilent);
    assert_eq!(deliver(&mut member, 2, &Order::TakeOff { wave: 0 }), []);
    assert_eq!(member.durable.state, State::SetUp);
    let transmits = notify(&mut member, 2.0, RoutingNotice::MasterReturned);
    assert_eq!(transmits, [Transmit::Resync]);
    deliver(&mut member, 2, &Order::TakeOff { wave: 0 });
    assert_eq!(member.durable.state, State::TakingOff);
}

#[test]
fn waypoint_opens_once_all_members_have_arrived() {
    let mut master = master_taking_off();
    arrive(&mut master, 20.0);
    notify(&mut master, 21.0, progress(0, 2));
    let transmits = notify(&mut master, 22.0, progress(2, 2));
    assert_eq!(transmits, [Transmit::Discover]);
    for notice in [
        RoutingNotice::DiscoveryStarted,
        RoutingNotice::HopUpdateStarted,
    ] {
        notify(&mut master, 23.0, notice);
    }
    let opened = notify(&mut master, 32.0, RoutingNotice::RoutesReady);
    assert_eq!(orders(&opened), [open_waypoint(0)]);
    assert!(orders(&notify(&mut master, 33.0, progress(0, 3))).is_empty());
    let transmits = notify(&mut master, 33.0, progress(2, 3));
    assert_eq!(orders(&transmits), [open_waypoint(1)]);
    assert_eq!(
        master.durable.state,
        State::MovingToWaypoint { waypoint: 1 }
    );
}

#[test]
fn neighbours_barrier_applies_at_waypoints_but_not_during_take_off() {
    let mut master = master_taking_off_with(Barrier::Neighbours);
    arrive(&mut master, 20.0);
    let transmits = notify(&mut master, 21.0, progress(2, 2));
    assert!(transmits.is_empty(), "drone 0 is still taking off");
    notify(&mut master, 22.0, progress(0, 2));
    let neighbours = [NodeId(2)].into_iter().collect();
    notify(&mut master, 30.0, RoutingNotice::Neighbours(neighbours));
    notify(&mut master, 30.0, RoutingNotice::RoutesReady);
    assert!(orders(&notify(&mut master, 31.0, progress(0, 3))).is_empty());
    let transmits = notify(&mut master, 32.0, progress(2, 3));
    assert_eq!(orders(&transmits), [open_waypoint(1)]);
    arrive(&mut master, 60.0);
    let transmits = notify(&mut master, 61.0, progress(2, 4));
    assert_eq!(orders(&transmits), [open_waypoint(2)]);
}

#[test]
fn only_awaited_members_are_left_out() {
    let mut master = master_taking_off_with(Barrier::Neighbours);
    notify(&mut master, 20.0, progress(0, 2));
    notify(&mut master, 20.0, progress(2, 2));
    arrive(&mut master, 20.0);
    let neighbours = [NodeId(2)].into_iter().collect();
    notify(&mut master, 30.0, RoutingNotice::Neighbours(neighbours));
    notify(&mut master, 30.0, RoutingNotice::RoutesReady);
    notify(&mut master, 32.0, progress(2, 3));
    arrive(&mut master, 60.0);
    let (transmits, events) = stimulate(&mut master, 160.0, Stimulus::Timeout);
    let (waypoint, apart) = (2, true);
    assert_eq!(orders(&transmits), [Order::Move { waypoint, apart }]);
    assert!(events.contains(&Event::LeftOut(NodeId(2))));
    assert!(!events.contains(&Event::LeftOut(NodeId(0))));
}

#[test]
fn silent_member_is_not_awaited_until_it_returns() {
    for (returns, keeps_going) in [(false, true), (true, false)] {
        let mut master = master_taking_off();
        notify(&mut master, 19.0, progress(0, 2));
        notify(&mut master, 19.1, RoutingNotice::Silent(NodeId(2).into()));
        if returns {
            notify(&mut master, 19.2, RoutingNotice::Returned(NodeId(2).into()));
        }
        let transmits = arrive(&mut master, 20.0);
        assert_eq!(transmits.contains(&Transmit::Discover), keeps_going);
    }
}

#[test]
fn late_member_flies_open_waypoints_in_order() {
    let mut member = member_at_waypoint_0(Liveness::Heartbeat);
    deliver(&mut member, 5, &open_waypoint(2));
    assert_eq!(
        member.durable.state,
        State::MovingToWaypoint { waypoint: 1 }
    );
    let transmits = arrive(&mut member, 40.0);
    assert_eq!(
        member.durable.state,
        State::MovingToWaypoint { waypoint: 2 }
    );
    assert!(!transmits.contains(&acknowledgement(5)));
    let transmits = arrive(&mut member, 50.0);
    assert!(transmits.contains(&acknowledgement(5)));
}

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
fn master_without_elections_lands_with_its_swarm() {
    let mut master = master_taking_off();
    let transmits = send(&mut master, 20.0, Input::GiveUp);
    assert_eq!(orders(&transmits), [land_at(waypoints()[0])]);
    assert_eq!(master.durable.state, State::Landing);
}

#[test]
fn restarted_mission_resumes_its_leg() {
    let mut member = member_at_waypoint_0(Liveness::Heartbeat);
    deliver(&mut member, 5, &open_waypoint(1));
    let checkpoint = member.durable.clone();
    let mut restarted = Mission::new(config(0, Liveness::Heartbeat), Some(checkpoint));
    let (transmits, _) = stimulate(&mut restarted, 35.0, Stimulus::Timeout);
    let to = Ned::new(100.0, -100.0, -25.0);
    assert_eq!(transmits, [Transmit::Resync, Transmit::Goal(fly_to(to))]);
    let arrived = arrive(&mut restarted, 40.0);
    assert!(arrived.contains(&acknowledgement(5)));
}

#[test]
fn restarted_process_resumes_a_leg_in_lockstep_but_waits_in_its_layer() {
    let mut member = member_at_waypoint_0(Liveness::Heartbeat);
    let (waypoint, apart) = (1, false);
    let goal_after_restart = |member: &Mission| {
        let mut checkpoint = member.durable.clone();
        checkpoint.begin_incarnation();
        let mut restarted = Mission::new(config(0, Liveness::Heartbeat), Some(checkpoint));
        let (transmits, _) = stimulate(&mut restarted, 35.0, Stimulus::Timeout);
        goal(&transmits)
    };
    assert!(matches!(
        goal_after_restart(&member),
        Some(Goal::TransitTo { .. })
    ));
    deliver(&mut member, 5, &Order::Move { waypoint, apart });
    let to = Ned::new(100.0, -100.0, -25.0);
    assert_eq!(goal_after_restart(&member), Some(fly_to(to)));
    // In its slot, with the next waypoint open before routes are ready.
    let mut member = mission(0, Liveness::Heartbeat);
    deliver(&mut member, 1, &complete_plan());
    deliver(&mut member, 2, &Order::TakeOff { wave: 0 });
    arrive(&mut member, 20.0);
    notify(&mut member, 21.0, RoutingNotice::HopUpdateStarted);
    deliver(&mut member, 3, &Order::Move { waypoint, apart });
    assert_eq!(member.durable.state, State::HopUpdate);
    assert!(matches!(
        goal_after_restart(&member),
        Some(Goal::TransitTo { .. })
    ));
}

#[test]
fn restarted_routing_is_told_leader_order_and_landing_again() {
    let mut master = master_taking_off();
    let transmits = notify(&mut master, 15.0, RoutingNotice::Resync);
    assert!(matches!(transmits[0], Transmit::Lead(_)));
    assert_eq!(orders(&transmits), [Order::TakeOff { wave: 0 }]);
    assert!(transmits.contains(&acknowledgement(1)));
    let mut member = member_at_waypoint_0(Liveness::Heartbeat);
    send(&mut member, 35.0, Input::GiveUp);
    let transmits = notify(&mut member, 36.0, RoutingNotice::Resync);
    assert!(transmits.contains(&acknowledgement(2)));
    assert!(transmits.contains(&Transmit::Land));
    send(
        &mut member,
        60.0,
        Input::Navigation(NavigationNotice::Landed),
    );
    let transmits = notify(&mut member, 61.0, RoutingNotice::Resync);
    assert!(transmits.contains(&Transmit::Stop));
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

#[test]
fn each_part_of_a_long_plan_has_its_limit() {
    let mut config = config(1, Liveness::Heartbeat);
    config.mission = vec![Ned::new(0.0, 0.0, -25.0); wire::PLAN_PART_MAX * 2 + 1].into();
    let mut master = Mission::new(config, None);
    send(&mut master, 0.0, Input::Fly);
    // No answers: the limit of the first part leaves out all members, and the master continues alone.
    let (transmits, _) = stimulate(&mut master, 30.0, Stimulus::Timeout);
    assert_eq!(orders(&transmits).last(), Some(&Order::TakeOff { wave: 0 }));
    // One member acknowledges the first part only.
    let mut master = Mission::new(master.config, None);
    send(&mut master, 0.0, Input::Fly);
    notify(&mut master, 1.0, progress(0, 1));
    stimulate(&mut master, 30.0, Stimulus::Timeout);
    let (transmits, _) = stimulate(&mut master, 60.0, Stimulus::Timeout);
    assert_eq!(orders(&transmits).last(), Some(&Order::TakeOff { wave: 0 }));
}

#[test]
fn failing_drone_stays_on_the_ground_and_a_failing_master_its_swarm() {
    let mut member = mission(0, Liveness::Heartbeat);
    deliver(&mut member, 1, &complete_plan());
    let transmits = send(&mut member, 5.0, Input::GiveUp);
    assert!(
        transmits.contains(&Transmit::Land),
        "the others stop waiting"
    );
    assert!(deliver(&mut member, 2, &Order::TakeOff { wave: 0 }).is_empty());
    let mut master = mission(1, Liveness::Heartbeat);
    send(&mut master, 0.0, Input::Fly);
    send(&mut master, 5.0, Input::GiveUp);
    assert!(orders(&stimulate(&mut master, 30.0, Stimulus::Timeout).0).is_empty());
    notify(&mut master, 31.0, progress(0, 1));
    assert!(orders(&notify(&mut master, 31.0, progress(2, 1))).is_empty());
}

#[test]
fn member_that_makes_progress_is_not_silent() {
    let mut master = master_taking_off();
    notify(&mut master, 5.0, RoutingNotice::Silent(NodeId(2).into()));
    notify(&mut master, 6.0, progress(2, 1));
    notify(&mut master, 19.0, progress(0, 2));
    assert!(!arrive(&mut master, 20.0).contains(&Transmit::Discover));
}

#[test]
fn undecodable_order_is_refused() {
    let mut member = mission(0, Liveness::Heartbeat);
    let notice = RoutingNotice::Order {
        ballot: Ballot {
            term: 1,
            rank: 0,
            master: NodeId(1),
        },
        sequence: 1,
        order: Bytes::from_static(&[0xff, 0xff]),
    };
    let (transmits, events) = stimulate(&mut member, 0.0, Stimulus::Input(Input::Routing(notice)));
    assert!(transmits.is_empty());
    assert!(events.contains(&Event::Refused));
}
