//! `muster swarm`: a scenario's drones as processes, from the command line.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use super::fleet::SCENARIO;

/// How long a test waits for what must happen; only a failing one does.
const PATIENCE: Duration = Duration::from_secs(60);

pub(crate) fn swarm(scenario: &str, out: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_muster"));
    let scenarios = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios");
    command
        .arg("swarm")
        .arg(scenarios.join(scenario))
        .arg("--out")
        .arg(out);
    command
}

/// The processes of drones that have to do with a folder, by number.
fn processes_of(folder: &Path) -> Vec<u32> {
    let folder = folder.to_string_lossy();
    let all = fs::read_dir("/proc").unwrap();
    let numbers = all.filter_map(|it| it.ok()?.file_name().to_str()?.parse().ok());
    let has_to_do = |pid: &u32| {
        let line = fs::read_to_string(format!("/proc/{pid}/cmdline"));
        line.is_ok_and(|line| line.contains("musterd") && line.contains(&*folder))
    };
    numbers.filter(has_to_do).collect()
}

/// Whether a process has been stopped by a signal.
pub(crate) fn stopped(pid: u32) -> bool {
    let stat = fs::read_to_string(format!("/proc/{pid}/stat"));
    // What stands in parentheses is the program's name.
    stat.is_ok_and(|stat| stat.rsplit(')').next().unwrap().starts_with(" T"))
}

/// A scenario in whose flight a drone's process is stopped for some seconds.
pub(crate) fn hanging(folder: &Path) -> PathBuf {
    let text = fs::read_to_string(SCENARIO).unwrap();
    let missions = Path::new(SCENARIO)
        .parent()
        .unwrap()
        .parent()
        .unwrap()
        .join("missions");
    let text = text.replace("../missions", missions.to_str().unwrap());
    let path = folder.join("hanging.toml");
    fs::write(
        &path,
        text + "\n[[faults]]\nat_s = 2\nhang = 0\nfor_s = 2.9\n",
    )
    .unwrap();
    path
}

pub(crate) fn wait_until(what: &str, holds: impl Fn() -> bool) {
    let since = Instant::now();
    while !holds() {
        assert!(
            since.elapsed() < PATIENCE,
            "not within {PATIENCE:?}: {what}"
        );
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn processes_elect_a_master_over_several_hops_and_are_judged_by_the_rules_of_a_simulation() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("flight");
    let run = swarm("hardware/swarm-kill-master.toml", &out)
        .arg("--json")
        .output()
        .unwrap();
    assert!(run.status.success(), "{run:?}");
    assert_eq!(processes_of(&out), [0; 0]);
    let report: Value = serde_json::from_slice(&run.stdout).unwrap();
    assert_eq!(report["violations"], Value::Array(Vec::new()));
    assert_eq!(report["mission_completed"], true);
    assert!(report.get("engine").is_none() && report.get("trace").is_none());
    let drones = report["drones"].as_array().unwrap();
    for (id, drone) in (0..).zip(drones) {
        let state = drone["state"].as_str().unwrap();
        if id == 2 {
            assert_eq!(state, "killed while moving to waypoint 2");
        } else {
            assert_eq!(state, "finished", "drone {id}");
            assert_eq!(drone["waypoints"], 3, "drone {id}");
        }
        assert!(drone["messages_sent"].as_u64() > Some(0), "drone {id}");
        assert!(drone["messages_received"].as_u64() > Some(0), "drone {id}");
    }
    // Nobody hears farther than the next but one: without the master they are two parts.
    let elections = report["elections"].as_array().unwrap();
    assert_eq!(elections.len(), 1, "{elections:?}");
    assert!(elections[0]["settled_after_s"].as_f64() < Some(2.0));
    assert_eq!(elections[0]["masters"].as_array().unwrap().len(), 2);
    for file in [
        "report.html",
        "report.json",
        "tracks.csv",
        "drones/drone-3/log.jsonl",
    ] {
        assert!(out.join(file).is_file(), "{file}");
    }
}

#[test]
fn processes_that_are_killed_or_hang_in_flight_start_again_and_fly_on() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("flight");
    let run = swarm("hardware/swarm-restart.toml", &out)
        .arg("--json")
        .output()
        .unwrap();
    assert!(run.status.success(), "{run:?}");
    assert_eq!(processes_of(&out), [0; 0]);
    let report: Value = serde_json::from_slice(&run.stdout).unwrap();
    assert_eq!(report["violations"], Value::Array(Vec::new()));
    assert_eq!(report["mission_completed"], true);
    for (id, drone) in (0..).zip(report["drones"].as_array().unwrap()) {
        assert_eq!(drone["state"], "finished", "drone {id}");
        assert_eq!(drone["waypoints"], 3, "drone {id}");
        let lives = fs::read_to_string(out.join(format!("drones/drone-{id}/log.jsonl"))).unwrap();
        let lives = lives.lines().filter(|line| line.contains("\"starts\""));
        assert_eq!(lives.count(), if [0, 2].contains(&id) { 2 } else { 1 });
    }
}

#[test]
fn a_mission_is_flown_over_connections_between_all() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("flight");
    let run = swarm("hardware/swarm-short.toml", &out)
        .args(["--transport", "quic", "--json"])
        .output()
        .unwrap();
    assert!(run.status.success(), "{run:?}");
    let report: Value = serde_json::from_slice(&run.stdout).unwrap();
    assert_eq!(report["violations"], Value::Array(Vec::new()));
    assert_eq!(report["mission_completed"], true);
    let mut connections = Vec::new();
    for id in 0..5 {
        let own = out.join(format!("drones/drone-{id}"));
        let file = fs::read_to_string(own.join("drone.toml")).unwrap();
        assert!(file.contains("[quic]") && !file.contains("[udp]"), "{file}");
        let log = fs::read_to_string(own.join("log.jsonl")).unwrap();
        let lines = log.lines().map(|line| serde_json::from_str(line).unwrap());
        let mut counted = lines.filter(|line: &Value| line["message"] == "counted");
        let counted = counted.next_back().unwrap();
        let count = |name: &str| counted[name].as_u64().unwrap();
        assert!(count("sent") > 0 && count("received") > 0, "{counted}");
        assert_eq!(count("too_long"), 0, "{counted}");
        connections.push(count("connections"));
        // Each frame was one's of the fleet; whom a drone has just met has yet to prove that it says it now.
        let dropped = counted["dropped"].as_str().unwrap();
        assert!(
            dropped.is_empty() || dropped.starts_with("unproven ") && !dropped.contains(','),
            "{counted}"
        );
    }
    // Whoever ends last has nobody left.
    assert_eq!(connections.iter().max(), Some(&4), "{connections:?}");
}

#[test]
fn no_process_outlives_whoever_started_it() {
    let folder = tempfile::tempdir().unwrap();
    let scenario = hanging(folder.path());
    for signal in ["KILL", "INT"] {
        let out = folder.path().join(signal);
        let mut command = swarm(scenario.to_str().unwrap(), &out);
        let mut starter = command.stderr(Stdio::null()).spawn().unwrap();
        wait_until("all five are up", || processes_of(&out).len() == 5);
        wait_until("all five answer", || {
            let mut status = Command::new(env!("CARGO_BIN_EXE_muster"));
            let asked = status.arg("status").arg(&out).output().unwrap();
            let table = String::from_utf8(asked.stdout).unwrap();
            // Two lines of headings and one below them.
            table.lines().count() >= 8 && asked.status.success()
        });
        wait_until("one stands still", || {
            processes_of(&out).into_iter().any(stopped)
        });
        let sent = Command::new("kill")
            .arg(format!("-{signal}"))
            .arg(starter.id().to_string())
            .status();
        assert!(sent.unwrap().success());
        starter.wait().unwrap();
        wait_until("none is left", || processes_of(&out).is_empty());
    }
}

#[test]
fn what_processes_can_not_do_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |scenario: &str, says: &str| {
        let run = swarm(scenario, &folder.path().join("out"))
            .output()
            .unwrap();
        let said = String::from_utf8(run.stderr).unwrap();
        let said: Vec<_> = said.split_whitespace().collect();
        assert_eq!(run.status.code(), Some(2), "{scenario}: {said:?}");
        assert!(said.join(" ").contains(says), "{scenario}: {said:?}");
    };
    refused("two-swarms.toml", "processes fly one swarm");
    refused("follow-by-hand.toml", "a simulated pilot or operator");
    refused("hung-mission.toml", "no actor of a process can be made to");
    refused(
        "failsafe-gps.toml",
        "a vehicle that is simulated in a process",
    );
    assert!(!folder.path().join("out").exists());
    // Nor is anything removed that is not of a flight.
    let own = folder.path().join("out/drones/own.txt");
    fs::create_dir_all(own.parent().unwrap()).unwrap();
    fs::write(&own, "mine").unwrap();
    refused("hardware/swarm-short.toml", "is not of an earlier flight");
    assert_eq!(fs::read_to_string(own).unwrap(), "mine");
}
