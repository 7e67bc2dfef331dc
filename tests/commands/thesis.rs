//! The command `muster thesis`.

use std::fs;
use std::path::Path;
use std::sync::LazyLock;

use assert_cmd::Command;
use serde_json::{Value, json};

/// The command in a folder without scenarios, since they are built in.
fn thesis(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::cargo_bin("muster").unwrap();
    command
        .current_dir(folder)
        .args(["thesis", "--engine", "events"])
        .args(arguments);
    command
}

/// Output of the command without arguments.
fn printed() -> &'static str {
    static PRINTED: LazyLock<String> = LazyLock::new(|| {
        let folder = tempfile::tempdir().unwrap();
        let run = thesis(folder.path(), &[]).assert().success();
        String::from_utf8(run.get_output().stdout.clone()).unwrap()
    });
    &PRINTED
}

#[test]
fn all_experiments_run_in_any_folder_and_write_to_the_default_folder() {
    let folder = tempfile::tempdir().unwrap();
    let run = thesis(folder.path(), &["--seed", "4", "--runs", "1"])
        .assert()
        .success();
    let printed = String::from_utf8(run.get_output().stdout.clone()).unwrap();
    assert!(printed.contains("waits  1 run\n"), "{printed}");
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
fn number_of_runs_is_that_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let run = |runs: &str, folder_is: &str| {
        let run = thesis(folder.path(), &["--runs", runs]).assert().success();
        let printed = String::from_utf8(run.get_output().stdout.clone()).unwrap();
        assert!(
            printed.contains(&format!("wrote {folder_is}/thesis.html")),
            "{printed}"
        );
        printed
    };
    let printed = run("2", "runs/thesis-seed-1");
    assert!(
        printed.contains("waits  2 runs, seeds 1 to 2,"),
        "{printed}"
    );
    assert_eq!(
        printed.matches("2 runs ").count(),
        2,
        "both headings: {printed}"
    );
    assert!(!printed.contains("20 runs"), "{printed}");
    // Each number of runs has a folder of its own, which the same command replaces.
    for _ in 0..2 {
        run("1", "runs/thesis-seed-1-2");
    }
}

#[test]
fn book_quotes_the_current_output() {
    let printed = printed();
    let page = include_str!("../../docs/src/performance/thesis.md");
    let shown = page.split("```text\n").skip(1).take(2);
    let shown: Vec<_> = shown.map(|it| it.split("```").next().unwrap()).collect();
    assert!(printed.starts_with(shown[0]), "{printed}");
    assert!(printed.contains(shown[1]), "{printed}");
}

#[test]
fn mean_waits_of_20_runs_are_near_those_of_the_thesis() {
    let printed = printed();
    assert!(printed.contains("20 runs, seeds 1 to 20"), "{printed}");
    for (row, least_s, most_s) in [
        ("ours, waiting for all drones", 1.0, 1.6),
        ("ours, neighbours + settling time", 0.344, 0.516),
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
fn json_is_one_object_with_stable_keys_and_seeds_wrap_around() {
    let folder = tempfile::tempdir().unwrap();
    let highest = i64::MAX.to_string();
    let arguments = ["--seed", &highest, "--runs", "2", "--json", "--out", "out"];
    let run = thesis(folder.path(), &arguments).assert().success();
    let output: Value = serde_json::from_slice(&run.get_output().stdout).unwrap();
    let written = fs::read(folder.path().join("out/thesis.json")).unwrap();
    assert_eq!(output, serde_json::from_slice::<Value>(&written).unwrap());
    assert_eq!(output["seed"], i64::MAX);
    let experiments = output["experiments"].as_array().unwrap();
    assert_eq!(experiments.len(), 5);
    for experiment in experiments {
        for quantity in experiment["quantities"].as_array().unwrap() {
            for key in ["thesis", "ours", "off_percent"] {
                assert!(quantity[key].is_number(), "{quantity}");
            }
        }
        assert!(experiment["report"]["trace"].is_string());
    }
    assert_eq!(output["waits_runs"]["seeds"], json!([i64::MAX, 0]));
    assert_eq!(output["waits_runs"]["engine_after_first"], "events");
    for variant in ["thesis", "strict", "neighbours", "settling"] {
        assert!(output["waits"][variant]["mean_s"].is_number());
    }
    let ours = ["strict", "neighbours", "settling"].map(|variant| &output["waits"][variant]);
    for wait in ours.into_iter().chain([&output["single_hop"]["ours"]]) {
        for run in ["lowest_run_s", "highest_run_s"] {
            assert!(wait[run].is_number());
        }
    }
    for source in ["ancestor", "ours"] {
        for wait in ["mean_s", "longest_s"] {
            assert!(output["single_hop"][source][wait].is_number());
        }
    }
}

#[test]
fn unusable_arguments_are_refused_before_a_run() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("taken"), "mine").unwrap();
    for (arguments, expected) in [
        (&["--seed", "-1"][..], "is not a whole number from 0"),
        (&["--seed", "one"], "`seed` takes a whole number"),
        (&["--runs", "0"], "a whole number from 1 to 1000"),
        (&["--out", "taken"], "is not a folder"),
        (&["scenarios/thesis-1.toml"], "unexpected argument"),
    ] {
        let run = thesis(folder.path(), arguments).output().unwrap();
        let output = String::from_utf8(run.stderr).unwrap();
        assert_eq!(run.status.code(), Some(2), "{arguments:?}: {output}");
        assert!(output.contains(expected), "{arguments:?}: {output}");
        assert!(run.stdout.is_empty());
        assert!(!folder.path().join("runs").exists());
    }
    assert_eq!(
        fs::read_to_string(folder.path().join("taken")).unwrap(),
        "mine"
    );
}
