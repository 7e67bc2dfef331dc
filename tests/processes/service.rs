//! What a service manager and an operator see of one process.

use std::os::unix::net::UnixDatagram;
use std::process::Command;
use std::time::Duration;

use super::fleet::{Fleet, Process};

#[test]
fn the_service_manager_is_told_that_a_drone_runs_what_it_does_and_that_it_is_alive() {
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
    let mut told = Vec::new();
    let mut is_told = |what: &str| {
        let mut buffer = [0; 512];
        while !told.iter().any(|it: &String| it.contains(what)) {
            let len = manager.recv(&mut buffer).unwrap();
            told.push(String::from_utf8(buffer[..len].to_vec()).unwrap());
        }
        told.clear();
    };
    is_told("READY=1");
    is_told("WATCHDOG=1");
    is_told("WATCHDOG=1");
    drone.signal("TERM");
    is_told("STATUS=finished");
    is_told("STOPPING=1");
    assert_eq!(
        drone.end(),
        Some(0),
        "it was on the ground, and stayed there"
    );
}

#[test]
fn a_journal_is_for_one_process() {
    let fleet = Fleet::new();
    let mut first = fleet.start(3, &[]);
    first.wait_for("that it starts", |line| line["message"] == "starts");
    let mut second = Command::new(&*super::fleet::MUSTERD);
    let second = second.arg("--config").arg(fleet.file(3)).output().unwrap();
    assert_eq!(second.status.code(), Some(1));
    let said = String::from_utf8(second.stderr).unwrap();
    assert!(said.contains("another process has the journal"), "{said}");
    first.signal("TERM");
    assert_eq!(first.end(), Some(0));
}
