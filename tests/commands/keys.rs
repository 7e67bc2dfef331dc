//! The command `muster keys`.

use std::path::Path;
use std::process::{Command, Output};

use crate::support::muster;

/// Runs `muster` where no file can be written to, as on a full disk.
fn muster_without_space(folder: &Path, arguments: &[&str]) -> Output {
    // Without the signal, a write beyond the limit is an error.
    let limited = "trap '' XFSZ; ulimit -f 0; exec \"$@\"";
    Command::new("sh")
        .args(["-c", limited, "sh", env!("CARGO_BIN_EXE_muster")])
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap()
}

#[test]
fn key_that_a_full_disk_had_no_space_for_can_be_created_later() {
    let home = tempfile::tempdir().unwrap();
    let commands: [(&[&str], &str); 2] = [
        (&["keys", "fleet", "fleet"], "fleet/fleet.key"),
        (&["keys", "drone", "fleet", "0"], "fleet/drone-0.key"),
    ];
    for (command, key) in commands {
        let refused = muster_without_space(home.path(), command);
        assert_eq!(refused.status.code(), Some(1), "{refused:?}");
        assert!(!home.path().join(key).exists(), "half of {key} is left");
        let created = muster(home.path(), command);
        assert_eq!(created.status.code(), Some(0), "{created:?}");
    }
}

#[test]
fn no_drone_gets_a_key_if_one_of_them_has_one() {
    let home = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| muster(home.path(), arguments).status.code();
    assert_eq!(run(&["keys", "fleet", "fleet"]), Some(0));
    assert_eq!(run(&["keys", "drone", "fleet", "0"]), Some(0));
    let roster = || std::fs::read(home.path().join("fleet/roster.toml")).unwrap();
    let before = roster();
    assert_eq!(run(&["keys", "drone", "fleet", "8", "0"]), Some(2));
    assert!(!home.path().join("fleet/drone-8.key").exists());
    assert_eq!(roster(), before);
    assert_eq!(run(&["keys", "drone", "fleet", "8", "8"]), Some(0));
}
