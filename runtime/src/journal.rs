//! A drone's journal: what its machines are built from after its process has ended, however it ended.
//!
//! Records are only added, each with its length and a checksum; reading ends at the first that is not whole, which is
//! what a process leaves that was killed while it wrote, and a disk whose power failed. Of each machine's checkpoints
//! the newest counts. Each start of the process is a record of its own, so that no two lives have one number.

mod folder;

use std::io;

pub use folder::{Folder, FolderError};
use muster_machines::cell::{Checkpoint, Checkpoints};
use serde::{Deserialize, Serialize};

/// Where a journal's bytes are.
pub trait Storage {
    /// All bytes that are there.
    ///
    /// # Errors
    /// When the system can't read them.
    fn read(&mut self) -> io::Result<Vec<u8>>;

    /// Adds bytes to the end; they may be lost, or a part of them, until [`Self::sync`] has returned.
    ///
    /// # Errors
    /// When the system can't write them; a part of them may be there.
    fn append(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Returns once all that was added will outlive a loss of power.
    ///
    /// # Errors
    /// When the system can't say so.
    fn sync(&mut self) -> io::Result<()>;

    /// Puts bytes in the place of all that is there, in one piece and to last.
    ///
    /// # Errors
    /// When the system can't; then all is as it was.
    fn replace(&mut self, bytes: &[u8]) -> io::Result<()>;
}

/// The size from which on a journal is written anew with what still counts, in bytes.
const COMPACT_ABOVE: usize = 256 * 1_024;

/// How many bytes stand before each record: its length and its checksum, lowest byte first.
const HEADING_LEN: usize = 8;

#[derive(Debug, Serialize, Deserialize)]
enum Record {
    /// The process started, for the nth time from 1.
    Boot(u32),
    Checkpoint(Checkpoint),
}

/// A drone's journal.
#[derive(Debug)]
pub struct Journal<S> {
    storage: S,
    len: usize,
}

impl<S: Storage> Journal<S> {
    /// Opens a journal for another life of the drone's process; what it is built from, and the number of that life.
    ///
    /// # Errors
    /// When the storage fails, or holds something that does not begin as a journal does: it may have been one, and what it
    /// said must not be forgotten. The journal is as it was then.
    pub fn open(mut storage: S) -> io::Result<(Self, Checkpoints)> {
        let bytes = storage.read()?;
        let mut checkpoints = Checkpoints::default();
        let mut boot = 0;
        for record in records(&bytes) {
            match record {
                Record::Boot(number) => boot = number,
                Record::Checkpoint(checkpoint) => {
                    checkpoints.keep(checkpoint);
                }
            }
        }
        if boot == 0 && !bytes.is_empty() {
            let message = "its beginning is damaged: it can't be told what the drone has done";
            return Err(io::Error::new(io::ErrorKind::InvalidData, message));
        }
        let Some(boot) = boot.checked_add(1) else {
            let message = "it has no number left for another life";
            return Err(io::Error::new(io::ErrorKind::InvalidData, message));
        };
        checkpoints.begin_life(boot);
        let mut journal = Self { storage, len: 0 };
        journal.compact(&checkpoints)?;
        Ok((journal, checkpoints))
    }

    /// Adds a checkpoint, `all` being the newest of each machine with it; `must_last` when nothing may be done on its
    /// account before it would outlive a loss of power.
    ///
    /// # Errors
    /// When the storage fails.
    pub fn keep(
        &mut self,
        checkpoint: &Checkpoint,
        all: &Checkpoints,
        must_last: bool,
    ) -> io::Result<()> {
        if self.len > COMPACT_ABOVE {
            return self.compact(all);
        }
        let mut bytes = Vec::new();
        write(&Record::Checkpoint(checkpoint.clone()), &mut bytes);
        self.storage.append(&bytes)?;
        self.len += bytes.len();
        if must_last {
            self.storage.sync()?;
        }
        Ok(())
    }

    /// Closes it and hands its storage back.
    #[must_use]
    pub fn into_storage(self) -> S {
        self.storage
    }

    fn compact(&mut self, all: &Checkpoints) -> io::Result<()> {
        let mut bytes = Vec::new();
        write(&Record::Boot(all.boot()), &mut bytes);
        for checkpoint in all.iter() {
            write(&Record::Checkpoint(checkpoint), &mut bytes);
        }
        self.storage.replace(&bytes)?;
        self.len = bytes.len();
        Ok(())
    }
}

fn write(record: &Record, bytes: &mut Vec<u8>) {
    let body = postcard::to_stdvec(record).expect("a checkpoint has a binary form");
    let len = u32::try_from(body.len()).expect("a checkpoint is far below 4 GiB");
    bytes.extend_from_slice(&len.to_le_bytes());
    bytes.extend_from_slice(&crc32fast::hash(&body).to_le_bytes());
    bytes.extend_from_slice(&body);
}

/// The records up to the first that is not whole.
fn records(mut bytes: &[u8]) -> impl Iterator<Item = Record> + '_ {
    std::iter::from_fn(move || {
        let (heading, rest) = bytes.split_at_checked(HEADING_LEN)?;
        let number = |at: usize| heading[at..at + 4].try_into().map(u32::from_le_bytes).ok();
        let (body, rest) = rest.split_at_checked(number(0)? as usize)?;
        if crc32fast::hash(body) != number(4)? {
            return None;
        }
        bytes = rest;
        postcard::from_bytes(body).ok()
    })
}

#[cfg(test)]
mod tests {
    use muster_machines::{mission, radio};
    use proptest::prelude::*;

    use super::*;

    #[derive(Debug, Default)]
    struct Memory(Vec<u8>);

    impl Storage for Memory {
        fn read(&mut self) -> io::Result<Vec<u8>> {
            Ok(self.0.clone())
        }

        fn append(&mut self, bytes: &[u8]) -> io::Result<()> {
            self.0.extend_from_slice(bytes);
            Ok(())
        }

        fn sync(&mut self) -> io::Result<()> {
            Ok(())
        }

        fn replace(&mut self, bytes: &[u8]) -> io::Result<()> {
            self.0 = bytes.to_vec();
            Ok(())
        }
    }

    fn counter(counter: u64) -> Checkpoint {
        Checkpoint::Radio(radio::Checkpoint { counter })
    }

    fn mission(opened: u16) -> Checkpoint {
        let checkpoint = mission::Checkpoint {
            opened: Some(opened),
            ..mission::Checkpoint::default()
        };
        Checkpoint::Mission(Box::new(checkpoint))
    }

    fn keep(journal: &mut Journal<Memory>, all: &mut Checkpoints, checkpoint: &Checkpoint) {
        all.keep(checkpoint.clone());
        journal.keep(checkpoint, all, true).unwrap();
    }

    #[test]
    fn the_newest_checkpoint_of_each_machine_outlives_the_process() {
        let (mut journal, mut all) = Journal::open(Memory::default()).unwrap();
        assert_eq!(all.boot(), 1);
        for checkpoint in [counter(1), mission(2), counter(3)] {
            keep(&mut journal, &mut all, &checkpoint);
        }
        let (_, found) = Journal::open(journal.into_storage()).unwrap();
        assert_eq!(found.boot(), 2);
        let found: Vec<_> = found.iter().collect();
        assert!(found.contains(&counter(3)) && found.len() == 2, "{found:?}");
    }

    #[test]
    fn a_journal_does_not_grow_for_ever() {
        let (mut journal, mut all) = Journal::open(Memory::default()).unwrap();
        for opened in 0..u16::MAX {
            keep(&mut journal, &mut all, &mission(opened));
        }
        assert!(journal.storage.0.len() < 2 * COMPACT_ABOVE);
        let (_, found) = Journal::open(journal.into_storage()).unwrap();
        let Some(Checkpoint::Mission(mission)) = found.iter().nth(1) else {
            panic!("{found:?}");
        };
        assert_eq!(mission.opened, Some(u16::MAX - 1));
    }

    #[test]
    fn a_journal_whose_beginning_is_damaged_is_refused_and_left_as_it_is() {
        let (mut journal, mut all) = Journal::open(Memory::default()).unwrap();
        keep(&mut journal, &mut all, &mission(3));
        let mut bytes = journal.into_storage().0;
        bytes[0] ^= 1;
        let error = Journal::open(Memory(bytes)).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::InvalidData);
    }

    #[test]
    fn a_journal_of_the_last_life_that_has_a_number_is_refused() {
        let mut bytes = Vec::new();
        write(&Record::Boot(u32::MAX), &mut bytes);
        let error = Journal::open(Memory(bytes)).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::InvalidData);
    }

    proptest! {
        #[test]
        fn whatever_is_torn_off_or_altered_at_the_end_what_stood_before_is_found(
            cut in 0_usize..60,
            garbage in proptest::collection::vec(any::<u8>(), 0..40),
        ) {
            let (mut journal, mut all) = Journal::open(Memory::default()).unwrap();
            keep(&mut journal, &mut all, &counter(7));
            let whole = journal.storage.0.len();
            keep(&mut journal, &mut all, &counter(8));
            let mut bytes = journal.into_storage().0;
            bytes.truncate(bytes.len().saturating_sub(cut).max(whole));
            bytes.extend_from_slice(&garbage);
            let (_, found) = Journal::open(Memory(bytes)).unwrap();
            let found: Vec<_> = found.iter().collect();
            prop_assert!(found.contains(&counter(7)) || found.contains(&counter(8)), "{found:?}");
        }
    }
}
