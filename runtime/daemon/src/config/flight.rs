//! The stored copy of the scenario's files from the start of a flight. A process that restarts in flight uses this copy,
//! even if the files have changed.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::Path;
use std::{fs, io};

use muster_runtime::diagnostic::BadInput;
use muster_runtime::file::replace;
use muster_runtime::journal;
use muster_runtime::plan::{self, Plan};
use serde::{Deserialize, Serialize};

use super::Read;

/// Name of the copy in the journal's folder.
const FILE_NAME: &str = "flight.json";

/// The text of all files from which a scenario was read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Files {
    /// Path of the scenario's file.
    scenario: String,
    /// Text of each file, by its path as the scenario names it.
    texts: BTreeMap<String, String>,
}

/// Where a drone's scenario comes from.
#[derive(Debug)]
pub(crate) enum Origin {
    /// The named files. They must be stored before the drone may fly.
    Named(Files),
    /// The stored copy of the flight that the drone may take part in.
    Stored,
    /// The named files, although by its journal the drone may take part in a flight: the stored copy is missing or
    /// damaged.
    Lost,
}

impl Files {
    /// Reads a scenario with `read` and records the text of each file.
    pub(super) fn record(path: &Path, read: Read<'_>) -> Result<(Plan, Self), BadInput> {
        let texts = RefCell::new(BTreeMap::new());
        let scenario = plan::load_with(path, &|path| {
            let text = read(path)?;
            texts.borrow_mut().insert(key(path), text.clone());
            Ok(text)
        })?;
        let files = Self {
            scenario: key(path),
            texts: texts.into_inner(),
        };
        Ok((scenario, files))
    }

    /// Parses the scenario.
    fn scenario(&self) -> Result<Plan, BadInput> {
        plan::load_with(Path::new(&self.scenario), &|path| {
            let text = self.texts.get(&key(path)).cloned();
            text.ok_or_else(|| {
                let message = "is missing in the copy from the start of the flight";
                BadInput::without_excerpt(path, message, "give the drone another journal folder")
            })
        })
    }

    /// Stores the files in a journal's folder, durably.
    pub(crate) fn store(&self, journal: &Path) -> io::Result<()> {
        let files = serde_json::to_string(self)?;
        let stored = StoredFiles {
            crc32: crc32fast::hash(files.as_bytes()),
            files,
        };
        replace(&journal.join(FILE_NAME), &serde_json::to_vec(&stored)?)
    }

    /// Loads the copy from a journal's folder. `None` if it is missing or damaged.
    fn load(journal: &Path) -> Option<Self> {
        let bytes = fs::read(journal.join(FILE_NAME)).ok()?;
        let stored: StoredFiles = serde_json::from_slice(&bytes).ok()?;
        let is_sound = crc32fast::hash(stored.files.as_bytes()) == stored.crc32;
        is_sound.then(|| serde_json::from_str(&stored.files).ok())?
    }
}

/// Format of the stored copy.
#[derive(Serialize, Deserialize)]
struct StoredFiles {
    /// CRC-32 of `files`.
    crc32: u32,
    /// [`Files`] as JSON.
    files: String,
}

/// Reads the scenario for a drone with this journal: the stored one if the drone may take part in a flight, otherwise the
/// named one.
pub(super) fn scenario(
    journal: &Path,
    named: &Path,
    read: Read<'_>,
) -> Result<(Plan, Origin), BadInput> {
    let read_named = || Files::record(named, read);
    // A journal that can't be read is refused when it is opened.
    let found = journal::peek(journal);
    if !found.is_ok_and(|it| it.may_be_in_flight()) {
        return read_named().map(|(scenario, files)| (scenario, Origin::Named(files)));
    }
    match Files::load(journal).and_then(|files| files.scenario().ok()) {
        Some(scenario) => Ok((scenario, Origin::Stored)),
        None => read_named().map(|(scenario, _)| (scenario, Origin::Lost)),
    }
}

fn key(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn damaged_copy_is_never_taken_for_another_scenario() {
        let folder = tempfile::tempdir().unwrap();
        let stored = Files {
            scenario: "flight.toml".to_owned(),
            texts: [("flight.toml".to_owned(), "seed = 1\n".repeat(40))].into(),
        };
        stored.store(folder.path()).unwrap();
        let path = folder.path().join(FILE_NAME);
        let intact = fs::read(&path).unwrap();
        let mut random = ChaCha8Rng::seed_from_u64(22);
        let mut found = 0;
        for case in 0..2_000 {
            let mut bytes = intact.clone();
            let at = random.random_range(0..bytes.len());
            match case % 4 {
                0 => bytes[at] ^= 1 << random.random_range(0..8),
                1 => bytes.truncate(at),
                2 => bytes[at..].fill(0),
                _ => drop(bytes.remove(at)),
            }
            fs::write(&path, bytes).unwrap();
            let loaded = Files::load(folder.path());
            found += u32::from(loaded.is_some());
            assert!(loaded.is_none_or(|it| it == stored), "case {case}");
        }
        assert!(found < 200, "{found}");
        fs::remove_file(&path).unwrap();
        assert_eq!(Files::load(folder.path()), None);
    }
}
