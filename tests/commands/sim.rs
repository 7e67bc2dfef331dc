//! The commands `muster sim`, `muster check` and `muster completions`.

mod checks;
mod paths;

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use assert_cmd::Command;
use serde_json::Value;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

fn muster(folder: &Path) -> Command {
    let mut command = Command::cargo_bin("muster").unwrap();
    command.current_dir(folder);
    command
}

fn scenario(name: &str) -> String {
    format!("{ROOT}/scenarios/{name}")
}

/// The report of `muster sim --json`.
fn json_report(folder: &Path, arguments: &[&str]) -> Value {
    let run = muster(folder)
        .args(["sim", &scenario("thesis-1.toml"), "--json"])
        .args(arguments)
        .assert()
        .success();
    serde_json::from_slice(&run.get_output().stdout).unwrap()
}

fn keys(object: &Value) -> BTreeSet<&str> {
    object
        .as_object()
        .unwrap()
        .keys()
        .map(String::as_str)
        .collect()
}

#[test]
fn json_has_stable_keys() {
    let folder = tempfile::tempdir().unwrap();
    let report = json_report(folder.path(), &["--seed", "9"]);
    let assert_keys = |object: &Value, names: &[&str]| {
        let missing: Vec<_> = names
            .iter()
            .filter(|name| !keys(object).contains(**name))
            .collect();
        assert!(missing.is_empty(), "{missing:?}");
    };
    assert_keys(
        &report,
        &[
            "scenario",
            "seed",
            "engine",
            "trace",
            "simulated_s",
            "wall_s",
            "drones",
            "means",
            "barriers",
            "min_separation_m",
            "violations",
        ],
    );
    assert_keys(
        &report["drones"][0],
        &[
            "id",
            "role",
            "hops",
            "parent",
            "relay",
            "out_of_range",
            "flight_time_s",
            "messages_sent",
            "messages_received",
            "state",
        ],
    );
    assert_keys(&report["means"], &["flight_time_s", "messages_received"]);
    assert_keys(
        &report["barriers"][0],
        &["waypoint", "arrived_s", "moving_s", "transmissions"],
    );
    assert_eq!(report["seed"], 9);
    assert_eq!(report["engine"], "actors");
    assert_eq!(report["violations"], Value::Array(vec![]));
    let trace = report["trace"].as_str().unwrap();
    assert!(trace.len() == 64 && trace.bytes().all(|digit| digit.is_ascii_hexdigit()));
}

#[test]
fn trace_is_the_same_for_all_runs_and_engines_but_not_seeds() {
    let folder = tempfile::tempdir().unwrap();
    let trace = |arguments: &[&str]| json_report(folder.path(), arguments)["trace"].clone();
    let first = trace(&["--engine", "actors"]);
    assert_eq!(trace(&["--engine", "actors"]), first);
    assert_eq!(trace(&["--engine", "events"]), first);
    assert_ne!(trace(&["--seed", "77"]), first);
}

#[test]
fn run_writes_its_report_to_the_printed_paths() {
    let folder = tempfile::tempdir().unwrap();
    let run = muster(folder.path())
        .args(["sim", &scenario("thesis-1.toml")])
        .assert()
        .success();
    let printed = String::from_utf8(run.get_output().stdout.clone()).unwrap();
    assert!(!printed.contains('\u{1b}'), "no colour without a terminal");
    for name in ["report.html", "report.json", "tracks.csv"] {
        let path = format!("runs/thesis-1-1/{name}");
        assert!(printed.contains(&path), "{printed}");
        assert!(folder.path().join(&path).metadata().unwrap().len() > 1_000);
    }
    let files: Vec<_> = fs::read_dir(folder.path().join("runs/thesis-1-1"))
        .unwrap()
        .collect();
    assert_eq!(files.len(), 3, "no other file is written");
    let report: Value = serde_json::from_slice(
        &fs::read(folder.path().join("runs/thesis-1-1/report.json")).unwrap(),
    )
    .unwrap();
    assert_eq!(report["drones"].as_array().unwrap().len(), 5);
}

#[test]
fn interrupted_run_leaves_no_report() {
    let folder = tempfile::tempdir().unwrap();
    let mut child = std::process::Command::new(assert_cmd::cargo::cargo_bin("muster"))
        .current_dir(folder.path())
        .args([
            "sim",
            &scenario("thesis-2.toml"),
            "--set",
            "protocol.period_ms=1",
        ])
        .args(["--out", "out", "--json"])
        .stdout(std::process::Stdio::null())
        .spawn()
        .unwrap();
    // With 1,000 frames per second and drone, the run takes a minute, so it can't be complete.
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(!folder.path().join("out").exists());
}

#[test]
fn broken_rule_is_reported_with_exit_code_3() {
    let folder = tempfile::tempdir().unwrap();
    // No drone lands within a minute.
    let run = muster(folder.path())
        .args([
            "sim",
            &scenario("thesis-1.toml"),
            "--set",
            "limits.duration_s=60",
            "--json",
        ])
        .assert()
        .code(3);
    let report: Value = serde_json::from_slice(&run.get_output().stdout).unwrap();
    assert_eq!(report["violations"][0]["rule"], 5);
    assert_eq!(
        report["violations"][0]["drones"],
        serde_json::json!([0, 1, 2, 3, 4])
    );
}

#[test]
fn broken_rule_comes_with_a_command_that_reproduces_it() {
    let folder = tempfile::tempdir().unwrap();
    // A mast in the slot of drone 3.
    let mast = "relays=[{ north_m = 0, east_m = 160, altitude_m = 25 }]";
    let first = muster(folder.path())
        .args(["sim", &scenario("thesis-1.toml"), "--seed", "5"])
        .args(["--set", "protocol.policy=tree", "--set", mast])
        .assert()
        .code(3);
    let printed = String::from_utf8(first.get_output().stdout.clone()).unwrap();
    let line = |printed: &str, start: &str| {
        let mut lines = printed.lines().map(str::trim);
        let found = lines.find(|line| line.starts_with(start));
        found
            .unwrap_or_else(|| panic!("no {start} in {printed}"))
            .to_owned()
    };
    let command = line(&printed, "muster sim ");
    assert!(command.contains("--seed 5 --engine actors"), "{command}");
    let programs = assert_cmd::cargo::cargo_bin("muster");
    let path = format!("{}:/usr/bin:/bin", programs.parent().unwrap().display());
    let again = Command::new("sh")
        .args(["-c", &command])
        .env("PATH", path)
        .current_dir(folder.path())
        .assert()
        .code(3);
    let again = String::from_utf8(again.get_output().stdout.clone()).unwrap();
    assert_eq!(line(&printed, "rule 4 at "), line(&again, "rule 4 at "));
}

#[test]
fn overrides_reach_the_drones() {
    let folder = tempfile::tempdir().unwrap();
    let report = json_report(
        folder.path(),
        &[
            "--set",
            "formation.drones=7",
            "--set",
            "protocol.policy=flood",
            "--set",
            "radio.range_m=330",
        ],
    );
    let drones = report["drones"].as_array().unwrap();
    let hops: Vec<_> = drones
        .iter()
        .map(|drone| drone["hops"].as_u64().unwrap())
        .collect();
    assert_eq!(hops, [2, 1, 1, 0, 1, 1, 2], "330 m reach two slots");
    assert_eq!(report["overrides"].as_array().unwrap().len(), 3);
}

#[test]
fn runs_with_other_fields_get_folders_of_their_own() {
    let folder = tempfile::tempdir().unwrap();
    let sim = |more: &[&str]| {
        let run = muster(folder.path())
            .args(["sim", "thesis-1", "--engine", "events"])
            .args(more)
            .assert()
            .success();
        let printed = String::from_utf8(run.get_output().stdout.clone()).unwrap();
        let written = printed
            .lines()
            .find_map(|line| line.strip_prefix(" wrote "));
        written.unwrap().to_owned()
    };
    let first = sim(&[]);
    assert_eq!(first, "runs/thesis-1-1/report.html");
    let kept = fs::read(folder.path().join(&first)).unwrap();
    assert_eq!(
        sim(&["--set", "radio.loss=0.2"]),
        "runs/thesis-1-1-2/report.html"
    );
    assert_eq!(
        sim(&["--set", "radio.loss=0.1"]),
        "runs/thesis-1-1-3/report.html"
    );
    assert_eq!(
        fs::read(folder.path().join(&first)).unwrap(),
        kept,
        "nothing is lost"
    );
    assert_eq!(sim(&[]), first, "the same run has its folder");
}

#[test]
fn release_builds_are_stripped() {
    let manifest = fs::read_to_string(format!("{ROOT}/Cargo.toml")).unwrap();
    let manifest: toml::Table = toml::from_str(&manifest).unwrap();
    assert_eq!(
        manifest["profile"]["release"]["strip"].as_bool(),
        Some(true)
    );
}

#[test]
fn recordings_are_written_where_asked_and_named() {
    let folder = tempfile::tempdir().unwrap();
    let run = muster(folder.path())
        .args(["sim", &scenario("kill-at-waypoint.toml")])
        .args(["--engine", "events", "--mcap", "run.mcap"])
        .args(["--kml", "run.kml", "--geojson", "run.geojson"])
        .args(["--animation", "run.svg"])
        .assert()
        .success();
    let printed = String::from_utf8(run.get_output().stdout.clone()).unwrap();
    for (name, begins) in [
        ("run.mcap", &b"\x89MCAP0\r\n"[..]),
        ("run.kml", b"<?xml"),
        ("run.geojson", b"{"),
        ("run.svg", b"<svg"),
    ] {
        assert!(printed.contains(&format!("wrote {name}")), "{printed}");
        let bytes = fs::read(folder.path().join(name)).unwrap();
        assert!(bytes.starts_with(begins), "{name}");
    }
}

#[test]
fn recording_that_can_not_be_written_is_refused_before_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |arguments: &[&str], why: &str| {
        let run = muster(folder.path())
            .args(["sim", &scenario("thesis-1.toml")])
            .args(arguments)
            .assert()
            .code(2);
        let printed = String::from_utf8(run.get_output().stderr.clone()).unwrap();
        assert!(printed.contains(why), "{printed}");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    };
    refused(
        &["--mcap", "missing/run.mcap"],
        "missing: is not an existing folder",
    );
    refused(&["--kml", "."], "is a folder");
    refused(
        &["--mcap", "/dev/null"],
        "/dev/null: is not a file but a device or a pipe",
    );
    refused(
        &["--kml", "run", "--geojson", "./run"],
        "run: is given for two recordings",
    );
    let out = folder.path().join("flight");
    fs::create_dir(&out).unwrap();
    let run = muster(folder.path())
        .args(["sim", &scenario("thesis-1.toml"), "--out", "flight"])
        .args(["--mcap", "./flight/report.json"])
        .assert()
        .code(2);
    let printed = String::from_utf8(run.get_output().stderr.clone()).unwrap();
    assert!(
        printed.contains("is a file of the report in --out"),
        "{printed}"
    );
    assert_eq!(fs::read_dir(out).unwrap().count(), 0);
}

#[test]
fn table_tells_of_drones_that_stayed_and_of_faults_that_never_happened() {
    let folder = tempfile::tempdir().unwrap();
    let printed = |set: &str, code: i32| {
        let mut command = muster(folder.path());
        command.args(["sim", "thesis-1", "--set", set]);
        let run = command.assert().code(code);
        String::from_utf8(run.get_output().stdout.clone()).unwrap()
    };
    let alone = printed("radio.loss=1", 4);
    let stayed = "not completed by all: flown without drones 0, 1, 3, 4, never off the ground";
    assert!(alone.contains(stayed), "{alone}");
    let killed = printed(r#"faults=[{ at_s = 0, kind = "kill", drone = 1 }]"#, 0);
    assert!(!killed.contains("never off the ground"), "{killed}");
    let faults = r#"faults=[{ at_s = 1, kind = "crash-actor", drone = 1, actor = "radio" },
        { at_s = 500000, kind = "kill", drone = 1 }]"#;
    let late = printed(faults, 0);
    assert!(
        late.contains("never injected, by number in the file: 2\n"),
        "{late}"
    );
    assert!(!late.contains("never off the ground"), "{late}");
}
