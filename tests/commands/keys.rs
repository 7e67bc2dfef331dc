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
