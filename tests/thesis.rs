//! The comparison with the thesis, as a user and a program meet it.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::fs;
use std::path::Path;
use std::sync::LazyLock;

use assert_cmd::Command;
use serde_json::{Value, json};

/// In a folder without scenarios: they are a part of the program.
fn thesis(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::cargo_bin("muster").unwrap();
    command
        .current_dir(folder)
        .args(["thesis", "--engine", "events"])
        .args(arguments);
    command
}

/// What is printed without arguments.
fn printed() -> &'static str {
    static PRINTED: LazyLock<String> = LazyLock::new(|| {
        let folder = tempfile::tempdir().unwrap();
        let run = thesis(folder.path(), &[]).assert().success();
        String::from_utf8(run.get_output().stdout.clone()).unwrap()
    });
    &PRINTED
}

#[test]
fn all_experiments_are_flown_from_anywhere_and_written_where_a_run_would_be() {
    let folder = tempfile::tempdir().unwrap();
    let run = thesis(folder.path(), &["--seed", "4", "--runs", "1"])
        .assert()
        .success();
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
    let printed = printed();
    let readme = include_str!("../README.md");
    let shown = readme.split("```text\n").skip(1).take(2);
    let shown: Vec<_> = shown.map(|it| it.split("```").next().unwrap()).collect();
    assert!(printed.starts_with(shown[0]), "{printed}");
    assert!(printed.contains(shown[1]), "{printed}");
}

#[test]
fn the_waits_that_are_printed_are_means_of_20_runs_and_near_the_thesiss() {
    let printed = printed();
    assert!(printed.contains("20 runs, seeds 1 to 20"), "{printed}");
    for (row, least_s, most_s) in [
        ("ours, for all drones", 1.0, 1.6),
        ("likewise, settling like the ancestor", 0.344, 0.516),
    ] {
        let row = printed
            .lines()
            .find_map(|line| line.trim().strip_prefix(row));
        let cells = row.unwrap().split_whitespace();
        let seconds: Vec<f64> = cells.map(|it| it.parse().unwrap()).collect();
        let [mean_s, lowest_s, highest_s, ..] = seconds[..] else {
            panic!("{printed}")
        };
        assert!((least_s..=most_s).contains(&mean_s), "{printed}");
        assert!(lowest_s <= mean_s && mean_s <= highest_s, "{printed}");
    }
}

#[test]
fn after_the_highest_seed_comes_0() {
    let folder = tempfile::tempdir().unwrap();
    let highest = i64::MAX.to_string();
    let arguments = ["--seed", &highest, "--runs", "2", "--json"];
    let run = thesis(folder.path(), &arguments).assert().success();
    let said: Value = serde_json::from_slice(&run.get_output().stdout).unwrap();
    assert_eq!(said["waits_runs"]["seeds"], json!([i64::MAX, 0]));
}

#[test]
fn json_is_one_object_with_the_keys_that_programs_rely_on() {
    let folder = tempfile::tempdir().unwrap();
    let run = thesis(folder.path(), &["--runs", "2", "--json", "--out", "out"])
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
    assert_eq!(said["waits_runs"]["seeds"], json!([1, 2]));
    assert_eq!(said["waits_runs"]["engine_after_first"], "events");
    for whose in ["thesis", "strict", "neighbours", "settling"] {
        assert!(said["waits"][whose]["mean_s"].is_number());
    }
    let ours = ["strict", "neighbours", "settling"].map(|whose| &said["waits"][whose]);
    for wait in ours.into_iter().chain([&said["single_hop"]["ours"]]) {
        for run in ["lowest_run_s", "highest_run_s"] {
            assert!(wait[run].is_number());
        }
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
        (&["--runs", "0"], "0 is not in 1..=1000"),
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
