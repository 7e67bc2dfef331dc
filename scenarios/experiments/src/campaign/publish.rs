//! The files of a complete campaign: rows in list order, and statistics.

use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use super::CampaignError;
use super::html::page;
use super::plan::Campaign;
use super::row;
use super::rows::Rows;
use super::summary::{self, BrokenRun, Summary, Tally};
use crate::output::{CompleteFile, DraftFile, WriteError};

/// One row per run, as CSV.
pub const RUNS_CSV: &str = "runs.csv";
/// One JSON object per line and run; written last, so the other files exist once it does.
pub const RUNS_JSONL: &str = "runs.jsonl";
/// One row per combination: medians and intervals.
pub const SUMMARY_CSV: &str = "summary.csv";
/// The page with plots and tables.
pub const SUMMARY_HTML: &str = "summary.html";

/// All files, in the order of publication.
pub(super) const PUBLISHED: [&str; 4] = [SUMMARY_HTML, SUMMARY_CSV, RUNS_CSV, RUNS_JSONL];

/// Maximum number of broken runs that are listed.
const BROKEN_MAX: usize = 5;

/// A complete campaign.
#[derive(Debug)]
pub struct Published {
    /// The campaign, as first written to its folder.
    pub campaign: Campaign,
    /// Statistics of each combination with a run in this shard, in order.
    pub summaries: Vec<Summary>,
    /// The first runs that broke a rule.
    pub broken: Vec<BrokenRun>,
    /// Written files, the page first.
    pub files: Vec<PathBuf>,
}

impl Published {
    /// Number of runs that broke a rule.
    #[must_use]
    pub fn broken_runs(&self) -> u64 {
        self.summaries.iter().map(|summary| summary.broken).sum()
    }

    /// Number of runs in which a fault of the scenario never happened.
    #[must_use]
    pub fn never_injected_runs(&self) -> u64 {
        let runs = self.summaries.iter().map(|it| it.never_injected);
        runs.sum()
    }

    /// Number of runs that broke no rule but did not complete the mission.
    #[must_use]
    pub fn incomplete_runs(&self) -> u64 {
        self.summaries
            .iter()
            .map(|summary| summary.incomplete)
            .sum()
    }
}

/// Writes the files of a campaign from the rows of one shard, or of all shards in order.
///
/// All files are written and synced under temporary names before the first is renamed. Memory: the figures of one
/// combination, and the summaries.
pub(super) fn publish(
    dir: &Path,
    campaign: &Campaign,
    sources: &mut [Rows],
) -> Result<Published, CampaignError> {
    let refused = |name: &str, error: io::Error| WriteError::file(&dir.join(name), error);
    let mut jsonl = DraftFile::create(dir, RUNS_JSONL)?;
    let mut csv = Table::create(dir, RUNS_CSV, row::heading(campaign))?;
    let (mut summaries, mut broken) = (Vec::new(), Vec::new());
    let seeds = campaign.runs() / campaign.combinations();
    for combination in 0..campaign.combinations() {
        let mut tally = Tally::default();
        for run in combination * seeds..(combination + 1) * seeds {
            // With all shards, exactly one has the run. A single shard may not have it.
            let source = usize::try_from(run).expect("at most RUNS_MAX") % sources.len();
            let Some((row, line)) = sources[source].row(run)? else {
                continue;
            };
            jsonl
                .write_all(line.as_bytes())
                .map_err(|error| refused(RUNS_JSONL, error))?;
            csv.add(row.record(campaign))?;
            tally.add(&row);
            if row.is_broken() && broken.len() < BROKEN_MAX {
                broken.push(BrokenRun::new(campaign, &row));
            }
        }
        let summary = tally.summary(campaign, combination);
        if summary.runs > 0 {
            summaries.push(summary);
        }
    }
    let observed = summary::observed(&summaries);
    let mut summary_csv = Table::create(dir, SUMMARY_CSV, summary::heading(campaign, &observed))?;
    for summary in &summaries {
        summary_csv.add(summary.record(&observed))?;
    }
    let mut html = DraftFile::create(dir, SUMMARY_HTML)?;
    html.write_all(page(campaign, &summaries, &broken).as_bytes())
        .map_err(|error| refused(SUMMARY_HTML, error))?;
    let complete = [
        html.complete()?,
        summary_csv.complete()?,
        csv.complete()?,
        jsonl.complete()?,
    ];
    let files = complete
        .into_iter()
        .map(CompleteFile::publish)
        .collect::<Result<_, _>>()?;
    Ok(Published {
        campaign: campaign.clone(),
        summaries,
        broken,
        files,
    })
}

/// A CSV file being written.
struct Table {
    path: PathBuf,
    writer: csv::Writer<DraftFile>,
}

impl Table {
    fn create(dir: &Path, name: &str, heading: Vec<String>) -> Result<Self, WriteError> {
        let mut table = Self {
            path: dir.join(name),
            writer: csv::Writer::from_writer(DraftFile::create(dir, name)?),
        };
        table.add(heading)?;
        Ok(table)
    }

    fn add(&mut self, record: Vec<String>) -> Result<(), WriteError> {
        let written = self.writer.write_record(record);
        written.map_err(|error| WriteError::file(&self.path, error.into()))
    }

    fn complete(self) -> Result<CompleteFile, WriteError> {
        match self.writer.into_inner() {
            Ok(draft) => draft.complete(),
            Err(error) => Err(WriteError::file(&self.path, error.into_error())),
        }
    }
}
