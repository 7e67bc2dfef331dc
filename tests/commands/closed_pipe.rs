//! Commands that print until they are interrupted, as in `muster fc watch … | head -1`.

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use crate::fc::{module, recorded};

/// Time for a command to end: it prints every second.
const LIMIT: Duration = Duration::from_secs(30);

/// Asserts that a command ends with success once its first line was read and the pipe is closed.
fn assert_ends_with_its_reader(arguments: &[&str]) {
    let mut process = Command::new(env!("CARGO_BIN_EXE_muster"))
        .args(arguments)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    let out = process.stdout.take().unwrap();
    BufReader::new(out).read_line(&mut line).unwrap();
    assert!(!line.is_empty(), "{arguments:?}");
    let deadline = Instant::now() + LIMIT;
    while Instant::now() < deadline {
        if let Some(status) = process.try_wait().unwrap() {
            assert!(status.success(), "{arguments:?}: {status}");
            return;
        }
        thread::sleep(Duration::from_millis(20));
    }
    process.kill().unwrap();
    process.wait().unwrap();
    panic!("{arguments:?} goes on without a reader");
}

#[test]
fn fc_watch_ends_when_its_reader_has_gone() {
    assert_ends_with_its_reader(&["fc", "watch", &recorded()]);
}

#[test]
fn fc_flow_ends_when_its_reader_has_gone() {
    assert_ends_with_its_reader(&["fc", "flow", &module()]);
}

#[test]
fn status_watch_ends_when_its_reader_has_gone() {
    for format in [&[][..], &["--json"]] {
        let watch = ["status", "127.0.0.1:1", "--watch"];
        assert_ends_with_its_reader(&[&watch, format].concat());
    }
}
