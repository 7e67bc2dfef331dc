//! The figures that the documents name, as the command prints them: a change that moves one shows here.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use assert_cmd::Command;

/// What `muster sim` prints, without what differs from run to run and what any change moves: the time that it took,
/// the trace, and where the report went.
fn printed(arguments: &str) -> String {
    let out = tempfile::tempdir().unwrap();
    let run = Command::cargo_bin("muster")
        .unwrap()
        .args(["sim", "--engine", "events"])
        .args(arguments.split_whitespace())
        .arg("--out")
        .arg(out.path().join("run"))
        .output()
        .unwrap();
    assert_eq!(run.status.code(), Some(0), "{arguments}");
    let printed = String::from_utf8(run.stdout).unwrap();
    let moves = |line: &str| {
        let word = line.split_whitespace().next();
        matches!(word, Some("simulated" | "trace" | "wrote"))
    };
    let lines: Vec<_> = printed.lines().filter(|line| !moves(line)).collect();
    lines.join("\n").trim_end().to_owned()
}

#[test]
fn a_master_followed_at_ten_metres_a_second_through_seven_hops() {
    insta::assert_snapshot!(printed("scenarios/follow.toml"));
}

#[test]
fn the_same_with_a_tenth_of_all_frames_lost() {
    insta::assert_snapshot!(printed("scenarios/follow.toml --set radio.loss=0.1"));
}

#[test]
fn a_master_followed_that_is_flown_by_hand() {
    insta::assert_snapshot!(printed("scenarios/follow-by-hand.toml"));
}

#[test]
fn nine_drones_that_change_from_each_formation_to_each_other() {
    insta::assert_snapshot!(printed("scenarios/shake-up.toml"));
}
