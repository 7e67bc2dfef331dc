//! Atomic replacement of files that survives a power cut, and locks between processes.

use std::ffi::OsString;
use std::fs::{self, File, TryLockError};
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

/// A lock on a file, against other processes. It ends when it is dropped, or with the process.
#[derive(Debug)]
pub struct Lock(File);

impl Lock {
    /// Locks a file. `None` if it is locked already.
    ///
    /// # Errors
    /// If the system refuses.
    pub fn of(file: &File) -> io::Result<Option<Self>> {
        let file = file.try_clone()?;
        match file.try_lock() {
            Ok(()) => Ok(Some(Self(file))),
            Err(TryLockError::WouldBlock) => Ok(None),
            Err(TryLockError::Error(error)) => Err(error),
        }
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        // Closing the file would not do: a process that another thread just starts has it open, too, until it runs its program.
        let _ = self.0.unlock();
    }
}

fn temporary_path(path: &Path) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(".new");
    name.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lock_ends_with_its_owner_even_while_the_file_is_open_elsewhere() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lock");
        let file = File::create(&path).unwrap();
        let lock = Lock::of(&file).unwrap().unwrap();
        let open = || File::open(&path).unwrap();
        assert!(Lock::of(&open()).unwrap().is_none());
        // As in a process that is just being started.
        let elsewhere = file.try_clone().unwrap();
        drop((lock, file));
        assert!(Lock::of(&open()).unwrap().is_some());
        drop(elsewhere);
    }
}
