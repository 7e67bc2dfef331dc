//! What `muster check` and a run say of a plan.

use std::fs;
use std::path::Path;

use serde_json::Value;

use super::{ROOT, json_report, muster, scenario};

#[test]
fn check_prints_the_verdict_first_and_the_rest_on_request() {
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
        "layer of drone",
    ] {
        assert_eq!(explained.matches(line).count(), 2, "{line}: {explained}");
    }
    let outer = explained.lines().filter(|line| !line.starts_with("  "));
    assert_eq!(outer.count(), files.len());
}

#[test]
fn check_sets_fields_of_scenarios_and_refuses_them_for_missions() {
    let check = |arguments: &[&str]| {
        let run = muster(Path::new(ROOT))
            .arg("check")
            .args(arguments)
            .assert();
        let output = run.get_output().clone();
        let text = [output.stdout, output.stderr].concat();
        (output.status.code(), String::from_utf8(text).unwrap())
    };
    let (code, text) = check(&["thesis-2", "--set", "formation.drones=25"]);
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("OK: 25 drones, about "), "{text}");
    let (code, text) = check(&["river", "--set", "formation.drones=25"]);
    assert_eq!(code, Some(2), "{text}");
    assert!(text.contains("leave out --set"), "{text}");
    let (code, text) = check(&["thesi-2"]);
    assert_eq!(code, Some(2), "{text}");
    let says = "no shipped scenario or mission of this name; did you mean `thesis-2`?";
    assert!(text.contains(says), "{text}");
    let (code, text) = check(&["thesis-1", "--set", "radio.loss=1"]);
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("on their own: lower `radio.loss`"), "{text}");
}

#[test]
fn swarm_that_is_not_connected_is_reported_and_does_not_complete_its_mission() {
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
