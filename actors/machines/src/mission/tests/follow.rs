//! The protocol in which a master is followed.

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
    config.following = Some(Following {
        is_piloted,
        ..FOLLOWING
    });
    config
}

fn arrives(mission: &mut Mission, at_s: f64) -> Vec<Transmit> {
    told(mission, at_s, Input::Navigation(NavigationNotice::Arrived))
}

fn is_at(mission: &mut Mission, at_s: f64, position: Ned, velocity: Velocity) -> Vec<Transmit> {
    let notice = NavigationNotice::At { position, velocity };
    told(mission, at_s, Input::Navigation(notice))
}

fn slave_in_its_slot() -> Mission {
    let mut slave = Mission::new(config_of_follower(0, false), None);
    ordered(&mut slave, 1, &whole_plan());
    ordered(&mut slave, 2, &Order::TakeOff { wave: 0 });
    arrives(&mut slave, 20.0);
    slave
}

/// A master in its slot at waypoint 0, all of its swarm too, from which it begins to be followed at 31 s.
fn followed_master(is_piloted: bool) -> (Mission, Vec<Transmit>) {
    let mut master = Mission::new(config_of_follower(1, is_piloted), None);
    told(&mut master, 0.0, Input::Fly);
    hears(&mut master, 1.0, progress(0, 1));
    hears(&mut master, 1.0, progress(2, 1));
    arrives(&mut master, 20.0);
    hears(&mut master, 20.0, progress(0, 2));
    hears(&mut master, 20.0, progress(2, 2));
    hears(&mut master, 30.0, RoutingNotice::RoutesReady);
    hears(&mut master, 31.0, progress(0, 3));
    let said = hears(&mut master, 31.0, progress(2, 3));
    assert_eq!(master.durable.state, State::Following);
    (master, said)
}

#[test]
fn a_slave_keeps_its_slot_around_a_master_that_moves_and_acknowledges_nothing() {
    let mut slave = slave_in_its_slot();
    let at = Ned::new(50.0, 0.0, -30.0);
    let velocity = NORTH;
    let said = ordered(&mut slave, 3, &Order::Follow { at, velocity });
    let track = Goal::Track {
        to: slave.config.layout.slot(NodeId(0), at),
        hold_altitude_m: at.altitude_m() + PITCH_M,
        velocity,
        hold: SECOND,
    };
    assert_eq!(said, [Transmit::Goal(track)]);
}

#[test]
fn a_slave_on_its_way_to_its_slot_does_not_run_after_the_swarm() {
    let mut slave = Mission::new(config_of_follower(0, false), None);
    ordered(&mut slave, 1, &whole_plan());
    ordered(&mut slave, 2, &Order::TakeOff { wave: 0 });
    let (at, velocity) = (Ned::new(50.0, 0.0, -30.0), NORTH);
    let said = ordered(&mut slave, 3, &Order::Follow { at, velocity });
    assert!(said.contains(&Transmit::Goal(Goal::Land)));
}

#[test]
fn a_slave_on_the_ground_does_not_take_off_to_follow() {
    let mut slave = Mission::new(config_of_follower(0, false), None);
    let (at, velocity) = (Ned::new(50.0, 0.0, -30.0), NORTH);
    assert_eq!(ordered(&mut slave, 1, &Order::Follow { at, velocity }), []);
    assert_eq!(ordered(&mut slave, 2, &Order::Assemble { at }), []);
}

#[test]
fn a_swarm_with_a_mission_is_not_led_away_from_it() {
    let mut slave = slave_at_waypoint_0(Liveness::Heartbeat);
    let (at, velocity) = (Ned::new(50.0, 0.0, -30.0), NORTH);
    assert_eq!(ordered(&mut slave, 3, &Order::Follow { at, velocity }), []);
}

#[test]
fn a_slave_whose_master_is_silent_lands() {
    let mut slave = slave_in_its_slot();
    let (at, velocity) = (Ned::new(50.0, 0.0, -30.0), NORTH);
    ordered(&mut slave, 3, &Order::Follow { at, velocity });
    let said = hears(&mut slave, 40.0, RoutingNotice::MasterSilent);
    assert!(said.contains(&Transmit::Goal(Goal::Land)));
}

#[test]
fn a_master_says_each_period_where_it_is_and_waits_for_nobody() {
    let (mut master, said) = followed_master(false);
    let to = waypoints()[1];
    assert!(said.contains(&Transmit::Goal(fly_to(to))));
    for tick in 0..5 {
        let at_s = 31.0 + 0.2 * f64::from(tick);
        let (said, _) = stimulate(&mut master, at_s, Stimulus::Timeout);
        assert_eq!(said, [Transmit::Locate], "at {at_s} s");
        let (said, _) = stimulate(&mut master, at_s + 0.1, Stimulus::Timeout);
        assert_eq!(said, [], "at {at_s} s");
        let at = Ned::new(f64::from(tick), 0.0, -25.0);
        let said = is_at(&mut master, at_s + 0.1, at, NORTH);
        let velocity = NORTH;
        assert_eq!(orders(&said), [Order::Follow { at, velocity }]);
    }
    let to = waypoints()[2];
    let said = arrives(&mut master, 50.0);
    assert!(said.contains(&Transmit::Goal(fly_to(to))));
}

#[test]
fn a_master_whose_host_stalled_says_once_where_it_is_and_then_each_period() {
    let (mut master, _) = followed_master(false);
    for (at_s, says) in [(31.0, true), (35.0, true), (35.1, false), (35.2, true)] {
        let (said, _) = stimulate(&mut master, at_s, Stimulus::Timeout);
        assert_eq!(said.contains(&Transmit::Locate), says, "at {at_s} s");
    }
}

#[test]
fn a_master_at_the_end_of_its_path_calls_all_together_and_lands_once_they_are_there() {
    let (mut master, _) = followed_master(false);
    arrives(&mut master, 50.0);
    let said = arrives(&mut master, 70.0);
    assert!(said.contains(&Transmit::Goal(Goal::Hold)));
    let at = waypoints()[2];
    let said = is_at(&mut master, 70.1, at, Velocity::ZERO);
    assert_eq!(orders(&said), [Order::Assemble { at }]);
    let sequence = master.durable.lead.as_ref().unwrap().sequence;
    arrives(&mut master, 70.2);
    hears(&mut master, 71.0, progress(0, sequence));
    let said = hears(&mut master, 71.0, progress(2, sequence));
    assert_eq!(orders(&said), [land_at(at)]);
    assert!(said.contains(&Transmit::Goal(Goal::Land)));
}

#[test]
fn a_master_flown_by_hand_is_left_to_its_pilot_until_the_operator_ends_the_flight() {
    let (mut master, said) = followed_master(true);
    assert!(said.contains(&Transmit::Goal(Goal::Yield)));
    let at = Ned::new(80.0, 40.0, -30.0);
    let said = is_at(&mut master, 32.0, at, Velocity::ZERO);
    assert_eq!(orders(&said).len(), 1, "a pilot may stop and go on");
    let said = told(&mut master, 33.0, Input::Land);
    assert_eq!(said, [Transmit::Goal(Goal::Hold)]);
    let velocity = NORTH;
    let said = is_at(&mut master, 33.2, at, velocity);
    assert_eq!(orders(&said), [Order::Follow { at, velocity }], "it brakes");
    let said = is_at(&mut master, 43.2, at, Velocity::ZERO);
    assert_eq!(orders(&said), [Order::Assemble { at }]);
}

#[test]
fn only_a_master_that_is_followed_is_told_to_end_it() {
    let mut master = master_taking_off();
    assert_eq!(told(&mut master, 5.0, Input::Land), []);
    let mut slave = slave_in_its_slot();
    assert_eq!(told(&mut slave, 25.0, Input::Land), []);
}

#[test]
fn a_followed_master_that_can_not_go_on_takes_its_swarm_down_where_it_is() {
    let (mut master, _) = followed_master(false);
    let at = Ned::new(80.0, 0.0, -25.0);
    is_at(&mut master, 40.0, at, NORTH);
    let said = told(&mut master, 41.0, Input::GiveUp);
    assert_eq!(orders(&said), [land_at(at)]);
}
