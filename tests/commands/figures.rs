//! Snapshots of the figures that the documents quote.

use assert_cmd::Command;

/// Output of `muster sim` without the lines that differ between runs or change with any edit: wall time, trace, and paths.
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
    let is_volatile = |line: &str| {
        let first_word = line.split_whitespace().next();
        matches!(first_word, Some("simulated" | "trace" | "wrote"))
    };
    let lines: Vec<_> = printed.lines().filter(|line| !is_volatile(line)).collect();
    lines.join("\n").trim_end().to_owned()
}

#[test]
fn master_followed_at_10_mps_through_seven_hops() {
    insta::assert_snapshot!(printed("scenarios/follow.toml"));
}

#[test]
fn master_followed_with_10_percent_frame_loss() {
    insta::assert_snapshot!(printed("scenarios/follow.toml --set radio.loss=0.1"));
}

#[test]
fn manually_flown_master_is_followed() {
    insta::assert_snapshot!(printed("scenarios/follow-by-hand.toml"));
}

#[test]
fn nine_drones_change_between_all_formations() {
    insta::assert_snapshot!(printed("scenarios/shake-up.toml"));
}
