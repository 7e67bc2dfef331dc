//! One process under a service manager.

use std::os::unix::net::UnixDatagram;
use std::process::Command;
use std::thread;
use std::time::Duration;

use rustix::process::{getpriority_process, setpriority_process};

use super::fleet::{Fleet, Process};

/// A program has the symbol if flaws can be planted in it, as `flights` of muster-scenarios finds for its own.
#[test]
fn tested_musterd_has_no_planted_flaws() {
    let has = |symbol| {
        let mut search = Command::new("grep");
        let found = search.args(["-qaF", symbol, &*super::fleet::MUSTERD]);
        found.status().unwrap().success()
    };
    assert!(has("15muster_machines"), "musterd has no symbols to search");
    assert!(!has("4flaw7planted"));
}

#[test]
fn service_manager_is_notified_of_readiness_status_and_watchdog() {
    let fleet = Fleet::new();
    let path = fleet.path("notify");
    let manager = UnixDatagram::bind(&path).unwrap();
    manager
        .set_read_timeout(Some(Duration::from_secs(60)))
        .unwrap();
    let mut command = Command::new(&*super::fleet::MUSTERD);
    command.arg("--config").arg(fleet.file(1));
    command
        .env("NOTIFY_SOCKET", &path)
        .env("WATCHDOG_USEC", "200000");
    let mut drone = Process::start(1, command);
    let mut notifications = Vec::new();
    let mut wait_for = |notification: &str| {
        let mut buffer = [0; 512];
        let found = |it: &String| it.contains(notification);
        while !notifications.iter().any(found) {
            let len = manager.recv(&mut buffer).unwrap();
            notifications.push(String::from_utf8(buffer[..len].to_vec()).unwrap());
        }
        notifications.clear();
    };
    wait_for("READY=1");
    wait_for("WATCHDOG=1");
    wait_for("WATCHDOG=1");
    drone.signal("TERM");
    wait_for("STATUS=finished");
    wait_for("STOPPING=1");
    assert_eq!(drone.end(), Some(0), "it stayed on the ground");
}

#[test]
fn process_has_the_nice_value_of_the_service_where_that_is_granted() {
    // A thread's nice value is its own.
    let is_granted = thread::spawn(|| setpriority_process(None, -10).is_ok());
    let is_granted = is_granted.join().unwrap();
    let own = getpriority_process(None).unwrap();
    let fleet = Fleet::new();
    let mut drone = fleet.start(1, &[]);
    drone.wait_until_ready();
    assert_eq!(drone.nice(), if is_granted { -10 } else { own });
}

#[test]
fn higher_flight_number_starts_a_new_flight_and_keeps_the_old_journal() {
    let fleet = Fleet::new();
    let flight = |number: u32| {
        let file = std::fs::read_to_string(fleet.file(3)).unwrap();
        let lines = file.lines().filter(|line| !line.starts_with("flight = "));
        let rest: Vec<_> = lines.collect();
        std::fs::write(
            fleet.file(3),
            format!("flight = {number}\n{}\n", rest.join("\n")),
        )
        .unwrap();
    };
    let run = |flag: &str, value: &std::path::Path| {
        let mut command = Command::new(&*super::fleet::MUSTERD);
        let output = command.arg(flag).arg(value).output().unwrap();
        let text = [output.stdout, output.stderr].concat();
        (output.status.code(), String::from_utf8(text).unwrap())
    };
    for number in [1, 2] {
        flight(number);
        let mut drone = fleet.start(3, &[]);
        drone.wait_for("ready", |line| line["message"] == "ready");
        drone.signal("TERM");
        assert_eq!(drone.end(), Some(0));
        let (code, output) = run("--config", &fleet.file(3));
        assert_eq!(code, Some(2), "{output}");
        assert!(output.contains("this flight is over"), "{output}");
        assert!(output.contains("set a higher `flight`"), "{output}");
    }
    let (code, output) = run("--show-journal", &fleet.path("journal-3/flight-1"));
    assert_eq!(code, Some(0), "{output}");
    assert!(output.contains("\"Finished\""), "{output}");
    flight(1);
    let (code, output) = run("--config", &fleet.file(3));
    assert_eq!(code, Some(2), "{output}");
    assert!(
        output.contains("the newest flight in the journal is 2"),
        "{output}"
    );
}

#[test]
fn journal_is_locked_by_its_process() {
    let fleet = Fleet::new();
    let mut first = fleet.start(3, &[]);
    first.wait_for("starts", |line| line["message"] == "starts");
    let mut second = Command::new(&*super::fleet::MUSTERD);
    let second = second.arg("--config").arg(fleet.file(3)).output().unwrap();
    assert_eq!(second.status.code(), Some(1));
    let output = String::from_utf8(second.stderr).unwrap();
    assert!(
        output.contains("another process has the journal"),
        "{output}"
    );
    first.signal("TERM");
    assert_eq!(first.end(), Some(0));
}
