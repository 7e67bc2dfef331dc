//! Whom the master waits for at waypoints.

use super::*;

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
    assert_eq!(orders(&transmits), [move_apart(1)]);
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
fn member_that_makes_progress_is_not_silent() {
    let mut master = master_taking_off();
    notify(&mut master, 5.0, RoutingNotice::Silent(NodeId(2).into()));
    notify(&mut master, 6.0, progress(2, 1));
    notify(&mut master, 19.0, progress(0, 2));
    assert!(!arrive(&mut master, 20.0).contains(&Transmit::Discover));
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
