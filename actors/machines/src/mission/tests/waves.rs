//! Taking off, crossing and landing in waves.

use super::*;
use crate::mission::Step;

const DRONES: u32 = 19;

/// Drone `id` of a mesh whose drones fly one layer only, in waves, and form a line at waypoint 2.
fn config_in_waves(id: u32) -> Config {
    let mut config = config(id, Liveness::Heartbeat);
    let drones = NonZeroU32::new(DRONES).unwrap();
    let separation = config.layout.separation();
    let mesh = Formation::new(Kind::CompactMesh, drones, 40.0, 0.0);
    let layout = Layout::new(mesh, 10.0, separation).in_waves(0);
    let line = Formation::new(Kind::Linear, drones, 40.0, 0.0);
    let change = Change::new(2, &layout, line);
    assert!(layout.take_off_waves() > 2 && layout.landing_waves() > 2 && change.waves() > 1);
    config.layout = Arc::new(layout);
    config.changes = Arc::new([change]);
    config
}

/// A drone for which that is so.
fn drone_that(is_so: impl Fn(&Config, NodeId) -> bool) -> Config {
    let ids = (0..DRONES).filter(|id| *id != 0);
    let found = ids.map(config_in_waves).find(|it| is_so(it, it.id));
    found.expect("there is such a drone")
}

fn slave_on_ground(config: Config) -> Mission {
    let mut slave = Mission::new(config, None);
    ordered(&mut slave, 1, &whole_plan());
    slave
}

fn arrives(mission: &mut Mission, at_s: f64) -> Vec<Transmit> {
    told(mission, at_s, Input::Navigation(NavigationNotice::Arrived))
}

fn take_off(wave: u16) -> Order {
    Order::TakeOff { wave }
}

#[test]
fn a_drone_takes_off_in_its_wave_and_acknowledges_earlier_ones_on_the_ground() {
    let mut slave = slave_on_ground(drone_that(|it, id| it.layout.take_off_wave(id) == 1));
    let said = ordered(&mut slave, 2, &take_off(0));
    assert_eq!((goal(&said), said.contains(&acknowledges(2))), (None, true));
    let said = ordered(&mut slave, 3, &take_off(1));
    assert!(matches!(goal(&said), Some(Goal::TakeOff { arm: true, .. })));
    assert!(!said.contains(&acknowledges(3)));
    assert!(arrives(&mut slave, 20.0).contains(&acknowledges(3)));
    assert!(ordered(&mut slave, 4, &take_off(2)).contains(&acknowledges(4)));
}

#[test]
fn a_drone_that_missed_its_wave_stays_on_the_ground() {
    let mut slave = slave_on_ground(drone_that(|it, id| it.layout.take_off_wave(id) == 0));
    let said = ordered(&mut slave, 3, &take_off(1));
    assert_eq!(said, [], "neither a goal nor an acknowledgement");
}

/// The master in its slot, and the members that its layout has.
fn master_in_slot() -> (Mission, u32) {
    let mut master = Mission::new(config_in_waves(0), None);
    assert_eq!(master.config.layout.formation().centre(), NodeId(0));
    told(&mut master, 0.0, Input::Fly);
    (master, 1)
}

/// All members carry out the master's newest order; what it orders then.
fn all_carry_out(master: &mut Mission, sequence: &mut u32) -> Vec<Order> {
    let members = NodeSet::from(1..DRONES);
    let notice = RoutingNotice::Progress {
        sequence: *sequence,
        acknowledged: members,
        landing: NodeSet::default(),
    };
    *sequence += 1;
    orders(&hears(master, 10.0, notice))
}

#[test]
fn the_master_orders_each_wave_once_the_one_before_is_up() {
    let (mut master, mut sequence) = master_in_slot();
    assert_eq!(all_carry_out(&mut master, &mut sequence), [take_off(0)]);
    arrives(&mut master, 20.0);
    let waves = master.config.layout.take_off_waves();
    for wave in 1..waves {
        assert_eq!(all_carry_out(&mut master, &mut sequence), [take_off(wave)]);
    }
    assert_eq!(all_carry_out(&mut master, &mut sequence), []);
    hears(&mut master, 30.0, RoutingNotice::RoutesReady);
    assert_eq!(master.durable.opened, Some(0));
}

/// A member at the last waypoint.
fn slave_at_the_end(config: Config) -> Mission {
    let mut slave = slave_on_ground(config);
    slave.durable.state = State::WaypointReached { waypoint: 2 };
    slave.durable.opened = Some(2);
    slave
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
fn a_drone_waits_in_its_sector_until_its_wave_crosses() {
    let mut slave = slave_at_the_end(drone_that(|it, id| it.changes[0].wave(id) == 1));
    let [over_old, over_new, new] = slave.config.changes[0].path(slave.config.id, waypoints()[2]);
    let waves = slave.config.changes[0].waves();
    let mut sequence = 2;
    let mut leads_to = |slave: &mut Mission, order: Order| {
        let said = ordered(slave, sequence, &order);
        let is_early = said.contains(&acknowledges(sequence));
        let arrived = arrives(slave, 20.0);
        assert!(!is_early && arrived.contains(&acknowledges(sequence)));
        sequence += 1;
        match goal(&said) {
            Some(Goal::FlyTo { to, .. }) => to,
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(leads_to(&mut slave, reform(Step::Climb, 0)), over_old);
    assert_eq!(leads_to(&mut slave, cross(0)), over_old);
    for wave in 1..waves {
        assert_eq!(leads_to(&mut slave, cross(wave)), over_new);
    }
    assert_eq!(leads_to(&mut slave, reform(Step::Descend, 0)), new);
}

#[test]
fn a_drone_that_missed_a_wave_of_a_crossing_lands() {
    let mut slave = slave_at_the_end(config_in_waves(3));
    ordered(&mut slave, 2, &reform(Step::Climb, 0));
    arrives(&mut slave, 20.0);
    let said = ordered(&mut slave, 4, &cross(1));
    assert_eq!(goal(&said), Some(Goal::Land));
}

#[test]
fn a_drone_lands_in_its_wave_and_acknowledges_on_the_ground() {
    let lands = |wave| Order::Land {
        at: waypoints()[2],
        changes: 0,
        wave,
        apart: false,
    };
    let mut slave = slave_at_the_end(drone_that(|it, id| it.layout.landing_wave(id) == 1));
    let said = ordered(&mut slave, 2, &lands(0));
    assert_eq!((goal(&said), said.contains(&acknowledges(2))), (None, true));
    let said = ordered(&mut slave, 3, &lands(1));
    assert!(matches!(goal(&said), Some(Goal::TransitTo { .. })));
    assert!(!said.contains(&Transmit::Land), "it is waited for");
    arrives(&mut slave, 30.0);
    let landed = Input::Navigation(NavigationNotice::Landed);
    let said = told(&mut slave, 60.0, landed);
    assert!(said.contains(&acknowledges(3)) && said.contains(&Transmit::Land));
}

#[test]
fn a_swarm_that_is_apart_lands_at_once_each_below_its_slot() {
    let mut slave = slave_at_the_end(drone_that(|it, id| it.layout.landing_wave(id) == 0));
    let last = slave.config.layout.landing_waves() - 1;
    let order = Order::Land {
        at: waypoints()[2],
        changes: 0,
        wave: last,
        apart: true,
    };
    let said = ordered(&mut slave, 2, &order);
    assert!(said.contains(&Transmit::Land));
    let Some(Goal::TransitTo { to }) = goal(&said) else {
        panic!("{said:?}");
    };
    let slot = slave.layout().slot(slave.config.id, waypoints()[2]);
    assert!(to.horizontal_distance_m(slot) < 20.0, "{to:?} for {slot:?}");
}
