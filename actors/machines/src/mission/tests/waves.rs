//! Waves of take-off, crossing and landing.

use super::*;
use crate::formation::WaveLimits;
use crate::mission::Step;

const DRONES: u32 = 19;

/// Drone `id` of a mesh in one layer with waves, which becomes a line at waypoint 2.
fn config_in_waves(id: u32) -> Config {
    let mut config = config(id, Liveness::Heartbeat);
    let drones = NonZeroU32::new(DRONES).unwrap();
    let separation = config.layout.separation();
    let mesh = Formation::new(Kind::CompactMesh, drones, 40.0, 0.0);
    let limits = WaveLimits {
        layers_max: 0,
        link_m: 40.0,
        ground_link_m: 40.0,
        hops_max: u32::MAX,
        searches_on: false,
    };
    let layout = Layout::new(mesh, 10.0, separation).in_waves(limits);
    let line = Formation::new(Kind::Linear, drones, 40.0, 0.0);
    let change = Change::new(2, &layout, line);
    assert!(layout.take_off_waves() > 2 && layout.landing_waves() > 2 && change.waves() > 1);
    config.layout = Arc::new(layout);
    config.changes = Arc::new([change]);
    config
}

/// The configuration of the first member that satisfies `predicate`.
fn config_where(predicate: impl Fn(&Config, NodeId) -> bool) -> Config {
    let ids = (0..DRONES).filter(|id| *id != 0);
    let found = ids.map(config_in_waves).find(|it| predicate(it, it.id));
    found.expect("a member satisfies the predicate")
}

fn member_on_ground(config: Config) -> Mission {
    let mut member = Mission::new(config, None);
    deliver(&mut member, 1, &complete_plan());
    member
}

fn take_off(wave: u16) -> Order {
    Order::TakeOff { wave }
}

#[test]
fn drone_takes_off_in_its_wave_and_acknowledges_other_waves() {
    let mut member = member_on_ground(config_where(|it, id| it.layout.take_off_wave(id) == 1));
    let transmits = deliver(&mut member, 2, &take_off(0));
    assert_eq!(
        (goal(&transmits), transmits.contains(&acknowledgement(2))),
        (None, true)
    );
    let transmits = deliver(&mut member, 3, &take_off(1));
    assert!(matches!(
        goal(&transmits),
        Some(Goal::TakeOff { arm: true, .. })
    ));
    assert!(!transmits.contains(&acknowledgement(3)));
    assert!(arrive(&mut member, 20.0).contains(&acknowledgement(3)));
    assert!(deliver(&mut member, 4, &take_off(2)).contains(&acknowledgement(4)));
}

#[test]
fn drone_that_missed_its_wave_stays_on_the_ground() {
    let mut member = member_on_ground(config_where(|it, id| it.layout.take_off_wave(id) == 0));
    let transmits = deliver(&mut member, 3, &take_off(1));
    assert_eq!(transmits, [], "neither a goal nor an acknowledgement");
}

/// A master that has published the plan, and its sequence number.
fn master_in_slot() -> (Mission, u32) {
    let mut master = Mission::new(config_in_waves(0), None);
    assert_eq!(master.config.layout.formation().centre(), NodeId(0));
    send(&mut master, 0.0, Input::Fly);
    (master, 1)
}

/// All members acknowledge order `sequence`. Returns the orders that follow.
fn all_acknowledge(master: &mut Mission, sequence: &mut u32) -> Vec<Order> {
    let members = NodeSet::from(1..DRONES);
    let notice = RoutingNotice::Progress {
        sequence: *sequence,
        acknowledged: members,
        landing: NodeSet::default(),
    };
    *sequence += 1;
    orders(&notify(master, 10.0, notice))
}

#[test]
fn master_orders_each_wave_once_the_last_is_in_its_slots() {
    let (mut master, mut sequence) = master_in_slot();
    assert_eq!(all_acknowledge(&mut master, &mut sequence), [take_off(0)]);
    arrive(&mut master, 20.0);
    let waves = master.config.layout.take_off_waves();
    for wave in 1..waves {
        assert_eq!(
            all_acknowledge(&mut master, &mut sequence),
            [take_off(wave)]
        );
    }
    assert_eq!(all_acknowledge(&mut master, &mut sequence), []);
    notify(&mut master, 30.0, RoutingNotice::RoutesReady);
    assert_eq!(master.durable.progress.opened, Some(0));
}

/// A member at waypoint 2, the last one.
fn member_at_last_waypoint(config: Config) -> Mission {
    let mut member = member_on_ground(config);
    member.durable.state = State::WaypointReached { waypoint: 2 };
    member.durable.progress.opened = Some(2);
    member
}

fn cross(wave: u16) -> Order {
    reform(Step::Cross, wave)
}

fn reform(step: Step, wave: u16) -> Order {
    Order::Reform {
        change: 0,
        step,
        wave,
        apart: false,
    }
}

#[test]
fn drone_waits_in_its_sector_until_its_wave_crosses() {
    let mut member = member_at_last_waypoint(config_where(|it, id| it.changes[0].wave(id) == 1));
    let [over_old, over_new, new] = member.config.changes[0].path(member.config.id, waypoints()[2]);
    let waves = member.config.changes[0].waves();
    let mut sequence = 2;
    let mut target_of = |member: &mut Mission, order: Order| {
        let transmits = deliver(member, sequence, &order);
        let is_early = transmits.contains(&acknowledgement(sequence));
        let arrived = arrive(member, 20.0);
        assert!(!is_early && arrived.contains(&acknowledgement(sequence)));
        sequence += 1;
        match goal(&transmits) {
            Some(Goal::FlyTo { to, .. }) => to,
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(target_of(&mut member, reform(Step::Climb, 0)), over_old);
    assert_eq!(target_of(&mut member, cross(0)), over_old);
    for wave in 1..waves {
        assert_eq!(target_of(&mut member, cross(wave)), over_new);
    }
    assert_eq!(target_of(&mut member, reform(Step::Descend, 0)), new);
}

#[test]
fn drone_that_missed_a_crossing_wave_lands() {
    let mut member = member_at_last_waypoint(config_in_waves(3));
    deliver(&mut member, 2, &reform(Step::Climb, 0));
    arrive(&mut member, 20.0);
    let transmits = deliver(&mut member, 4, &cross(1));
    assert_eq!(goal(&transmits), Some(Goal::Land));
}

#[test]
fn drone_lands_in_its_wave_and_acknowledges_on_the_ground() {
    let lands = |wave| Order::Land {
        at: waypoints()[2],
        changes: 0,
        wave,
        apart: false,
    };
    let config = Config {
        spreading_grace: 6 * SECOND,
        ..config_where(|it, id| it.layout.landing_wave(id) == 1)
    };
    let mut member = member_at_last_waypoint(config);
    let transmits = deliver(&mut member, 2, &lands(0));
    assert_eq!(
        (goal(&transmits), transmits.contains(&acknowledgement(2))),
        (None, true)
    );
    let transmits = deliver(&mut member, 3, &lands(1));
    assert!(matches!(goal(&transmits), Some(Goal::TransitTo { .. })));
    assert!(
        !transmits.contains(&Transmit::Land),
        "the next wave waits for it"
    );
    arrive(&mut member, 30.0);
    let landed = Input::Navigation(NavigationNotice::Landed);
    let transmits = send(&mut member, 60.0, landed);
    assert!(transmits.contains(&acknowledgement(3)) && transmits.contains(&Transmit::Land));
    assert!(
        !transmits.contains(&Transmit::Stop),
        "it repeats the announcement"
    );
    assert_eq!(
        stimulate(&mut member, 66.0, Stimulus::Timeout).0,
        [Transmit::Stop]
    );
}

#[test]
fn drone_that_landed_by_itself_relays_no_longer_than_it_flies() {
    let config = Config {
        spreading_grace: 6 * SECOND,
        ..config_where(|it, id| it.layout.landing_wave(id) == 0)
    };
    let mut member = member_at_last_waypoint(config);
    let failing = Input::Navigation(NavigationNotice::Failing {
        failure: Failure::BatteryCritical,
        stop: waypoints()[2],
        is_airborne: true,
    });
    let transmits = send(&mut member, 30.0, failing);
    assert!(transmits.contains(&Transmit::Land), "{transmits:?}");
    let landed = Input::Navigation(NavigationNotice::Landed);
    assert_eq!(send(&mut member, 60.0, landed), [Transmit::Stop]);
}

#[test]
fn swarm_out_of_lockstep_lands_at_once_each_below_its_slot() {
    let mut member =
        member_at_last_waypoint(config_where(|it, id| it.layout.landing_wave(id) == 0));
    let last = member.config.layout.landing_waves() - 1;
    let order = Order::Land {
        at: waypoints()[2],
        changes: 0,
        wave: last,
        apart: true,
    };
    let transmits = deliver(&mut member, 2, &order);
    assert!(transmits.contains(&Transmit::Land));
    let Some(Goal::TransitTo { to }) = goal(&transmits) else {
        panic!("{transmits:?}");
    };
    let slot = member.layout().slot(member.config.id, waypoints()[2]);
    assert!(to.horizontal_distance_m(slot) < 20.0, "{to:?} for {slot:?}");
}
