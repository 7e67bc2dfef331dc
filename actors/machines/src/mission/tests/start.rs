//! On the ground and during the take-off.

use super::*;

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
