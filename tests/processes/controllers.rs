//! Drones with simulated flight controllers, as processes in real time.

use std::fs;

use muster_controller::{Config, Contact, FailsafeSettings, Procedure, Settings, Version};
use muster_daemon::control::{ActorFault, ControlMessage};
use muster_machines::node::Address;
use muster_msp::Channel;
use muster_scenarios::scenario;
use serde_json::{Value, json};

use super::fleet::{Fleet, Process, SCENARIO, assert_refused, replace};
use super::flights::{common_ballot, others, state};
use super::rc::start;
use super::receiver::Receiver;
use super::swarm::{complete_report, scenario_with, swarm, wait_until};

const DRONES: u32 = 3;
/// The first leader of three drones in line.
pub(super) const LEADER: u32 = 1;

/// Three drones of a fleet, each with a receiver where it starts, in the scenario with
/// these replacements.
pub(super) fn controlled(
    replacements: &[(&str, &str)],
    settings: impl Fn(u32) -> Settings,
) -> (Fleet, Vec<Receiver>) {
    let fleet = Fleet::new();
    let folder = fleet.file(0);
    let folder = folder.parent().unwrap();
    let path = scenario_with("swarm-controllers.toml", replacements, folder);
    let plan = scenario::load(&path, &[]).unwrap().plan;
    let places = (0..DRONES).zip(plan.start_positions());
    let receivers = places.map(|(id, place)| {
        let mut config = Config::new(plan.home, settings(id));
        config.place = place;
        // For as long as any test: the usual one hovers for seven minutes.
        config.airframe.battery.capacity_mah *= 3.0;
        let receiver = Receiver::start(config);
        let vehicle = format!(
            "vehicle = \"msp\"\nport = \"{}\"\nreceiver = \"sole\"",
            receiver.address
        );
        replace(&fleet.file(id), "vehicle = \"closed-form\"", &vehicle);
        replace(&fleet.file(id), SCENARIO, path.to_str().unwrap());
        receiver
    });
    let receivers = receivers.collect();
    (fleet, receivers)
}

fn fly(fleet: &Fleet) -> Vec<Process> {
    let arguments = |id| if id == LEADER { &["--fly"][..] } else { &[] };
    (0..DRONES)
        .map(|id| fleet.start(id, arguments(id)))
        .collect()
}

pub(super) fn landing() -> Settings {
    let mut settings = Settings::fit();
    settings.failsafe.landing_s = 20;
    settings
}

#[test]
fn controller_of_a_killed_leader_lands_it_and_the_others_finish() {
    let (fleet, receivers) = controlled(&[], |_| landing());
    let mut drones = fly(&fleet);
    let leader = &mut drones[LEADER as usize];
    leader.wait_for_mission(&json!({ "Opened": { "waypoint": 1 } }));
    let port = fleet.status(LEADER)["port"].clone();
    assert_eq!(port["state"], "open", "{port}");
    assert!(port["rc_per_s"].as_u64() >= Some(30), "{port}");
    let (_, metrics) = fleet.get(LEADER, "/metrics");
    assert!(metrics.contains("muster_port_state{state=\"open\"} 1"));
    leader.signal("KILL");
    assert_eq!(leader.end(), None);
    let lost = &receivers[LEADER as usize];
    let truth = lost.truth();
    assert!(truth.is_armed && truth.contact == Contact::Airborne);
    wait_until("the failsafe has landed it", || !lost.truth().is_armed);

    for (id, drone) in others(&mut drones, LEADER) {
        assert_eq!(drone.end(), Some(0), "drone {id}");
        let over = json!({ "Landing": "MissionOver" });
        assert!(drone.missions().contains(&over), "drone {id}");
    }
    for receiver in &receivers {
        let truth = receiver.truth();
        assert_eq!(truth.contact, Contact::Ground);
        assert!(!truth.is_armed);
    }
    let survivors: Vec<_> = others(&mut drones, LEADER).map(|(_, it)| &*it).collect();
    assert!(common_ballot(&survivors)["term"].as_u64() > Some(1));
}

#[test]
fn drone_whose_link_failed_for_good_ends_once_its_controller_has_landed_it() {
    let no_restart = ("[safety]", "[limits]\nmsp_restarts_max = 0\n\n[safety]");
    let (fleet, receivers) = controlled(&[no_restart], |_| landing());
    let mut drones: Vec<_> = (0..DRONES).map(|id| start(&fleet, id, &[])).collect();
    let on_its_way = json!({ "State": { "MovingToWaypoint": { "waypoint": 1 } } });
    drones[0].wait_for_mission(&on_its_way);
    drones[0].control(&ControlMessage::Inject {
        actor: Address::Msp,
        fault: ActorFault::Crashes,
    });
    assert_eq!(drones[0].end(), Some(4));
    let truth = receivers[0].truth();
    assert!(!truth.is_armed && truth.contact == Contact::Ground);
}

/// Only its controller tells the new process that the drone flies.
#[test]
fn drone_that_restarts_in_the_air_without_its_journal_lands() {
    let (fleet, receivers) = controlled(&[], |_| landing());
    let mut drones = fly(&fleet);
    let leader = &mut drones[LEADER as usize];
    leader.wait_for_mission(&json!({ "Opened": { "waypoint": 1 } }));
    leader.signal("KILL");
    leader.end();
    fs::remove_dir_all(fleet.path(&format!("journal-{LEADER}"))).unwrap();
    let receiver = &receivers[LEADER as usize];
    assert!(receiver.truth().contact == Contact::Airborne);
    let mut restarted = fleet.start(LEADER, &[]);
    restarted.wait_for_mission(&json!({ "Landing": "JournalLost" }));
    wait_until("it has landed", || !receiver.truth().is_armed);
    assert_eq!(receiver.truth().contact, Contact::Ground);
}

/// Drones 0 and 2 are in the stage `bench`; the board of drone 1, in the stage `sim`, doesn't say that it is a simulation.
#[test]
fn neither_a_bench_drone_nor_a_board_that_is_no_simulation_is_armed() {
    let (fleet, receivers) = controlled(&[], |id| Settings {
        reports_simulator: id != LEADER,
        ..Settings::fit()
    });
    for id in [0, 2] {
        replace(&fleet.file(id), "stage = \"sim\"", "stage = \"bench\"");
    }
    let mut drones = fly(&fleet);
    for (drone, receiver) in drones.iter_mut().zip(&receivers) {
        drone.wait_for_mission(&state("TakingOff"));
        let before = receiver.received();
        // Six seconds at 50 Hz: a controller arms five seconds after its start.
        wait_until("RC continues", || receiver.received() >= before + 300);
    }
    for (id, receiver) in (0..).zip(&receivers) {
        assert!(!receiver.truth().is_armed, "drone {id}");
        let (low, centre) = (Channel::LOW.us(), Channel::CENTRE.us());
        for (_, rc) in &receiver.seen().rc {
            // Roll, pitch, throttle, yaw, AUX1, AUX2.
            let idle = [centre, centre, low, centre, low, low];
            assert_eq!(rc.channels_us[..6], idle, "drone {id}");
        }
    }
}

#[test]
fn serial_port_is_refused_in_the_stage_sim() {
    let (fleet, _receivers) = controlled(&[], |_| Settings::fit());
    replace(
        &fleet.file(0),
        "port = \"tcp:",
        "port = \"serial:/dev/ttyACM0\" # ",
    );
    let expected = "in the stage \"sim\" `port` needs \"tcp:HOST:PORT\"";
    assert_refused(&mut fleet.command(0), expected);
    let (fleet, _receivers) = controlled(&[], |_| Settings::fit());
    replace(&fleet.file(0), "tcp:127.0.0.1", "tcp:192.0.2.1");
    let expected = "in the stage \"sim\" `port` needs an address of this host";
    assert_refused(&mut fleet.command(0), expected);
}

#[test]
fn an_optical_flow_module_must_be_in_the_scenario_and_on_this_host() {
    let refused = |scenario: &[(&str, &str)], flow: &str, expected: &str| {
        let (fleet, _receivers) = controlled(scenario, |_| Settings::fit());
        let named = format!("{flow}receiver = ");
        replace(&fleet.file(0), "receiver = ", &named);
        assert_refused(&mut fleet.command(0), expected);
    };
    let module = [("[vehicle]", "[vehicle.flow]\n\n[vehicle]")];
    refused(
        &[],
        "flow = \"tcp:127.0.0.1:9020\"\n",
        "the scenario has no table `[vehicle.flow]`",
    );
    refused(&module, "", "so this needs `flow`");
    refused(
        &module,
        "flow = \"tcp:192.0.2.1:9020\"\n",
        "`flow` needs a serial device or an address of this host",
    );
    refused(
        &module,
        "flow = \"ttyUSB0\"\n",
        "`flow` needs \"serial:/dev/ttyUSB0@115200\"",
    );
}

/// Settings that no drone may fly, how its file names its receiver, and the rule that they break.
fn unfit() -> [(Settings, &'static str, &'static str); 3] {
    let failsafe = FailsafeSettings {
        procedure: Procedure::Drop,
        ..Settings::fit().failsafe
    };
    let drop = Settings {
        failsafe,
        ..Settings::fit()
    };
    // A simulation may hold the last override for ever; that is no finding here.
    let override_drop = Settings {
        failsafe,
        ..Settings::overriding(Version::V4_6)
    };
    [
        (drop, "sole", "failsafe-procedure"),
        (override_drop, "override", "failsafe-procedure"),
        (Settings::fit(), "override", "override-mask"),
    ]
}

#[test]
fn controllers_that_are_not_fit_to_fly_get_no_rc_and_status_says_why() {
    let (fleet, receivers) = controlled(&[], |id| unfit()[id as usize].0.clone());
    for (id, (_, receiver, _)) in (0..).zip(unfit()) {
        let receiver = format!("receiver = \"{receiver}\"");
        replace(&fleet.file(id), "receiver = \"sole\"", &receiver);
    }
    let mut drones = fly(&fleet);
    drones.iter_mut().for_each(Process::wait_until_ready);
    for (id, (_, _, rule)) in (0..).zip(unfit()) {
        let is_named = |text: &Value| text.as_str().unwrap().contains(rule);
        let status = fleet.wait_for_status(id, "the port is open", |status| {
            status["port"]["state"] == "open"
        });
        let names = |list: &Value| list.as_array().unwrap().iter().any(is_named);
        assert!(names(&status["port"]["unfit"]), "{rule}: {status:#}");
        assert!(names(&status["faults"]), "{rule}: {status:#}");
    }
    fleet.wait_for_status(LEADER, "it takes off", |status| {
        status["state"]["name"] == "taking_off"
    });
    for receiver in &receivers {
        assert_eq!(receiver.received(), 0);
    }
}

/// Flies a swarm of simulated controllers with these faults. Returns the report, and what drone 0's file says.
fn fly_with(replacements: &[(&str, &str)], faults: &str) -> (Value, String) {
    let folder = tempfile::tempdir().unwrap();
    let path = scenario_with("swarm-controllers.toml", replacements, folder.path());
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, text + faults).unwrap();
    let out = folder.path().join("flight");
    let run = swarm(path.to_str().unwrap(), &out)
        .arg("--json")
        .output()
        .unwrap();
    let report = complete_report(&run, &out);
    let file = fs::read_to_string(out.join("drones/drone-0/drone.toml")).unwrap();
    (report, file)
}

#[test]
fn swarm_flies_simulated_controllers_and_injects_their_faults() {
    let faults = r#"
[[faults]]
at_waypoint = 1
kind = "kill"
drone = "master"

[[faults]]
at_waypoint = 1
kind = "corrupt-bytes"
drone = 0
share = 0.002
for_s = 5

[[faults]]
at_waypoint = 1
kind = "delay-bytes"
drone = 2
by_ms = 30
for_s = 5
"#;
    let (report, file) = fly_with(&[], faults);
    for (id, drone) in (0..).zip(report["drones"].as_array().unwrap()) {
        let state = drone["state"].as_str().unwrap();
        if id == LEADER {
            assert!(state.starts_with("killed "), "{state}");
        } else {
            assert_eq!(state, "finished", "drone {id}");
        }
    }
    assert_eq!(report["elections"].as_array().unwrap().len(), 1);
    assert!(file.contains("vehicle = \"msp\"") && file.contains("port = \"tcp:127.0.0.1:"));
}

/// A sagging battery lands its drone, a pilot takes another one, and what lasts a moment changes nothing.
#[test]
fn swarm_with_pilots_flies_on_through_each_other_fault_of_controllers() {
    let faults = r#"
[[faults]]
at_waypoint = 1
kind = "take-over"
drone = 2

[[faults]]
at_waypoint = 1
kind = "sag-battery"
drone = 0
volts = 5

[[faults]]
at_waypoint = 1
kind = "freeze-controller"
drone = 1
for_s = 0.2

[[faults]]
at_waypoint = 1
after_s = 1
kind = "lose-bytes"
drone = 1
share = 0.002
for_s = 3

[[faults]]
at_waypoint = 1
after_s = 5
kind = "close-port"
drone = 1
for_s = 0.1
"#;
    let pilot = [("kind = \"msp\"", "kind = \"msp\"\nreceiver = \"override\"")];
    let (report, file) = fly_with(&pilot, faults);
    assert!(file.contains("receiver = \"override\""));
    let drones = report["drones"].as_array().unwrap();
    let causes: Vec<_> = drones.iter().map(|it| &it["landed_because"]).collect();
    let expected = [
        json!("its battery was critically low"),
        Value::Null,
        json!("its pilot took it over"),
    ];
    assert_eq!(causes, expected.iter().collect::<Vec<_>>());
}
