//! Storage of a journal on disk.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use thiserror::Error;

use super::Storage;
use crate::file::{Lock, replace, sync_folder_of};

/// Name of the file with the records.
pub(super) const FILE: &str = "journal";
/// Name of the file with the number of the last synced record, and its checksum.
const LAST_SYNCED_FILE: &str = "lasting";

/// The folder of a drone's journal, locked against other processes.
///
/// The file `journal` is appended to, and replaced as a whole on compaction. A partial append is truncated, so that later
/// records can be read.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    file: File,
    len: u64,
    last_synced: File,
    _lock: Lock,
}

/// A journal's folder can't be opened: the system's fault, or another process has it.
#[derive(Debug, Error)]
pub enum FolderError {
    /// Another process has the lock.
    #[error("another process has the journal in {}", .0.display())]
    Taken(PathBuf),
    /// The folder can't be created, or its files not be opened.
    #[error("can't use the journal in {}", path.display())]
    Unusable {
        /// The folder.
        path: PathBuf,
        /// The system's error.
        #[source]
        source: io::Error,
    },
}

impl Folder {
    /// Opens and locks a folder; creates it if necessary.
    ///
    /// # Errors
    /// If another process has it, or the system refuses.
    pub fn open(folder: &Path) -> Result<Self, FolderError> {
        let unusable = |source| FolderError::Unusable {
            path: folder.to_owned(),
            source,
        };
        fs::create_dir_all(folder).map_err(unusable)?;
        let lock = File::create(folder.join("lock")).map_err(unusable)?;
        let lock = Lock::of(&lock).map_err(unusable)?;
        let lock = lock.ok_or_else(|| FolderError::Taken(folder.to_owned()))?;
        let path = folder.join(FILE);
        let file = open(&path).map_err(unusable)?;
        sync_folder_of(&path).map_err(unusable)?;
        let len = file.metadata().map_err(unusable)?.len();
        let mut options = OpenOptions::new();
        let options = options.create(true).truncate(false).read(true).write(true);
        let last_synced = options
            .open(folder.join(LAST_SYNCED_FILE))
            .map_err(unusable)?;
        Ok(Self {
            path,
            file,
            len,
            last_synced,
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

    fn last_synced(&mut self) -> io::Result<u64> {
        read_note(&self.last_synced)
    }

    fn set_last_synced(&mut self, number: u64) -> io::Result<()> {
        self.last_synced.write_all_at(&encode_note(number), 0)
    }
}

/// The number of the last record known to be synced, without locking the folder; 0 if unknown.
pub(super) fn last_synced(folder: &Path) -> io::Result<u64> {
    match File::open(folder.join(LAST_SYNCED_FILE)) {
        Ok(file) => read_note(&file),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(0),
        Err(error) => Err(error),
    }
}

fn read_note(file: &File) -> io::Result<u64> {
    let mut note = [0; NOTE_LEN];
    match file.read_exact_at(&mut note, 0) {
        Ok(()) => Ok(decode_note(note)),
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => Ok(0),
        Err(error) => Err(error),
    }
}

/// Length of the note: the number, little-endian, and its checksum.
const NOTE_LEN: usize = 12;

fn encode_note(number: u64) -> [u8; NOTE_LEN] {
    let mut note = [0; NOTE_LEN];
    let (written, checksum) = note.split_at_mut(8);
    written.copy_from_slice(&number.to_le_bytes());
    checksum.copy_from_slice(&crc32fast::hash(written).to_le_bytes());
    note
}

/// The number in a valid note; 0 otherwise.
fn decode_note(bytes: [u8; NOTE_LEN]) -> u64 {
    let [a, b, c, d, e, f, g, h, ..] = bytes;
    let number = u64::from_le_bytes([a, b, c, d, e, f, g, h]);
    if encode_note(number) == bytes {
        number
    } else {
        0
    }
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
    fn checkpoints_survive_to_the_next_incarnation() {
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
    fn journal_is_locked_by_one_process_at_a_time() {
        let folder = tempfile::tempdir().unwrap();
        let first = Folder::open(folder.path()).unwrap();
        let second = Folder::open(folder.path());
        assert!(matches!(second, Err(FolderError::Taken(_))));
        drop(first);
        Folder::open(folder.path()).unwrap();
    }

    #[test]
    fn replacement_removes_all_earlier_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let mut storage = Folder::open(folder.path()).unwrap();
        storage.append(b"before").unwrap();
        storage.replace(b"instead").unwrap();
        storage.append(b", and more").unwrap();
        assert_eq!(storage.read().unwrap(), b"instead, and more");
    }
}
