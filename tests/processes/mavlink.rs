//! A drone with an autopilot that speaks MAVLink, as a process in real time among simulated drones.

use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::path::Path;

use mavlink::dialects::common::{HEARTBEAT_DATA, MavAutopilot, MavCmd, MavLandedState, MavMessage};
use mavlink::{MavHeader, write_v2_msg};
use muster_scenarios::scenario;
use serde_json::json;

use super::autopilot::Autopilot;
use super::fleet::{Fleet, MASTER, SCENARIO, assert_refused, replace};
use super::flights::{others, state};
use super::swarm::wait_until;

/// The drone with the autopilot.
const PILOTED: u32 = 0;

/// The vehicle's lines in a drone's file.
fn vehicle(port: &str) -> String {
    format!("vehicle = \"mavlink\"\nport = \"udpin:{port}\"")
}

/// A fleet whose first drone has a scripted autopilot, where the drone starts; and the address at which that drone listens.
fn piloted() -> (Fleet, Autopilot, SocketAddr) {
    let fleet = Fleet::new();
    let mut port: SocketAddr = fleet.address(PILOTED).parse().unwrap();
    let [first, second, third, _] = match port.ip() {
        std::net::IpAddr::V4(it) => it.octets(),
        std::net::IpAddr::V6(_) => unreachable!("fleets have IPv4"),
    };
    port.set_ip(Ipv4Addr::new(first, second, third, 100).into());
    let plan = scenario::load(Path::new(SCENARIO), &[]).unwrap().plan;
    let place = plan.start_positions().next().unwrap();
    let autopilot = Autopilot::start(plan.home, place, port);
    let file = fleet.file(PILOTED);
    replace(
        &file,
        "vehicle = \"closed-form\"",
        &vehicle(&port.to_string()),
    );
    (fleet, autopilot, port)
}

/// Sends noise, and heartbeats of other systems.
fn disturb(port: SocketAddr) {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    let heartbeat = MavMessage::HEARTBEAT(HEARTBEAT_DATA {
        autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
        ..Default::default()
    });
    for number in 0..100 {
        let header = MavHeader {
            system_id: 2 + number,
            component_id: 1,
            sequence: 0,
        };
        let mut datagram = Vec::new();
        write_v2_msg(&mut datagram, header, &heartbeat).unwrap();
        socket.send_to(&datagram, port).unwrap();
        socket.send_to(&[0xFD; 40], port).unwrap();
    }
}

#[test]
fn autopilot_flies_a_mission_in_lockstep_with_four_simulated_drones() {
    let (fleet, autopilot, port) = piloted();
    let mut drones = fleet.fly();
    drones[MASTER as usize].wait_for_mission(&json!({ "Opened": { "waypoint": 1 } }));
    disturb(port);
    let status = fleet.wait_for_status(PILOTED, "bad input is counted", |status| {
        status["port"]["bad_frames"].as_u64() >= Some(200)
    });
    assert_eq!(status["port"]["state"], "open");
    for (id, drone) in (0..).zip(&mut drones) {
        assert_eq!(drone.end(), Some(0), "drone {id}");
        let over = json!({ "Landing": "MissionOver" });
        assert!(drone.missions().contains(&over), "drone {id}");
    }
    let flown = autopilot.state();
    assert!(!flown.is_armed && !flown.has_failed_safe);
    assert!(flown.targets.len() >= 2, "{:?}", flown.targets);
    for (target, left_m) in &flown.targets {
        assert!(
            *left_m < 1.0,
            "{target:?} came {left_m} m before the end of a leg"
        );
    }
    let flight = [
        MavCmd::MAV_CMD_DO_SET_MODE,
        MavCmd::MAV_CMD_COMPONENT_ARM_DISARM,
        MavCmd::MAV_CMD_NAV_TAKEOFF,
        MavCmd::MAV_CMD_NAV_LAND,
    ];
    let mut commands = flown.commands.clone();
    commands.retain(|it| *it != MavCmd::MAV_CMD_DO_CHANGE_SPEED);
    commands.dedup();
    assert_eq!(commands, flight);
}

#[test]
fn autopilot_of_a_killed_process_lands_by_its_own_failsafe_and_the_others_finish() {
    let (fleet, autopilot, _) = piloted();
    let mut drones = fleet.fly();
    drones[MASTER as usize].wait_for_mission(&json!({ "Opened": { "waypoint": 1 } }));
    let drone = &mut drones[PILOTED as usize];
    drone.signal("KILL");
    assert_eq!(drone.end(), None);
    assert!(autopilot.state().is_armed);
    wait_until("the failsafe has landed it", || !autopilot.state().is_armed);
    assert!(autopilot.state().has_failed_safe);
    for (id, drone) in others(&mut drones, PILOTED) {
        assert_eq!(drone.end(), Some(0), "drone {id}");
    }
}

#[test]
fn silent_autopilot_counts_as_landing_and_the_others_finish() {
    let (fleet, autopilot, _) = piloted();
    let mut drones = fleet.fly();
    drones[MASTER as usize].wait_for_mission(&json!({ "Opened": { "waypoint": 1 } }));
    autopilot.state().is_silent = true;
    drones[PILOTED as usize].wait_for("it lands", |line| {
        let seen = line["seen"].as_str().unwrap_or_default();
        seen.contains("\"Landing\"")
    });
    for (id, drone) in others(&mut drones, PILOTED) {
        assert_eq!(drone.end(), Some(0), "drone {id}");
    }
}

#[test]
fn autopilot_that_does_not_say_that_it_is_a_simulation_gets_no_command() {
    let (fleet, autopilot, _) = piloted();
    autopilot.state().is_real = true;
    let mut drones = fleet.fly();
    drones[PILOTED as usize].wait_for("it is refused", |line| {
        let message = line["message"].as_str().unwrap_or_default();
        message.contains("does not report a simulation")
    });
    wait_until("the others fly", || {
        fleet.status(1)["vehicle"]["altitude_m"].as_f64() > Some(1.0)
    });
    let state = autopilot.state();
    assert_eq!(state.commands, []);
    assert!(!state.is_armed);
}

#[test]
fn in_the_stage_bench_an_autopilot_is_asked_for_telemetry_and_gets_no_command() {
    let (fleet, autopilot, _) = piloted();
    replace(&fleet.file(PILOTED), "stage = \"sim\"", "stage = \"bench\"");
    let mut drones = fleet.fly();
    drones[PILOTED as usize].wait_for_mission(&state("TakingOff"));
    let status = fleet.wait_for_status(PILOTED, "it knows where it is", |status| {
        status["vehicle"]["position_lost_s"].is_null() && status["port"]["state"] == "open"
    });
    assert_eq!(status["vehicle"]["charge"], 0.9);
    wait_until("the others fly", || {
        fleet.status(1)["vehicle"]["altitude_m"].as_f64() > Some(1.0)
    });
    let state = autopilot.state();
    assert_eq!(state.commands, []);
    assert_eq!(state.landed, MavLandedState::MAV_LANDED_STATE_ON_GROUND);
}

#[test]
fn what_an_autopilot_may_not_do_is_refused_by_name() {
    let (fleet, _autopilot, port) = piloted();
    let file = fleet.file(PILOTED);
    let port = vehicle(&port.to_string());
    for (from, to, expected) in [
        (
            "stage = \"sim\"",
            "stage = \"flight\"",
            "`stage` needs \"sim\" or \"bench\"",
        ),
        (
            &*port,
            &*vehicle("0.0.0.0:14550"),
            "`port` needs a loopback address",
        ),
        (
            &*port,
            "vehicle = \"mavlink\"",
            "`vehicle = \"mavlink\"` needs `port`",
        ),
        (
            &*port,
            &format!("{port}\nreceiver = \"sole\""),
            "only a `vehicle = \"msp\"`",
        ),
    ] {
        replace(&file, from, to);
        assert_refused(&mut fleet.command(PILOTED), expected);
        replace(&file, to, from);
    }
}
