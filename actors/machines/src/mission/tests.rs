mod change;
mod election;
mod failsafe;
mod follow;
mod hold;
mod waves;

use std::num::NonZeroU32;

use super::*;
use crate::formation::{Formation, Kind, Layering, Separation};
use crate::machine::{Emitted, Stimulus, step};
use crate::navigation::Failure;

/// Of the leader epoch that the operator starts.
const OPERATORS: Ballot = Ballot {
    term: 1,
    rank: 0,
    master: NodeId(1),
};

const SECOND: Duration = Duration::from_secs(1);

/// The lowest layer above the slots.
const PITCH_M: f64 = 5.5;

/// Straight to a slot, in lockstep with the swarm.
fn fly_to(to: Ned) -> Goal {
    Goal::FlyTo {
        to,
        hold_altitude_m: to.altitude_m() + PITCH_M,
    }
}

fn waypoints() -> Vec<Ned> {
    [0.0, 100.0, 200.0]
        .map(|north_m| Ned::new(north_m, 0.0, -25.0))
        .into()
}

/// Drone `id` of a line of three, 1 being the centre.
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
        spreading_patience: Duration::ZERO,
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
    let Ok(deadline) = step(mission, now, stimulus, |said| match said {
        Emitted::Transmit(transmit) => transmits.push(transmit),
        Emitted::Event(event) => events.push(event),
    });
    let is_overdue = is_timeout && deadline.is_some_and(|deadline| deadline <= now);
    assert!(!is_overdue, "at {now} its deadline is {deadline:?}");
    (transmits, events)
}

fn told(mission: &mut Mission, at_s: f64, input: Input) -> Vec<Transmit> {
    stimulate(mission, at_s, Stimulus::Input(input)).0
}

fn ordered(mission: &mut Mission, sequence: u32, order: &Order) -> Vec<Transmit> {
    let ballot = OPERATORS;
    let order = wire::encode_order(order).into();
    let notice = RoutingNotice::Order {
        ballot,
        sequence,
        order,
    };
    told(mission, 1.0, Input::Routing(notice))
}

fn hears(mission: &mut Mission, at_s: f64, notice: RoutingNotice) -> Vec<Transmit> {
    told(mission, at_s, Input::Routing(notice))
}

fn progress(member: u32, acknowledged: u32) -> RoutingNotice {
    RoutingNotice::Progress {
        sequence: acknowledged,
        acknowledged: NodeId(member).into(),
        landing: NodeSet::default(),
    }
}

fn acknowledges(sequence: u32) -> Transmit {
    Transmit::Acknowledge {
        ballot: OPERATORS,
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

fn land_at(at: Ned) -> Order {
    Order::Land {
        at,
        changes: 0,
        apart: false,
        wave: 0,
    }
}

fn whole_plan() -> Order {
    Order::Plan {
        index: 0,
        count: 1,
        waypoints: waypoints(),
        holds: Vec::new(),
    }
}

/// A slave in its slot at waypoint 0, routes up.
fn slave_at_waypoint_0(liveness: Liveness) -> Mission {
    let mut slave = mission(0, liveness);
    ordered(&mut slave, 1, &whole_plan());
    ordered(&mut slave, 2, &Order::TakeOff { wave: 0 });
    told(
        &mut slave,
        20.0,
        Input::Navigation(NavigationNotice::Arrived),
    );
    for notice in [
        RoutingNotice::DiscoveryStarted,
        RoutingNotice::HopUpdateStarted,
        RoutingNotice::RoutesReady,
    ] {
        hears(&mut slave, 30.0, notice);
    }
    assert_eq!(slave.durable.state, State::WaypointReached { waypoint: 0 });
    slave
}

/// A master whose two members have the plan and are taking off.
fn master_taking_off() -> Mission {
    master_taking_off_with(Barrier::Strict)
}

fn master_taking_off_with(barrier: Barrier) -> Mission {
    let config = Config {
        barrier,
        ..config(1, Liveness::Heartbeat)
    };
    let mut master = Mission::new(config, None);
    told(&mut master, 0.0, Input::Fly);
    hears(&mut master, 1.0, progress(0, 1));
    let transmits = hears(&mut master, 1.0, progress(2, 1));
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
fn only_the_drone_at_the_centre_leads_and_only_once_told() {
    let mut slave = mission(0, Liveness::Heartbeat);
    let (transmits, events) = stimulate(&mut slave, 0.0, Stimulus::Input(Input::Fly));
    assert!(transmits.is_empty());
    assert_eq!(events[0], Event::Refused);
    let mut master = mission(1, Liveness::Heartbeat);
    assert!(stimulate(&mut master, 0.0, Stimulus::Timeout).0.is_empty());
    assert_eq!(orders(&told(&mut master, 0.0, Input::Fly)), [whole_plan()]);
}

#[test]
fn nobody_takes_off_without_the_whole_mission() {
    let mut slave = mission(0, Liveness::Heartbeat);
    assert!(ordered(&mut slave, 1, &Order::TakeOff { wave: 0 }).is_empty());
    let half = Order::Plan {
        index: 0,
        count: 2,
        waypoints: vec![Ned::HOME; wire::PLAN_PART_MAX],
        holds: Vec::new(),
    };
    assert_eq!(ordered(&mut slave, 1, &half), [acknowledges(1)]);
    assert!(ordered(&mut slave, 3, &Order::TakeOff { wave: 0 }).is_empty());
    assert_eq!(slave.durable.state, State::SetUp);
}

#[test]
fn a_member_that_does_not_get_ready_is_left_out_after_the_limit() {
    let mut master = mission(1, Liveness::Heartbeat);
    told(&mut master, 0.0, Input::Fly);
    assert!(
        orders(&hears(&mut master, 1.0, progress(0, 1))).is_empty(),
        "drone 2 is missing"
    );
    let (transmits, events) = stimulate(&mut master, 30.0, Stimulus::Timeout);
    assert_eq!(orders(&transmits), [Order::TakeOff { wave: 0 }]);
    assert!(events.contains(&Event::LeftOut(NodeId(2))));
}

#[test]
fn a_member_that_does_not_get_to_its_slot_is_left_out_after_the_limit() {
    let mut master = master_taking_off();
    told(
        &mut master,
        20.0,
        Input::Navigation(NavigationNotice::Arrived),
    );
    hears(&mut master, 21.0, progress(0, 2));
    let (transmits, events) = stimulate(&mut master, 61.0, Stimulus::Timeout);
    assert_eq!(transmits, [Transmit::Discover]);
    assert!(events.contains(&Event::LeftOut(NodeId(2))));
}

#[test]
fn while_the_swarm_takes_off_a_master_waits_for_silent_members_as_long_as_they_bear_its_silence() {
    let mut master = master_taking_off();
    master.config.spreading_patience = 6 * SECOND;
    let arrived = Input::Navigation(NavigationNotice::Arrived);
    told(&mut master, 20.0, arrived);
    hears(&mut master, 21.0, progress(0, 2));
    let silent = RoutingNotice::Silent(NodeId(2).into());
    assert_eq!(hears(&mut master, 30.0, silent), []);
    assert_eq!(stimulate(&mut master, 35.9, Stimulus::Timeout).0, []);
    let (said, _) = stimulate(&mut master, 36.0, Stimulus::Timeout);
    assert_eq!(said, [Transmit::Discover]);
}

#[test]
fn whoever_misses_its_master_does_not_take_off_at_an_old_word_and_asks_once_it_is_back() {
    let mut slave = mission(0, Liveness::Heartbeat);
    ordered(&mut slave, 1, &whole_plan());
    hears(&mut slave, 1.0, RoutingNotice::MasterSilent);
    assert_eq!(ordered(&mut slave, 2, &Order::TakeOff { wave: 0 }), []);
    assert_eq!(slave.durable.state, State::SetUp);
    let said = hears(&mut slave, 2.0, RoutingNotice::MasterReturned);
    assert_eq!(said, [Transmit::Resync]);
    ordered(&mut slave, 2, &Order::TakeOff { wave: 0 });
    assert_eq!(slave.durable.state, State::TakingOff);
}

#[test]
fn a_waypoint_opens_once_the_last_member_is_there() {
    let mut master = master_taking_off();
    told(
        &mut master,
        20.0,
        Input::Navigation(NavigationNotice::Arrived),
    );
    hears(&mut master, 21.0, progress(0, 2));
    let transmits = hears(&mut master, 22.0, progress(2, 2));
    assert_eq!(transmits, [Transmit::Discover]);
    for notice in [
        RoutingNotice::DiscoveryStarted,
        RoutingNotice::HopUpdateStarted,
    ] {
        hears(&mut master, 23.0, notice);
    }
    let opened = hears(&mut master, 32.0, RoutingNotice::RoutesReady);
    assert_eq!(
        orders(&opened),
        [Order::Move {
            waypoint: 0,
            apart: false
        }]
    );
    assert!(orders(&hears(&mut master, 33.0, progress(0, 3))).is_empty());
    let transmits = hears(&mut master, 33.0, progress(2, 3));
    assert_eq!(
        orders(&transmits),
        [Order::Move {
            waypoint: 1,
            apart: false
        }]
    );
    assert_eq!(
        master.durable.state,
        State::MovingToWaypoint { waypoint: 1 }
    );
}

#[test]
fn at_a_waypoint_a_master_may_wait_for_those_that_it_hears_and_on_the_way_up_it_may_not() {
    let mut master = master_taking_off_with(Barrier::Neighbours);
    let arrived = Input::Navigation(NavigationNotice::Arrived);
    told(&mut master, 20.0, arrived.clone());
    let transmits = hears(&mut master, 21.0, progress(2, 2));
    assert!(transmits.is_empty(), "drone 0 is still on its way up");
    hears(&mut master, 22.0, progress(0, 2));
    let neighbours = [NodeId(2)].into_iter().collect();
    hears(&mut master, 30.0, RoutingNotice::Hears(neighbours));
    hears(&mut master, 30.0, RoutingNotice::RoutesReady);
    assert!(orders(&hears(&mut master, 31.0, progress(0, 3))).is_empty());
    let transmits = hears(&mut master, 32.0, progress(2, 3));
    assert_eq!(
        orders(&transmits),
        [Order::Move {
            waypoint: 1,
            apart: false
        }]
    );
    told(&mut master, 60.0, arrived);
    let transmits = hears(&mut master, 61.0, progress(2, 4));
    assert_eq!(
        orders(&transmits),
        [Order::Move {
            waypoint: 2,
            apart: false
        }]
    );
}

#[test]
fn only_those_that_are_waited_for_are_left_out() {
    let mut master = master_taking_off_with(Barrier::Neighbours);
    hears(&mut master, 20.0, progress(0, 2));
    hears(&mut master, 20.0, progress(2, 2));
    let arrived = Input::Navigation(NavigationNotice::Arrived);
    told(&mut master, 20.0, arrived.clone());
    let neighbours = [NodeId(2)].into_iter().collect();
    hears(&mut master, 30.0, RoutingNotice::Hears(neighbours));
    hears(&mut master, 30.0, RoutingNotice::RoutesReady);
    hears(&mut master, 32.0, progress(2, 3));
    told(&mut master, 60.0, arrived);
    let (transmits, events) = stimulate(&mut master, 160.0, Stimulus::Timeout);
    let (waypoint, apart) = (2, true);
    assert_eq!(orders(&transmits), [Order::Move { waypoint, apart }]);
    assert!(events.contains(&Event::LeftOut(NodeId(2))));
    assert!(!events.contains(&Event::LeftOut(NodeId(0))));
}

#[test]
fn a_silent_member_holds_nobody_up_and_one_that_comes_back_is_waited_for_again() {
    for (returns, keeps_going) in [(false, true), (true, false)] {
        let mut master = master_taking_off();
        hears(&mut master, 19.0, progress(0, 2));
        hears(&mut master, 19.1, RoutingNotice::Silent(NodeId(2).into()));
        if returns {
            hears(&mut master, 19.2, RoutingNotice::Returned(NodeId(2).into()));
        }
        let transmits = told(
            &mut master,
            20.0,
            Input::Navigation(NavigationNotice::Arrived),
        );
        assert_eq!(transmits.contains(&Transmit::Discover), keeps_going);
    }
}

#[test]
fn a_drone_that_is_behind_flies_the_opened_waypoints_in_order() {
    let mut slave = slave_at_waypoint_0(Liveness::Heartbeat);
    ordered(
        &mut slave,
        5,
        &Order::Move {
            waypoint: 2,
            apart: false,
        },
    );
    assert_eq!(slave.durable.state, State::MovingToWaypoint { waypoint: 1 });
    let transmits = told(
        &mut slave,
        40.0,
        Input::Navigation(NavigationNotice::Arrived),
    );
    assert_eq!(slave.durable.state, State::MovingToWaypoint { waypoint: 2 });
    assert!(!transmits.contains(&acknowledges(5)));
    let transmits = told(
        &mut slave,
        50.0,
        Input::Navigation(NavigationNotice::Arrived),
    );
    assert!(transmits.contains(&acknowledges(5)));
}

#[test]
fn a_drone_that_is_not_in_its_slot_when_the_swarm_moves_on_lands() {
    let mut slave = mission(0, Liveness::Heartbeat);
    ordered(&mut slave, 1, &whole_plan());
    ordered(&mut slave, 2, &Order::TakeOff { wave: 0 });
    let transmits = ordered(
        &mut slave,
        3,
        &Order::Move {
            waypoint: 0,
            apart: false,
        },
    );
    assert_eq!(transmits, [], "on its way there may be others below it");
    assert_eq!(slave.durable.state, State::TakingOff);
    let arrived = Input::Navigation(NavigationNotice::Arrived);
    told(&mut slave, 20.0, arrived.clone());
    assert_eq!(slave.durable.state, State::MovingToLand);
    let transmits = told(&mut slave, 30.0, arrived);
    assert!(transmits.contains(&Transmit::Goal(Goal::Land)));
    assert_eq!(slave.durable.state, State::Landing);
}

#[test]
fn a_landing_drone_obeys_nobody_any_more() {
    let mut slave = slave_at_waypoint_0(Liveness::Heartbeat);
    told(&mut slave, 35.0, Input::GiveUp);
    assert_eq!(slave.durable.state, State::Landing);
    assert!(
        ordered(
            &mut slave,
            9,
            &Order::Move {
                waypoint: 1,
                apart: false
            }
        )
        .is_empty()
    );
    assert_eq!(slave.durable.state, State::Landing);
}

#[test]
fn a_silent_master_brings_a_drone_down_in_flight_too_unless_the_thesis_is_followed() {
    // At the end of the leg, which it is told of in mid-leg or there.
    for (liveness, in_mid_leg, there) in [
        (
            Liveness::Heartbeat,
            Some(LandingReason::MasterSilent),
            State::MovingToLand,
        ),
        (Liveness::Thesis, None, State::Landing),
    ] {
        let mut slave = slave_at_waypoint_0(liveness);
        ordered(
            &mut slave,
            5,
            &Order::Move {
                waypoint: 1,
                apart: false,
            },
        );
        hears(&mut slave, 40.0, RoutingNotice::MasterSilent);
        let moving = State::MovingToWaypoint { waypoint: 1 };
        assert_eq!(slave.durable.state, moving);
        assert_eq!(slave.durable.leaving, in_mid_leg);
        told(
            &mut slave,
            50.0,
            Input::Navigation(NavigationNotice::Arrived),
        );
        assert_eq!(slave.durable.state, there);
    }
}

#[test]
fn a_leg_that_takes_too_long_ends_in_a_landing() {
    let mut slave = slave_at_waypoint_0(Liveness::Heartbeat);
    ordered(
        &mut slave,
        5,
        &Order::Move {
            waypoint: 1,
            apart: false,
        },
    );
    stimulate(&mut slave, 100.9, Stimulus::Timeout);
    assert_eq!(slave.durable.state, State::MovingToWaypoint { waypoint: 1 });
    stimulate(&mut slave, 101.0, Stimulus::Timeout);
    assert_eq!(slave.durable.state, State::Landing);
}

#[test]
fn a_master_that_must_land_takes_its_swarm_down_with_it() {
    let mut master = master_taking_off();
    let transmits = told(&mut master, 20.0, Input::GiveUp);
    assert_eq!(orders(&transmits), [land_at(waypoints()[0])]);
    assert_eq!(master.durable.state, State::Landing);
}

#[test]
fn a_restarted_mission_goes_on_where_it_was() {
    let mut slave = slave_at_waypoint_0(Liveness::Heartbeat);
    ordered(
        &mut slave,
        5,
        &Order::Move {
            waypoint: 1,
            apart: false,
        },
    );
    let checkpoint = slave.durable.clone();
    let mut restarted = Mission::new(config(0, Liveness::Heartbeat), Some(checkpoint));
    let (transmits, _) = stimulate(&mut restarted, 35.0, Stimulus::Timeout);
    let to = Ned::new(100.0, -100.0, -25.0);
    assert_eq!(transmits, [Transmit::Resync, Transmit::Goal(fly_to(to))]);
    let arrived = told(
        &mut restarted,
        40.0,
        Input::Navigation(NavigationNotice::Arrived),
    );
    assert!(arrived.contains(&acknowledges(5)));
}

#[test]
fn a_process_that_starts_anew_in_mid_leg_flies_on_among_the_others_and_at_a_waypoint_climbs() {
    let mut slave = slave_at_waypoint_0(Liveness::Heartbeat);
    let (waypoint, apart) = (1, false);
    let starts_anew = |slave: &Mission| {
        let mut checkpoint = slave.durable.clone();
        checkpoint.begin_incarnation();
        let mut restarted = Mission::new(config(0, Liveness::Heartbeat), Some(checkpoint));
        let (transmits, _) = stimulate(&mut restarted, 35.0, Stimulus::Timeout);
        goal(&transmits)
    };
    assert!(matches!(starts_anew(&slave), Some(Goal::TransitTo { .. })));
    ordered(&mut slave, 5, &Order::Move { waypoint, apart });
    let to = Ned::new(100.0, -100.0, -25.0);
    assert_eq!(starts_anew(&slave), Some(fly_to(to)));
    // In its slot, told to move on before there are ways.
    let mut slave = mission(0, Liveness::Heartbeat);
    ordered(&mut slave, 1, &whole_plan());
    ordered(&mut slave, 2, &Order::TakeOff { wave: 0 });
    let arrived = Input::Navigation(NavigationNotice::Arrived);
    told(&mut slave, 20.0, arrived);
    hears(&mut slave, 21.0, RoutingNotice::HopUpdateStarted);
    ordered(&mut slave, 3, &Order::Move { waypoint, apart });
    assert_eq!(slave.durable.state, State::HopUpdate);
    assert!(matches!(starts_anew(&slave), Some(Goal::TransitTo { .. })));
}

#[test]
fn what_is_out_is_said_again_to_a_restarted_routing() {
    let mut master = master_taking_off();
    let said = hears(&mut master, 15.0, RoutingNotice::Resync);
    assert!(matches!(said[0], Transmit::Lead(_)));
    assert_eq!(orders(&said), [Order::TakeOff { wave: 0 }]);
    assert!(said.contains(&acknowledges(1)));
    let mut slave = slave_at_waypoint_0(Liveness::Heartbeat);
    told(&mut slave, 35.0, Input::GiveUp);
    let said = hears(&mut slave, 36.0, RoutingNotice::Resync);
    assert!(said.contains(&acknowledges(2)));
    assert!(said.contains(&Transmit::Land));
    told(
        &mut slave,
        60.0,
        Input::Navigation(NavigationNotice::Landed),
    );
    let said = hears(&mut slave, 61.0, RoutingNotice::Resync);
    assert!(said.contains(&Transmit::Stop));
}

#[test]
fn take_off_and_the_way_to_land_have_limits() {
    let mut slave = mission(0, Liveness::Heartbeat);
    ordered(&mut slave, 1, &whole_plan());
    ordered(&mut slave, 2, &Order::TakeOff { wave: 0 });
    stimulate(&mut slave, 61.0, Stimulus::Timeout);
    assert_eq!(slave.durable.state, State::Landing);
    let mut slave = slave_at_waypoint_0(Liveness::Heartbeat);
    ordered(&mut slave, 5, &land_at(waypoints()[0]));
    assert_eq!(slave.durable.state, State::MovingToLand);
    stimulate(&mut slave, 101.0, Stimulus::Timeout);
    assert_eq!(slave.durable.state, State::Landing);
}

#[test]
fn the_way_to_land_is_flown_in_the_drone_s_own_layer() {
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
        .find(|(id, layer_m)| *id != OPERATORS.master.0 && **layer_m > 0.0)
        .expect("a matrix of 40 needs layers");
    config.id = NodeId(id);
    let expected_m = 25.0 + layer_m;
    let mut slave = Mission::new(config, None);
    ordered(&mut slave, 1, &whole_plan());
    ordered(&mut slave, 2, &Order::TakeOff { wave: 0 });
    told(
        &mut slave,
        20.0,
        Input::Navigation(NavigationNotice::Arrived),
    );
    let at = waypoints()[2];
    let said = ordered(&mut slave, 3, &land_at(at));
    let goal = said.iter().find_map(|transmit| match transmit {
        Transmit::Goal(Goal::TransitTo { to }) => Some(to.altitude_m()),
        _ => None,
    });
    assert_eq!(goal, Some(expected_m));
}

#[test]
fn every_part_of_a_long_mission_has_its_limit() {
    let mut config = config(1, Liveness::Heartbeat);
    config.mission = vec![Ned::new(0.0, 0.0, -25.0); wire::PLAN_PART_MAX * 2 + 1].into();
    let mut master = Mission::new(config, None);
    told(&mut master, 0.0, Input::Fly);
    // Nobody answers: the limit of the first part leaves all out, and the master goes on alone.
    let (transmits, _) = stimulate(&mut master, 30.0, Stimulus::Timeout);
    assert_eq!(orders(&transmits).last(), Some(&Order::TakeOff { wave: 0 }));
    // One answers the first part and no more.
    let mut master = Mission::new(master.config, None);
    told(&mut master, 0.0, Input::Fly);
    hears(&mut master, 1.0, progress(0, 1));
    stimulate(&mut master, 30.0, Stimulus::Timeout);
    let (transmits, _) = stimulate(&mut master, 60.0, Stimulus::Timeout);
    assert_eq!(orders(&transmits).last(), Some(&Order::TakeOff { wave: 0 }));
}

#[test]
fn a_drone_given_up_on_the_ground_stays_there_and_so_does_a_swarm_without_its_master() {
    let mut slave = mission(0, Liveness::Heartbeat);
    ordered(&mut slave, 1, &whole_plan());
    let said = told(&mut slave, 5.0, Input::GiveUp);
    assert!(said.contains(&Transmit::Land), "nobody is to wait for it");
    assert!(ordered(&mut slave, 2, &Order::TakeOff { wave: 0 }).is_empty());
    let mut master = mission(1, Liveness::Heartbeat);
    told(&mut master, 0.0, Input::Fly);
    told(&mut master, 5.0, Input::GiveUp);
    assert!(orders(&stimulate(&mut master, 30.0, Stimulus::Timeout).0).is_empty());
    hears(&mut master, 31.0, progress(0, 1));
    assert!(orders(&hears(&mut master, 31.0, progress(2, 1))).is_empty());
}

#[test]
fn a_member_that_makes_progress_is_not_silent() {
    let mut master = master_taking_off();
    hears(&mut master, 5.0, RoutingNotice::Silent(NodeId(2).into()));
    hears(&mut master, 6.0, progress(2, 1));
    hears(&mut master, 19.0, progress(0, 2));
    let arrived = Input::Navigation(NavigationNotice::Arrived);
    assert!(!told(&mut master, 20.0, arrived).contains(&Transmit::Discover));
}

#[test]
fn an_order_that_is_none_is_counted_and_not_obeyed() {
    let mut slave = mission(0, Liveness::Heartbeat);
    let notice = RoutingNotice::Order {
        ballot: Ballot {
            term: 1,
            rank: 0,
            master: NodeId(1),
        },
        sequence: 1,
        order: Bytes::from_static(&[0xff, 0xff]),
    };
    let (transmits, events) = stimulate(&mut slave, 0.0, Stimulus::Input(Input::Routing(notice)));
    assert!(transmits.is_empty());
    assert!(events.contains(&Event::Refused));
}
