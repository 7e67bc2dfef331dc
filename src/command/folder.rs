//! Output folders of commands.

use std::fmt::Display;
use std::path::{Path, PathBuf};

use muster_runtime::diagnostic::BadInput;

/// The default output folder for a scenario: `runs/STEM-SUFFIX`. `output::numbered` finds the first that is free.
pub(crate) fn default_for(file: &Path, suffix: impl Display) -> PathBuf {
    let stem = file.file_stem().unwrap_or_default();
    Path::new("runs").join(format!("{}-{suffix}", stem.to_string_lossy()))
}

/// What was resumed in a folder, and how many of its parts were complete; `None` if nothing was.
pub(crate) fn resumed((whole, part): (&str, &str), folder: &Path, complete: u64) -> Option<String> {
    let parts = match complete {
        0 => return None,
        1 => format!("1 {part} was"),
        complete => format!("{complete} {part}s were"),
    };
    Some(format!(
        "resumed the {whole} in {}: {parts} complete before",
        folder.display()
    ))
}

/// Refuses a folder that can't be written to, before a run starts. The longest existing part of the path must be a
/// writable folder.
pub(crate) fn check_writable(out: &Path) -> Result<(), BadInput> {
    let help = "--out takes a folder; it is created if it does not exist";
    check_ancestors(out, help)
}

/// Refuses a file that can't be written, before work starts. Its folder is created later if it does not exist.
pub(crate) fn check_file(out: &Path) -> Result<(), BadInput> {
    let help = "--out takes the path of a file; its folder is created if it does not exist";
    let refuse = |what: &str| BadInput::without_excerpt(out, what, help);
    if out.is_dir() || out.file_name().is_none() {
        return Err(refuse("is a folder"));
    }
    if out.exists() && !out.is_file() {
        return Err(refuse("is not a file but a device or a pipe"));
    }
    check_ancestors(out.parent().unwrap_or(Path::new("")), help)
}

/// Refuses a folder of which the longest existing part is no folder, or can't be written to.
pub(crate) fn check_ancestors(folder: &Path, help: &str) -> Result<(), BadInput> {
    let mut ancestors = folder.ancestors();
    let existing = ancestors.find(|path| path.symlink_metadata().is_ok());
    let existing = existing
        .filter(|path| *path != Path::new(""))
        .unwrap_or(Path::new("."));
    if !existing.is_dir() {
        return Err(BadInput::without_excerpt(existing, "is not a folder", help));
    }
    tempfile::tempfile_in(existing).map(drop).map_err(|error| {
        BadInput::without_excerpt(existing, format!("can't be written to: {error}"), help)
    })
}
