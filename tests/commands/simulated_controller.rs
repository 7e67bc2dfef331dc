//! `muster fc simulate` as a process, over TCP with our codec. `.ci/flight-controller` looks at it over a pseudo-terminal with
//! an independent client.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use muster_msp::{Attitude, Decode, Decoder, Message, Version, request};

use crate::support::muster;

/// A running simulation; ends with this value.
struct Simulation {
    process: Child,
    /// What it printed first.
    said: String,
}

impl Simulation {
    fn start(arguments: &[&str]) -> Self {
        let mut process = Command::new(env!("CARGO_BIN_EXE_muster"))
            .args(["fc", "simulate"])
            .args(arguments)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut said = String::new();
        let out = process.stdout.take().unwrap();
        BufReader::new(out).read_line(&mut said).unwrap();
        Self { process, said }
    }
}

impl Drop for Simulation {
    fn drop(&mut self) {
        self.process.kill().unwrap();
        self.process.wait().unwrap();
    }
}

fn attitude(stream: &mut TcpStream) -> Attitude {
    let mut bytes = Vec::new();
    request::<Attitude>(Version::V1, &mut bytes).unwrap();
    stream.write_all(&bytes).unwrap();
    let mut decoder = Decoder::default();
    let mut found = None;
    let mut buffer = [0; 64];
    while found.is_none() {
        let count = stream.read(&mut buffer).unwrap();
        assert!(count > 0, "closed");
        decoder.read(&buffer[..count], |frame| {
            assert_eq!(frame.command, Attitude::COMMAND);
            found = Some(Attitude::decode(frame.payload).unwrap());
        });
    }
    found.unwrap()
}

#[test]
fn one_connection_after_another_is_served() {
    let simulation = Simulation::start(&["--listen", "127.0.0.1:0"]);
    let (_, address) = simulation.said.trim().split_once("tcp:").unwrap();
    for _ in 0..2 {
        let mut stream = TcpStream::connect(address).unwrap();
        stream
            .set_read_timeout(Some(Duration::from_secs(10)))
            .unwrap();
        let attitude = attitude(&mut stream);
        assert!(attitude.roll_ddeg.abs() < 20 && attitude.pitch_ddeg.abs() < 20);
    }
}

#[test]
fn drone_with_a_pilot_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let shipped = include_str!("../../scenarios/chaos-controllers.toml");
    let mission = concat!(env!("CARGO_MANIFEST_DIR"), "/scenarios/missions/");
    let pilots = shipped
        .replace("missions/", mission)
        .replace("[vehicle]\n", "[vehicle]\nreceiver = \"override\"\n");
    std::fs::write(folder.path().join("pilots.toml"), pilots).unwrap();
    let port = ["--listen", "127.0.0.1:0"];
    let drone = ["--scenario", "pilots.toml", "--drone", "0"];
    let run = muster(
        folder.path(),
        &[&["fc", "simulate"][..], &port, &drone].concat(),
    );
    assert_eq!(run.status.code(), Some(2));
    let error = String::from_utf8(run.stderr).unwrap();
    assert!(error.contains("pilots are not simulated"), "{error}");
}
