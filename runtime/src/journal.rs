//! A drone's journal: what its machines are built from after its process has ended, however it ended.
//!
//! Records are only added, each with its length and a checksum; reading ends at the first that is not whole, which is
//! what a process leaves that was killed while it wrote, and a disk whose power failed. One that is whole and not
//! understood is another version's, and no such end. Of each machine's checkpoints the newest counts. Each start of the process is a record of its own, so that no two lives have one number.

mod folder;

use std::path::Path;
use std::{fs, io};

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
    /// Whole records that this version does not understand, as they were found.
    unknown: Vec<u8>,
}

impl<S: Storage> Journal<S> {
    /// Opens a journal for another life of the drone's process; what it is built from, and the number of that life.
    ///
    /// # Errors
    /// When the storage fails, holds something that does not begin as a journal does, or has a whole record that this
    /// version does not understand: what a journal said must not be forgotten. The journal is as it was then.
    pub fn open(storage: S) -> io::Result<(Self, Checkpoints)> {
        Self::begin(storage, |unknown| match unknown.first() {
            None => Ok(()),
            Some(at) => Err(refused(format!(
                "the record at byte {at} is whole, and none that this version understands: what the drone has done can't be \
                 told (start it with the version that wrote it, or with another journal)"
            ))),
        })
    }

    /// Likewise, for a drone in the air, which can't be refused: records that this version does not understand are passed
    /// over, and kept as they are, so that no later life takes the journal for whole. Where there are any
    /// ([`Self::is_understood`]) it is not known what the drone was doing, and it is to come down.
    ///
    /// # Errors
    /// As [`Self::open`], but for such records.
    pub fn open_in_flight(storage: S) -> io::Result<(Self, Checkpoints)> {
        Self::begin(storage, |_| Ok(()))
    }

    /// Whether all records that it had when it was opened were understood.
    #[must_use]
    pub const fn is_understood(&self) -> bool {
        self.unknown.is_empty()
    }

    fn begin(
        mut storage: S,
        check: impl FnOnce(&[usize]) -> io::Result<()>,
    ) -> io::Result<(Self, Checkpoints)> {
        let bytes = storage.read()?;
        let found = Found::in_bytes(&bytes);
        if found.boot == 0 && !bytes.is_empty() {
            let message = "its beginning is damaged: it can't be told what the drone has done";
            return Err(refused(message.to_owned()));
        }
        check(&found.unknown_at)?;
        let Some(boot) = found.boot.checked_add(1) else {
            return Err(refused("it has no number left for another life".to_owned()));
        };
        let mut checkpoints = found.checkpoints;
        checkpoints.begin_life(boot);
        let mut journal = Self {
            storage,
            len: 0,
            unknown: found.unknown,
        };
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
        if self.len > COMPACT_ABOVE + self.unknown.len() {
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
        bytes.extend_from_slice(&self.unknown);
        for checkpoint in all.iter() {
            write(&Record::Checkpoint(checkpoint), &mut bytes);
        }
        self.storage.replace(&bytes)?;
        self.len = bytes.len();
        Ok(())
    }
}

/// What the journal in a folder says, as far as it is understood; nothing where there is none. No life begins.
///
/// # Errors
/// When the system can't read it.
pub fn peek(folder: &Path) -> io::Result<Option<Checkpoints>> {
    match fs::read(folder.join(folder::FILE)) {
        Ok(bytes) => Ok((!bytes.is_empty()).then(|| Found::in_bytes(&bytes).checkpoints)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error),
    }
}

fn refused(why: String) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, why)
}

/// What is read of a journal.
#[derive(Default)]
struct Found {
    checkpoints: Checkpoints,
    /// The number of the last life; 0 where no life has begun.
    boot: u32,
    /// Whole records that are not understood, and at which byte each begins.
    unknown: Vec<u8>,
    unknown_at: Vec<usize>,
}

impl Found {
    fn in_bytes(bytes: &[u8]) -> Self {
        let mut found = Self::default();
        let mut at = 0;
        while let Some(body) = whole(&bytes[at..]) {
            let end = at + HEADING_LEN + body.len();
            // A longer one than this version's is another version's.
            match postcard::take_from_bytes(body) {
                Ok((Record::Boot(number), [])) => found.boot = number,
                Ok((Record::Checkpoint(checkpoint), [])) => {
                    found.checkpoints.keep(checkpoint);
                }
                Ok(_) | Err(_) => {
                    found.unknown.extend_from_slice(&bytes[at..end]);
                    found.unknown_at.push(at);
                }
            }
            at = end;
        }
        found
    }
}

fn write(record: &Record, bytes: &mut Vec<u8>) {
    let body = postcard::to_stdvec(record).expect("a checkpoint has a binary form");
    frame(&body, bytes);
}

/// Adds a record to a journal's bytes as it stands there: `body` behind its length and its checksum.
///
/// # Panics
/// When it is longer than 4 GiB.
pub fn frame(body: &[u8], bytes: &mut Vec<u8>) {
    let len = u32::try_from(body.len()).expect("a checkpoint is far below 4 GiB");
    bytes.extend_from_slice(&len.to_le_bytes());
    bytes.extend_from_slice(&crc32fast::hash(body).to_le_bytes());
    bytes.extend_from_slice(body);
}

/// What the first record says, if it is whole. None is empty: zeros are what a disk may have in the place of what was
/// not written yet.
fn whole(bytes: &[u8]) -> Option<&[u8]> {
    let (heading, rest) = bytes.split_at_checked(HEADING_LEN)?;
    let number = |at: usize| heading[at..at + 4].try_into().map(u32::from_le_bytes).ok();
    let body = rest.get(..number(0)? as usize)?;
    (!body.is_empty() && crc32fast::hash(body) == number(4)?).then_some(body)
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

    /// A journal with a mission's checkpoint, a record of another version's, and a radio's checkpoint behind it.
    fn with_unknown_record() -> Vec<u8> {
        let (mut journal, mut all) = Journal::open(Memory::default()).unwrap();
        keep(&mut journal, &mut all, &mission(3));
        let mut bytes = journal.into_storage().0;
        frame(&[77, 1, 2, 3], &mut bytes);
        write(&Record::Checkpoint(counter(5)), &mut bytes);
        bytes
    }

    #[test]
    fn a_whole_record_that_is_not_understood_is_no_torn_end() {
        let bytes = with_unknown_record();
        let refused = Journal::open(Memory(bytes.clone())).unwrap_err();
        assert_eq!(refused.kind(), io::ErrorKind::InvalidData);
        let at = bytes.windows(4).position(|it| it == [77, 1, 2, 3]).unwrap() - HEADING_LEN;
        let says = format!("the record at byte {at} is whole");
        assert!(refused.to_string().starts_with(&says), "{refused}");

        // Nor is one that goes on where this version's ends.
        let (journal, _) = Journal::open(Memory::default()).unwrap();
        let mut longer = journal.into_storage().0;
        let known = postcard::to_stdvec(&Record::Checkpoint(counter(5))).unwrap();
        frame(&[known, vec![1]].concat(), &mut longer);
        Journal::open(Memory(longer)).unwrap_err();
    }

    #[test]
    fn in_flight_what_is_understood_counts_and_the_rest_is_still_there_for_the_next_life() {
        let mut bytes = with_unknown_record();
        for life in 2..5 {
            let (mut journal, mut all) = Journal::open_in_flight(Memory(bytes)).unwrap();
            assert!(!journal.is_understood());
            assert_eq!(all.boot(), life);
            assert!(all.holds(&counter(5)) && all.state() == mission::State::default());
            (0..u16::MAX / 4).for_each(|opened| keep(&mut journal, &mut all, &mission(opened)));
            keep(&mut journal, &mut all, &mission(3));
            bytes = journal.into_storage().0;
            Journal::open(Memory(bytes.clone())).unwrap_err();
        }
    }

    #[test]
    fn zeros_at_the_end_are_what_a_disk_had_not_written_yet() {
        let (mut journal, mut all) = Journal::open(Memory::default()).unwrap();
        keep(&mut journal, &mut all, &counter(7));
        let mut bytes = journal.into_storage().0;
        bytes.extend_from_slice(&[0; 512]);
        let (_, found) = Journal::open(Memory(bytes)).unwrap();
        assert!(found.holds(&counter(7)));
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
