//! The comparison with the thesis, as a user and a program meet it.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::fs;
use std::path::Path;

use assert_cmd::Command;
use serde_json::Value;

/// In a folder without scenarios: they are a part of the program.
fn thesis(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::cargo_bin("muster").unwrap();
    command
        .current_dir(folder)
        .args(["thesis", "--engine", "events"])
        .args(arguments);
    command
}

#[test]
fn all_experiments_are_flown_from_anywhere_and_written_where_a_run_would_be() {
    let folder = tempfile::tempdir().unwrap();
    let run = thesis(folder.path(), &["--seed", "4"]).assert().success();
    let printed = String::from_utf8(run.get_output().stdout.clone()).unwrap();
    for table in 9..=13 {
        assert!(
            printed.contains(&format!("thesis, table {table}")),
            "{printed}"
        );
    }
    assert!(!printed.contains('\x1b'), "{printed}");
    assert!(run.get_output().stderr.is_empty());
    for name in ["thesis.html", "thesis.json"] {
        assert!(
            folder
                .path()
                .join("runs/thesis-seed-4")
                .join(name)
                .is_file()
        );
    }
}

#[test]
fn the_readme_shows_what_is_printed() {
    let folder = tempfile::tempdir().unwrap();
    let run = thesis(folder.path(), &[]).assert().success();
    let printed = String::from_utf8(run.get_output().stdout.clone()).unwrap();
    let readme = include_str!("../README.md");
    let shown = readme.split("```text\n").skip(1).take(2);
    let shown: Vec<_> = shown.map(|it| it.split("```").next().unwrap()).collect();
    assert!(printed.starts_with(shown[0]), "{printed}");
    assert!(printed.contains(shown[1]), "{printed}");
}

#[test]
fn json_is_one_object_with_the_keys_that_programs_rely_on() {
    let folder = tempfile::tempdir().unwrap();
    let run = thesis(folder.path(), &["--json", "--out", "out"])
        .assert()
        .success();
    let said: Value = serde_json::from_slice(&run.get_output().stdout).unwrap();
    let kept = fs::read(folder.path().join("out/thesis.json")).unwrap();
    assert_eq!(said, serde_json::from_slice::<Value>(&kept).unwrap());
    assert_eq!(said["seed"], 1);
    let experiments = said["experiments"].as_array().unwrap();
    assert_eq!(experiments.len(), 5);
    for experiment in experiments {
        for quantity in experiment["quantities"].as_array().unwrap() {
            for key in ["thesis", "ours", "off_percent"] {
                assert!(quantity[key].is_number(), "{quantity}");
            }
        }
        assert!(experiment["report"]["trace"].is_string());
    }
    for whose in ["thesis", "strict", "neighbours", "settling"] {
        assert!(said["waits"][whose]["mean_s"].is_number());
    }
    for whose in ["ancestor", "ours"] {
        for wait in ["mean_s", "longest_s"] {
            assert!(said["single_hop"][whose][wait].is_number());
        }
    }
}

#[test]
fn what_can_not_be_used_is_refused_before_anything_is_flown() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("taken"), "mine").unwrap();
    for (arguments, word) in [
        (&["--seed", "-1"][..], "is not a whole number from 0"),
        (&["--seed", "one"], "`seed` is a whole number"),
        (&["--out", "taken"], "is not a folder"),
        (&["scenarios/thesis-1.toml"], "unexpected argument"),
    ] {
        let run = thesis(folder.path(), arguments).output().unwrap();
        let said = String::from_utf8(run.stderr).unwrap();
        assert_eq!(run.status.code(), Some(2), "{arguments:?}: {said}");
        assert!(said.contains(word), "{arguments:?}: {said}");
        assert!(run.stdout.is_empty());
        assert!(!folder.path().join("runs").exists());
    }
    assert_eq!(
        fs::read_to_string(folder.path().join("taken")).unwrap(),
        "mine"
    );
}
