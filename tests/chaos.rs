//! The command `muster chaos`.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod support;

use std::fs;
use std::path::Path;

use support::muster;

const SCENARIO: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenarios/chaos.toml");

/// Runs a search. Returns its exit code and output.
fn chaos(folder: &Path, more: &[&str]) -> (Option<i32>, String) {
    let run = muster(folder, &[&["chaos", SCENARIO], more].concat());
    let output = [run.stdout, run.stderr].concat();
    (run.status.code(), String::from_utf8(output).unwrap())
}

#[test]
fn search_without_a_finding_shows_its_coverage_and_resumes() {
    let folder = tempfile::tempdir().unwrap();
    let (code, output) = chaos(folder.path(), &["--seeds", "0..6", "--out", "out"]);
    assert_eq!(code, Some(0), "{output}");
    for words in [
        "6 without a violation",
        "combinations",
        "redraws",
        "simulated hours",
        "plans and",
        "no fault injected",
        "rules  none broken",
        "chaos.json",
    ] {
        assert!(output.contains(words), "{words}: {output}");
    }
    let (code, output) = chaos(folder.path(), &["--seeds", "0..10", "--out", "out"]);
    assert_eq!(code, Some(0), "{output}");
    assert!(output.contains("10 without a violation"), "{output}");
    let (code, output) = chaos(folder.path(), &["--seeds", "5..10", "--out", "out"]);
    assert_eq!(
        code,
        Some(2),
        "another first seed is another search: {output}"
    );
}

#[test]
fn finding_is_a_scenario_that_breaks_the_rule_by_itself() {
    let folder = tempfile::tempdir().unwrap();
    // No drone has landed by then.
    let short = [
        "--set",
        "limits.duration_s=30",
        "--seeds",
        "0..10",
        "--out",
        "out",
    ];
    let (code, output) = chaos(folder.path(), &short);
    assert_eq!(code, Some(3), "{output}");
    assert!(
        output.contains("rule 5") && output.contains("found.toml"),
        "{output}"
    );
    let found = fs::read_to_string(folder.path().join("out/found.toml")).unwrap();
    assert!(!found.contains("[[faults]]"), "no fault is needed: {found}");
    let run = muster(folder.path(), &["sim", "out/found.toml"]);
    assert_eq!(run.status.code(), Some(3));
    assert!(String::from_utf8(run.stdout).unwrap().contains("rule 5"));
}

#[test]
fn search_with_keep_going_lists_all_findings() {
    let folder = tempfile::tempdir().unwrap();
    let short = [
        "--set",
        "limits.duration_s=30",
        "--seeds",
        "0..4",
        "--keep-going",
    ];
    let (code, output) = chaos(folder.path(), &[&short[..], &["--out", "out"]].concat());
    assert_eq!(code, Some(3), "{output}");
    for words in [
        "0 without a violation",
        "broken by 4 plans",
        "seed 3: rule 5, ",
    ] {
        assert!(output.contains(words), "{words}: {output}");
    }
    assert!(!folder.path().join("out/found.toml").exists());
}

#[test]
fn invalid_run_limit_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    for limit in ["0", "-1", "a minute"] {
        let limit = format!("--run-limit={limit}");
        let (code, output) = chaos(folder.path(), &["--seeds", "0..1", &limit]);
        assert_eq!(code, Some(2), "{output}");
        let accepted = "a whole number of seconds from 1 to 604800";
        assert!(output.contains(accepted), "{output}");
    }
}
