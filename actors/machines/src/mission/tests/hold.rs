//! Waits at waypoints that the mission asks for.

use super::*;
use crate::mission::Following;
use crate::mission::hold::HoldTooLong;

/// Half a minute at waypoint 1.
fn holds() -> Holds {
    let mut holds = Holds::default();
    holds.add(1, 30 * SECOND).unwrap();
    holds
}

fn with_holds(config: Config) -> Config {
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

const fn opens(waypoint: u16) -> Order {
    Order::Move {
        waypoint,
        apart: false,
    }
}

fn arrives(mission: &mut Mission, at_s: f64) -> Vec<Order> {
    let arrived = Input::Navigation(NavigationNotice::Arrived);
    orders(&told(mission, at_s, arrived))
}

/// An instant, so many seconds after the start.
fn after(seconds: f64) -> Option<Timestamp> {
    Some(Timestamp::from_secs_f64(seconds))
}

/// A master at waypoint 1 since 50 s, whose members are there since 51 s.
fn holding_master() -> Mission {
    let mut master = Mission::new(with_holds(config(1, Liveness::Heartbeat)), None);
    let said = told(&mut master, 0.0, Input::Fly);
    assert_eq!(orders(&said), [plan_with_holds()]);
    for (at_s, sequence) in [(1.0, 1), (20.0, 2), (31.0, 3)] {
        if sequence == 2 {
            arrives(&mut master, at_s);
        }
        if sequence == 3 {
            hears(&mut master, 30.0, RoutingNotice::RoutesReady);
        }
        hears(&mut master, at_s, progress(0, sequence));
        hears(&mut master, at_s, progress(2, sequence));
    }
    assert_eq!(arrives(&mut master, 50.0), []);
    for member in [0, 2] {
        let said = hears(&mut master, 51.0, progress(member, 4));
        assert_eq!(orders(&said), [], "it holds");
    }
    master
}

#[test]
fn a_master_holds_once_all_have_arrived_and_opens_the_next_waypoint_then() {
    let mut master = holding_master();
    assert_eq!(master.deadline(), after(81.0));
    assert_eq!(
        orders(&stimulate(&mut master, 80.9, Stimulus::Timeout).0),
        []
    );
    let (said, events) = stimulate(&mut master, 81.0, Stimulus::Timeout);
    assert_eq!(orders(&said), [opens(2)]);
    assert!(events.contains(&Event::Opened { waypoint: 2 }));
    assert!(
        !events
            .iter()
            .any(|event| matches!(event, Event::LeftOut(_)))
    );
}

#[test]
fn a_master_that_restarts_amid_a_hold_goes_on_with_it() {
    let before = holding_master();
    let mut master = Mission::new(before.config.clone(), Some(before.durable.clone()));
    assert_eq!(arrives(&mut master, 60.0), []);
    assert_eq!(master.deadline(), after(81.0));
    let (said, _) = stimulate(&mut master, 81.0, Stimulus::Timeout);
    assert_eq!(orders(&said), [opens(2)]);
}

#[test]
fn whoever_comes_back_amid_a_hold_is_waited_for_after_it_but_not_for_ever() {
    let mut master = holding_master();
    if let Some(lead) = &mut master.durable.lead {
        lead.acknowledged = NodeId(0).into();
    }
    assert_eq!(
        orders(&stimulate(&mut master, 81.0, Stimulus::Timeout).0),
        []
    );
    assert_eq!(master.deadline(), after(81.0 + 100.0));
    let (said, events) = stimulate(&mut master, 181.0, Stimulus::Timeout);
    assert!(events.contains(&Event::LeftOut(NodeId(2))));
    assert_eq!(
        orders(&said),
        [Order::Move {
            waypoint: 2,
            apart: true
        }]
    );
}

/// A member at waypoint 1 since 50 s.
fn holding_member() -> Mission {
    let mut member = Mission::new(with_holds(config(0, Liveness::Heartbeat)), None);
    ordered(&mut member, 1, &plan_with_holds());
    assert_eq!(member.durable.holds, holds());
    ordered(&mut member, 2, &Order::TakeOff { wave: 0 });
    arrives(&mut member, 20.0);
    hears(&mut member, 30.0, RoutingNotice::RoutesReady);
    ordered(&mut member, 3, &opens(0));
    ordered(&mut member, 4, &opens(1));
    arrives(&mut member, 50.0);
    member
}

#[test]
fn a_member_waits_at_a_waypoint_however_long_the_hold() {
    let mut member = holding_member();
    let (said, events) = stimulate(&mut member, 1_500.0, Stimulus::Timeout);
    assert_eq!((said, events), (vec![], vec![]));
    assert_eq!(member.durable.state, State::WaypointReached { waypoint: 1 });
}

#[test]
fn whoever_is_elected_amid_a_hold_holds_for_the_whole_of_it_once_all_have_acknowledged() {
    let mut member = holding_member();
    let said = hears(&mut member, 60.0, RoutingNotice::MasterSilent);
    assert_eq!(orders(&said), [opens(1)]);
    let silent = RoutingNotice::Silent(NodeId(1).into());
    assert_eq!(orders(&hears(&mut member, 60.5, silent)), []);
    let said = hears(&mut member, 61.0, progress(2, 1));
    assert_eq!(orders(&said), [], "it holds");
    assert_eq!(member.deadline(), after(91.0));
    let (said, _) = stimulate(&mut member, 91.0, Stimulus::Timeout);
    assert_eq!(
        orders(&said),
        [Order::Move {
            waypoint: 2,
            apart: true
        }]
    );
}

#[test]
fn a_followed_master_holds_at_its_waypoints_and_says_meanwhile_where_it_is() {
    let following = Following {
        period: Duration::from_millis(200),
        hold: SECOND,
        is_piloted: false,
    };
    let config = Config {
        following: Some(following),
        ..with_holds(config(1, Liveness::Heartbeat))
    };
    let mut master = Mission::new(config, None);
    told(&mut master, 0.0, Input::Fly);
    for (at_s, sequence) in [(1.0, 1), (20.0, 2), (31.0, 3)] {
        if sequence == 2 {
            arrives(&mut master, at_s);
        }
        if sequence == 3 {
            hears(&mut master, 30.0, RoutingNotice::RoutesReady);
        }
        hears(&mut master, at_s, progress(0, sequence));
        hears(&mut master, at_s, progress(2, sequence));
    }
    assert_eq!(master.durable.state, State::Following);
    let arrived = Input::Navigation(NavigationNotice::Arrived);
    assert_eq!(told(&mut master, 50.0, arrived.clone()), []);
    // Its mission, built anew, is told again that it is there.
    assert_eq!(told(&mut master, 60.0, arrived), []);
    let (said, _) = stimulate(&mut master, 79.9, Stimulus::Timeout);
    assert_eq!(said, [Transmit::Locate]);
    let (said, _) = stimulate(&mut master, 80.0, Stimulus::Timeout);
    let next = master.config.layout.slot(NodeId(1), waypoints()[2]);
    assert_eq!(goal(&said), Some(fly_to(next)));
}

#[test]
fn holds_add_up_to_the_longest_and_no_longer() {
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
    assert_eq!(holds.iter().count(), 1, "no hold is none");
}

#[test]
fn a_part_of_the_plan_without_holds_is_written_as_ever() {
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
