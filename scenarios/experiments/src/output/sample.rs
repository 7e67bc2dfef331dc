//! Sample runs for tests: a line of drones that flies 2,500 m north and lands.

use std::collections::BTreeMap;
use std::time::Duration;

use muster_controller::{Config, Controller, Settings, Sticks, Truth};
use muster_machines::geodetic::Geodetic;
use muster_machines::geometry::Ned;
use muster_machines::mission::State;
use muster_machines::time::Timestamp;
use muster_scenarios::report::{
    Barrier, Bridge, ControlSeries, DroneReport, Engine, Flight, FlightOfDrone, History, Means,
    RelayReport, Report, Role, Violation,
};
use nalgebra::UnitQuaternion;

const SPACING_M: f64 = 160.0;
const LANDING_SPACING_M: f64 = 5.0;
const ALTITUDE_M: f64 = 20.0;
const LEG_M: f64 = 500.0;
const LEGS: u16 = 5;
const SPEED_MPS: f64 = 12.0;
const CLIMB_S: f64 = 15.0;

/// A run of `drones` drones without faults; the middle one is the master.
pub(crate) fn swarm(drones: u32) -> (Report, Flight) {
    let master = (drones - 1) / 2;
    let script = Script::new(drones);
    let flight = Flight {
        waypoints: (0..=LEGS)
            .map(|leg| at_altitude(f64::from(leg) * LEG_M, 0.0))
            .collect(),
        range_m: 300.0,
        drones: (0..drones).map(|id| script.fly(id, master)).collect(),
        history: History::default(),
        others: vec![],
    };
    let reports: Vec<_> = (0..drones)
        .map(|id| report_of(id, master, drones, &flight))
        .collect();
    let number = f64::from(drones);
    let flight_times = reports.iter().filter_map(|drone| drone.flight_time_s);
    let report = Report {
        elections: Vec::new(),
        firmware: None,
        firmware_stalls: None,
        scenario: "scenarios/thesis-2.toml".to_owned(),
        seed: 7,
        overrides: Vec::new(),
        engine: Some(Engine::Actors),
        command: "muster sim scenarios/thesis-2.toml --seed 7 --engine actors".to_owned(),
        trace: Some("9f2d6c1b7a4e80353c5d1f6e8b9a07d24c3f5e6a1b8d9c0e7f2a4b6c8d0e1f35".to_owned()),
        simulated_s: script.end_s,
        wall_s: 1.87,
        clock_uncertainty_s: None,
        bridges: bridges(master, drones),
        agent_failures: Vec::new(),
        observed: Vec::new(),
        never_met: vec![],
        never_injected: vec![],
        dropped: BTreeMap::new(),
        medium: None,
        interrupted: false,
        unchecked: false,
        relays: Vec::new(),
        mission_completed: true,
        means: Means {
            flight_time_s: Some(flight_times.sum::<f64>() / number),
            messages_received: reports
                .iter()
                .map(|d| d.messages_received as f64)
                .sum::<f64>()
                / number,
        },
        drones: reports,
        barriers: script.barriers(drones),
        changes: vec![],
        following: None,
        min_separation_m: (drones > 1).then_some(LANDING_SPACING_M - 0.13),
        violations: vec![],
        others: vec![],
    };
    (report, flight)
}

/// The drones beside the master, and those that only they can reach.
fn bridges(master: u32, drones: u32) -> Vec<Bridge> {
    let sides = [
        (master.wrapping_sub(1), 0..master.saturating_sub(1)),
        (master + 1, master + 2..drones),
    ];
    let bridges = sides.into_iter().map(|(bridge, beyond)| Bridge {
        bridge,
        out_of_range: beyond.collect(),
    });
    bridges
        .filter(|bridge| !bridge.out_of_range.is_empty())
        .collect()
}

/// A run of six drones with restarts, an early landing and violations.
pub(crate) fn faulty() -> (Report, Flight) {
    let (mut report, flight) = swarm(6);
    let lost = &mut report.drones[5];
    lost.flight_time_s = None;
    lost.waypoint_delay_s = None;
    lost.waypoint_delay_max_s = None;
    lost.hops = None;
    lost.parent = None;
    lost.state = "moving to waypoint 3".to_owned();
    lost.landed = false;
    lost.restarts = 1;
    let early = &mut report.drones[0];
    early.landed_because = Some("the master was silent".to_owned());
    early.restarts = 2;
    report.violations = vec![
        Violation {
            rule: 3,
            at_s: 131.25,
            drones: vec![4, 5],
            what: "came within 1.2 m of each other".to_owned(),
        },
        Violation {
            rule: 9,
            at_s: 260.0,
            drones: vec![5],
            what: "was still in the air at the end".to_owned(),
        },
    ];
    (report, flight)
}

fn at(seconds: f64) -> Timestamp {
    Timestamp::from_secs_f64(seconds)
}

fn at_altitude(north_m: f64, east_m: f64) -> Ned {
    Ned::new(north_m, east_m, -ALTITUDE_M)
}

/// Schedule of the swarm.
struct Script {
    /// Time when the last drone is in its slot.
    formed_s: f64,
    /// Departures to waypoints 1, 2, …, and to land.
    departures_s: Vec<f64>,
    end_s: f64,
}

impl Script {
    fn new(drones: u32) -> Self {
        let farthest_m = f64::from(drones / 2) * (SPACING_M - LANDING_SPACING_M);
        let formed_s = 5.0 + CLIMB_S + farthest_m / SPEED_MPS;
        let first_s = formed_s + 36.0;
        let leg_s = LEG_M / SPEED_MPS + wait_s(f64::from(drones / 2));
        let departures_s: Vec<_> = (0..=LEGS)
            .map(|leg| first_s + f64::from(leg) * leg_s)
            .collect();
        let end_s = departures_s[usize::from(LEGS)] + farthest_m / SPEED_MPS + CLIMB_S + 2.0;
        Self {
            formed_s,
            departures_s,
            end_s,
        }
    }

    fn fly(&self, id: u32, master: u32) -> FlightOfDrone {
        let slots = f64::from(id) - f64::from(master);
        let lag_s = 0.11 * slots.abs();
        let (slot_m, place_m) = (slots * SPACING_M, slots * LANDING_SPACING_M);
        let spread_s = (slot_m - place_m).abs() / SPEED_MPS;
        let ground = |north_m: f64| Ned::new(north_m, place_m, 0.0);
        let mut keys = vec![
            (0.0, ground(0.0)),
            (5.0, ground(0.0)),
            (5.0 + CLIMB_S, at_altitude(0.0, place_m)),
            (5.0 + CLIMB_S + spread_s, at_altitude(0.0, slot_m)),
        ];
        let mut states = vec![
            (0.0, State::Start),
            (1.0 + lag_s, State::SetUp),
            (5.0, State::TakingOff),
            (self.formed_s, State::NeighbourDiscovery),
            (self.formed_s + 20.0 + lag_s, State::HopUpdate),
            (
                self.formed_s + 32.0 + lag_s,
                State::MovingToWaypoint { waypoint: 0 },
            ),
            (
                self.formed_s + 33.0 + lag_s,
                State::WaypointReached { waypoint: 0 },
            ),
        ];
        for leg in 1..=LEGS {
            let from_s = self.departures_s[usize::from(leg) - 1] + lag_s;
            let to_s = from_s + LEG_M / SPEED_MPS;
            keys.push((from_s, at_altitude(f64::from(leg - 1) * LEG_M, slot_m)));
            keys.push((to_s, at_altitude(f64::from(leg) * LEG_M, slot_m)));
            states.push((from_s, State::MovingToWaypoint { waypoint: leg }));
            states.push((to_s, State::WaypointReached { waypoint: leg }));
        }
        let (north_m, from_s) = (
            f64::from(LEGS) * LEG_M,
            self.departures_s[usize::from(LEGS)],
        );
        let above_s = from_s + lag_s + spread_s;
        keys.push((from_s + lag_s, at_altitude(north_m, slot_m)));
        keys.push((above_s, at_altitude(north_m, place_m)));
        keys.push((above_s + CLIMB_S, ground(north_m)));
        states.push((from_s + lag_s, State::MovingToLand));
        states.push((above_s, State::Landing));
        states.push((above_s + CLIMB_S, State::Finished));
        FlightOfDrone {
            track: sampled(&keys),
            states: states
                .into_iter()
                .map(|(since_s, state)| (at(since_s), state))
                .collect(),
            died_at: None,
            control: None,
        }
    }

    fn barriers(&self, drones: u32) -> Vec<Barrier> {
        let wait_s = wait_s(f64::from(drones / 2));
        (0..)
            .zip(&self.departures_s)
            .map(|(waypoint, &moving_s)| Barrier {
                waypoint,
                arrived_s: moving_s - wait_s - 0.04 * f64::from(waypoint),
                moving_s,
                hold_s: 0.0,
                transmissions: u64::from(3 * drones + 5 * u32::from(waypoint)),
                keep_alives: u64::from(drones),
                retries: 0,
            })
            .collect()
    }
}

/// Barrier wait of a swarm with its farthest drone `hops` away.
fn wait_s(hops: f64) -> f64 {
    0.35 * hops + 0.2
}

/// One point per second on the lines between `keys`, with a lateral sway of up to 1 m.
fn sampled(keys: &[(f64, Ned)]) -> Vec<(Timestamp, Ned)> {
    let mut track = vec![];
    let mut time_s = 0.0;
    for pair in keys.windows(2) {
        let ((from_s, from), (to_s, to)) = (pair[0], pair[1]);
        while time_s < to_s {
            let place = from
                .0
                .lerp(&to.0, ((time_s - from_s) / (to_s - from_s)).max(0.0));
            let sway_m = (time_s / 9.0).sin() * (-place.z / ALTITUDE_M);
            track.push((at(time_s), Ned::new(place.x, place.y + sway_m, place.z)));
            time_s += 1.0;
        }
    }
    if let Some(&(end_s, end)) = keys.last() {
        track.push((at(end_s), end));
    }
    track
}

fn report_of(id: u32, master: u32, drones: u32, flight: &Flight) -> DroneReport {
    let hops = id.abs_diff(master);
    let parent = if id < master {
        id + 1
    } else {
        id.saturating_sub(1)
    };
    let at_an_end = id == 0 || id + 1 == drones;
    let states = &flight.drones[id as usize].states;
    let (discovery, finished) = (states[3].0, states[states.len() - 1].0);
    let flight_time_s = finished.since(discovery).as_secs_f64();
    let received = if at_an_end { 1.0 } else { 2.0 } * flight_time_s * 5.2;
    DroneReport {
        id,
        role: if hops == 0 {
            Role::Master
        } else {
            Role::Member
        },
        hops: u16::try_from(hops).ok(),
        parent: (hops > 0).then_some(parent),
        relay: hops > 0 && !at_an_end,
        out_of_range: hops > 1,
        routing_list: if id < master {
            (0..id).collect()
        } else {
            (id + 1..drones).collect()
        },
        flight_time_s: Some(flight_time_s),
        messages_sent: (flight_time_s * 5.0) as u64 + u64::from(id % 4) * 17,
        messages_received: received as u64 + u64::from(id % 3) * 41,
        messages_at_least: false,
        waypoint_delay_s: Some(wait_s(f64::from(drones / 2)) + 0.03 * f64::from(hops)),
        waypoint_delay_max_s: Some(wait_s(f64::from(drones / 2)) + 0.05 * f64::from(hops)),
        state: "finished".to_owned(),
        landed: true,
        waypoints: 1,
        landed_because: None,
        restarts: 0,
        following: None,
        port: None,
    }
}

/// A relay that stands at a place.
pub(crate) fn relay(id: u32, place: Ned) -> RelayReport {
    RelayReport {
        id,
        north_m: place.north_m(),
        east_m: place.east_m(),
        altitude_m: place.altitude_m(),
        hops: None,
        parent: None,
        messages_sent: 0,
        messages_received: 0,
        messages_at_least: false,
        restarts: 0,
    }
}

/// The aircraft of a flight controller at rest, but rolled so far and armed.
fn rolled(roll_deg: f64) -> Truth {
    let home = Geodetic::new(39.48, -0.34, 20.0).unwrap();
    let config = Config::new(home, Settings::fit());
    let level = Controller::new(config, 1, Timestamp::ZERO).aircraft(Timestamp::ZERO);
    Truth {
        attitude: UnitQuaternion::from_euler_angles(roll_deg.to_radians(), -0.1, 2.0),
        is_armed: true,
        ..level
    }
}

/// How an aircraft was flown from second 10 on for so long, with a look ten times a second. It leans by 40° at second 12 only.
pub(crate) fn flown(seconds: u32, rc_gap: Duration) -> ControlSeries {
    let mut series = ControlSeries::default();
    let (level, leans) = (rolled(0.0), rolled(40.0));
    for look in 0..seconds * 10 {
        let sticks = Sticks {
            throttle_us: 1_300,
            rc_gap: Some(rc_gap),
        };
        let truth = if look == 20 { &leans } else { &level };
        series.look(at(10.0 + f64::from(look) / 10.0), truth, Some(sticks));
    }
    series
}

/// How an aircraft was flown, with as many stretches as there may be, each different.
pub(crate) fn leaning() -> ControlSeries {
    let mut series = ControlSeries::default();
    for look in 0..=1_500_u16 {
        let lean_deg = 30.0 * f64::from(look).sin();
        let sticks = Sticks {
            throttle_us: 1_000 + look % 1_000,
            rc_gap: Some(Duration::from_millis(u64::from(look % 190))),
        };
        let now = at(f64::from(look) * 0.0999);
        series.look(now, &rolled(lean_deg), Some(sticks));
    }
    series
}
