//! A campaign's folder: its identity, its lock and its journal of rows.

use std::fs::{self, File, OpenOptions};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use muster_runtime::diagnostic::{BadInput, read_text};
use muster_runtime::file::Lock;
use muster_scenarios::report::Engine;
use serde::{Deserialize, Serialize};

use super::CampaignError;
use super::plan::{Campaign, PROGRAM};
use super::publish::{PUBLISHED, RUNS_JSONL};
use super::row::Row;
use super::rows::Rows;
use crate::chaos::CHAOS_JSON;
use crate::output::{CompleteFile, DraftFile, WriteError, create_folder};

/// File that identifies the campaign of a folder.
pub(crate) const CAMPAIGN_JSON: &str = "campaign.json";
/// Journal: rows of a campaign that is not complete.
const JOURNAL: &str = "runs.journal";

/// Content of `campaign.json`: the arguments as typed.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Identity {
    program: String,
    scenario: String,
    content: String,
    engine: Engine,
    set: Vec<String>,
    vary: Vec<String>,
    seeds: String,
    shard: String,
}

impl From<&Campaign> for Identity {
    fn from(campaign: &Campaign) -> Self {
        Self {
            program: campaign.program.clone(),
            scenario: campaign.scenario.clone(),
            content: campaign.content.clone(),
            engine: campaign.engine,
            set: campaign.set.iter().map(ToString::to_string).collect(),
            vary: campaign.vary.iter().map(ToString::to_string).collect(),
            seeds: campaign.seeds.to_string(),
            shard: campaign.shard.to_string(),
        }
    }
}

impl TryFrom<Identity> for Campaign {
    type Error = String;

    fn try_from(identity: Identity) -> Result<Self, String> {
        let campaign = Self {
            program: identity.program,
            scenario: identity.scenario,
            content: identity.content,
            engine: identity.engine,
            set: identity
                .set
                .iter()
                .map(|it| it.parse())
                .collect::<Result<_, _>>()?,
            vary: identity
                .vary
                .iter()
                .map(|it| it.parse())
                .collect::<Result<_, _>>()?,
            seeds: identity.seeds.parse()?,
            shard: identity.shard.parse()?,
        };
        campaign.check_size()?;
        Ok(campaign)
    }
}

impl Campaign {
    /// Reads the campaign of a folder; `None` if the folder is unused.
    ///
    /// # Errors
    /// If `dir` is a file, or if it has files of a campaign but no valid `campaign.json`.
    pub(super) fn read_folder(dir: &Path) -> Result<Option<Self>, BadInput> {
        if dir.exists() && !dir.is_dir() {
            let help = "name a folder; it is created if it does not exist";
            return Err(BadInput::without_excerpt(dir, "is a file", help));
        }
        let path = dir.join(CAMPAIGN_JSON);
        let help = "name another folder, or delete this one";
        if !path.exists() {
            if dir.join(CHAOS_JSON).exists() {
                let message =
                    format!("holds a search of `muster chaos` ({CHAOS_JSON}), no campaign");
                let help = "name another folder with --out";
                return Err(BadInput::without_excerpt(dir, message, help));
            }
            let has_content =
                |name: &&str| fs::metadata(dir.join(name)).is_ok_and(|it| it.len() > 0);
            let stray = PUBLISHED
                .iter()
                .chain(&[JOURNAL])
                .find(|name| has_content(name));
            return match stray {
                None => Ok(None),
                Some(name) => {
                    let message = format!("has {name} but no {CAMPAIGN_JSON}");
                    Err(BadInput::without_excerpt(dir, message, help))
                }
            };
        }
        let campaign = serde_json::from_str::<Identity>(&read_text(&path)?)
            .map_err(|error| error.to_string())
            .and_then(Self::try_from)
            .map_err(|error| BadInput::without_excerpt(&path, error, help))?;
        Ok(Some(campaign))
    }

    /// First difference from another campaign, in words; `None` if both have the same rows.
    ///
    /// The content of the scenario counts, not its path.
    pub(super) fn difference(&self, other: &Self) -> Option<String> {
        let (mine, others) = (Identity::from(self), Identity::from(other));
        let list = |values: &[String]| {
            if values.is_empty() {
                "none".to_owned()
            } else {
                values.join(" ")
            }
        };
        let pairs = [
            ("program", mine.program, others.program),
            ("engine", mine.engine.to_string(), others.engine.to_string()),
            ("set", list(&mine.set), list(&others.set)),
            ("vary", list(&mine.vary), list(&others.vary)),
            ("seeds", mine.seeds, others.seeds),
            ("shard", mine.shard, others.shard),
        ];
        let different = pairs.into_iter().find(|(_, mine, others)| mine != others);
        match different {
            Some((what, mine, others)) => Some(format!("{what}: {mine}, not {others}")),
            None if self.content != other.content => {
                Some("the scenario or its mission changed".to_owned())
            }
            None => None,
        }
    }

    /// Reads the campaign of a folder and refuses one that belongs to another campaign.
    pub(super) fn check_folder(&self, dir: &Path) -> Result<Option<Self>, BadInput> {
        let existing = Self::read_folder(dir)?;
        if let Some(difference) = existing.as_ref().and_then(|it| it.difference(self)) {
            let message = format!("belongs to another campaign ({difference})");
            let help = "name another folder with --out, or delete this one to start again";
            return Err(BadInput::without_excerpt(dir, message, help));
        }
        Ok(existing)
    }

    /// Whether a folder belongs to this campaign or is unused.
    #[must_use]
    pub fn can_use(&self, dir: &Path) -> bool {
        self.check_folder(dir).is_ok()
    }

    /// Refuses a campaign of another program version.
    pub(super) fn check_program(&self, dir: &Path) -> Result<(), BadInput> {
        if self.program == PROGRAM {
            return Ok(());
        }
        let message = format!("was written by {}; this is {PROGRAM}", self.program);
        let help =
            "use the version that wrote it; two versions may simulate a scenario differently";
        Err(BadInput::without_excerpt(dir, message, help))
    }
}

/// A campaign's folder, locked against other processes.
#[derive(Debug)]
pub(super) struct Folder {
    dir: PathBuf,
    journal: File,
    _lock: Lock,
}

impl Folder {
    /// Creates or opens the folder of a campaign, and returns the campaign as first written there.
    ///
    /// # Errors
    /// If the folder belongs to another campaign or another process uses it (it stays unchanged), or if the system refuses.
    pub(super) fn open(dir: &Path, campaign: &Campaign) -> Result<(Self, Campaign), CampaignError> {
        campaign.check_folder(dir)?;
        create_folder(dir)?;
        let path = dir.join(JOURNAL);
        let open = OpenOptions::new()
            .read(true)
            .append(true)
            .create(true)
            .open(&path);
        let journal = open.map_err(|error| WriteError::file(&path, error))?;
        let lock = Lock::of(&journal).map_err(|error| WriteError::file(&path, error))?;
        let lock = lock.ok_or_else(|| {
            let message = "is in use by another process";
            let help = "wait until it ends, or name another folder with --out";
            BadInput::without_excerpt(dir, message, help)
        })?;
        remove_drafts(dir);
        // Checked again: another process may have used the folder before the lock.
        let original = match campaign.check_folder(dir)? {
            Some(original) => original,
            None => {
                let mut text = serde_json::to_string_pretty(&Identity::from(campaign))
                    .expect("an identity holds only text");
                text.push('\n');
                CompleteFile::new(dir, CAMPAIGN_JSON, text.as_bytes())?.publish()?;
                campaign.clone()
            }
        };
        let dir = dir.to_owned();
        let folder = Self {
            dir,
            journal,
            _lock: lock,
        };
        Ok((folder, original))
    }

    pub(super) fn dir(&self) -> &Path {
        &self.dir
    }

    /// The existing rows: the published ones if complete, else those of the journal. The journal's last line may be torn.
    pub(super) fn rows(&self, campaign: &Campaign) -> Result<Rows, CampaignError> {
        let published = self.dir.join(RUNS_JSONL);
        let journal = self.dir.join(JOURNAL);
        if let Ok(file) = File::open(&published) {
            let rows = Rows::scan(&published, file, campaign)?;
            if rows.is_complete() {
                return Ok(rows);
            }
        }
        let reopened = File::open(&journal).map_err(|source| CampaignError::Read {
            path: journal.clone(),
            source,
        })?;
        Rows::scan(&journal, reopened, campaign)
    }

    /// Truncates the journal after its last valid row.
    pub(super) fn truncate_journal(&self, rows: &Rows) -> Result<(), WriteError> {
        self.journal
            .set_len(rows.valid_len())
            .map_err(|error| WriteError::file(&self.dir.join(JOURNAL), error))
    }

    /// Appends a row to the journal with one write. A killed process leaves at most one torn row.
    pub(super) fn append(&mut self, row: &Row) -> Result<(), WriteError> {
        let mut line = serde_json::to_string(row).expect("all values of a row are valid JSON");
        line.push('\n');
        self.journal
            .write_all(line.as_bytes())
            .map_err(|error| WriteError::file(&self.dir.join(JOURNAL), error))
    }

    /// Removes the journal and the lock, once the rows are published.
    pub(super) fn close(self) -> Result<(), WriteError> {
        let path = self.dir.join(JOURNAL);
        fs::remove_file(&path).map_err(|error| WriteError::file(&path, error))
    }
}

/// The published rows of a shard; `None` if it is not complete.
pub(super) fn published(dir: &Path, campaign: &Campaign) -> Result<Option<Rows>, CampaignError> {
    let path = dir.join(RUNS_JSONL);
    let Ok(file) = File::open(&path) else {
        return Ok(None);
    };
    let rows = Rows::scan(&path, file, campaign)?;
    Ok(rows.is_complete().then_some(rows))
}

/// Removes the drafts of a killed process. No other process writes drafts, because the folder is locked.
fn remove_drafts(dir: &Path) {
    let Ok(entries) = fs::read_dir(dir) else {
        return;
    };
    for entry in entries.flatten() {
        if DraftFile::is_name(&entry.file_name()) {
            // A draft that stays does no harm.
            let _ = fs::remove_file(entry.path());
        }
    }
}
