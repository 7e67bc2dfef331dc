//! What flies is apart from what is simulated.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::process::Command;

#[test]
fn what_builds_musterd_knows_no_world_no_report_and_no_campaign() {
    let tree = Command::new(env!("CARGO"))
        .args([
            "tree",
            "--locked",
            "--offline",
            "--package",
            env!("CARGO_PKG_NAME"),
        ])
        .args([
            "--edges",
            "normal,build",
            "--prefix",
            "none",
            "--format",
            "{p}",
        ])
        .output()
        .unwrap();
    let packages = String::from_utf8(tree.stdout).unwrap();
    assert!(packages.contains("muster-machines "), "{packages}");
    for apart in [
        "muster-scenarios ",
        "muster-deploy ",
        "muster v",
        "maud ",
        "csv ",
    ] {
        let is_there = packages.lines().any(|it| it.starts_with(apart));
        assert!(!is_there, "{apart}is linked into musterd");
    }
}

#[test]
fn musterd_says_which_it_is() {
    let version = Command::new(env!("CARGO_BIN_EXE_musterd"))
        .arg("--version")
        .output()
        .unwrap();
    let expected = format!("musterd {}\n", env!("CARGO_PKG_VERSION"));
    assert_eq!(String::from_utf8(version.stdout).unwrap(), expected);
}
