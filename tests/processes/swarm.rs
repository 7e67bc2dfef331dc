//! The command `muster swarm` on this machine.

use std::fs;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use muster_runtime::journal::{Folder, MAGIC, Storage, frame_record};
use serde_json::Value;

use super::fleet::{MUSTERD, SCENARIO, assert_refused, replace};

/// Time limit for a condition that must come true.
const TIMEOUT: Duration = Duration::from_secs(60);

/// Environment variable that marks the processes of a flight; its value is the folder of the flight.
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
    command.arg("--musterd").arg(&*MUSTERD);
    command
}

/// Process ids of a flight's daemons, including launchers.
pub(crate) fn processes_of(folder: &Path) -> Vec<u32> {
    let mark = format!("{MARK}={}", folder.display());
    let all = fs::read_dir("/proc").unwrap();
    let numbers = all.filter_map(|it| it.ok()?.file_name().to_str()?.parse().ok());
    let is_marked = |pid: &u32| {
        let program = fs::read_link(format!("/proc/{pid}/exe"));
        // The process may have ended.
        let environment = fs::read(format!("/proc/{pid}/environ")).unwrap_or_default();
        let mut variables = environment.split(|byte| *byte == 0);
        program.is_ok_and(|it| it == Path::new(&*super::fleet::MUSTERD))
            && variables.any(|it| it == mark.as_bytes())
    };
    numbers.filter(is_marked).collect()
}

/// Whether a process is stopped by a signal.
pub(crate) fn is_stopped(pid: u32) -> bool {
    let stat = fs::read_to_string(format!("/proc/{pid}/stat"));
    // The program's name is in parentheses.
    stat.is_ok_and(|stat| stat.rsplit(')').next().unwrap().starts_with(" T"))
}

/// Writes a scenario in which a drone's process hangs for some seconds.
pub(crate) fn hanging(folder: &Path) -> PathBuf {
    with_faults(
        folder,
        "\n[[faults]]\nkind = \"hang\"\nat_s = 2\ndrone = 0\nfor_s = 2.9\n",
    )
}

/// Writes the short scenario with these faults into a folder.
pub(crate) fn with_faults(folder: &Path, faults: &str) -> PathBuf {
    let path = scenario_with("swarm-short.toml", &[], folder);
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, text + faults).unwrap();
    path
}

/// Copies a shipped hardware scenario into a folder, with replacements.
pub(crate) fn scenario_with(name: &str, replacements: &[(&str, &str)], folder: &Path) -> PathBuf {
    let shipped = Path::new(SCENARIO).with_file_name(name);
    let missions = shipped.parent().unwrap().with_file_name("missions");
    let path = folder.join(name);
    fs::copy(shipped, &path).unwrap();
    for (from, to) in [("../missions", missions.to_str().unwrap())]
        .iter()
        .chain(replacements)
    {
        replace(&path, from, to);
    }
    path
}

pub(crate) fn wait_until(condition: &str, mut holds: impl FnMut() -> bool) {
    let since = Instant::now();
    while !holds() {
        assert!(
            since.elapsed() < TIMEOUT,
            "not within {TIMEOUT:?}: {condition}"
        );
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// The report of a complete flight. Asserts that no rule was broken and no process is left.
pub(crate) fn complete_report(run: &Output, out: &Path) -> Value {
    assert!(run.status.success(), "{run:?}");
    assert_eq!(processes_of(out), [0; 0]);
    let report: Value = serde_json::from_slice(&run.stdout).unwrap();
    assert_eq!(report["violations"], Value::Array(Vec::new()));
    assert_eq!(report["mission_completed"], true);
    report
}

#[test]
fn processes_elect_a_master_over_several_hops_and_keep_the_rules() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("flight");
    let run = swarm("hardware/swarm-kill-master.toml", &out)
        .arg("--json")
        .output()
        .unwrap();
    let report = complete_report(&run, &out);
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
        let at_least = drone.get("messages_at_least").is_some();
        assert_eq!(at_least, id == 2, "drone {id}");
    }
    // Each drone hears two neighbours on each side at most. Without the master there are two segments.
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

/// Path of a file in a drone's folder.
fn drone_file(out: &Path, id: u32, file: &str) -> PathBuf {
    out.join(format!("drones/drone-{id}/{file}"))
}

fn log(out: &Path, id: u32) -> String {
    fs::read_to_string(drone_file(out, id, "log.jsonl")).unwrap_or_default()
}

/// Meanwhile, the scenario files are overwritten, and another program takes the status port of a drone.
#[test]
fn killed_and_hanging_processes_resume_their_flight() {
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
    let file = fs::read_to_string(drone_file(&out, 2, "drone.toml")).unwrap();
    let http = file.lines().find_map(|line| line.strip_prefix("http = "));
    let address = http.unwrap().trim_matches('"');
    let mut taken = None;
    wait_until("the master is killed", || {
        taken = TcpListener::bind(address).ok();
        taken.is_some()
    });
    wait_until("it flies without its status port", || {
        log(&out, 2).contains("retries each second")
    });
    drop(taken);
    wait_until("it answers again", || {
        let mut status = Command::new(env!("CARGO_BIN_EXE_muster"));
        let run = status.args(["status", address]).output().unwrap();
        run.status.success()
    });
    let run = run.wait_with_output().unwrap();
    let report = complete_report(&run, &out);
    for (id, drone) in (0..).zip(report["drones"].as_array().unwrap()) {
        assert_eq!(drone["state"], "finished", "drone {id}");
        assert_eq!(drone["waypoints"], 3, "drone {id}");
        let incarnations = log(&out, id).matches("\"starts\"").count();
        assert_eq!(incarnations, if [0, 2].contains(&id) { 2 } else { 1 });
    }
}

/// `limits.hang_ms` by default.
const HANG_MS: f64 = 1_000.0;

/// An idle actor gets a message each second, from which on its hang can be seen.
fn assert_hang_is_found_in_time(log: &str) {
    let lines = log.lines().map(|line| serde_json::from_str(line).unwrap());
    let lines: Vec<Value> = lines.collect();
    let line = |message: &str| {
        let found = lines.iter().rfind(|line| line["message"] == message);
        found.unwrap_or_else(|| panic!("no `{message}`: {log}"))
    };
    let (injected, found) = (line("a fault is injected"), line("an actor hangs"));
    assert_eq!(injected["actor"], found["actor"]);
    let waited_ms = found["waited_ms"].as_f64().unwrap();
    assert!((HANG_MS..=HANG_MS + 100.0).contains(&waited_ms), "{found}");
    let at_ms = |line: &Value| line["at_ns"].as_u64().unwrap() as f64 / 1e6;
    let after_ms = at_ms(found) - at_ms(injected);
    assert!(after_ms <= HANG_MS + 100.0 + 1_000.0, "{after_ms} ms");
}

/// In each drone, one actor crashes and another one hangs forever.
#[test]
fn crashed_and_hanging_actors_are_restarted_and_the_mission_completes() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("flight");
    let actors = ["radio", "routing", "mission", "navigation", "msp"];
    let faults = (0..actors.len()).map(|id| {
        let (crashes, hangs) = (actors[id], actors[(id + 1) % actors.len()]);
        format!(
            "\n[[faults]]\nkind = \"crash-actor\"\nat_waypoint = 0\nafter_s = 1\ndrone = {id}\nactor = \"{crashes}\"\n\
             \n[[faults]]\nkind = \"hang\"\nat_waypoint = 1\nafter_s = 1\ndrone = {id}\nactor = \"{hangs}\"\n"
        )
    });
    let scenario = with_faults(folder.path(), &faults.collect::<String>());
    let mut command = swarm(scenario.to_str().unwrap(), &out);
    let run = command.arg("--json").output().unwrap();
    let report = complete_report(&run, &out);
    for (id, drone) in (0..).zip(report["drones"].as_array().unwrap()) {
        assert_eq!(drone["waypoints"], 3, "drone {id}");
        let output = log(&out, id);
        assert_eq!(output.matches("an actor failed").count(), 2, "{output}");
        assert_eq!(output.matches("an actor hangs").count(), 1, "{output}");
        assert_hang_is_found_in_time(&output);
        assert_eq!(output.matches("\"starts\"").count(), 1, "{output}");
    }
}

#[test]
fn drone_lands_if_its_journal_or_scenario_is_unreadable_after_a_restart() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("flight");
    let restarts = [0, 1, 4].map(|id| {
        format!("\n[[faults]]\nkind = \"restart\"\nat_waypoint = 1\nafter_s = 1\ndrone = {id}\nfor_s = 2\n")
    });
    let scenario = with_faults(folder.path(), &restarts.concat());
    let mut command = swarm(scenario.to_str().unwrap(), &out);
    let command = command.arg("--json").stdout(Stdio::piped());
    let run = command.spawn().unwrap();
    wait_until("it takes off", || log(&out, 4).contains("TakingOff"));
    // While the processes are down: journal 0 gets a record of an unknown version, journal 4 such a record in place of all
    // but its first, and drone 1 loses its scenario.
    let journal = |id: u32| {
        let mut opened = None;
        wait_until("its process has ended", || {
            opened = Folder::open(&drone_file(&out, id, "journal/flight-1")).ok();
            opened.is_some()
        });
        opened.unwrap()
    };
    let mut unknown = Vec::new();
    frame_record(&[99, 1, 2, 3], &mut unknown);
    journal(0).append(&unknown).unwrap();
    let mut last = journal(4);
    let mut bytes = last.read().unwrap();
    let first = &bytes[MAGIC.len()..];
    let len = u32::from_le_bytes(first[..4].try_into().unwrap());
    bytes.truncate(MAGIC.len() + 8 + len as usize);
    last.replace(&[bytes, unknown].concat()).unwrap();
    drop(last);
    let held = journal(1);
    fs::remove_file(drone_file(&out, 1, "journal/flight-1/flight.json")).unwrap();
    drop(held);

    let run = run.wait_with_output().unwrap();
    let report: Value = serde_json::from_slice(&run.stdout).unwrap();
    assert_eq!(report["violations"], Value::Array(Vec::new()), "{run:?}");
    for id in 0..5 {
        let output = log(&out, id);
        let is_lost = output.contains("the journal has no valid state of the flight");
        assert_eq!(is_lost, [0, 1, 4].contains(&id), "{output}");
        let over = [
            r#"{\"Landing\":\"JournalLost\"}"#,
            r#"{\"Landing\":\"MissionOver\"}"#,
        ];
        let reasons = over.map(|it| output.contains(it));
        assert_eq!(reasons, [is_lost, !is_lost], "{output}");
        assert!(output.contains("Finished"), "{output}");
    }
    // On the ground, such a drone does not start.
    for id in [0, 4] {
        let mut again = Command::new(&*super::fleet::MUSTERD);
        again
            .arg("--config")
            .arg(drone_file(&out, id, "drone.toml"));
        let run = again.output().unwrap();
        let output = String::from_utf8(run.stderr).unwrap();
        assert_eq!(run.status.code(), Some(1), "{output}");
        assert!(output.contains("last state is unknown"), "{output}");
    }
}

#[test]
fn mission_completes_over_quic() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("flight");
    let run = swarm("hardware/swarm-short.toml", &out)
        .args(["--transport", "quic", "--json"])
        .output()
        .unwrap();
    complete_report(&run, &out);
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
        // All frames are of the fleet. Only the first frames of a new peer, before its freshness is proven, are dropped.
        let dropped = counted["dropped"].as_str().unwrap();
        assert!(
            dropped.is_empty() || dropped.starts_with("unproven ") && !dropped.contains(','),
            "{counted}"
        );
    }
    // The drones that end last have fewer connections.
    assert_eq!(connections.iter().max(), Some(&4), "{connections:?}");
}

#[test]
fn no_process_outlives_its_starter() {
    let folder = tempfile::tempdir().unwrap();
    let scenario = hanging(folder.path());
    for signal in ["KILL", "INT"] {
        let out = folder.path().join(signal);
        let mut command = swarm(scenario.to_str().unwrap(), &out);
        let mut starter = command.stderr(Stdio::null()).spawn().unwrap();
        wait_until("five drones and a launcher run", || {
            processes_of(&out).len() == 6
        });
        wait_until("all five answer", || {
            let mut status = Command::new(env!("CARGO_BIN_EXE_muster"));
            let run = status.arg("status").arg(&out).output().unwrap();
            let table = String::from_utf8(run.stdout).unwrap();
            // Three lines of header and five rows.
            table.lines().count() >= 8 && run.status.success()
        });
        wait_until("one process is stopped", || {
            processes_of(&out).into_iter().any(is_stopped)
        });
        let sent = Command::new("kill")
            .arg(format!("-{signal}"))
            .arg(starter.id().to_string())
            .status();
        assert!(sent.unwrap().success());
        starter.wait().unwrap();
        wait_until("no process is left", || processes_of(&out).is_empty());
    }
}

#[test]
fn interrupted_flight_reports_what_was_flown() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let mut command = swarm("hardware/swarm-short.toml", &out);
    let piped = command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let starter = piped.arg("--json").spawn().unwrap();
    wait_until("a drone flies", || {
        let mut status = Command::new(env!("CARGO_BIN_EXE_muster"));
        let run = status.arg("status").arg(&out).arg("--json").output();
        let statuses: Value = serde_json::from_slice(&run.unwrap().stdout).unwrap_or_default();
        let altitude_m = &statuses["drones"][0]["status"]["vehicle"]["altitude_m"];
        altitude_m.as_f64() > Some(1.0)
    });
    let pid = starter.id().to_string();
    let sent = Command::new("kill").args(["-INT", &pid]).status();
    assert!(sent.unwrap().success());
    let run = starter.wait_with_output().unwrap();
    assert_eq!(processes_of(&out), [0; 0]);
    assert_eq!(run.status.code(), Some(1), "{run:?}");
    let said = String::from_utf8_lossy(&run.stderr);
    assert!(said.contains("interrupted before the end"), "{said}");
    let report: Value = serde_json::from_slice(&run.stdout).unwrap();
    assert_eq!(report["interrupted"], true);
    assert_eq!(report["mission_completed"], false);
    assert_eq!(report["violations"], Value::Array(Vec::new()));
    let flown_s = report["simulated_s"].as_f64().unwrap();
    assert!(flown_s > 0.0 && flown_s < 60.0, "{flown_s}");
    let written: Value =
        serde_json::from_slice(&fs::read(out.join("report.json")).unwrap()).unwrap();
    assert_eq!(written, report);
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains(", then interrupted"));
}

#[test]
fn scenarios_for_simulation_only_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |scenario: &str, expected: &str| {
        assert_refused(&mut swarm(scenario, &folder.path().join("out")), expected);
    };
    refused("two-swarms.toml", "has several swarms");
    refused("follow-by-hand.toml", "a simulated pilot or operator");
    refused(
        "failsafe-gps.toml",
        "the vehicle simulated beside a process",
    );
    assert!(!folder.path().join("out").exists());
    // A folder that is not of a flight is not touched.
    let own = folder.path().join("out/drones/own.txt");
    fs::create_dir_all(own.parent().unwrap()).unwrap();
    fs::write(&own, "mine").unwrap();
    refused(
        "hardware/swarm-short.toml",
        "does not belong to an earlier flight",
    );
    assert_eq!(fs::read_to_string(own).unwrap(), "mine");
}

#[test]
fn prepared_drones_start_by_hand_and_fly() {
    let folder = tempfile::tempdir().unwrap();
    let prepare = || {
        Command::new(env!("CARGO_BIN_EXE_muster"))
            .current_dir(folder.path())
            .args(["swarm", "swarm-short", "--prepare", "five"])
            .output()
            .unwrap()
    };
    let prepared = prepare();
    let printed = String::from_utf8(prepared.stdout).unwrap();
    let commands: Vec<_> = (printed.lines())
        .filter_map(|line| line.trim().strip_prefix("musterd "))
        .collect();
    assert_eq!(commands.len(), 5, "{printed}");
    assert!(
        commands[4].ends_with("drone-2/drone.toml --fly"),
        "the leader is last: {printed}"
    );
    let mut drones: Vec<_> = commands
        .iter()
        .map(|arguments| {
            let mut command = Command::new(&*super::fleet::MUSTERD);
            command
                .current_dir(folder.path())
                .args(arguments.split(' '));
            std::thread::sleep(Duration::from_millis(300));
            command.stderr(Stdio::null()).spawn().unwrap()
        })
        .collect();
    for drone in &mut drones {
        assert_eq!(
            drone.wait().unwrap().code(),
            Some(0),
            "it has flown and landed"
        );
    }
    let again = prepare();
    assert_eq!(again.status.code(), Some(2), "keys are not overwritten");
}
