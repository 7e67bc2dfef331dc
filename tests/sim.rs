//! The commands `muster sim`, `muster check` and `muster completions`.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

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
fn completions_are_printed_for_every_shell() {
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let run = muster(Path::new(ROOT))
            .args(["completions", shell])
            .assert()
            .success();
        assert!(String::from_utf8_lossy(&run.get_output().stdout).contains("muster"));
    }
}

#[test]
fn path_after_set_is_completed_as_a_file_in_bash() {
    let folder = tempfile::tempdir().unwrap();
    let script = muster(folder.path())
        .args(["completions", "bash"])
        .output()
        .unwrap()
        .stdout;
    fs::write(folder.path().join("muster.bash"), script).unwrap();
    // Readline splits words at `=`. No reply of the script's own means bash's names of files.
    let asked = "source muster.bash; COMP_WORDS=(muster sim thesis-1 --set mission.file = ri); COMP_CWORD=6; \
                 _muster muster ri =; echo \"${#COMPREPLY[@]}\"; complete -p muster";
    let bash = std::process::Command::new("bash")
        .current_dir(folder.path())
        .args(["-c", asked])
        .output()
        .unwrap();
    let answer = String::from_utf8(bash.stdout).unwrap();
    assert!(
        answer.starts_with("0\n") && answer.contains("-o default"),
        "{answer}"
    );
}

#[test]
fn check_says_the_verdict_first_and_the_rest_on_request() {
    let files = [
        "thesis-1.toml",
        "thesis-2.toml",
        "missions/albufera.plan",
        "missions/river.waypoints",
    ];
    let check = |more: &[&str]| {
        let run = muster(Path::new(ROOT))
            .arg("check")
            .args(files.map(scenario))
            .args(more)
            .assert()
            .success();
        String::from_utf8(run.get_output().stdout.clone()).unwrap()
    };
    let verdicts = check(&[]);
    assert_eq!(verdicts.lines().count(), files.len(), "{verdicts}");
    assert!(
        verdicts.lines().all(|line| line.contains(": OK: ")),
        "{verdicts}"
    );
    assert!(
        verdicts.contains("thesis-2.toml: OK: 15 drones, about "),
        "{verdicts}"
    );
    assert!(verdicts.contains("min, 12 need relays"), "{verdicts}");
    let explained = check(&["--explain"]);
    for line in [
        "worst-case time to re-elect: ",
        "all landed by ",
        "layers taking off: ",
    ] {
        assert_eq!(explained.matches(line).count(), 2, "{line}: {explained}");
    }
    let outer = explained.lines().filter(|line| !line.starts_with("  "));
    assert_eq!(outer.count(), files.len());
}

#[test]
fn swarm_that_is_not_connected_is_told_and_its_mission_is_not_completed() {
    let folder = tempfile::tempdir().unwrap();
    let apart = folder.path().join("apart.toml");
    let thesis = fs::read_to_string(scenario("thesis-1.toml")).unwrap();
    let mission = scenario("missions/albufera.plan");
    let text = thesis
        .replace("spacing_m = 160", "spacing_m = 350")
        .replace("missions/albufera.plan", &mission);
    fs::write(&apart, text).unwrap();
    let check = muster(folder.path())
        .args(["check", "apart.toml"])
        .assert()
        .success();
    let checked = String::from_utf8_lossy(&check.get_output().stdout).into_owned();
    assert!(
        checked.starts_with("apart.toml: WARNING: 5 drones"),
        "{checked}"
    );
    assert!(
        checked.contains("drones 0, 1, 3, 4 can't reach the master"),
        "{checked}"
    );
    for engine in ["events", "actors"] {
        let run = muster(folder.path())
            .args(["sim", "apart.toml", "--engine", engine])
            .assert()
            .code(4);
        let table = String::from_utf8_lossy(&run.get_output().stdout).into_owned();
        assert!(
            table.contains("5 segments never heard each other"),
            "{table}"
        );
        assert!(table.contains("raise `radio.range_m`"), "{table}");
    }
    let report = fs::read(folder.path().join("runs/apart-1/report.json")).unwrap();
    let report: Value = serde_json::from_slice(&report).unwrap();
    assert_eq!(
        report["never_met"],
        serde_json::json!([[0], [1], [2], [3], [4]])
    );
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
fn shipped_scenarios_and_missions_fly_by_name_anywhere() {
    let folder = tempfile::tempdir().unwrap();
    // A file of the same name does not take the name's place.
    fs::write(folder.path().join("thesis-1"), "not a scenario").unwrap();
    let trace = |scenario: &str, more: &[&str]| {
        let run = muster(folder.path())
            .args(["sim", scenario, "--engine", "events", "--json"])
            .args(more)
            .assert()
            .success();
        let report: Value = serde_json::from_slice(&run.get_output().stdout).unwrap();
        (
            report["trace"].clone(),
            report["command"].as_str().unwrap().to_owned(),
        )
    };
    let (by_name, command) = trace("thesis-1", &[]);
    assert_eq!(command, "muster sim thesis-1 --seed 1 --engine events");
    assert_eq!(by_name, trace(&scenario("thesis-1.toml"), &[]).0);
    let river = format!("mission.file={}", scenario("missions/river.waypoints"));
    let (by_name, _) = trace("thesis-1", &["--set", "mission.file=river"]);
    assert_eq!(by_name, trace("thesis-1", &["--set", &river]).0);
    for more in [
        &["check", "two-swarms", "river", "swarm-short"][..],
        &["list"],
    ] {
        muster(folder.path()).args(more).assert().success();
    }
    let campaign = ["campaign", "thesis-1", "--seeds", "0..1"];
    muster(folder.path()).args(campaign).assert().success();
    assert!(
        folder
            .path()
            .join("runs/thesis-1-campaign/runs.csv")
            .exists()
    );
    let refused = muster(folder.path())
        .args(["sim", "thesis2"])
        .assert()
        .code(2);
    let refused = String::from_utf8_lossy(&refused.get_output().stderr).into_owned();
    assert!(refused.contains("did you mean `thesis-2`?"), "{refused}");
}

#[test]
fn paths_that_are_set_start_at_the_current_folder() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("here");
    fs::create_dir(&place).unwrap();
    fs::copy(
        scenario("missions/river.waypoints"),
        place.join("mine.waypoints"),
    )
    .unwrap();
    let sim = |mission: &str| {
        let mut command = muster(&place);
        command.args(["sim", &scenario("thesis-1.toml"), "--engine", "events"]);
        command.args(["--set", &format!("mission.file={mission}")]);
        command.assert()
    };
    sim("mine.waypoints").success();
    let refused = sim("mine.waypoint").code(2);
    let refused = String::from_utf8_lossy(&refused.get_output().stderr).into_owned();
    for words in [
        "did you mean `mine.waypoints`?",
        "current folder",
        "[mission]",
    ] {
        assert!(refused.contains(words), "{words}: {refused}");
    }
}

#[test]
fn new_scenario_is_written_once_and_flies() {
    let folder = tempfile::tempdir().unwrap();
    let new = ["new", "scenario", "my-first"];
    muster(folder.path()).args(new).assert().success();
    let again = muster(folder.path()).args(new).assert().code(2);
    let again = String::from_utf8_lossy(&again.get_output().stderr).into_owned();
    assert!(again.contains("is not overwritten"), "{again}");
    let checked = muster(folder.path())
        .args(["check", "my-first.toml"])
        .assert()
        .success();
    let checked = String::from_utf8_lossy(&checked.get_output().stdout).into_owned();
    assert!(
        checked.starts_with("my-first.toml: OK: 9 drones"),
        "{checked}"
    );
    muster(folder.path())
        .args(["sim", "my-first.toml"])
        .assert()
        .success();
    let path = folder.path().join("my-first.toml");
    let text = fs::read_to_string(&path).unwrap();
    let with_fault = text.replace("# [[faults]]\n# at_s", "[[faults]]\nat_s");
    let with_fault = with_fault.replace("# kind = \"kill", "kind = \"kill");
    fs::write(&path, with_fault.replace("# drone = ", "drone = ")).unwrap();
    let killed = muster(folder.path())
        .args(["sim", "my-first.toml"])
        .assert()
        .success();
    let killed = String::from_utf8_lossy(&killed.get_output().stdout).into_owned();
    assert!(killed.contains(" election "), "{killed}");
    for bad in ["a.b", "", "no-such-folder/x"] {
        muster(folder.path())
            .args(["new", "scenario", bad])
            .assert()
            .code(2);
    }
}

#[test]
fn hovering_mission_is_checked_and_flown() {
    let folder = tempfile::tempdir().unwrap();
    let hover = folder.path().join("hover.waypoints");
    fs::write(
        &hover,
        "QGC WPL 110\n0 1 0 16 0 0 0 0 39.333 -0.3085 2 1\n1 0 3 22 0 0 0 0 0 0 25 1\n\
         2 0 3 16 30 0 0 0 39.333 -0.3085 25 1\n3 0 3 21 0 0 0 0 0 0 0 1\n",
    )
    .unwrap();
    let check = muster(folder.path())
        .args(["check", "hover.waypoints"])
        .assert()
        .success();
    let printed = String::from_utf8_lossy(&check.get_output().stdout).into_owned();
    assert!(
        printed.contains("mission with 1 waypoint, length 0 m"),
        "{printed}"
    );
    for engine in ["events", "actors"] {
        muster(folder.path())
            .args([
                "sim",
                &scenario("thesis-1.toml"),
                "--engine",
                engine,
                "--set",
            ])
            .arg(format!("mission.file={}", hover.display()))
            .assert()
            .success();
    }
}

#[test]
fn unchecked_run_is_marked_everywhere() {
    let folder = tempfile::tempdir().unwrap();
    let report = json_report(folder.path(), &["--engine", "events", "--unchecked"]);
    assert_eq!(report["unchecked"], true);
    assert!(
        report["command"]
            .as_str()
            .unwrap()
            .ends_with(" --unchecked")
    );
    let checked = json_report(folder.path(), &["--engine", "events"]);
    assert!(checked.get("unchecked").is_none());
    assert_eq!(report["trace"], checked["trace"], "the flight is the same");
    let run = muster(folder.path())
        .args([
            "sim",
            &scenario("thesis-1.toml"),
            "--engine",
            "events",
            "--unchecked",
        ])
        .assert()
        .success();
    let text = String::from_utf8(run.get_output().stdout.clone()).unwrap();
    assert!(
        text.contains("none checked: this run proves nothing"),
        "{text}"
    );
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
        &["--kml", "run", "--geojson", "run"],
        "run: is given for two recordings",
    );
}
