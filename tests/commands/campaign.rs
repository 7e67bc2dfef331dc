//! The commands `muster campaign` and `muster campaign-merge`.

mod several_machines;

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Output, Stdio};
use std::time::{Duration, Instant};

use crate::support::muster;

const SCENARIO: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenarios/thesis-1.toml");
/// Two values and seven seeds: 14 runs.
const CAMPAIGN: [&str; 4] = ["--seeds", "3..10", "--vary", "radio.loss=0,0.1"];

fn campaign(folder: &Path, out: &str, more: &[&str]) -> Output {
    let arguments = [&["campaign", SCENARIO, "--out", out], &CAMPAIGN[..], more].concat();
    muster(folder, &arguments)
}

/// Runs a campaign, which must succeed, and returns its files.
fn campaign_files(folder: &Path, out: &str, more: &[&str]) -> BTreeMap<String, Vec<u8>> {
    let run = campaign(folder, out, more);
    assert!(
        run.status.success(),
        "{}",
        String::from_utf8_lossy(&run.stderr)
    );
    files(&folder.join(out))
}

fn files(dir: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(dir).unwrap().map(|entry| entry.unwrap());
    entries
        .map(|entry| {
            let name = entry.file_name().into_string().unwrap();
            (name, fs::read(entry.path()).unwrap())
        })
        .collect()
}

/// Asserts that two folders are the same. Names the differing file, since contents are long.
fn assert_same(files: &BTreeMap<String, Vec<u8>>, others: &BTreeMap<String, Vec<u8>>) {
    assert!(
        files.keys().eq(others.keys()),
        "{:?} {:?}",
        files.keys(),
        others.keys()
    );
    for (name, content) in files {
        assert!(others[name] == *content, "{name} differs");
    }
}

fn error_text(run: &Output) -> String {
    let text = String::from_utf8(run.stderr.clone()).unwrap();
    // Messages are wrapped to the width of a terminal.
    text.replace("\n  │ ", " ")
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
}

#[test]
fn shards_merge_to_the_bytes_of_an_undivided_campaign() {
    let home = tempfile::tempdir().unwrap();
    let whole = campaign_files(home.path(), "whole", &[]);
    assert_eq!(
        whole.keys().map(String::as_str).collect::<Vec<_>>(),
        [
            "campaign.json",
            "runs.csv",
            "runs.jsonl",
            "summary.csv",
            "summary.html"
        ]
    );
    let lines = |name: &str| String::from_utf8_lossy(&whole[name]).lines().count();
    assert_eq!(lines("runs.csv"), 15);
    assert_eq!(lines("runs.jsonl"), 14);
    assert_eq!(lines("summary.csv"), 3);
    for part in ["3/3", "1/3", "2/3"] {
        campaign_files(
            home.path(),
            &format!("part-{}", &part[..1]),
            &["--shard", part],
        );
    }
    let merge = |parts: &[&str], out: &str| {
        muster(
            home.path(),
            &[&["campaign-merge", "--out", out], parts].concat(),
        )
    };
    let merged = merge(&["part-2", "part-3", "part-1"], "merged");
    assert!(merged.status.success(), "{}", error_text(&merged));
    assert_same(&files(&home.path().join("merged")), &whole);

    campaign_files(
        home.path(),
        "other",
        &["--shard", "3/3", "--set", "radio.range_m=310"],
    );
    let cases: &[(&[&str], &str, &str)] = &[
        (&["part-1", "part-3"], "none", "missing: 2/3"),
        (
            &["part-1", "part-2", "part-2", "part-3"],
            "none",
            "is shard 2/3, and so is part-2",
        ),
        (
            &["part-1", "part-2", "other"],
            "none",
            "to another campaign than part-1 (set:",
        ),
        (&["part-1", "whole"], "none", "shard: 1/1, not of 3"),
        (&["nowhere"], "none", "contains no campaign"),
        (
            &["part-1", "part-2", "part-3"],
            "part-1",
            "belongs to another campaign (shard: 1/3",
        ),
    ];
    for (parts, out, expected) in cases {
        let refused = merge(parts, out);
        assert_eq!(refused.status.code(), Some(2), "{expected}");
        assert!(
            error_text(&refused).contains(expected),
            "{}",
            error_text(&refused)
        );
        assert!(!home.path().join("none").exists(), "a file was written");
    }
}

#[test]
fn jobs_and_engines_do_not_change_results() {
    let home = tempfile::tempdir().unwrap();
    let one = campaign_files(home.path(), "one", &["--jobs", "1"]);
    assert_same(&campaign_files(home.path(), "two", &["--jobs", "2"]), &one);
    let actors = campaign_files(
        home.path(),
        "actors",
        &["--jobs", "2", "--engine", "actors"],
    );
    assert_eq!(actors["summary.csv"], one["summary.csv"]);
    let rows = String::from_utf8_lossy(&actors["runs.csv"]).replace(",actors,", ",events,");
    assert_eq!(rows.as_bytes(), one["runs.csv"]);
}

#[test]
fn killed_campaign_resumes_to_the_same_bytes() {
    let home = tempfile::tempdir().unwrap();
    let whole = campaign_files(home.path(), "whole", &[]);
    let mut child = std::process::Command::new(assert_cmd::cargo::cargo_bin("muster"))
        .current_dir(home.path())
        .args(["campaign", SCENARIO, "--out", "killed", "--jobs", "1"])
        .args(CAMPAIGN)
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let journal = home.path().join("killed/runs.journal");
    let deadline = Instant::now() + Duration::from_secs(60);
    while fs::metadata(&journal).map_or(0, |it| it.len()) < 1_000 {
        assert!(Instant::now() < deadline && child.try_wait().unwrap().is_none());
        std::thread::yield_now();
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let rows = fs::read(&journal).unwrap();
    assert!(
        !home.path().join("killed/runs.jsonl").exists(),
        "the campaign was killed too late"
    );

    // A kill may also leave half a row, and half a temporary file.
    let cut = &rows[..rows.len() - 7];
    fs::write(&journal, cut).unwrap();
    fs::write(home.path().join("killed/.muster-abc"), "half").unwrap();
    let kept = cut.iter().filter(|byte| **byte == b'\n').count();

    let resumed = campaign(home.path(), "killed", &["--jobs", "2"]);
    let printed = String::from_utf8_lossy(&resumed.stdout);
    let flew = format!("flew {} runs", 14 - kept);
    assert!(printed.contains(&flew), "{flew} in: {printed}");
    assert_same(&files(&home.path().join("killed")), &whole);

    let again = campaign(home.path(), "killed", &[]);
    let printed = String::from_utf8_lossy(&again.stdout);
    assert!(printed.contains("flew 0 runs"), "{printed}");
    let resumed = "resumed the campaign in killed: 14 runs were complete before";
    assert!(printed.contains(resumed), "{printed}");
    assert_same(&files(&home.path().join("killed")), &whole);
}

#[test]
fn folder_of_another_campaign_is_refused_and_not_changed() {
    let home = tempfile::tempdir().unwrap();
    let scenarios = home.path().join("missions");
    fs::create_dir(&scenarios).unwrap();
    let mission = include_str!("../../scenarios/missions/albufera.plan");
    let scenario = include_str!("../../scenarios/thesis-1.toml");
    let write = |scenario: &str, mission: &str| {
        fs::write(home.path().join("s.toml"), scenario).unwrap();
        fs::write(scenarios.join("albufera.plan"), mission).unwrap();
    };
    let run = |more: &[&str]| {
        let base = ["campaign", "s.toml", "--out", "out"];
        muster(home.path(), &[&base, more].concat())
    };
    let same: &[&str] = &["--seeds", "0..2", "--vary", "radio.loss=0,0.1"];
    write(scenario, mission);
    assert!(run(same).status.success());
    let before = files(&home.path().join("out"));
    let refused = |more: &[&str], expected: &str| {
        let run = run(more);
        assert_eq!(run.status.code(), Some(2), "{expected}");
        assert!(error_text(&run).contains(expected), "{}", error_text(&run));
        assert_same(&files(&home.path().join("out")), &before);
    };
    refused(
        &["--seeds", "0..3", "--vary", "radio.loss=0,0.1"],
        "(seeds: 0..2, not 0..3)",
    );
    refused(
        &["--seeds", "0..2", "--vary", "radio.loss=0.1,0"],
        "(vary: radio.loss=0,0.1,",
    );
    refused(&["--seeds", "0..2"], "not none)");
    refused(
        &[same, &["--set", "radio.range_m=310"]].concat(),
        "(set: none, not",
    );
    refused(
        &[same, &["--engine", "actors"]].concat(),
        "(engine: events, not actors)",
    );
    refused(
        &[same, &["--shard", "1/2"]].concat(),
        "(shard: 1/1, not 1/2)",
    );
    write(&scenario.replace("range_m = 300", "range_m = 310"), mission);
    refused(same, "the scenario or its mission changed");
    let moved = mission.replacen("39.336211", "39.336311", 1);
    assert_ne!(moved, mission);
    write(scenario, &moved);
    refused(same, "the scenario or its mission changed");
    // A comment does not matter.
    write(&format!("# Mine.\n{scenario}"), mission);
    assert!(run(same).status.success());
    assert_same(&files(&home.path().join("out")), &before);
    // Another version may give other results.
    let identity = home.path().join("out/campaign.json");
    let text = fs::read_to_string(&identity).unwrap();
    fs::write(&identity, text.replace("\"muster ", "\"muster 9.")).unwrap();
    assert!(error_text(&run(same)).contains("(program: muster 9."));
    fs::remove_file(&identity).unwrap();
    let stray = run(same);
    assert_eq!(stray.status.code(), Some(2));
    assert!(
        error_text(&stray).contains("no campaign.json"),
        "{}",
        error_text(&stray)
    );
}

#[test]
fn unusable_arguments_are_refused_and_nothing_is_written() {
    let cases: &[(&[&str], &str)] = &[
        (&[], "--seeds"),
        (&["--seeds", "5"], "is not a range of seeds"),
        (&["--seeds", "a..b"], "is not a range of seeds"),
        (&["--seeds", "-3..4"], "is not a range of seeds"),
        (&["--seeds", "5..5"], "is an empty range"),
        (&["--seeds", "9..=3"], "is an empty range"),
        (
            &["--seeds", "0..9223372036854775809"],
            "exceeds the highest seed",
        ),
        (&["--seeds", "0..10000001"], "more than 10000000 runs"),
        (&["--seeds", "0..2", "--vary", "radio.loss"], "has no `=`"),
        (
            &["--seeds", "0..2", "--vary", "radio.loss=0,,1"],
            "empty value",
        ),
        (&["--seeds", "0..2", "--vary", "radio.loss=0,0"], "twice"),
        (
            &["--seeds", "0..2", "--vary", "loss=0,1"],
            "did you mean `radio.loss`?",
        ),
        (
            &["--seeds", "0..2", "--vary", "radio.loss=0,7"],
            "7 is not a share",
        ),
        (&["--seeds", "0..2", "--vary", "seed=1,2"], "use --seeds"),
        (
            &["--seeds", "0..2", "--set", "seed=1"],
            "the seed is set by both",
        ),
        (
            &[
                "--seeds",
                "0..2",
                "--vary",
                "radio.loss=0",
                "--vary",
                "radio.loss=1",
            ],
            "varied twice",
        ),
        (
            &[
                "--seeds",
                "0..2",
                "--vary",
                "radio.loss=0",
                "--set",
                "radio.loss=1",
            ],
            "both set and varied",
        ),
        (&["--seeds", "0..2", "--shard", "0/3"], "is not a shard"),
        (&["--seeds", "0..2", "--shard", "4/3"], "is not a shard"),
        (&["--seeds", "0..2", "--shard", "1/1001"], "is not a shard"),
        (&["--seeds", "0..2", "--jobs", "0"], "from 1 to 1024"),
        (&["--seeds", "0..2", "--engine", "steam"], "events"),
        (&["--seeds", "0..2", "--out", "taken"], "is not a folder"),
        (
            &["--seeds", "0..2", "--vary", "mission.file=nowhere.plan"],
            "nowhere.plan",
        ),
    ];
    let home = tempfile::tempdir().unwrap();
    fs::write(home.path().join("taken"), "mine").unwrap();
    for (arguments, expected) in cases {
        let run = muster(home.path(), &[&["campaign", SCENARIO], *arguments].concat());
        assert_eq!(
            run.status.code(),
            Some(2),
            "{arguments:?}: {}",
            error_text(&run)
        );
        assert!(
            error_text(&run).contains(expected),
            "`{expected}` not in: {}",
            error_text(&run)
        );
        assert!(run.stdout.is_empty());
        assert_eq!(files(home.path()).len(), 1, "{arguments:?} wrote a file");
    }
}

#[test]
fn broken_rules_have_rows_and_commands_that_reproduce_them() {
    let home = tempfile::tempdir().unwrap();
    let broken = "limits.duration_s=60,3000";
    let arguments = ["--seeds", "4..6", "--vary", broken, "--out", "out"];
    let run = muster(
        home.path(),
        &[&["campaign", SCENARIO], &arguments[..]].concat(),
    );
    assert_eq!(run.status.code(), Some(3), "{}", error_text(&run));
    let printed = String::from_utf8(run.stdout).unwrap();
    assert!(printed.contains("broken in 2 runs"), "{printed}");
    let commands: Vec<_> = printed
        .lines()
        .filter_map(|line| line.trim().strip_prefix("muster "))
        .collect();
    assert_eq!(commands.len(), 2, "{printed}");
    let again: Vec<_> = commands[0].split(' ').chain(["--out", "again"]).collect();
    assert_eq!(
        muster(home.path(), &again).status.code(),
        Some(3),
        "{}",
        commands[0]
    );
    let rows = fs::read_to_string(home.path().join("out/runs.csv")).unwrap();
    assert_eq!(rows.lines().count(), 5, "the campaign continued");
    assert!(rows.lines().nth(1).unwrap().contains(",1,5,"), "{rows}");
    let again = muster(
        home.path(),
        &[&["campaign", SCENARIO], &arguments[..]].concat(),
    );
    assert_eq!(again.status.code(), Some(3), "also without new runs");
}

#[test]
fn runs_with_an_incomplete_mission_are_counted_and_reported() {
    let home = tempfile::tempdir().unwrap();
    // Every leg takes longer than this.
    let limit = ["--set", "limits.leg_s=30"];
    let arguments = ["campaign", SCENARIO, "--seeds", "0..2", "--out", "out"];
    let run = muster(home.path(), &[&arguments[..], &limit].concat());
    assert_eq!(run.status.code(), Some(4), "{}", error_text(&run));
    let printed = String::from_utf8_lossy(&run.stdout);
    assert!(printed.contains("incomplete in 2 runs"), "{printed}");
    let summary = fs::read_to_string(home.path().join("out/summary.csv")).unwrap();
    let column = |line: usize, name: &str| {
        let at = summary.lines().next().unwrap().split(',');
        let at = at.clone().position(|it| it == name).unwrap();
        summary
            .lines()
            .nth(line)
            .unwrap()
            .split(',')
            .nth(at)
            .unwrap()
            .to_owned()
    };
    assert_eq!(column(1, "broken"), "0");
    assert_eq!(column(1, "incomplete"), "2");
}

#[test]
fn default_folder_is_not_that_of_another_campaign() {
    let home = tempfile::tempdir().unwrap();
    let printed = |more: &[&str]| {
        let arguments = ["campaign", SCENARIO, "--seeds", "0..1"];
        let run = muster(home.path(), &[&arguments[..], more].concat());
        assert!(run.status.success(), "{}", error_text(&run));
        String::from_utf8(run.stdout).unwrap()
    };
    let other = ["--set", "radio.loss=0.1"];
    assert!(printed(&[]).contains("thesis-1-campaign/runs.csv"));
    assert!(printed(&other).contains("thesis-1-campaign-2/runs.csv"));
    for (more, folder) in [(&[][..], "campaign/"), (&other[..], "campaign-2/")] {
        let printed = printed(more);
        assert!(printed.contains(&format!("thesis-1-{folder}runs.csv")));
        assert!(printed.contains("1 run was complete before"), "{printed}");
    }
}
