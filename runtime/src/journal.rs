//! A drone's journal: the checkpoints that its machines are rebuilt from after a restart of its process.
//!
//! # Format
//!
//! The journal begins with [`MAGIC`], which ends with the format's version. Records follow, each with length, checksum, and a
//! number that is one higher than the previous record's. The newest checkpoint of each machine counts. Each start of the
//! process writes a boot record, so that every incarnation has its own number.
//!
//! # Damage
//!
//! Reading ends at the first incomplete record. This is a torn end, left by a kill or a power cut during a write, if no
//! complete record follows and no synced record is missing. Otherwise the journal is damaged. The number of the last synced
//! record is kept outside of the journal. It is written after the records are synced, so it never names a record that is not.
//!
//! A damaged journal, or a complete record of another version, is refused on the ground. In the air the drone lands.

pub mod flights;
mod folder;
mod memory;
mod writer;

use std::path::Path;
use std::{fs, io};

pub use folder::{Folder, FolderError};
pub use memory::{MemoryStorage, PowerCutStorage};
use muster_machines::mission::State;
use muster_machines::node::{Checkpoint, Checkpoints};
use serde::{Deserialize, Serialize};
pub use writer::{QueueFull, WAITING_MAX, WriteReport, Writer};

/// Storage of a journal's bytes.
pub trait Storage {
    /// Reads all bytes.
    ///
    /// # Errors
    /// If the system can't read them.
    fn read(&mut self) -> io::Result<Vec<u8>>;

    /// Appends bytes. Until [`Self::sync`] has returned, some or all of them may be lost.
    ///
    /// # Errors
    /// If the system can't write them; some of them may be stored.
    fn append(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Makes all appended bytes survive a power cut.
    ///
    /// # Errors
    /// If the system can't.
    fn sync(&mut self) -> io::Result<()>;

    /// Replaces all bytes, atomically and durably.
    ///
    /// # Errors
    /// If the system can't; then the old bytes are kept.
    fn replace(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// The number of the last record known to be synced; 0 if unknown.
    ///
    /// # Errors
    /// If the system can't read it.
    fn last_synced(&mut self) -> io::Result<u64>;

    /// Stores the number of the last synced record, outside of the journal. A power cut may revert it.
    ///
    /// # Errors
    /// If the system can't write it.
    fn set_last_synced(&mut self, number: u64) -> io::Result<()>;
}

/// Version of the format.
pub const VERSION: u8 = 2;

/// First bytes of a journal: the file type and the format's version.
pub const MAGIC: [u8; 8] = [b'm', b'u', b's', b't', b'e', b'r', b'J', VERSION];

/// Size above which a journal is compacted to the newest checkpoints, in bytes.
const COMPACT_ABOVE: usize = 256 * 1_024;

/// Bytes before each record's body: its length and its checksum, little-endian.
const HEADING_LEN: usize = 8;

/// Prefix of a record that preserves damaged bytes. It is no valid encoding of a record's number.
const DAMAGED: [u8; 11] = [0xff; 11];

#[derive(Debug, Serialize, Deserialize)]
enum Record {
    /// Start of an incarnation, numbered from 1.
    Boot(u32),
    Checkpoint(Checkpoint),
}

/// A drone's journal.
#[derive(Debug)]
pub struct Journal<S> {
    storage: S,
    len: usize,
    /// Number of the last record.
    number: u64,
    /// Records of other versions, unchanged, and records that preserve damaged bytes.
    unknown: Vec<u8>,
}

impl<S: Storage> Journal<S> {
    /// Opens a journal and starts a new incarnation. Returns the newest checkpoints, with the incarnation's number.
    ///
    /// # Errors
    /// If the storage fails, has no journal of this version, is damaged, or has a complete record of another version. The
    /// journal is unchanged, so that no checkpoint is lost.
    pub fn open(storage: S) -> io::Result<(Self, Checkpoints)> {
        Self::start_incarnation(storage, |found| match &found.defect {
            None => Ok(()),
            Some(defect) => Err(invalid_data(format!(
                "{defect}: the drone's last state is unknown (start it with the version that wrote the journal, or with \
                 another journal)"
            ))),
        })
    }

    /// Opens a journal as [`Self::open`] does, for a drone in the air: damaged and unknown records are skipped.
    ///
    /// They are preserved, so that no later incarnation takes the journal for intact. If there are any, [`Self::is_intact`]
    /// is false: the drone's last state is unknown and it must land.
    ///
    /// # Errors
    /// If the storage fails, or no incarnation number is left.
    pub fn open_in_flight(storage: S) -> io::Result<(Self, Checkpoints)> {
        Self::start_incarnation(storage, |_| Ok(()))
    }

    /// Whether the journal had no damaged or unknown record when it was opened.
    #[must_use]
    pub const fn is_intact(&self) -> bool {
        self.unknown.is_empty()
    }

    fn start_incarnation(
        mut storage: S,
        check: impl FnOnce(&Contents) -> io::Result<()>,
    ) -> io::Result<(Self, Checkpoints)> {
        let bytes = storage.read()?;
        let found = Contents::decode(&bytes, storage.last_synced()?);
        check(&found)?;
        let Some(boot) = found.boot.checked_add(1) else {
            return Err(invalid_data(
                "the journal has no incarnation number left".to_owned(),
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

    /// Adds a checkpoint, which is durable once [`Self::sync`] has returned. `all` are the newest checkpoints, with this one.
    ///
    /// # Errors
    /// If the storage fails.
    pub fn add(&mut self, checkpoint: &Checkpoint, all: &Checkpoints) -> io::Result<()> {
        if self.len > COMPACT_ABOVE + self.unknown.len() {
            return self.compact(all);
        }
        let number = self.number + 1;
        let mut bytes = Vec::new();
        append_record(number, &Record::Checkpoint(checkpoint.clone()), &mut bytes);
        self.storage.append(&bytes)?;
        self.len += bytes.len();
        self.number = number;
        Ok(())
    }

    /// Makes all added checkpoints durable.
    ///
    /// # Errors
    /// If the storage fails.
    pub fn sync(&mut self) -> io::Result<()> {
        self.storage.sync()?;
        self.storage.set_last_synced(self.number)
    }

    /// Closes the journal and returns its storage.
    #[must_use]
    pub fn into_storage(self) -> S {
        self.storage
    }

    fn compact(&mut self, all: &Checkpoints) -> io::Result<()> {
        let mut number = self.number + 1;
        let mut bytes = MAGIC.to_vec();
        append_record(number, &Record::Boot(all.boot()), &mut bytes);
        bytes.extend_from_slice(&self.unknown);
        for checkpoint in all.iter() {
            number += 1;
            append_record(number, &Record::Checkpoint(checkpoint), &mut bytes);
        }
        self.storage.replace(&bytes)?;
        self.len = bytes.len();
        self.number = number;
        self.storage.set_last_synced(number)
    }
}

/// A journal that was read without starting an incarnation.
#[derive(Debug)]
pub enum Peeked {
    /// There is no journal.
    Missing,
    /// All records that are known to be synced are there and can be read.
    Intact(Box<Checkpoints>),
    /// Records are missing, damaged or of another version: the last state is unknown.
    Damaged {
        /// Checkpoints of the records that can be read. Newer ones may be lost.
        readable: Box<Checkpoints>,
        /// The first defect.
        defect: String,
    },
}

impl Peeked {
    /// Checkpoints of the records that can be read. `None` if there is no journal.
    #[must_use]
    pub fn readable(&self) -> Option<&Checkpoints> {
        match self {
            Self::Missing => None,
            Self::Intact(readable) | Self::Damaged { readable, .. } => Some(readable),
        }
    }

    /// Whether the drone may take part in a flight that is not over. True if a damaged journal does not say that it is over.
    #[must_use]
    pub fn may_be_in_flight(&self) -> bool {
        match self {
            Self::Missing => false,
            Self::Intact(checkpoints) => checkpoints.is_flight_ongoing(),
            Self::Damaged { readable, .. } => readable.state() != State::Finished,
        }
    }

    /// Whether the flight certainly never began: the journal is intact, and the drone has heard of no master.
    #[must_use]
    pub fn is_unused(&self) -> bool {
        matches!(self, Self::Intact(it) if it.state() == State::Start && !it.is_flight_ongoing())
    }
}

/// Reads the journal in a folder without starting an incarnation.
///
/// # Errors
/// If the system can't read it.
pub fn peek(folder: &Path) -> io::Result<Peeked> {
    // Read first: a process that writes meanwhile adds records, but removes none.
    let last_synced = folder::last_synced(folder)?;
    let bytes = match fs::read(folder.join(folder::FILE)) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == io::ErrorKind::NotFound => Vec::new(),
        Err(error) => return Err(error),
    };
    if bytes.is_empty() && last_synced == 0 {
        return Ok(Peeked::Missing);
    }
    let contents = Contents::decode(&bytes, last_synced);
    let checkpoints = Box::new(contents.checkpoints);
    Ok(match contents.defect {
        None => Peeked::Intact(checkpoints),
        Some(defect) => Peeked::Damaged {
            readable: checkpoints,
            defect,
        },
    })
}

fn invalid_data(message: String) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, message)
}

/// A journal's decoded contents.
#[derive(Default)]
struct Contents {
    checkpoints: Checkpoints,
    /// Number of the last incarnation; 0 before the first.
    boot: u32,
    /// Number of the last record.
    number: u64,
    /// Records of other versions, and records that preserve damaged bytes.
    unknown: Vec<u8>,
    /// Description of the first defect.
    defect: Option<String>,
}

impl Contents {
    /// Decodes a journal; records up to number `last_synced` must be present.
    fn decode(bytes: &[u8], last_synced: u64) -> Self {
        let mut found = Self::default();
        if bytes.is_empty() {
            found.require_record(last_synced);
            return found;
        }
        let Some(records) = bytes.strip_prefix(&MAGIC) else {
            found.preserve_damaged(
                bytes,
                "the file does not begin like a journal of this version".to_owned(),
            );
            return found;
        };
        let Some(rest) = found.decode_records(records) else {
            return found;
        };
        if has_sound_record(rest) {
            let defect = format!(
                "the record at byte {} is damaged, and intact records follow",
                bytes.len() - rest.len()
            );
            found.preserve_damaged(rest, defect);
        }
        if found.boot == 0 && found.defect.is_none() {
            found.preserve_damaged(rest, "the first record is damaged".to_owned());
        }
        found.require_record(last_synced);
        found
    }

    /// Decodes complete records. Returns the bytes after the last one; `None` after a gap in the numbers, where decoding ends.
    fn decode_records<'a>(&mut self, records: &'a [u8]) -> Option<&'a [u8]> {
        let mut at = 0;
        while let Some(body) = complete_record(&records[at..]) {
            let end = at + HEADING_LEN + body.len();
            let previous = self.number;
            let is_next = |number: u64| {
                number == previous + 1
                    || previous == 0
                    || !self.unknown.is_empty() && number > previous
            };
            // A record with bytes left over is another version's.
            match postcard::take_from_bytes::<(u64, Record)>(body) {
                Ok(((number, record), [])) if is_next(number) => {
                    self.number = number;
                    match record {
                        Record::Boot(number) => self.boot = number,
                        Record::Checkpoint(checkpoint) => {
                            self.checkpoints.keep(checkpoint);
                        }
                    }
                }
                Ok(((number, _), [])) => {
                    let defect = format!(
                        "the record at byte {} has number {number} after {previous}",
                        MAGIC.len() + at
                    );
                    self.preserve_damaged(&records[at..], defect);
                    return None;
                }
                Ok(_) | Err(_) => {
                    self.defect.get_or_insert_with(|| {
                        format!(
                            "the record at byte {} is of another version",
                            MAGIC.len() + at
                        )
                    });
                    self.unknown.extend_from_slice(&records[at..end]);
                }
            }
            at = end;
        }
        Some(&records[at..])
    }

    /// Preserves damaged bytes in a record that no version decodes.
    fn preserve_damaged(&mut self, rest: &[u8], defect: String) {
        self.defect.get_or_insert(defect);
        frame_record(&[&DAMAGED, rest].concat(), &mut self.unknown);
    }

    /// Marks the journal as damaged if synced records are missing.
    fn require_record(&mut self, last_synced: u64) {
        if self.number < last_synced {
            let last = self.number;
            self.preserve_damaged(
                &[],
                format!("the journal ends with record {last}, but record {last_synced} was synced"),
            );
            self.number = last_synced;
        }
    }
}

/// Whether a complete record of this version begins anywhere after the first byte.
fn has_sound_record(bytes: &[u8]) -> bool {
    (1..bytes.len()).any(|at| {
        let body = complete_record(&bytes[at..]);
        body.is_some_and(|it| postcard::from_bytes::<(u64, Record)>(it).is_ok())
    })
}

fn append_record(number: u64, record: &Record, bytes: &mut Vec<u8>) {
    let body = postcard::to_stdvec(&(number, record)).expect("a checkpoint has a binary form");
    frame_record(&body, bytes);
}

/// Appends a record to a journal's bytes: length, checksum and `body`.
///
/// # Panics
/// If the body is longer than 4 GiB.
pub fn frame_record(body: &[u8], bytes: &mut Vec<u8>) {
    let len = u32::try_from(body.len()).expect("a checkpoint is far below 4 GiB");
    bytes.extend_from_slice(&len.to_le_bytes());
    bytes.extend_from_slice(&crc32fast::hash(body).to_le_bytes());
    bytes.extend_from_slice(body);
}

/// The body of the first record, if it is complete. An empty body is not: a disk may have zeros in unwritten places.
fn complete_record(bytes: &[u8]) -> Option<&[u8]> {
    let (heading, rest) = bytes.split_at_checked(HEADING_LEN)?;
    let number = |at: usize| heading[at..at + 4].try_into().map(u32::from_le_bytes).ok();
    let body = rest.get(..number(0)? as usize)?;
    (!body.is_empty() && crc32fast::hash(body) == number(4)?).then_some(body)
}

#[cfg(test)]
mod tests;
