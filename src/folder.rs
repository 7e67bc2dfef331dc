//! Where commands write what comes of them.

use std::fmt::Display;
use std::path::{Path, PathBuf};

use muster_runtime::diagnostic::BadInput;

/// The folder of a file's flights unless another one is given: within `runs`, named after the file and what was done.
pub(crate) fn of(file: &Path, what: impl Display) -> PathBuf {
    let stem = file.file_stem().unwrap_or_default();
    Path::new("runs").join(format!("{}-{what}", stem.to_string_lossy()))
}

/// Refuses, before anything is flown, a folder that can't be written to: what there is of its path must be a folder
/// in which files can be made.
pub(crate) fn check(out: &Path) -> Result<(), BadInput> {
    let help = "--out takes a folder, which is made if it is not there";
    let there = out.ancestors().find(|path| path.symlink_metadata().is_ok());
    let there = there
        .filter(|path| *path != Path::new(""))
        .unwrap_or(Path::new("."));
    if !there.is_dir() {
        return Err(BadInput::without_excerpt(there, "is not a folder", help));
    }
    tempfile::tempfile_in(there).map(drop).map_err(|error| {
        BadInput::without_excerpt(there, format!("can't be written to: {error}"), help)
    })
}
