//! Campaigns as a user meets them: divided, interrupted, refused, with broken rules.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod support;

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Output, Stdio};
use std::time::{Duration, Instant};

use support::muster;

const SCENARIO: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenarios/thesis-1.toml");
/// Two values and seven seeds: 14 runs.
const CAMPAIGN: [&str; 4] = ["--seeds", "3..10", "--vary", "radio.loss=0,0.1"];

fn campaign(folder: &Path, out: &str, more: &[&str]) -> Output {
    let arguments = [&["campaign", SCENARIO, "--out", out], &CAMPAIGN[..], more].concat();
    muster(folder, &arguments)
}

fn flown(folder: &Path, out: &str, more: &[&str]) -> BTreeMap<String, Vec<u8>> {
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

/// Names what differs, for the content is long.
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

fn said(run: &Output) -> String {
    let text = String::from_utf8(run.stderr.clone()).unwrap();
    // The message is wrapped to the width of a terminal.
    text.replace("\n  │ ", " ")
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
}

#[test]
fn shards_merge_to_the_bytes_of_an_undivided_campaign() {
    let home = tempfile::tempdir().unwrap();
    let whole = flown(home.path(), "whole", &[]);
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
        flown(
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
    assert!(merged.status.success(), "{}", said(&merged));
    assert_same(&files(&home.path().join("merged")), &whole);

    flown(
        home.path(),
        "other",
        &["--shard", "3/3", "--set", "radio.range_m=310"],
    );
    let cases: &[(&[&str], &str, &str)] = &[
        (&["part-1", "part-3"], "none", "one is not there: 2/3"),
        (
            &["part-1", "part-2", "part-2", "part-3"],
            "none",
            "is shard 2/3, as part-2 is",
        ),
        (
            &["part-1", "part-2", "other"],
            "none",
            "of another campaign than part-1 (set:",
        ),
        (&["part-1", "whole"], "none", "shard: 1/1, not of 3"),
        (&["nowhere"], "none", "holds no campaign"),
        (
            &["part-1", "part-2", "part-3"],
            "part-1",
            "folder of another campaign (shard: 1/3",
        ),
    ];
    for (parts, out, words) in cases {
        let refused = merge(parts, out);
        assert_eq!(refused.status.code(), Some(2), "{words}");
        assert!(said(&refused).contains(words), "{}", said(&refused));
        assert!(!home.path().join("none").exists(), "something was written");
    }
}

#[test]
fn jobs_and_engines_change_no_figure() {
    let home = tempfile::tempdir().unwrap();
    let one = flown(home.path(), "one", &["--jobs", "1"]);
    assert_same(&flown(home.path(), "two", &["--jobs", "2"]), &one);
    let actors = flown(
        home.path(),
        "actors",
        &["--jobs", "2", "--engine", "actors"],
    );
    assert_eq!(actors["summary.csv"], one["summary.csv"]);
    let rows = String::from_utf8_lossy(&actors["runs.csv"]).replace(",actors,", ",events,");
    assert_eq!(rows.as_bytes(), one["runs.csv"]);
}

#[test]
fn a_killed_campaign_goes_on_to_the_same_bytes() {
    let home = tempfile::tempdir().unwrap();
    let whole = flown(home.path(), "whole", &[]);
    let mut child = std::process::Command::new(assert_cmd::cargo::cargo_bin("muster"))
        .current_dir(home.path())
        .args(["campaign", SCENARIO, "--out", "killed", "--jobs", "1"])
        .args(CAMPAIGN)
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let journal = home.path().join("killed/runs.journal");
    let patience = Instant::now() + Duration::from_secs(60);
    while fs::metadata(&journal).map_or(0, |it| it.len()) < 1_000 {
        assert!(Instant::now() < patience && child.try_wait().unwrap().is_none());
        std::thread::yield_now();
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let rows = fs::read(&journal).unwrap();
    assert!(
        !home.path().join("killed/runs.jsonl").exists(),
        "it got to its end"
    );

    // What else a kill may leave: half a row, and half a file under another name.
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
    assert!(printed.contains("14 were there already"), "{printed}");
    assert_same(&files(&home.path().join("killed")), &whole);
}

#[test]
fn the_folder_of_another_campaign_is_refused_and_left_alone() {
    let home = tempfile::tempdir().unwrap();
    let scenarios = home.path().join("missions");
    fs::create_dir(&scenarios).unwrap();
    let mission = include_str!("../scenarios/missions/albufera.plan");
    let scenario = include_str!("../scenarios/thesis-1.toml");
    let write = |scenario: &str, mission: &str| {
        fs::write(home.path().join("s.toml"), scenario).unwrap();
        fs::write(scenarios.join("albufera.plan"), mission).unwrap();
    };
    let run = |more: &[&str]| {
        let base = ["campaign", "s.toml", "--out", "out"];
        muster(home.path(), &[&base, more].concat())
    };
    let asked: &[&str] = &["--seeds", "0..2", "--vary", "radio.loss=0,0.1"];
    write(scenario, mission);
    assert!(run(asked).status.success());
    let before = files(&home.path().join("out"));
    let refused = |more: &[&str], words: &str| {
        let run = run(more);
        assert_eq!(run.status.code(), Some(2), "{words}");
        assert!(said(&run).contains(words), "{}", said(&run));
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
    refused(&["--seeds", "0..2"], "not nothing)");
    refused(
        &[asked, &["--set", "radio.range_m=310"]].concat(),
        "(set: nothing, not",
    );
    refused(
        &[asked, &["--engine", "actors"]].concat(),
        "(engine: events, not actors)",
    );
    refused(
        &[asked, &["--shard", "1/2"]].concat(),
        "(shard: 1/1, not 1/2)",
    );
    write(&scenario.replace("range_m = 300", "range_m = 310"), mission);
    refused(asked, "said something else");
    let moved = mission.replacen("39.336211", "39.336311", 1);
    assert_ne!(moved, mission);
    write(scenario, &moved);
    refused(asked, "said something else");
    // A comment says nothing.
    write(&format!("# Mine.\n{scenario}"), mission);
    assert!(run(asked).status.success());
    assert_same(&files(&home.path().join("out")), &before);
    // Another version may fly otherwise.
    let identity = home.path().join("out/campaign.json");
    let text = fs::read_to_string(&identity).unwrap();
    fs::write(&identity, text.replace("\"muster ", "\"muster 9.")).unwrap();
    assert!(said(&run(asked)).contains("(program: muster 9."));
    fs::remove_file(&identity).unwrap();
    let stray = run(asked);
    assert_eq!(stray.status.code(), Some(2));
    assert!(
        said(&stray).contains("no campaign.json"),
        "{}",
        said(&stray)
    );
}

#[test]
fn what_cannot_be_flown_is_refused_and_nothing_is_written() {
    let cases: &[(&[&str], &str)] = &[
        (&[], "--seeds"),
        (&["--seeds", "5"], "no range of seeds"),
        (&["--seeds", "a..b"], "no range of seeds"),
        (&["--seeds", "-3..4"], "no range of seeds"),
        (&["--seeds", "5..5"], "holds no seed"),
        (&["--seeds", "9..=3"], "holds no seed"),
        (
            &["--seeds", "0..9223372036854775809"],
            "beyond the highest seed",
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
        (
            &["--seeds", "0..2", "--vary", "seed=1,2"],
            "varied by --seeds",
        ),
        (&["--seeds", "0..2", "--set", "seed=1"], "the seed is set"),
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
        (&["--seeds", "0..2", "--shard", "0/3"], "is no part"),
        (&["--seeds", "0..2", "--shard", "4/3"], "is no part"),
        (&["--seeds", "0..2", "--shard", "1/1001"], "is no part"),
        (&["--seeds", "0..2", "--jobs", "0"], "from 1 to 1024"),
        (&["--seeds", "0..2", "--engine", "steam"], "events"),
        (&["--seeds", "0..2", "--out", "taken"], "is a file"),
        (
            &["--seeds", "0..2", "--vary", "mission.file=nowhere.plan"],
            "nowhere.plan",
        ),
    ];
    let home = tempfile::tempdir().unwrap();
    fs::write(home.path().join("taken"), "mine").unwrap();
    for (arguments, words) in cases {
        let run = muster(home.path(), &[&["campaign", SCENARIO], *arguments].concat());
        assert_eq!(run.status.code(), Some(2), "{arguments:?}: {}", said(&run));
        assert!(
            said(&run).contains(words),
            "`{words}` is missing in: {}",
            said(&run)
        );
        assert!(run.stdout.is_empty());
        assert_eq!(files(home.path()).len(), 1, "{arguments:?} wrote something");
    }
}

#[test]
fn broken_rules_have_their_rows_and_the_commands_that_repeat_them() {
    let home = tempfile::tempdir().unwrap();
    let broken = "limits.duration_s=60,3000";
    let arguments = ["--seeds", "4..6", "--vary", broken, "--out", "out"];
    let run = muster(
        home.path(),
        &[&["campaign", SCENARIO], &arguments[..]].concat(),
    );
    assert_eq!(run.status.code(), Some(3), "{}", said(&run));
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
    assert_eq!(rows.lines().count(), 5, "the campaign went on");
    assert!(rows.lines().nth(1).unwrap().contains(",1,5,"), "{rows}");
    let again = muster(
        home.path(),
        &[&["campaign", SCENARIO], &arguments[..]].concat(),
    );
    assert_eq!(again.status.code(), Some(3), "it is told each time");
}

#[test]
fn runs_that_do_not_fly_the_mission_to_its_end_are_counted_and_told() {
    let home = tempfile::tempdir().unwrap();
    // Every leg takes longer.
    let limit = ["--set", "limits.leg_s=30"];
    let arguments = ["campaign", SCENARIO, "--seeds", "0..2", "--out", "out"];
    let run = muster(home.path(), &[&arguments[..], &limit].concat());
    assert_eq!(run.status.code(), Some(4), "{}", said(&run));
    let printed = String::from_utf8_lossy(&run.stdout);
    assert!(
        printed.contains("not flown to the end in 2 runs"),
        "{printed}"
    );
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
fn a_campaign_whose_folder_is_not_named_takes_one_that_is_no_other_campaign_s() {
    let home = tempfile::tempdir().unwrap();
    let flown = |more: &[&str]| {
        let arguments = ["campaign", SCENARIO, "--seeds", "0..1"];
        let run = muster(home.path(), &[&arguments[..], more].concat());
        assert!(run.status.success(), "{}", said(&run));
        String::from_utf8(run.stdout).unwrap()
    };
    let other = ["--set", "radio.loss=0.1"];
    assert!(flown(&[]).contains("thesis-1-campaign/runs.csv"));
    assert!(flown(&other).contains("thesis-1-campaign-2/runs.csv"));
    for (more, folder) in [(&[][..], "campaign/"), (&other[..], "campaign-2/")] {
        let printed = flown(more);
        assert!(printed.contains(&format!("thesis-1-{folder}runs.csv")));
        assert!(printed.contains("1 were there already"), "{printed}");
    }
}
