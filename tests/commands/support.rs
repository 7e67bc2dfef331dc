//! Shared by the tests of the command.

use std::path::Path;
use std::process::Output;

use assert_cmd::Command;

/// Runs `muster` in a folder.
pub(crate) fn muster(folder: &Path, arguments: &[&str]) -> Output {
    Command::cargo_bin("muster")
        .unwrap()
        .current_dir(folder)
        .args(arguments)
        .output()
        .unwrap()
}
