//! Changes of formation, step by step.

use super::*;
use crate::formation::Layering;
use crate::mission::Step;

/// Drone `id` of a line of three that becomes a matrix at waypoint 0.
fn config_with_a_change(id: u32) -> Config {
    let mut config = config(id, Liveness::Heartbeat);
    let drones = NonZeroU32::new(3).unwrap();
    let matrix = Formation::new(Kind::CompactMatrix, drones, 100.0, 0.0);
    config.changes = Arc::new([Change::new(0, &config.layout, matrix)]);
    config
}

fn step_of_change(step: Step) -> Order {
    Order::Reform {
        change: 0,
        step,
        apart: false,
        wave: 0,
    }
}

fn slave_in_its_slot() -> Mission {
    slave_of(config_with_a_change(0))
}

fn slave_of(config: Config) -> Mission {
    let mut slave = Mission::new(config, None);
    ordered(&mut slave, 1, &whole_plan());
    ordered(&mut slave, 2, &Order::TakeOff { wave: 0 });
    arrives(&mut slave, 20.0);
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

fn arrives(mission: &mut Mission, at_s: f64) -> Vec<Transmit> {
    told(mission, at_s, Input::Navigation(NavigationNotice::Arrived))
}

#[test]
fn a_slave_takes_the_steps_one_by_one_and_acknowledges_each_once_it_is_taken() {
    let mut slave = slave_in_its_slot();
    let corners = slave.config.changes[0].path(NodeId(0), waypoints()[0]);
    let steps = [Step::Climb, Step::Cross, Step::Descend];
    for ((sequence, step), to) in (4..).zip(steps).zip(corners) {
        let said = ordered(&mut slave, sequence, &step_of_change(step));
        let hold_altitude_m = to.altitude_m();
        assert_eq!(
            goal(&said),
            Some(Goal::FlyTo {
                to,
                hold_altitude_m
            })
        );
        assert!(!said.contains(&acknowledges(sequence)));
        let said = arrives(&mut slave, 30.0);
        assert!(said.contains(&acknowledges(sequence)));
    }
    assert_eq!(slave.durable.state, State::WaypointReached { waypoint: 0 });
    let said = ordered(
        &mut slave,
        7,
        &Order::Move {
            waypoint: 1,
            apart: false,
        },
    );
    let slot = slave.config.changes[0]
        .layout()
        .slot(NodeId(0), waypoints()[1]);
    assert_eq!(goal(&said), Some(fly_to(slot)));
}

#[test]
fn a_slave_that_missed_a_step_lands_instead_of_flying_into_the_others() {
    let mut slave = slave_in_its_slot();
    let said = ordered(&mut slave, 5, &step_of_change(Step::Cross));
    assert_eq!(goal(&said), Some(Goal::Land));
    let mut slave = slave_in_its_slot();
    ordered(&mut slave, 4, &step_of_change(Step::Climb));
    let said = ordered(&mut slave, 5, &step_of_change(Step::Cross));
    assert_eq!(goal(&said), Some(Goal::Land), "it is still climbing");
    let mut slave = slave_in_its_slot();
    let said = ordered(
        &mut slave,
        7,
        &Order::Move {
            waypoint: 1,
            apart: false,
        },
    );
    assert_eq!(goal(&said), Some(Goal::Land), "the others have changed");
}

#[test]
fn a_change_that_is_none_is_refused() {
    for change in [1, u16::MAX] {
        let mut slave = slave_in_its_slot();
        let step = Step::Climb;
        assert_eq!(
            ordered(
                &mut slave,
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
    let mut slave = slave_in_its_slot();
    let at = waypoints()[0];
    let changes = 2;
    assert_eq!(
        ordered(
            &mut slave,
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
fn a_master_orders_each_step_once_all_have_taken_the_one_before() {
    let mut master = Mission::new(config_with_a_change(1), None);
    told(&mut master, 0.0, Input::Fly);
    hears(&mut master, 1.0, progress(0, 1));
    hears(&mut master, 1.0, progress(2, 1));
    arrives(&mut master, 20.0);
    hears(&mut master, 20.0, progress(0, 2));
    hears(&mut master, 20.0, progress(2, 2));
    let said = hears(&mut master, 30.0, RoutingNotice::RoutesReady);
    assert_eq!(
        orders(&said),
        [Order::Move {
            waypoint: 0,
            apart: false
        }]
    );
    hears(&mut master, 31.0, progress(0, 3));
    let mut said = hears(&mut master, 31.0, progress(2, 3));
    for (sequence, step) in (4..).zip([Step::Climb, Step::Cross, Step::Descend]) {
        assert_eq!(orders(&said), [step_of_change(step)]);
        assert_eq!(orders(&arrives(&mut master, 40.0)), []);
        hears(&mut master, 41.0, progress(0, sequence));
        said = hears(&mut master, 41.0, progress(2, sequence));
    }
    assert_eq!(
        orders(&said),
        [Order::Move {
            waypoint: 1,
            apart: false
        }]
    );
}

#[test]
fn a_master_goes_on_without_a_member_that_never_takes_the_step() {
    let mut master = Mission::new(config_with_a_change(1), None);
    told(&mut master, 0.0, Input::Fly);
    hears(&mut master, 1.0, progress(0, 1));
    hears(&mut master, 1.0, progress(2, 1));
    arrives(&mut master, 20.0);
    hears(&mut master, 20.0, progress(0, 2));
    hears(&mut master, 20.0, progress(2, 2));
    hears(&mut master, 30.0, RoutingNotice::RoutesReady);
    hears(&mut master, 31.0, progress(0, 3));
    hears(&mut master, 31.0, progress(2, 3));
    arrives(&mut master, 40.0);
    hears(&mut master, 41.0, progress(0, 4));
    let (said, events) = stimulate(&mut master, 140.0, Stimulus::Timeout);
    // The one that is left out may be in the way of the others: they keep apart.
    let (change, step, apart) = (0, Step::Cross, true);
    let cross = Order::Reform {
        change,
        step,
        apart,
        wave: 0,
    };
    assert_eq!(orders(&said), [cross]);
    assert!(events.contains(&Event::LeftOut(NodeId(2))));
}

#[test]
fn whoever_misses_its_master_below_where_others_may_cross_waits_in_its_layer() {
    let mut slave = slave_in_its_slot();
    slave.config.succession = Succession::Elect;
    slave.config.spreading_patience = 6 * SECOND;
    ordered(&mut slave, 4, &step_of_change(Step::Climb));
    assert_eq!(hears(&mut slave, 10.0, RoutingNotice::MasterSilent), []);
    let said = arrives(&mut slave, 11.0);
    assert!(slave.durable.in_layer && said.contains(&Transmit::Scatter));
}

/// Everybody has a layer of its own, and the formation is changed at a waypoint.
fn config_in_layers(waypoint: u16) -> Config {
    let mut config = config_with_a_change(0);
    let matrix = config.changes[0].layout().formation().clone();
    let layout = Arc::into_inner(config.layout).unwrap();
    let layout = layout.with_layers(Layering::Each);
    config.changes = Arc::new([Change::new(waypoint, &layout, matrix)]);
    config.layout = Arc::new(layout);
    config
}

#[test]
fn a_slave_in_its_own_layer_that_still_looks_for_routes_takes_the_step_that_the_others_take() {
    for state in [
        State::TakingOff,
        State::NeighbourDiscovery,
        State::HopUpdate,
    ] {
        let mut slave = Mission::new(config_in_layers(0), None);
        ordered(&mut slave, 1, &whole_plan());
        ordered(&mut slave, 2, &Order::TakeOff { wave: 0 });
        arrives(&mut slave, 20.0);
        slave.durable.in_layer = true;
        slave.durable.state = state;
        let said = ordered(&mut slave, 4, &step_of_change(Step::Cross));
        assert!(goal(&said).is_some(), "{state:?}");
        assert!(arrives(&mut slave, 30.0).contains(&acknowledges(4)));
    }
}

#[test]
fn a_slave_in_its_own_layer_that_missed_a_step_catches_up() {
    let mut slave = slave_of(config_in_layers(1));
    slave.durable.in_layer = true;
    // It is at waypoint 0, and the others change formation at waypoint 1.
    let said = ordered(&mut slave, 4, &step_of_change(Step::Cross));
    assert!(!said.contains(&acknowledges(4)));
    let moves = State::MovingToWaypoint { waypoint: 1 };
    assert_eq!(slave.durable.state, moves);
    let said = arrives(&mut slave, 30.0);
    assert!(said.contains(&Transmit::Resync), "{said:?}");
    let said = ordered(&mut slave, 4, &step_of_change(Step::Cross));
    assert!(goal(&said).is_some());
    assert!(arrives(&mut slave, 40.0).contains(&acknowledges(4)));
}

#[test]
fn told_to_land_amid_a_step_a_member_takes_it_and_comes_down_there() {
    let mut slave = slave_in_its_slot();
    ordered(&mut slave, 4, &step_of_change(Step::Climb));
    let said = ordered(&mut slave, 5, &land_at(waypoints()[0]));
    assert_eq!(goal(&said), None, "the step is flown on");
    let there = arrives(&mut slave, 30.0);
    assert_eq!(slave.durable.state, State::Landing);
    assert_eq!(goal(&there), Some(Goal::Land));
}
