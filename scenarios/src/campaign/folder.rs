//! A campaign's folder: whose it is, and the rows that are already there.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use muster_runtime::diagnostic::{BadInput, read_text};
use serde::{Deserialize, Serialize};

use super::CampaignError;
use super::plan::{Campaign, PROGRAM};
use super::publish::{PUBLISHED, RUNS_JSONL};
use super::row::Row;
use super::rows::Rows;
use crate::report::{Complete, Draft, Engine, WriteError, make_folder};

/// The file that says whose a folder is.
const CAMPAIGN_JSON: &str = "campaign.json";
/// The rows of a campaign that is not at its end.
const JOURNAL: &str = "runs.journal";

/// What `campaign.json` holds: arguments as they are typed.
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
    /// Whose a folder is; nothing if nobody's.
    ///
    /// # Errors
    /// When it is a file, or has files of a campaign but none that says which.
    pub(super) fn of_folder(dir: &Path) -> Result<Option<Self>, BadInput> {
        if dir.exists() && !dir.is_dir() {
            let help = "a campaign needs a folder, which is made if it is not there";
            return Err(BadInput::without_excerpt(dir, "is a file", help));
        }
        let path = dir.join(CAMPAIGN_JSON);
        let help = "name another folder, or delete this one if nothing in it is needed";
        if !path.exists() {
            let written = |name: &&str| fs::metadata(dir.join(name)).is_ok_and(|it| it.len() > 0);
            let stray = PUBLISHED
                .iter()
                .chain(&[JOURNAL])
                .find(|name| written(name));
            return match stray {
                None => Ok(None),
                Some(name) => {
                    let message = format!("has {name} and no {CAMPAIGN_JSON} that says what of");
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

    /// In what it differs from another, in words; nothing if the rows of either are those of the other.
    ///
    /// The path of the scenario is left out: what the file says is compared.
    pub(super) fn difference(&self, other: &Self) -> Option<String> {
        let (mine, others) = (Identity::from(self), Identity::from(other));
        let list = |values: &[String]| {
            if values.is_empty() {
                "nothing".to_owned()
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
                Some("the scenario or its mission said something else".to_owned())
            }
            None => None,
        }
    }

    /// Refuses a folder that is another campaign's.
    pub(super) fn check_folder(&self, dir: &Path) -> Result<Option<Self>, BadInput> {
        let there = Self::of_folder(dir)?;
        if let Some(difference) = there.as_ref().and_then(|there| there.difference(self)) {
            let message = format!("is the folder of another campaign ({difference})");
            let help = "name another folder with --out, or delete this one to begin anew";
            return Err(BadInput::without_excerpt(dir, message, help));
        }
        Ok(there)
    }

    /// Whether a folder is this campaign's, or nobody's yet.
    #[must_use]
    pub fn may_use(&self, dir: &Path) -> bool {
        self.check_folder(dir).is_ok()
    }

    /// Refuses what another version of the program has begun.
    pub(super) fn check_program(&self, dir: &Path) -> Result<(), BadInput> {
        if self.program == PROGRAM {
            return Ok(());
        }
        let message = format!("is of {}, and this is {PROGRAM}", self.program);
        let help =
            "use the version that made it; two versions may fly the same scenario differently";
        Err(BadInput::without_excerpt(dir, message, help))
    }
}

/// A campaign's folder, which no other process works in as long as this is held.
#[derive(Debug)]
pub(super) struct Folder {
    dir: PathBuf,
    journal: File,
}

impl Folder {
    /// Takes a folder for a campaign, and the campaign as it was first named there.
    ///
    /// # Errors
    /// When it is another campaign's or another process works in it, of which nothing is changed, or when the system
    /// refuses.
    pub(super) fn take(dir: &Path, campaign: &Campaign) -> Result<(Self, Campaign), CampaignError> {
        campaign.check_folder(dir)?;
        make_folder(dir)?;
        let path = dir.join(JOURNAL);
        let open = OpenOptions::new()
            .read(true)
            .append(true)
            .create(true)
            .open(&path);
        let journal = open.map_err(|error| WriteError::file(&path, error))?;
        match journal.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                let message = "another process works in this folder";
                let help = "wait for it, or name another folder with --out";
                return Err(BadInput::without_excerpt(dir, message, help).into());
            }
            Err(TryLockError::Error(error)) => return Err(WriteError::file(&path, error).into()),
        }
        remove_drafts(dir);
        // Looked at again: it may have been taken and left in between.
        let named = match campaign.check_folder(dir)? {
            Some(named) => named,
            None => {
                let mut text = serde_json::to_string_pretty(&Identity::from(campaign))
                    .expect("an identity holds text alone");
                text.push('\n');
                Complete::new(dir, CAMPAIGN_JSON, text.as_bytes())?.publish()?;
                campaign.clone()
            }
        };
        let dir = dir.to_owned();
        Ok((Self { dir, journal }, named))
    }

    pub(super) fn dir(&self) -> &Path {
        &self.dir
    }

    /// The rows that are there: those published if they are all, or else those of the journal, whose last line may
    /// be broken.
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

    /// Cuts the journal to where its rows are good.
    pub(super) fn cut_journal(&self, rows: &Rows) -> Result<(), WriteError> {
        self.journal
            .set_len(rows.good())
            .map_err(|error| WriteError::file(&self.dir.join(JOURNAL), error))
    }

    /// Adds a row to the journal, in one piece; a process that is killed leaves a part of the last one at most.
    pub(super) fn keep(&mut self, row: &Row) -> Result<(), WriteError> {
        let mut line = serde_json::to_string(row).expect("a row holds nothing that JSON can't");
        line.push('\n');
        self.journal
            .write_all(line.as_bytes())
            .map_err(|error| WriteError::file(&self.dir.join(JOURNAL), error))
    }

    /// Lets go of the folder at the campaign's end: the journal's rows are published.
    pub(super) fn close(self) -> Result<(), WriteError> {
        let path = self.dir.join(JOURNAL);
        fs::remove_file(&path).map_err(|error| WriteError::file(&path, error))
    }
}

/// The rows that a finished shard has published; nothing if it is not at its end.
pub(super) fn published(dir: &Path, campaign: &Campaign) -> Result<Option<Rows>, CampaignError> {
    let path = dir.join(RUNS_JSONL);
    let Ok(file) = File::open(&path) else {
        return Ok(None);
    };
    let rows = Rows::scan(&path, file, campaign)?;
    Ok(rows.is_complete().then_some(rows))
}

/// Removes what a killed process was about to publish; none can be at it, for the folder is held.
fn remove_drafts(dir: &Path) {
    let Ok(entries) = fs::read_dir(dir) else {
        return;
    };
    for entry in entries.flatten() {
        if Draft::is_name(&entry.file_name()) {
            // What can't be removed is in nobody's way.
            let _ = fs::remove_file(entry.path());
        }
    }
}
