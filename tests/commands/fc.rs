//! `muster fc` as a process, with a controller that answers what Betaflight answered.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::Output;
use std::thread;
use std::time::Duration;

use muster_msp::{
    Decode, Decoder, Direction, Frame, Message, ModeRangeExtra, ModeRanges, ModeRangesExtra,
    OpticalFlow, RangefinderSample, ShortList, Version, encode, order, reply,
};
use serde_json::Value;

/// Frames of Betaflight in a table of recordings.
fn frames(recorded: &str, rows: &str, column: &str) -> Vec<Vec<u8>> {
    let recorded: toml::Table = toml::from_str(recorded).unwrap();
    let frame = |row: &toml::Value| {
        let hex = row[column].as_str().unwrap().replace(' ', "");
        let byte = |at: usize| u8::from_str_radix(&hex[at..at + 2], 16).unwrap();
        (0..hex.len()).step_by(2).map(byte).collect()
    };
    recorded[rows]
        .as_array()
        .unwrap()
        .iter()
        .map(frame)
        .collect()
}

/// Replies of Betaflight, as recorded.
fn replies() -> Vec<Vec<u8>> {
    let replies = include_str!("../../actors/msp/tests/data/replies.toml");
    let golden = include_str!("../../actors/msp/tests/data/golden.toml");
    let mut all = frames(replies, "reply", "reply");
    all.extend(frames(golden, "frame", "hex"));
    all.push(extras(&all));
    all
}

/// What was not recorded: none of the modes' ranges has a link or the logic AND.
fn extras(replies: &[Vec<u8>]) -> Vec<u8> {
    let mut modes = Vec::new();
    for frame in replies {
        Decoder::default().read(frame, |frame| {
            if frame.command == ModeRanges::COMMAND && modes.is_empty() {
                let ranges = ModeRanges::decode(frame.payload).unwrap().ranges;
                modes.extend(ranges.into_iter().map(|it| it.mode));
            }
        });
    }
    let plain = |mode| ModeRangeExtra {
        mode,
        ..ModeRangeExtra::default()
    };
    let extras = ShortList(modes.into_iter().map(plain).collect());
    let mut frame = Vec::new();
    reply(Version::V1, &ModeRangesExtra { extras }, &mut frame).unwrap();
    frame
}

/// The same reply in the version of its question, as Betaflight does.
fn answer(replies: &[Vec<u8>], question: &Frame<'_>, out: &mut Vec<u8>) {
    let length = out.len();
    for reply in replies {
        Decoder::default().read(reply, |frame| {
            if frame.direction == Direction::Reply && frame.command == question.command {
                let version = question.version;
                encode(&Frame { version, ..frame }, out).unwrap();
            }
        });
        if out.len() > length {
            return;
        }
    }
    let refusal = Frame {
        direction: Direction::Error,
        payload: &[],
        ..*question
    };
    encode(&refusal, out).unwrap();
}

fn serve(mut stream: TcpStream) {
    let (replies, mut decoder) = (replies(), Decoder::default());
    let mut buffer = [0; 256];
    while let Ok(length @ 1..) = stream.read(&mut buffer) {
        let mut out = Vec::new();
        decoder.read(&buffer[..length], |frame| {
            answer(&replies, &frame, &mut out);
        });
        if stream.write_all(&out).is_err() {
            return;
        }
    }
}

/// A controller's device. Its thread ends with the test's process.
pub(crate) fn recorded() -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let device = format!("tcp:{}", listener.local_addr().unwrap());
    thread::spawn(move || listener.incoming().flatten().for_each(serve));
    device
}

fn fc(arguments: &[&str]) -> Output {
    crate::support::muster(Path::new("."), &[&["fc"], arguments].concat())
}

/// The exit code and the rows of a command's output.
fn json(arguments: &[&str]) -> (Option<i32>, Vec<Value>) {
    let run = fc(&[arguments, &["--json"]].concat());
    let out = String::from_utf8(run.stdout).unwrap();
    let rows = out.lines().map(|line| serde_json::from_str(line).unwrap());
    (run.status.code(), rows.collect())
}

#[test]
fn probe_shows_who_the_controller_is() {
    let (code, rows) = json(&["probe", &recorded()]);
    assert_eq!(code, Some(0));
    let seen = &rows[0];
    assert_eq!(seen["variant"], "BTFL");
    assert_eq!(seen["version"], "4.6.0");
    assert_eq!(seen["name"], "muster");
    assert_eq!(seen["line"]["loss"], 0.0);
    let shown = fc(&["probe", &recorded()]);
    let shown = String::from_utf8(shown.stdout).unwrap();
    assert!(
        shown.starts_with("firmware  Betaflight 4.6.0, MSP API 1.47\n"),
        "{shown}"
    );
}

#[test]
fn check_has_an_exit_code_of_its_own_and_says_what_to_set() {
    let (code, rows) = json(&["check", &recorded(), "--receiver", "override"]);
    assert_eq!(code, Some(5));
    assert_eq!(rows[0]["fit"], false);
    let findings = rows[0]["findings"].as_array().unwrap();
    let rules: Vec<_> = findings
        .iter()
        .map(|it| it["rule"].as_str().unwrap())
        .collect();
    assert!(
        rules.contains(&"override-fallback") && rules.contains(&"command-line-unread"),
        "{rules:?}"
    );
    let shown = fc(&["check", &recorded(), "--receiver", "override"]);
    let shown = String::from_utf8(shown.stdout).unwrap();
    assert!(
        shown.contains("set:   flash Betaflight 2026.6 or newer"),
        "{shown}"
    );
}

#[test]
fn watch_prints_a_line_a_second() {
    let (code, rows) = json(&["watch", &recorded(), "--seconds", "2"]);
    assert_eq!((code, rows.len()), (Some(0), 2));
    assert_eq!(rows[1]["state"], "open");
    assert!(rows[1]["frames_per_second"].as_u64().is_some());
}

/// The device of an optical flow module.
pub(crate) fn module() -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let device = format!("tcp:{}", listener.local_addr().unwrap());
    let mut bytes = Vec::new();
    let (quality, distance_mm) = (200, 1_250);
    let range = RangefinderSample {
        quality,
        distance_mm,
    };
    let rates = OpticalFlow {
        quality,
        x_mradps: -120,
        y_mradps: 340,
    };
    order(Version::V2, &range, &mut bytes).unwrap();
    order(Version::V2, &rates, &mut bytes).unwrap();
    thread::spawn(move || {
        for mut line in listener.incoming().flatten() {
            while line.write_all(&bytes).is_ok() {
                thread::sleep(Duration::from_millis(20));
            }
        }
    });
    device
}

#[test]
fn flow_shows_what_a_module_says() {
    let (code, rows) = json(&["flow", &module(), "--seconds", "1"]);
    assert_eq!((code, rows.len()), (Some(0), 1));
    assert_eq!(rows[0]["x_radps"], -0.12);
    assert_eq!(rows[0]["y_radps"], 0.34);
    assert_eq!(rows[0]["distance_m"], 1.25);
    assert_eq!(rows[0]["noise_bytes"], 0);
    let shown = fc(&["flow", &module(), "--seconds", "1"]);
    let shown = String::from_utf8(shown.stdout).unwrap();
    let begins = "x -0.12 y +0.34 rad/s, quality 200 of 255; distance 1.25 m, quality 200 of 255; ";
    assert!(shown.starts_with(begins), "{shown}");
    let closed = fc(&["flow", "tcp:127.0.0.1:1"]);
    assert_eq!(closed.status.code(), Some(1));
}

#[test]
fn tune_prints_a_table_that_a_scenario_takes() {
    let run = fc(&["tune", "betaflight-hover"]);
    let printed = String::from_utf8(run.stdout).unwrap();
    assert_eq!(run.status.code(), Some(0), "{printed}");
    assert!(printed.contains("# attitude lag 0.1"), "{printed}");
    let printed: toml::Table = toml::from_str(&printed).unwrap();
    let gains = printed["vehicle"]["gains"].as_table().unwrap();
    assert_eq!(gains.len(), 9);
    let hover = gains["hover_throttle"].as_float().unwrap();
    assert!((hover - 0.3).abs() < 0.03, "{hover}");
    let sets: Vec<String> = gains
        .iter()
        .map(|(name, value)| format!("vehicle.gains.{name}={value}"))
        .collect();
    let mut arguments = vec!["sim", "betaflight-hover", "--json", "--out"];
    let out = tempfile::tempdir().unwrap();
    let folder = out.path().join("run");
    arguments.push(folder.to_str().unwrap());
    for set in &sets {
        arguments.extend(["--set", set]);
    }
    let flown = crate::support::muster(Path::new("."), &arguments);
    assert_eq!(flown.status.code(), Some(0));
}

#[test]
fn tune_refuses_a_scenario_without_flight_controllers() {
    let run = fc(&["tune", "thesis-2"]);
    let error = String::from_utf8(run.stderr).unwrap();
    assert_eq!(run.status.code(), Some(2), "{error}");
    assert!(error.contains("has no flight controllers"), "{error}");
}

#[test]
fn a_name_that_is_no_device_is_refused_with_examples() {
    let run = fc(&["probe", "ttyACM0"]);
    let error = String::from_utf8(run.stderr).unwrap();
    assert_eq!(run.status.code(), Some(2), "{error}");
    assert!(error.contains("serial:/dev/ttyACM0"), "{error}");
}

#[test]
fn an_absent_controller_is_a_failure_of_this_machine() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let device = format!("tcp:{}", listener.local_addr().unwrap());
    drop(listener);
    let run = fc(&["check", &device]);
    let error = String::from_utf8(run.stderr).unwrap();
    assert_eq!(run.status.code(), Some(1), "{error}");
    assert!(error.contains(&format!("can't open {device}")), "{error}");
}
