//! `muster swarm`: a scenario's drones as processes, from the command line.

use std::fs;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use muster_runtime::journal::{Folder, MAGIC, Storage, frame};
use serde_json::Value;

use super::fleet::{SCENARIO, assert_refused, replace};

/// How long a test waits for what must happen; only a failing one does.
const PATIENCE: Duration = Duration::from_secs(60);

/// What the processes of a flight have in their environment, as they inherit it from their starter: its folder.
const MARK: &str = "MUSTER_TEST_FLIGHT";

pub(crate) fn swarm(scenario: &str, out: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_muster"));
    command.env(MARK, out);
    let scenarios = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios");
    command
        .arg("swarm")
        .arg(scenarios.join(scenario))
        .arg("--out")
        .arg(out);
    command
}

/// The daemon's processes that a flight into a folder has started, agents too, by number.
pub(crate) fn processes_of(folder: &Path) -> Vec<u32> {
    let mark = format!("{MARK}={}", folder.display());
    let all = fs::read_dir("/proc").unwrap();
    let numbers = all.filter_map(|it| it.ok()?.file_name().to_str()?.parse().ok());
    let is_of_it = |pid: &u32| {
        let program = fs::read_link(format!("/proc/{pid}/exe"));
        // It may have ended meanwhile.
        let environment = fs::read(format!("/proc/{pid}/environ")).unwrap_or_default();
        let mut variables = environment.split(|byte| *byte == 0);
        program.is_ok_and(|it| it == Path::new(&*super::fleet::MUSTERD))
            && variables.any(|it| it == mark.as_bytes())
    };
    numbers.filter(is_of_it).collect()
}

/// Whether a process has been stopped by a signal.
pub(crate) fn stopped(pid: u32) -> bool {
    let stat = fs::read_to_string(format!("/proc/{pid}/stat"));
    // What stands in parentheses is the program's name.
    stat.is_ok_and(|stat| stat.rsplit(')').next().unwrap().starts_with(" T"))
}

/// A scenario in whose flight a drone's process is stopped for some seconds.
pub(crate) fn hanging(folder: &Path) -> PathBuf {
    with_faults(folder, "\n[[faults]]\nat_s = 2\nhang = 0\nfor_s = 2.9\n")
}

/// The short scenario with this at its end, in a folder.
pub(crate) fn with_faults(folder: &Path, faults: &str) -> PathBuf {
    let path = scenario_with("swarm-short.toml", &[], folder);
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, text + faults).unwrap();
    path
}

/// A copy in a folder of a shipped scenario for hardware, in which some words are replaced.
pub(crate) fn scenario_with(name: &str, words: &[(&str, &str)], folder: &Path) -> PathBuf {
    let shipped = Path::new(SCENARIO).with_file_name(name);
    let missions = shipped.parent().unwrap().with_file_name("missions");
    let path = folder.join(name);
    fs::copy(shipped, &path).unwrap();
    for (from, to) in [("../missions", missions.to_str().unwrap())]
        .iter()
        .chain(words)
    {
        replace(&path, from, to);
    }
    path
}

pub(crate) fn wait_until(what: &str, mut holds: impl FnMut() -> bool) {
    let since = Instant::now();
    while !holds() {
        assert!(
            since.elapsed() < PATIENCE,
            "not within {PATIENCE:?}: {what}"
        );
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// What a flight that was flown to its end came to: no rule was broken, and no process is left.
pub(crate) fn flown(run: &Output, out: &Path) -> Value {
    assert!(run.status.success(), "{run:?}");
    assert_eq!(processes_of(out), [0; 0]);
    let report: Value = serde_json::from_slice(&run.stdout).unwrap();
    assert_eq!(report["violations"], Value::Array(Vec::new()));
    assert_eq!(report["mission_completed"], true);
    report
}

#[test]
fn processes_elect_a_master_over_several_hops_and_are_judged_by_the_rules_of_a_simulation() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("flight");
    let run = swarm("hardware/swarm-kill-master.toml", &out)
        .arg("--json")
        .output()
        .unwrap();
    let report = flown(&run, &out);
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

/// What a drone of a flight has in its folder.
fn of_drone(out: &Path, id: u32, file: &str) -> PathBuf {
    out.join(format!("drones/drone-{id}/{file}"))
}

fn log(out: &Path, id: u32) -> String {
    fs::read_to_string(of_drone(out, id, "log.jsonl")).unwrap_or_default()
}

/// Meanwhile somebody hands their scenario's place to nonsense, and takes the port at which one of them was asked.
#[test]
fn processes_that_are_killed_or_hang_in_flight_start_again_and_fly_on_what_they_flew() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("flight");
    let mut command = swarm("hardware/swarm-restart.toml", &out);
    let command = command.arg("--json").stdout(Stdio::piped());
    let run = command.spawn().unwrap();
    wait_until("the master takes off", || {
        log(&out, 2).contains("TakingOff")
    });
    for file in fs::read_dir(out.join("drones/scenario")).unwrap() {
        fs::write(file.unwrap().path(), "nonsense").unwrap();
    }
    let file = fs::read_to_string(of_drone(&out, 2, "drone.toml")).unwrap();
    let http = file.lines().find_map(|line| line.strip_prefix("http = "));
    let address = http.unwrap().trim_matches('"');
    let mut taken = None;
    wait_until("the master is killed", || {
        taken = TcpListener::bind(address).ok();
        taken.is_some()
    });
    wait_until("it flies on though it can't be asked", || {
        log(&out, 2).contains("the drone flies on, and tries again")
    });
    drop(taken);
    wait_until("it can be asked again", || {
        let mut status = Command::new(env!("CARGO_BIN_EXE_muster"));
        let asked = status.args(["status", address]).output().unwrap();
        asked.status.success()
    });
    let run = run.wait_with_output().unwrap();
    let report = flown(&run, &out);
    for (id, drone) in (0..).zip(report["drones"].as_array().unwrap()) {
        assert_eq!(drone["state"], "finished", "drone {id}");
        assert_eq!(drone["waypoints"], 3, "drone {id}");
        let incarnations = log(&out, id).matches("\"starts\"").count();
        assert_eq!(incarnations, if [0, 2].contains(&id) { 2 } else { 1 });
    }
}

/// Each drone has another actor fail, and then another one hang for good.
#[test]
fn actors_of_processes_that_fail_or_hang_in_flight_are_mended_and_the_mission_is_flown() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("flight");
    let actors = ["radio", "routing", "mission", "navigation", "msp"];
    let faults = (0..actors.len()).map(|id| {
        let (crashes, hangs) = (actors[id], actors[(id + 1) % actors.len()]);
        format!(
            "\n[[faults]]\nat_waypoint = 0\nafter_s = 1\ncrash = {id}\nactor = \"{crashes}\"\n\
             \n[[faults]]\nat_waypoint = 1\nafter_s = 1\nhang = {id}\nactor = \"{hangs}\"\n"
        )
    });
    let scenario = with_faults(folder.path(), &faults.collect::<String>());
    let mut command = swarm(scenario.to_str().unwrap(), &out);
    let run = command.arg("--json").output().unwrap();
    let report = flown(&run, &out);
    for (id, drone) in (0..).zip(report["drones"].as_array().unwrap()) {
        assert_eq!(drone["waypoints"], 3, "drone {id}");
        let said = log(&out, id);
        assert_eq!(said.matches("an actor failed").count(), 2, "{said}");
        assert_eq!(said.matches("an actor hangs").count(), 1, "{said}");
        assert_eq!(said.matches("\"starts\"").count(), 1, "{said}");
    }
}

#[test]
fn a_drone_in_flight_whose_journal_or_scenario_can_not_be_understood_comes_down() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("flight");
    let restarts = [0, 1, 4].map(|id| {
        format!("\n[[faults]]\nat_waypoint = 1\nafter_s = 1\nrestart = {id}\nfor_s = 2\n")
    });
    let scenario = with_faults(folder.path(), &restarts.concat());
    let mut command = swarm(scenario.to_str().unwrap(), &out);
    let command = command.arg("--json").stdout(Stdio::piped());
    let run = command.spawn().unwrap();
    wait_until("it takes off", || log(&out, 4).contains("TakingOff"));
    // Once each process is gone: of another version's making, altogether or but for its first record; and what it flew.
    let journal = |id: u32| {
        let mut opened = None;
        wait_until("its process is gone", || {
            opened = Folder::open(&of_drone(&out, id, "journal")).ok();
            opened.is_some()
        });
        opened.unwrap()
    };
    let mut unknown = Vec::new();
    frame(&[99, 1, 2, 3], &mut unknown);
    journal(0).append(&unknown).unwrap();
    let mut last = journal(4);
    let mut bytes = last.read().unwrap();
    let first = &bytes[MAGIC.len()..];
    let len = u32::from_le_bytes(first[..4].try_into().unwrap());
    bytes.truncate(MAGIC.len() + 8 + len as usize);
    last.replace(&[bytes, unknown].concat()).unwrap();
    drop(last);
    let held = journal(1);
    fs::remove_file(of_drone(&out, 1, "journal/flight.json")).unwrap();
    drop(held);

    let run = run.wait_with_output().unwrap();
    let report: Value = serde_json::from_slice(&run.stdout).unwrap();
    assert_eq!(report["violations"], Value::Array(Vec::new()), "{run:?}");
    for id in 0..5 {
        let said = log(&out, id);
        let is_lost = said.contains("what the drone was doing is not known any more");
        assert_eq!(is_lost, [0, 1, 4].contains(&id), "{said}");
        let over = [
            r#"{\"Landing\":\"JournalLost\"}"#,
            r#"{\"Landing\":\"MissionOver\"}"#,
        ];
        let reasons = over.map(|it| said.contains(it));
        assert_eq!(reasons, [is_lost, !is_lost], "{said}");
        assert!(said.contains("Finished"), "{said}");
    }
    // On the ground, where nobody is in danger, such a drone does not start.
    for id in [0, 4] {
        let mut again = Command::new(&*super::fleet::MUSTERD);
        again.arg("--config").arg(of_drone(&out, id, "drone.toml"));
        let run = again.output().unwrap();
        let said = String::from_utf8(run.stderr).unwrap();
        assert_eq!(run.status.code(), Some(1), "{said}");
        assert!(
            said.contains("none that this version understands"),
            "{said}"
        );
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
    flown(&run, &out);
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
        wait_until("all five and their agent are up", || {
            processes_of(&out).len() == 6
        });
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
        assert_refused(&mut swarm(scenario, &folder.path().join("out")), says);
    };
    refused("two-swarms.toml", "processes fly one swarm");
    refused("follow-by-hand.toml", "a simulated pilot or operator");
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
