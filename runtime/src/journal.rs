//! A drone's journal: what its machines are built from after its process has ended, however it ended.
//!
//! It begins with [`MAGIC`], which ends with the version of its form. Records are only added, each with its length, a
//! checksum, and a number that is one higher than that of the record before. Of each machine's checkpoints the newest counts.
//! Each start of the process is a record of its own, so that no two lives have one number.
//!
//! Reading ends at the first record that is not whole. Where nothing that is whole stands behind it and nothing is missing
//! that was known to last, that is the torn end that a process leaves which was killed while it wrote, and a disk whose power
//! failed. Otherwise it is damage. How far the records are known to last is written beside them, after they do, and is lost
//! before they are. Damage, and a record that is whole and not understood, for it is another version's, are never passed over
//! on the ground; in the air the drone comes down.

mod folder;
mod writer;

use std::path::Path;
use std::{fs, io};

pub use folder::{Folder, FolderError};
use muster_machines::node::{Checkpoint, Checkpoints};
use serde::{Deserialize, Serialize};
pub use writer::{Writer, Written};

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

    /// The number of the record up to which all were last known to last; 0 where that is not known.
    ///
    /// # Errors
    /// When the system can't read it.
    fn lasting(&mut self) -> io::Result<u64>;

    /// Notes it, outside of the records. A loss of power may take the note back.
    ///
    /// # Errors
    /// When the system can't write it.
    fn note_lasting(&mut self, number: u64) -> io::Result<()>;
}

/// What a journal begins with: its kind, and the version of its form.
pub const MAGIC: [u8; 8] = *b"musterJ\x01";

/// The size from which on a journal is written anew with what still counts, in bytes.
const COMPACT_ABOVE: usize = 256 * 1_024;

/// How many bytes stand before each record: its length and its checksum, lowest byte first.
const HEADING_LEN: usize = 8;

/// What a record begins with that keeps bytes which are not understood; no number of a record is encoded so.
const DAMAGED: [u8; 11] = [0xff; 11];

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
    /// That of the last record.
    number: u64,
    /// Records that this version does not understand, as they were found, and what was damaged.
    unknown: Vec<u8>,
}

impl<S: Storage> Journal<S> {
    /// Opens a journal for another life of the drone's process; what it is built from, and the number of that life.
    ///
    /// # Errors
    /// When the storage fails, holds something that is no journal of this version, is damaged, or has a whole record that this
    /// version does not understand: what a journal said must not be forgotten. The journal is as it was then.
    pub fn open(storage: S) -> io::Result<(Self, Checkpoints)> {
        Self::begin(storage, |found| match &found.trouble {
            None => Ok(()),
            Some(trouble) => Err(refused(format!(
                "{trouble}: what the drone has done can't be told (start it with the version that wrote it, or with another \
                 journal)"
            ))),
        })
    }

    /// Likewise, for a drone in the air, which can't be refused: what is damaged or not understood is passed over, and kept as
    /// it is, so that no later life takes the journal for whole. Where there is any ([`Self::is_understood`]) it is not known
    /// what the drone was doing, and it is to come down.
    ///
    /// # Errors
    /// When the storage fails, or has no number left for another life.
    pub fn open_in_flight(storage: S) -> io::Result<(Self, Checkpoints)> {
        Self::begin(storage, |_| Ok(()))
    }

    /// Whether all that it had when it was opened was understood.
    #[must_use]
    pub const fn is_understood(&self) -> bool {
        self.unknown.is_empty()
    }

    fn begin(
        mut storage: S,
        check: impl FnOnce(&Found) -> io::Result<()>,
    ) -> io::Result<(Self, Checkpoints)> {
        let bytes = storage.read()?;
        let found = Found::in_bytes(&bytes, storage.lasting()?);
        check(&found)?;
        let Some(boot) = found.boot.checked_add(1) else {
            return Err(refused(
                "it has no number left for another incarnation".to_owned(),
            ));
        };
        let mut checkpoints = found.checkpoints;
        checkpoints.begin_incarnation(boot);
        let mut journal = Self {
            storage,
            len: 0,
            number: found.number,
            unknown: found.unknown,
        };
        journal.compact(&checkpoints)?;
        Ok((journal, checkpoints))
    }

    /// Adds a checkpoint, `all` being the newest of each machine with it. It will last once [`Self::sync`] has returned.
    ///
    /// # Errors
    /// When the storage fails.
    pub fn add(&mut self, checkpoint: &Checkpoint, all: &Checkpoints) -> io::Result<()> {
        if self.len > COMPACT_ABOVE + self.unknown.len() {
            return self.compact(all);
        }
        let number = self.number + 1;
        let mut bytes = Vec::new();
        write(number, &Record::Checkpoint(checkpoint.clone()), &mut bytes);
        self.storage.append(&bytes)?;
        self.len += bytes.len();
        self.number = number;
        Ok(())
    }

    /// Returns once all that was added outlives a loss of power.
    ///
    /// # Errors
    /// When the storage fails.
    pub fn sync(&mut self) -> io::Result<()> {
        self.storage.sync()?;
        self.storage.note_lasting(self.number)
    }

    /// Closes it and hands its storage back.
    #[must_use]
    pub fn into_storage(self) -> S {
        self.storage
    }

    fn compact(&mut self, all: &Checkpoints) -> io::Result<()> {
        let mut number = self.number + 1;
        let mut bytes = MAGIC.to_vec();
        write(number, &Record::Boot(all.boot()), &mut bytes);
        bytes.extend_from_slice(&self.unknown);
        for checkpoint in all.iter() {
            number += 1;
            write(number, &Record::Checkpoint(checkpoint), &mut bytes);
        }
        self.storage.replace(&bytes)?;
        self.len = bytes.len();
        self.number = number;
        self.storage.note_lasting(number)
    }
}

/// What the journal in a folder says, as far as it is understood; nothing where there is none. No life begins.
///
/// # Errors
/// When the system can't read it.
pub fn peek(folder: &Path) -> io::Result<Option<Checkpoints>> {
    match fs::read(folder.join(folder::FILE)) {
        Ok(bytes) => Ok((!bytes.is_empty()).then(|| Found::in_bytes(&bytes, 0).checkpoints)),
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
    /// That of the last record.
    number: u64,
    /// What is not understood, as records.
    unknown: Vec<u8>,
    /// What is wrong with the first of it, in words.
    trouble: Option<String>,
}

impl Found {
    /// What bytes say of which the records up to that number are known to last.
    fn in_bytes(bytes: &[u8], lasting: u64) -> Self {
        let mut found = Self::default();
        if bytes.is_empty() {
            found.misses(lasting);
            return found;
        }
        let Some(records) = bytes.strip_prefix(&MAGIC) else {
            found.gives_up(
                bytes,
                "it does not begin as a journal of this version does".to_owned(),
            );
            return found;
        };
        let mut at = 0;
        while let Some(body) = whole(&records[at..]) {
            let end = at + HEADING_LEN + body.len();
            let before = found.number;
            let is_next = |number: u64| {
                number == before + 1 || before == 0 || !found.unknown.is_empty() && number > before
            };
            // A longer one than this version's is another version's.
            match postcard::take_from_bytes::<(u64, Record)>(body) {
                Ok(((number, record), [])) if is_next(number) => {
                    found.number = number;
                    match record {
                        Record::Boot(number) => found.boot = number,
                        Record::Checkpoint(checkpoint) => {
                            found.checkpoints.keep(checkpoint);
                        }
                    }
                }
                Ok(((number, _), [])) => {
                    let trouble = format!(
                        "the record at byte {} has number {number} behind {before}",
                        MAGIC.len() + at
                    );
                    found.gives_up(&records[at..], trouble);
                    return found;
                }
                Ok(_) | Err(_) => {
                    found.trouble.get_or_insert_with(|| {
                        format!("the record at byte {} is whole, and none that this version understands", MAGIC.len() + at)
                    });
                    found.unknown.extend_from_slice(&records[at..end]);
                }
            }
            at = end;
        }
        let rest = &records[at..];
        if has_sound_record(rest) {
            let trouble = format!(
                "the record at byte {} is damaged, and sound ones stand behind it",
                MAGIC.len() + at
            );
            found.gives_up(rest, trouble);
        }
        if found.boot == 0 && found.trouble.is_none() {
            found.gives_up(rest, "its beginning is damaged".to_owned());
        }
        found.misses(lasting);
        found
    }

    /// What is left is damaged: it is kept as a record that no version understands.
    fn gives_up(&mut self, rest: &[u8], trouble: String) {
        self.trouble.get_or_insert(trouble);
        frame(&[&DAMAGED, rest].concat(), &mut self.unknown);
    }

    /// It is damaged if records are missing that were known to last.
    fn misses(&mut self, lasting: u64) {
        if self.number < lasting {
            let last = self.number;
            self.gives_up(
                &[],
                format!(
                    "it ends with record {last}, though record {lasting} had been written to last"
                ),
            );
            self.number = lasting;
        }
    }
}

/// Whether a record that is whole and understood begins anywhere in bytes that don't begin with one.
fn has_sound_record(bytes: &[u8]) -> bool {
    (1..bytes.len()).any(|at| {
        let body = whole(&bytes[at..]);
        body.is_some_and(|it| postcard::from_bytes::<(u64, Record)>(it).is_ok())
    })
}

fn write(number: u64, record: &Record, bytes: &mut Vec<u8>) {
    let body = postcard::to_stdvec(&(number, record)).expect("a checkpoint has a binary form");
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
mod tests;
