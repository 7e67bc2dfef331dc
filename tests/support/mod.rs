//! What tests of the program share.

use std::path::Path;
use std::process::Output;

use assert_cmd::Command;

/// What the program does that is started in `folder`.
pub(crate) fn muster(folder: &Path, arguments: &[&str]) -> Output {
    Command::cargo_bin("muster")
        .unwrap()
        .current_dir(folder)
        .args(arguments)
        .output()
        .unwrap()
}
