//! Atomic replacement of files that survives a power cut.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Replaces a file's content atomically and durably: readers see the old content or all of the new one.
///
/// # Errors
/// If the system refuses. Then the file has its old content, and a file with the suffix `.new` may stand beside it; or it
/// has the new content, which may not survive a power cut.
pub fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let new = temporary_path(path);
    let mut file = File::create(&new)?;
    file.write_all(bytes)?;
    file.sync_all()?;
    fs::rename(&new, path)?;
    sync_folder_of(path)
}

/// Syncs the folder of a file, so that the file's name survives a power cut.
///
/// # Errors
/// If the system can't sync it.
pub fn sync_folder_of(path: &Path) -> io::Result<()> {
    let folder = match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    File::open(folder)?.sync_all()
}

fn temporary_path(path: &Path) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(".new");
    name.into()
}
