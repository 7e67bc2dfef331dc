//! The command `muster chaos`.

use std::fs;
use std::path::Path;

use crate::support::muster;

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
    assert!(
        output.starts_with("OK: 6 plans, no rule broken; "),
        "{output}"
    );
    assert_eq!(
        output.lines().count(),
        3,
        "the rest is for --explain: {output}"
    );
    let explained = ["--seeds", "0..6", "--out", "out", "--explain"];
    let (code, output) = chaos(folder.path(), &explained);
    assert_eq!(code, Some(0), "{output}");
    for words in [
        "6 without a violation",
        "combinations",
        "redraws",
        "simulated hours",
        "plans and",
        "no fault injected",
        "OK: 6 plans",
        "chaos.json",
    ] {
        assert!(output.contains(words), "{words}: {output}");
    }
    let (code, output) = chaos(folder.path(), &["--seeds", "0..10", "--out", "out"]);
    assert_eq!(code, Some(0), "{output}");
    assert!(output.starts_with("OK: 10 plans, "), "{output}");
    let resumed = "resumed the search in out: 6 plans were complete before";
    assert!(output.contains(resumed), "{output}");
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
        output.starts_with("BROKEN: rule 5 at ") && output.contains("found.toml"),
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
    assert!(
        output.starts_with("BROKEN: a rule, by 4 of 4 plans\n"),
        "{output}"
    );
    for words in ["seed 0: rule 5, ", "seed 3: rule 5, "] {
        assert!(output.contains(words), "{words}: {output}");
    }
    assert!(!folder.path().join("out/found.toml").exists());
}

#[test]
fn another_search_gets_a_folder_of_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let seeds = ["--seeds", "0..1"];
    let lossy = ["--seeds", "0..1", "--set", "radio.loss=0.1"];
    for (arguments, out) in [
        (&seeds[..], "runs/chaos-chaos-0"),
        (&lossy, "runs/chaos-chaos-0-2"),
        (&seeds, "runs/chaos-chaos-0"),
    ] {
        let (code, output) = chaos(folder.path(), arguments);
        assert_eq!(code, Some(0), "{output}");
        assert!(
            output.contains(&format!("wrote {out}/chaos.json")),
            "{output}"
        );
    }
}

#[test]
fn searches_and_campaigns_do_not_share_a_folder() {
    let folder = tempfile::tempdir().unwrap();
    let thesis = ["thesis-1", "--seeds", "0..1", "--out"];
    let campaign = |out| {
        let run = muster(
            folder.path(),
            &[&["campaign"], &thesis[..], &[out]].concat(),
        );
        let output = [run.stdout, run.stderr].concat();
        (run.status.code(), String::from_utf8(output).unwrap())
    };
    let names = |out| {
        let entries = fs::read_dir(folder.path().join(out)).unwrap();
        let mut names: Vec<_> = entries.map(|it| it.unwrap().file_name()).collect();
        names.sort();
        names
    };
    let search = |out| chaos(folder.path(), &["--seeds", "0..1", "--out", out]);
    assert_eq!(campaign("campaign").0, Some(0));
    assert_eq!(search("search").0, Some(0));
    let before = [names("campaign"), names("search")];
    for ((code, output), says) in [
        (search("campaign"), "holds a campaign of `muster campaign`"),
        (campaign("search"), "holds a search of `muster chaos`"),
    ] {
        assert_eq!(code, Some(2), "{output}");
        assert!(output.contains(says), "{output}");
        assert!(
            output.contains("name another folder with --out"),
            "{output}"
        );
    }
    assert_eq!([names("campaign"), names("search")], before);
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
