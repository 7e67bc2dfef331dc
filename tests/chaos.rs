//! The search for a fault plan that breaks a rule, as a user meets it: nothing found, something found, refused.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod support;

use std::fs;
use std::path::Path;

use support::muster;

const SCENARIO: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenarios/chaos.toml");

fn searched(folder: &Path, more: &[&str]) -> (Option<i32>, String) {
    let run = muster(folder, &[&["chaos", SCENARIO], more].concat());
    let said = [run.stdout, run.stderr].concat();
    (run.status.code(), String::from_utf8(said).unwrap())
}

#[test]
fn a_search_that_finds_nothing_says_what_was_tried_and_goes_on_where_it_ended() {
    let folder = tempfile::tempdir().unwrap();
    let (code, said) = searched(folder.path(), &["--seeds", "0..6", "--out", "out"]);
    assert_eq!(code, Some(0), "{said}");
    for words in [
        "6 without a violation",
        "combinations",
        "drawn anew",
        "simulated hours",
        "plans and",
        "no fault has met",
        "rules  none broken",
        "chaos.json",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
    let (code, said) = searched(folder.path(), &["--seeds", "0..10", "--out", "out"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("10 without a violation"), "{said}");
    let (code, said) = searched(folder.path(), &["--seeds", "5..10", "--out", "out"]);
    assert_eq!(code, Some(2), "that is another search: {said}");
}

#[test]
fn what_is_found_is_a_scenario_that_breaks_the_rule_by_itself() {
    let folder = tempfile::tempdir().unwrap();
    // Nobody is down by then.
    let short = [
        "--set",
        "limits.duration_s=30",
        "--seeds",
        "0..10",
        "--out",
        "out",
    ];
    let (code, said) = searched(folder.path(), &short);
    assert_eq!(code, Some(3), "{said}");
    assert!(
        said.contains("rule 5") && said.contains("found.toml"),
        "{said}"
    );
    let found = fs::read_to_string(folder.path().join("out/found.toml")).unwrap();
    assert!(!found.contains("[[faults]]"), "it takes none: {found}");
    let run = muster(folder.path(), &["sim", "out/found.toml"]);
    assert_eq!(run.status.code(), Some(3));
    assert!(String::from_utf8(run.stdout).unwrap().contains("rule 5"));
}

#[test]
fn a_search_that_goes_on_lists_what_it_found() {
    let folder = tempfile::tempdir().unwrap();
    let short = [
        "--set",
        "limits.duration_s=30",
        "--seeds",
        "0..4",
        "--keep-going",
    ];
    let (code, said) = searched(folder.path(), &[&short[..], &["--out", "out"]].concat());
    assert_eq!(code, Some(3), "{said}");
    for words in [
        "0 without a violation",
        "broken by 4 plans",
        "seed 3: rule 5, ",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
    assert!(!folder.path().join("out/found.toml").exists());
}

#[test]
fn a_run_limit_that_is_no_number_of_seconds_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    for limit in ["0", "-1", "a minute"] {
        let limit = format!("--run-limit={limit}");
        let (code, said) = searched(folder.path(), &["--seeds", "0..1", &limit]);
        assert_eq!(code, Some(2), "{said}");
        let accepted = "a whole number of seconds from 1 to 604800";
        assert!(said.contains(accepted), "{said}");
    }
}
