//! Output folders of commands.

use std::fmt::Display;
use std::path::{Path, PathBuf};

use muster_runtime::diagnostic::BadInput;

/// The default output folder for a scenario: `runs/STEM-SUFFIX`. `report::numbered` finds the first that is free.
pub(crate) fn default_for(file: &Path, suffix: impl Display) -> PathBuf {
    let stem = file.file_stem().unwrap_or_default();
    Path::new("runs").join(format!("{}-{suffix}", stem.to_string_lossy()))
}

/// Refuses a folder that can't be written to, before a run starts. The longest existing part of the path must be a
/// writable folder.
pub(crate) fn check_writable(out: &Path) -> Result<(), BadInput> {
    let help = "--out takes a folder; it is created if it does not exist";
    let existing = out.ancestors().find(|path| path.symlink_metadata().is_ok());
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
