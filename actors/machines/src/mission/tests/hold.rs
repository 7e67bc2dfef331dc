//! Holds at waypoints.

use super::*;
use crate::mission::Following;
use crate::mission::hold::HoldTooLong;

/// 30 s at waypoint 1.
fn holds() -> Holds {
    let mut holds = Holds::default();
    holds.add(1, 30 * SECOND).unwrap();
    holds
}

fn config_with_holds(config: Config) -> Config {
    Config {
        succession: Succession::Elect,
        holds: holds(),
        ..config
    }
}

fn plan_with_holds() -> Order {
    Order::Plan {
        index: 0,
        count: 1,
        waypoints: waypoints(),
        holds: vec![Duration::ZERO, 30 * SECOND, Duration::ZERO],
    }
}

fn orders_on_arrival(mission: &mut Mission, at_s: f64) -> Vec<Order> {
    orders(&arrive(mission, at_s))
}

/// Time in seconds after the start.
fn after(seconds: f64) -> Option<Timestamp> {
    Some(Timestamp::from_secs_f64(seconds))
}

/// A master at waypoint 1 since 50 s. Its members arrived at 51 s.
fn holding_master() -> Mission {
    let mut master = Mission::new(config_with_holds(config(1, Liveness::Heartbeat)), None);
    let transmits = send(&mut master, 0.0, Input::Fly);
    assert_eq!(orders(&transmits), [plan_with_holds()]);
    for (at_s, sequence) in [(1.0, 1), (20.0, 2), (31.0, 3)] {
        if sequence == 2 {
            orders_on_arrival(&mut master, at_s);
        }
        if sequence == 3 {
            notify(&mut master, 30.0, RoutingNotice::RoutesReady);
        }
        notify(&mut master, at_s, progress(0, sequence));
        notify(&mut master, at_s, progress(2, sequence));
    }
    assert_eq!(orders_on_arrival(&mut master, 50.0), []);
    for member in [0, 2] {
        let transmits = notify(&mut master, 51.0, progress(member, 4));
        assert_eq!(orders(&transmits), [], "the hold is not over");
    }
    master
}

#[test]
fn master_opens_the_next_waypoint_after_the_hold() {
    let mut master = holding_master();
    assert_eq!(master.deadline(), after(81.0));
    assert_eq!(
        orders(&stimulate(&mut master, 80.9, Stimulus::Timeout).0),
        []
    );
    let (transmits, events) = stimulate(&mut master, 81.0, Stimulus::Timeout);
    assert_eq!(orders(&transmits), [open_waypoint(2)]);
    assert!(events.contains(&Event::Opened { waypoint: 2 }));
    assert!(
        !events
            .iter()
            .any(|event| matches!(event, Event::LeftOut(_)))
    );
}

#[test]
fn restarted_master_continues_its_hold() {
    let before = holding_master();
    let mut master = Mission::new(before.config.clone(), Some(before.durable.clone()));
    assert_eq!(orders_on_arrival(&mut master, 60.0), []);
    assert_eq!(master.deadline(), after(81.0));
    let (transmits, _) = stimulate(&mut master, 81.0, Stimulus::Timeout);
    assert_eq!(orders(&transmits), [open_waypoint(2)]);
}

#[test]
fn member_returning_during_a_hold_is_awaited_for_a_leg_limit() {
    let mut master = holding_master();
    if let Some(lead) = &mut master.durable.lead {
        lead.acknowledged = NodeId(0).into();
    }
    assert_eq!(
        orders(&stimulate(&mut master, 81.0, Stimulus::Timeout).0),
        []
    );
    assert_eq!(master.deadline(), after(81.0 + 100.0));
    let (transmits, events) = stimulate(&mut master, 181.0, Stimulus::Timeout);
    assert!(events.contains(&Event::LeftOut(NodeId(2))));
    assert_eq!(orders(&transmits), [move_apart(1)], "all climb first");
    assert_eq!(orders_on_arrival(&mut master, 190.0), []);
    let transmits = notify(&mut master, 191.0, progress(0, 5));
    assert_eq!(orders(&transmits), [move_apart(2)]);
}

/// A member at waypoint 1 since 50 s.
fn holding_member() -> Mission {
    let mut member = Mission::new(config_with_holds(config(0, Liveness::Heartbeat)), None);
    deliver(&mut member, 1, &plan_with_holds());
    assert_eq!(member.durable.holds, holds());
    deliver(&mut member, 2, &Order::TakeOff { wave: 0 });
    orders_on_arrival(&mut member, 20.0);
    notify(&mut member, 30.0, RoutingNotice::RoutesReady);
    deliver(&mut member, 3, &open_waypoint(0));
    deliver(&mut member, 4, &open_waypoint(1));
    orders_on_arrival(&mut member, 50.0);
    member
}

#[test]
fn member_waits_through_a_hold_of_any_length() {
    let mut member = holding_member();
    let (transmits, events) = stimulate(&mut member, 1_500.0, Stimulus::Timeout);
    assert_eq!((transmits, events), (vec![], vec![]));
    assert_eq!(member.durable.state, State::WaypointReached { waypoint: 1 });
}

#[test]
fn master_elected_during_a_hold_begins_it_anew() {
    let mut member = holding_member();
    let transmits = notify(&mut member, 60.0, RoutingNotice::MasterSilent);
    assert_eq!(orders(&transmits), [move_apart(1)]);
    orders_on_arrival(&mut member, 60.2);
    let silent = RoutingNotice::Silent(NodeId(1).into());
    assert_eq!(orders(&notify(&mut member, 60.5, silent)), []);
    let transmits = notify(&mut member, 61.0, progress(2, 1));
    assert_eq!(orders(&transmits), [], "the hold is not over");
    assert_eq!(member.deadline(), after(91.0));
    let (transmits, _) = stimulate(&mut member, 91.0, Stimulus::Timeout);
    assert_eq!(orders(&transmits), [move_apart(2)]);
}

#[test]
fn followed_master_publishes_its_position_during_holds() {
    let following = Following {
        period: Duration::from_millis(200),
        hold: SECOND,
        is_piloted: false,
    };
    let config = Config {
        conduct: Conduct::Following(following),
        ..config_with_holds(config(1, Liveness::Heartbeat))
    };
    let mut master = Mission::new(config, None);
    send(&mut master, 0.0, Input::Fly);
    for (at_s, sequence) in [(1.0, 1), (20.0, 2), (31.0, 3)] {
        if sequence == 2 {
            orders_on_arrival(&mut master, at_s);
        }
        if sequence == 3 {
            notify(&mut master, 30.0, RoutingNotice::RoutesReady);
        }
        notify(&mut master, at_s, progress(0, sequence));
        notify(&mut master, at_s, progress(2, sequence));
    }
    assert_eq!(master.durable.state, State::Following);
    assert_eq!(arrive(&mut master, 50.0), []);
    // A restarted mission receives the arrival again.
    assert_eq!(arrive(&mut master, 60.0), []);
    let (transmits, _) = stimulate(&mut master, 79.9, Stimulus::Timeout);
    assert_eq!(transmits, [Transmit::Locate]);
    let (transmits, _) = stimulate(&mut master, 80.0, Stimulus::Timeout);
    let next = master.config.layout.slot(NodeId(1), waypoints()[2]);
    assert_eq!(goal(&transmits), Some(fly_to(next)));
}

#[test]
fn holds_add_up_to_the_maximum() {
    let mut holds = Holds::default();
    holds.add(3, Duration::from_micros(1_999)).unwrap();
    assert_eq!(holds.at(3), Duration::from_millis(1));
    holds.add(3, Holds::MAX - Duration::from_millis(1)).unwrap();
    assert_eq!(holds.at(3), Holds::MAX);
    let hold = Holds::MAX + Duration::from_millis(1);
    let refused = holds.add(3, Duration::from_millis(1));
    assert_eq!(refused, Err(HoldTooLong { hold }));
    assert_eq!(holds.total(), Holds::MAX);
    holds.add(4, Duration::ZERO).unwrap();
    assert_eq!(holds.iter().count(), 1, "zero is not stored");
}

#[test]
fn plan_part_without_holds_has_an_empty_list() {
    let mut holds = Holds::default();
    let last = u16::try_from(wire::PLAN_PART_MAX).unwrap();
    holds.add(last, SECOND).unwrap();
    assert_eq!(holds.part(0, wire::PLAN_PART_MAX), []);
    let second = holds.part(wire::PLAN_PART_MAX, 2);
    assert_eq!(second, [SECOND, Duration::ZERO]);
    let mut read = Holds::default();
    read.add_part(wire::PLAN_PART_MAX, &second);
    assert_eq!(read, holds);
}
