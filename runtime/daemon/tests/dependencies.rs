//! `musterd` does not link the simulation, and prints its version.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::process::Command;

#[test]
fn musterd_links_no_world_report_or_campaign() {
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
    assert!(tree.status.success(), "{tree:?}");
    let packages = String::from_utf8(tree.stdout).unwrap();
    assert!(packages.contains("muster-machines "), "{packages}");
    for excluded in [
        "muster-scenarios ",
        "muster-experiments ",
        "muster-controller ",
        "muster-indoor-world ",
        "muster-deploy ",
        "muster v",
        "maud ",
        "csv ",
        "mcap ",
        "lz4 ",
    ] {
        let is_linked = packages.lines().any(|it| it.starts_with(excluded));
        assert!(!is_linked, "{excluded}is linked into musterd");
    }
}

#[test]
fn musterd_prints_its_version() {
    let version = Command::new(env!("CARGO_BIN_EXE_musterd"))
        .arg("--version")
        .output()
        .unwrap();
    let expected = format!("musterd {}\n", env!("CARGO_PKG_VERSION"));
    assert_eq!(String::from_utf8(version.stdout).unwrap(), expected);
}
