//! The files of a drone's scenario as they were when its flight began: a process that starts again in the middle of it
//! goes on with these, whatever has become of the files since.

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

/// What they are kept in, in the journal's folder.
const KEPT: &str = "flight.json";

/// The text of all files from which a scenario was read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Files {
    /// The path of the scenario's own.
    scenario: String,
    /// By path, as the scenario leads there.
    texts: BTreeMap<String, String>,
}

/// Where a drone's scenario comes from.
#[derive(Debug)]
pub(crate) enum Origin {
    /// From the files that are named, which are to be kept before it may fly.
    Named(Files),
    /// From those with which the flight began that the drone takes part in.
    Kept,
    /// From the files that are named, though by its journal the drone takes part in a flight: those with which that began
    /// are not there any more, or can't be read.
    Lost,
}

impl Files {
    /// Reads a scenario by `read`, and keeps in mind what was read.
    pub(super) fn record(path: &Path, read: Read<'_>) -> Result<(Plan, Self), BadInput> {
        let texts = RefCell::new(BTreeMap::new());
        let scenario = plan::load_from(path, &|path| {
            let text = read(path)?;
            texts.borrow_mut().insert(name(path), text.clone());
            Ok(text)
        })?;
        let files = Self {
            scenario: name(path),
            texts: texts.into_inner(),
        };
        Ok((scenario, files))
    }

    /// The scenario that they are of.
    fn scenario(&self) -> Result<Plan, BadInput> {
        plan::load_from(Path::new(&self.scenario), &|path| {
            let kept = self.texts.get(&name(path)).cloned();
            kept.ok_or_else(|| {
                let message = "was not kept when the flight began";
                BadInput::without_excerpt(path, message, "give the drone another journal")
            })
        })
    }

    /// Keeps them in a journal's folder, to last.
    pub(crate) fn keep(&self, journal: &Path) -> io::Result<()> {
        let files = serde_json::to_string(self)?;
        let kept = Kept {
            crc32: crc32fast::hash(files.as_bytes()),
            files,
        };
        replace(&journal.join(KEPT), &serde_json::to_vec(&kept)?)
    }

    /// Those that are kept in a journal's folder, if they are there and as they were.
    fn kept(journal: &Path) -> Option<Self> {
        let bytes = fs::read(journal.join(KEPT)).ok()?;
        let kept: Kept = serde_json::from_slice(&bytes).ok()?;
        let is_sound = crc32fast::hash(kept.files.as_bytes()) == kept.crc32;
        is_sound.then(|| serde_json::from_str(&kept.files).ok())?
    }
}

/// The files as they are kept.
#[derive(Serialize, Deserialize)]
struct Kept {
    /// Of `files`.
    crc32: u32,
    /// As JSON.
    files: String,
}

/// Reads the scenario that a drone with this journal flies, or is to fly: that of the flight that it takes part in, or else
/// the named one.
pub(super) fn scenario(
    journal: &Path,
    named: &Path,
    read: Read<'_>,
) -> Result<(Plan, Origin), BadInput> {
    let of_named = || Files::record(named, read);
    // A journal that can't be read is refused when it is opened.
    let checkpoints = journal::peek(journal).ok().flatten();
    if !checkpoints.is_some_and(|it| it.are_of_a_flight()) {
        return of_named().map(|(scenario, files)| (scenario, Origin::Named(files)));
    }
    match Files::kept(journal).and_then(|files| files.scenario().ok()) {
        Some(scenario) => Ok((scenario, Origin::Kept)),
        None => of_named().map(|(scenario, _)| (scenario, Origin::Lost)),
    }
}

fn name(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}
