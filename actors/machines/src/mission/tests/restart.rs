//! What is known after a restart.

use super::failsafe::failing;
use super::*;

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
fn restarted_routing_gets_leader_order_and_landing_again() {
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
fn member_that_returned_while_the_mission_was_down_is_awaited() {
    let mut master = master_taking_off();
    notify(&mut master, 19.1, RoutingNotice::Silent(NodeId(2).into()));
    let checkpoint = master.durable.clone();
    // The notice that drone 2 has returned is lost. The routing repeats who is silent: nobody.
    let mut restarted = Mission::new(config(1, Liveness::Heartbeat), Some(checkpoint));
    stimulate(&mut restarted, 19.5, Stimulus::Timeout);
    notify(&mut restarted, 19.5, progress(0, 2));
    let transmits = arrive(&mut restarted, 20.0);
    assert!(
        !transmits.contains(&Transmit::Discover),
        "drone 2 still takes off"
    );
}

#[test]
fn master_that_returned_while_the_routing_was_down_is_believed() {
    let mut config = config(0, Liveness::Heartbeat);
    config.succession = Succession::Elect;
    config.spreading_grace = 30 * SECOND;
    let mut member = Mission::new(config, None);
    deliver(&mut member, 1, &complete_plan());
    notify(&mut member, 5.0, RoutingNotice::MasterSilent);
    // The restarted routing hears the master, and knows of no silence that it could take back.
    notify(&mut member, 6.0, RoutingNotice::Resync);
    deliver(&mut member, 2, &Order::TakeOff { wave: 0 });
    assert_eq!(member.durable.state, State::TakingOff);
    let (transmits, _) = stimulate(&mut member, 36.0, Stimulus::Timeout);
    let claims = |it: &Transmit| matches!(it, Transmit::Lead(_));
    assert!(!transmits.iter().any(claims));
}

#[test]
fn pure_relay_with_a_low_battery_continues_when_its_mission_restarts() {
    let drones = config(0, Liveness::Heartbeat).layout.formation().drones();
    let relay = || config(drones, Liveness::Heartbeat);
    let mut mission = Mission::new(relay(), None);
    send(
        &mut mission,
        5.0,
        failing(Failure::BatteryLow, Ned::HOME, false),
    );
    let mut restarted = Mission::new(relay(), Some(mission.durable.clone()));
    stimulate(&mut restarted, 6.0, Stimulus::Timeout);
    let landed = Input::Navigation(NavigationNotice::Landed);
    send(&mut restarted, 6.1, landed);
    assert_eq!(restarted.durable.state, State::Finished);
}

#[test]
fn arrival_at_an_earlier_goal_is_no_arrival_at_the_next_waypoint() {
    let member = member_at_open_waypoint(config(0, Liveness::Heartbeat));
    // Its restarted mission repeats the goal, and the navigation, which is there, will answer.
    let mut member = Mission::new(member.config.clone(), Some(member.durable.clone()));
    let goal = member.goal().unwrap();
    // The routing's answer comes first: an order that the old mission has not seen.
    deliver(&mut member, 4, &open_waypoint(1));
    let moving = State::MovingToWaypoint { waypoint: 1 };
    assert_eq!(member.durable.state, moving);
    let arrived = Input::Navigation(NavigationNotice::Arrived(goal));
    assert_eq!(send(&mut member, 1.0, arrived), []);
    assert_eq!(member.durable.state, moving);
    let arrived = Input::Navigation(NavigationNotice::Arrived(member.goal().unwrap()));
    send(&mut member, 20.0, arrived);
    assert_eq!(member.durable.state, State::WaypointReached { waypoint: 1 });
}
