//! The following protocol.

use super::*;
use crate::geometry::Velocity;
use crate::mission::Following;

const FOLLOWING: Following = Following {
    period: Duration::from_millis(200),
    hold: SECOND,
    is_piloted: false,
};
const NORTH: Velocity = Velocity::new(10.0, 0.0, 0.0);

fn config_of_follower(id: u32, is_piloted: bool) -> Config {
    let mut config = config(id, Liveness::Heartbeat);
    config.conduct = Conduct::Following(Following {
        is_piloted,
        ..FOLLOWING
    });
    config
}

fn report_position(
    mission: &mut Mission,
    at_s: f64,
    position: Ned,
    velocity: Velocity,
) -> Vec<Transmit> {
    let notice = NavigationNotice::Position { position, velocity };
    send(mission, at_s, Input::Navigation(notice))
}

fn member_in_slot() -> Mission {
    let mut member = Mission::new(config_of_follower(0, false), None);
    deliver(&mut member, 1, &complete_plan());
    deliver(&mut member, 2, &Order::TakeOff { wave: 0 });
    arrive(&mut member, 20.0);
    member
}

/// A master at waypoint 0 with its whole swarm, followed from 31 s on, and its last outputs.
fn master_following(is_piloted: bool) -> (Mission, Vec<Transmit>) {
    let mut master = Mission::new(config_of_follower(1, is_piloted), None);
    send(&mut master, 0.0, Input::Fly);
    notify(&mut master, 1.0, progress(0, 1));
    notify(&mut master, 1.0, progress(2, 1));
    arrive(&mut master, 20.0);
    notify(&mut master, 20.0, progress(0, 2));
    notify(&mut master, 20.0, progress(2, 2));
    notify(&mut master, 30.0, RoutingNotice::RoutesReady);
    notify(&mut master, 31.0, progress(0, 3));
    let transmits = notify(&mut master, 31.0, progress(2, 3));
    assert_eq!(master.durable.state, State::Following);
    (master, transmits)
}

#[test]
fn member_tracks_a_moving_master_without_acknowledging() {
    let mut member = member_in_slot();
    let at = Ned::new(50.0, 0.0, -30.0);
    let velocity = NORTH;
    let transmits = deliver(&mut member, 3, &Order::Follow { at, velocity });
    let track = Goal::Track {
        to: member.config.layout.slot(NodeId(0), at),
        hold_altitude_m: at.altitude_m() + LAYER_SPACING_M,
        velocity,
        hold: SECOND,
    };
    assert_eq!(transmits, [Transmit::Goal(track)]);
}

#[test]
fn member_still_taking_off_lands_instead_of_following() {
    let mut member = Mission::new(config_of_follower(0, false), None);
    deliver(&mut member, 1, &complete_plan());
    deliver(&mut member, 2, &Order::TakeOff { wave: 0 });
    let (at, velocity) = (Ned::new(50.0, 0.0, -30.0), NORTH);
    let transmits = deliver(&mut member, 3, &Order::Follow { at, velocity });
    assert!(transmits.contains(&Transmit::Goal(Goal::Land)));
}

#[test]
fn member_on_the_ground_does_not_follow() {
    let mut member = Mission::new(config_of_follower(0, false), None);
    let (at, velocity) = (Ned::new(50.0, 0.0, -30.0), NORTH);
    assert_eq!(deliver(&mut member, 1, &Order::Follow { at, velocity }), []);
    assert_eq!(deliver(&mut member, 2, &Order::Assemble { at }), []);
}

#[test]
fn follow_orders_are_refused_without_following() {
    let mut member = member_at_waypoint_0(Liveness::Heartbeat);
    let (at, velocity) = (Ned::new(50.0, 0.0, -30.0), NORTH);
    assert_eq!(deliver(&mut member, 3, &Order::Follow { at, velocity }), []);
}

#[test]
fn member_lands_if_its_followed_master_is_silent() {
    let mut member = member_in_slot();
    let (at, velocity) = (Ned::new(50.0, 0.0, -30.0), NORTH);
    deliver(&mut member, 3, &Order::Follow { at, velocity });
    let transmits = notify(&mut member, 40.0, RoutingNotice::MasterSilent);
    assert!(transmits.contains(&Transmit::Goal(Goal::Land)));
}

#[test]
fn followed_master_publishes_its_position_each_period_without_barrier() {
    let (mut master, transmits) = master_following(false);
    let to = waypoints()[1];
    assert!(transmits.contains(&Transmit::Goal(fly_to(to))));
    for tick in 0..5 {
        let at_s = 31.0 + 0.2 * f64::from(tick);
        let (transmits, _) = stimulate(&mut master, at_s, Stimulus::Timeout);
        assert_eq!(transmits, [Transmit::Locate], "at {at_s} s");
        let (transmits, _) = stimulate(&mut master, at_s + 0.1, Stimulus::Timeout);
        assert_eq!(transmits, [], "at {at_s} s");
        let at = Ned::new(f64::from(tick), 0.0, -25.0);
        let transmits = report_position(&mut master, at_s + 0.1, at, NORTH);
        let velocity = NORTH;
        assert_eq!(orders(&transmits), [Order::Follow { at, velocity }]);
    }
    let to = waypoints()[2];
    let transmits = arrive(&mut master, 50.0);
    assert!(transmits.contains(&Transmit::Goal(fly_to(to))));
}

#[test]
fn followed_master_skips_periods_missed_in_a_stall() {
    let (mut master, _) = master_following(false);
    for (at_s, is_due) in [(31.0, true), (35.0, true), (35.1, false), (35.2, true)] {
        let (transmits, _) = stimulate(&mut master, at_s, Stimulus::Timeout);
        assert_eq!(transmits.contains(&Transmit::Locate), is_due, "at {at_s} s");
    }
}

#[test]
fn followed_master_assembles_and_lands_after_its_last_waypoint() {
    let (mut master, _) = master_following(false);
    arrive(&mut master, 50.0);
    let transmits = arrive(&mut master, 70.0);
    assert!(transmits.contains(&Transmit::Goal(Goal::Hold)));
    let at = waypoints()[2];
    let transmits = report_position(&mut master, 70.1, at, Velocity::ZERO);
    assert_eq!(orders(&transmits), [Order::Assemble { at }]);
    let sequence = master.durable.lead.as_ref().unwrap().sequence;
    arrive(&mut master, 70.2);
    notify(&mut master, 71.0, progress(0, sequence));
    let transmits = notify(&mut master, 71.0, progress(2, sequence));
    assert_eq!(orders(&transmits), [land_at(at)]);
    assert!(transmits.contains(&Transmit::Goal(Goal::Land)));
}

#[test]
fn piloted_master_yields_until_the_operator_ends_the_flight() {
    let (mut master, transmits) = master_following(true);
    assert!(transmits.contains(&Transmit::Goal(Goal::Yield)));
    let at = Ned::new(80.0, 40.0, -30.0);
    let transmits = report_position(&mut master, 32.0, at, Velocity::ZERO);
    assert_eq!(
        orders(&transmits).len(),
        1,
        "a stop does not end the following"
    );
    let transmits = send(&mut master, 33.0, Input::Land);
    assert_eq!(transmits, [Transmit::Goal(Goal::Hold)]);
    let velocity = NORTH;
    let transmits = report_position(&mut master, 33.2, at, velocity);
    assert_eq!(
        orders(&transmits),
        [Order::Follow { at, velocity }],
        "still moving"
    );
    let transmits = report_position(&mut master, 43.2, at, Velocity::ZERO);
    assert_eq!(orders(&transmits), [Order::Assemble { at }]);
}

#[test]
fn only_followed_masters_accept_the_operators_land_command() {
    let mut master = master_taking_off();
    assert_eq!(send(&mut master, 5.0, Input::Land), []);
    let mut member = member_in_slot();
    assert_eq!(send(&mut member, 25.0, Input::Land), []);
}

#[test]
fn failing_followed_master_lands_its_swarm_at_its_position() {
    let (mut master, _) = master_following(false);
    let at = Ned::new(80.0, 0.0, -25.0);
    report_position(&mut master, 40.0, at, NORTH);
    let transmits = send(&mut master, 41.0, Input::GiveUp);
    assert_eq!(orders(&transmits), [land_at(at)]);
}

#[test]
fn swarm_of_an_elected_follower_assembles_above_the_first_masters_part() {
    let config = |id| Config {
        succession: Succession::Elect,
        ..config_of_follower(id, false)
    };
    let (at, velocity) = (Ned::new(50.0, 0.0, -25.0), NORTH);
    let follower = |id| {
        let mut member = Mission::new(config(id), None);
        deliver(&mut member, 1, &complete_plan());
        deliver(&mut member, 2, &Order::TakeOff { wave: 0 });
        arrive(&mut member, 20.0);
        deliver(&mut member, 3, &Order::Follow { at, velocity });
        member
    };
    let mut elected = follower(0);
    let transmits = notify(&mut elected, 40.0, RoutingNotice::MasterSilent);
    // It comes to rest and climbs without a goal.
    assert!(elected.durable.lead.is_some() && goal(&transmits).is_none());
    let position = elected.config.layout.slot(NodeId(0), at);
    let of_elected = report_position(&mut elected, 43.0, position, Velocity::ZERO);
    let ballot = elected.durable.leader.ballot().unwrap();
    let mut other = follower(2);
    notify(&mut other, 43.0, RoutingNotice::Leader(ballot));
    let order = wire::encode_order(&Order::Assemble { at }).into();
    let sequence = 1;
    let assemble = RoutingNotice::Order {
        ballot,
        sequence,
        order,
    };
    let of_other = notify(&mut other, 43.0, assemble);
    for transmits in [of_elected, of_other] {
        match goal(&transmits) {
            Some(Goal::TransitTo { to }) => assert!(to.altitude_m() > 30.0, "{to:?}"),
            other => panic!("{other:?}"),
        }
    }
}
