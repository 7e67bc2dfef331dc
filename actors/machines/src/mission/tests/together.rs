//! A swarm that misses members for the first time flies on together, in its master's layer.

use super::*;
use crate::wire::Step;

/// Drone `id` of a line of three with a layer each.
fn config_in_layers(id: u32) -> Config {
    let mut config = config(id, Liveness::Heartbeat);
    let layout = Arc::into_inner(config.layout).unwrap();
    config.layout = Arc::new(layout.with_layers(Layering::PerDrone));
    config
}

/// A master whose members fly to waypoint 1, by order 4.
fn master_on_first_leg() -> Mission {
    let mut config = config_in_layers(1);
    config.mission = [waypoints(), waypoints()].concat().into();
    let mut master = Mission::new(config, None);
    send(&mut master, 0.0, Input::Fly);
    for sequence in [1, 2] {
        notify(&mut master, 20.0, progress(0, sequence));
        notify(&mut master, 20.0, progress(2, sequence));
    }
    arrive(&mut master, 20.0);
    notify(&mut master, 30.0, RoutingNotice::RoutesReady);
    notify(&mut master, 32.0, progress(0, 3));
    let transmits = notify(&mut master, 32.0, progress(2, 3));
    assert_eq!(orders(&transmits), [open_waypoint(1)]);
    master
}

/// A member at waypoint 0 whose others miss drone 2.
fn member_of_others(strays: impl Into<NodeSet>) -> (Mission, Vec<Transmit>) {
    let mut member = Mission::new(config_in_layers(0), None);
    deliver(&mut member, 1, &complete_plan());
    deliver(&mut member, 2, &Order::TakeOff { wave: 0 });
    arrive(&mut member, 20.0);
    deliver(&mut member, 3, &open_waypoint(0));
    notify(&mut member, 30.0, RoutingNotice::RoutesReady);
    let (waypoint, strays) = (1, strays.into());
    let transmits = deliver(&mut member, 4, &Order::MoveTogether { waypoint, strays });
    (member, transmits)
}

fn altitude_of(member: &Mission, id: u32) -> f64 {
    member.altitude_in_layer_m(NodeId(id), waypoints()[1])
}

#[test]
fn master_that_misses_a_member_leads_the_others_in_its_own_layer() {
    let mut master = master_on_first_leg();
    notify(&mut master, 40.0, RoutingNotice::Silent(NodeId(2).into()));
    arrive(&mut master, 60.0);
    let transmits = notify(&mut master, 61.0, progress(0, 4));
    let (waypoint, strays) = (2, NodeId(2).into());
    assert_eq!(
        orders(&transmits),
        [Order::MoveTogether { waypoint, strays }]
    );
    let Some(Goal::TransitTo { to }) = goal(&transmits) else {
        panic!("{transmits:?}");
    };
    let lowest_m = waypoints()[1].altitude_m() + LAYER_SPACING_M;
    assert!((to.altitude_m() - lowest_m).abs() < 1e-9, "{to:?}");
}

#[test]
fn master_that_misses_another_member_later_scatters_the_swarm() {
    let mut master = master_on_first_leg();
    notify(&mut master, 40.0, RoutingNotice::Silent(NodeId(2).into()));
    arrive(&mut master, 60.0);
    notify(&mut master, 61.0, progress(0, 4));
    notify(&mut master, 62.0, RoutingNotice::Silent(NodeId(0).into()));
    let transmits = arrive(&mut master, 80.0);
    let (waypoint, apart) = (3, true);
    assert_eq!(orders(&transmits), [Order::Move { waypoint, apart }]);
}

#[test]
fn member_in_step_climbs_to_the_masters_layer_and_flies_level() {
    let (member, transmits) = member_of_others(NodeId(2));
    let Some(Goal::FlyLevelTo {
        to,
        hold_altitude_m,
    }) = goal(&transmits)
    else {
        panic!("{transmits:?}");
    };
    assert!((to.altitude_m() - altitude_of(&member, 1)).abs() < 1e-9);
    assert!((hold_altitude_m - altitude_of(&member, 0)).abs() < 1e-9);
    assert!(altitude_of(&member, 1) < altitude_of(&member, 0));
}

#[test]
fn stray_that_hears_the_order_flies_in_its_own_layer() {
    let (member, transmits) = member_of_others(NodeId(0));
    assert!(matches!(goal(&transmits), Some(Goal::TransitTo { .. })));
    assert!(member.is_in_own_layer());
}

#[test]
fn member_leaves_the_masters_layer_for_its_own_once_it_has_another_master_or_changes_formation() {
    let (mut member, _) = member_of_others(NodeId(2));
    arrive(&mut member, 60.0);
    let ballot = Ballot {
        term: 2,
        rank: 2,
        master: NodeId(2),
    };
    let (waypoint, apart) = (1, false);
    let order = wire::encode_order(&Order::Move { waypoint, apart });
    let notice = RoutingNotice::Order {
        ballot,
        sequence: 1,
        order: order.into(),
    };
    let transmits = notify(&mut member, 61.0, notice);
    let Some(Goal::TransitTo { to }) = goal(&transmits) else {
        panic!("{transmits:?}");
    };
    assert!((to.altitude_m() - altitude_of(&member, 0)).abs() < 1e-9);

    let (mut member, _) = member_of_others(NodeId(2));
    let (change, step, wave, apart) = (0, Step::Climb, 0, true);
    let reform = Order::Reform {
        change,
        step,
        wave,
        apart,
    };
    deliver(&mut member, 5, &reform);
    assert!(member.is_in_own_layer());
}
