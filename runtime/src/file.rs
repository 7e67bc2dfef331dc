//! Files that are there whole or not at all, and that outlive a loss of power.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Puts bytes in the place of a file, in one piece and to last: whoever reads it, at whatever time, finds what was there
/// before or all of them.
///
/// # Errors
/// When the system can't; either what was there before is there still, and perhaps a file beside it whose name ends in
/// `.new`, or all of the bytes are, which may not outlive a loss of power.
pub fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let new = beside(path);
    let mut file = File::create(&new)?;
    file.write_all(bytes)?;
    file.sync_all()?;
    fs::rename(&new, path)?;
    sync_folder_of(path)
}

/// Returns once a file's being there, under its name, will outlive a loss of power.
///
/// # Errors
/// When the system can't say so.
pub fn sync_folder_of(path: &Path) -> io::Result<()> {
    let folder = match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    File::open(folder)?.sync_all()
}

fn beside(path: &Path) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(".new");
    name.into()
}
