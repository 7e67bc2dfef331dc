//! A journal's bytes on a disk.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Write};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use thiserror::Error;

use super::Storage;
use crate::file::{replace, sync_folder_of};

/// The file with the records, in a journal's folder.
pub(super) const FILE: &str = "journal";
/// The file with the number of the record up to which all last, and its checksum.
const LASTING: &str = "lasting";

/// The folder of a drone's journal, which no other process can have meanwhile.
///
/// Its file `journal` is only added to, and now and then replaced as a whole. What could not be added whole is cut off
/// again, so that what comes after it can be read.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    file: File,
    len: u64,
    lasting: File,
    /// Held as long as this process lives, however it ends.
    _lock: File,
}

/// Why a journal's folder can't be had: the machine's fault, or another process's.
#[derive(Debug, Error)]
pub enum FolderError {
    /// Another process has it.
    #[error("another process has the journal in {}", .0.display())]
    Taken(PathBuf),
    /// It can't be made, or its files not be opened.
    #[error("can't use the journal in {}", path.display())]
    Unusable {
        /// The folder.
        path: PathBuf,
        /// What the system says.
        #[source]
        source: io::Error,
    },
}

impl Folder {
    /// Opens a folder, which is made if it is not there.
    ///
    /// # Errors
    /// When another process has it, or the system refuses.
    pub fn open(folder: &Path) -> Result<Self, FolderError> {
        let unusable = |source| FolderError::Unusable {
            path: folder.to_owned(),
            source,
        };
        fs::create_dir_all(folder).map_err(unusable)?;
        let lock = File::create(folder.join("lock")).map_err(unusable)?;
        lock.try_lock().map_err(|error| match error {
            TryLockError::WouldBlock => FolderError::Taken(folder.to_owned()),
            TryLockError::Error(source) => unusable(source),
        })?;
        let path = folder.join(FILE);
        let file = open(&path).map_err(unusable)?;
        sync_folder_of(&path).map_err(unusable)?;
        let len = file.metadata().map_err(unusable)?.len();
        let mut options = OpenOptions::new();
        let options = options.create(true).truncate(false).read(true).write(true);
        let lasting = options.open(folder.join(LASTING)).map_err(unusable)?;
        Ok(Self {
            path,
            file,
            len,
            lasting,
            _lock: lock,
        })
    }
}

fn open(path: &Path) -> io::Result<File> {
    OpenOptions::new().create(true).append(true).open(path)
}

impl Storage for Folder {
    fn read(&mut self) -> io::Result<Vec<u8>> {
        fs::read(&self.path)
    }

    fn append(&mut self, bytes: &[u8]) -> io::Result<()> {
        if let Err(error) = self.file.write_all(bytes) {
            self.file.set_len(self.len)?;
            return Err(error);
        }
        self.len += bytes.len() as u64;
        Ok(())
    }

    fn sync(&mut self) -> io::Result<()> {
        self.file.sync_data()
    }

    fn replace(&mut self, bytes: &[u8]) -> io::Result<()> {
        replace(&self.path, bytes)?;
        self.file = open(&self.path)?;
        self.len = bytes.len() as u64;
        Ok(())
    }

    fn lasting(&mut self) -> io::Result<u64> {
        let mut note = [0; NOTE_LEN];
        match self.lasting.read_exact_at(&mut note, 0) {
            Ok(()) => Ok(read_note(note)),
            Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => Ok(0),
            Err(error) => Err(error),
        }
    }

    fn note_lasting(&mut self, number: u64) -> io::Result<()> {
        self.lasting.write_all_at(&note(number), 0)
    }
}

/// The number, lowest byte first, and its checksum.
const NOTE_LEN: usize = 12;

fn note(number: u64) -> [u8; NOTE_LEN] {
    let mut note = [0; NOTE_LEN];
    let (written, checksum) = note.split_at_mut(8);
    written.copy_from_slice(&number.to_le_bytes());
    checksum.copy_from_slice(&crc32fast::hash(written).to_le_bytes());
    note
}

/// The number of a note that is whole; 0 of any other.
fn read_note(bytes: [u8; NOTE_LEN]) -> u64 {
    let [a, b, c, d, e, f, g, h, ..] = bytes;
    let number = u64::from_le_bytes([a, b, c, d, e, f, g, h]);
    if note(number) == bytes { number } else { 0 }
}

#[cfg(test)]
mod tests {
    use muster_machines::node::Checkpoint;
    use muster_machines::radio;

    use super::*;
    use crate::journal::Journal;

    fn counter(counter: u64) -> Checkpoint {
        Checkpoint::Radio(radio::Checkpoint { counter })
    }

    #[test]
    fn what_was_kept_is_there_for_the_next_life() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("deep/inside");
        for incarnation in 1..=3 {
            let (mut journal, mut all) = Journal::open(Folder::open(&path).unwrap()).unwrap();
            assert_eq!(all.boot(), incarnation);
            if incarnation > 1 {
                assert!(all.holds(&counter(u64::from(incarnation) - 1)));
            }
            let checkpoint = counter(incarnation.into());
            all.keep(checkpoint.clone());
            journal.add(&checkpoint, &all).unwrap();
            journal.sync().unwrap();
        }
    }

    #[test]
    fn a_journal_is_for_one_process_at_a_time() {
        let folder = tempfile::tempdir().unwrap();
        let first = Folder::open(folder.path()).unwrap();
        let second = Folder::open(folder.path());
        assert!(matches!(second, Err(FolderError::Taken(_))));
        drop(first);
        Folder::open(folder.path()).unwrap();
    }

    #[test]
    fn what_replaces_a_journal_is_all_that_is_left_of_it() {
        let folder = tempfile::tempdir().unwrap();
        let mut storage = Folder::open(folder.path()).unwrap();
        storage.append(b"before").unwrap();
        storage.replace(b"instead").unwrap();
        storage.append(b", and more").unwrap();
        assert_eq!(storage.read().unwrap(), b"instead, and more");
    }
}
