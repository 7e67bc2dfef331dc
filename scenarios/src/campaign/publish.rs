//! A campaign's files: the rows in the order of the list, and what they come to.

use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use super::CampaignError;
use super::html::page;
use super::plan::Campaign;
use super::row;
use super::rows::Rows;
use super::summary::{self, Broken, Summary, Tally};
use crate::report::{Complete, Draft, WriteError};

/// A row a run, for a spreadsheet.
pub const RUNS_CSV: &str = "runs.csv";
/// Likewise, a JSON object a line; once it is there, the others are.
pub const RUNS_JSONL: &str = "runs.jsonl";
/// A row a combination: medians and intervals.
pub const SUMMARY_CSV: &str = "summary.csv";
/// The same to look at.
pub const SUMMARY_HTML: &str = "summary.html";

/// All of them, in the order in which they take their places.
pub(super) const PUBLISHED: [&str; 4] = [SUMMARY_HTML, SUMMARY_CSV, RUNS_CSV, RUNS_JSONL];

/// How many of the runs that broke a rule are told.
const BROKEN_MAX: usize = 5;

/// A campaign at its end.
#[derive(Debug)]
pub struct Published {
    /// Which one, as it was first named in its folder.
    pub campaign: Campaign,
    /// What each combination with a run at hand came to, in order.
    pub summaries: Vec<Summary>,
    /// The first of the runs that broke a rule.
    pub broken: Vec<Broken>,
    /// The files that were written, for a person first.
    pub files: Vec<PathBuf>,
}

impl Published {
    /// How many runs broke a rule.
    #[must_use]
    pub fn broken_runs(&self) -> u64 {
        self.summaries.iter().map(|summary| summary.broken).sum()
    }

    /// How many runs kept the rules and did not fly the mission to its end.
    #[must_use]
    pub fn incomplete_runs(&self) -> u64 {
        self.summaries
            .iter()
            .map(|summary| summary.incomplete)
            .sum()
    }
}

/// Writes the files of a campaign from the rows of one shard, or from those of all shards in their order.
///
/// All are complete on the disk, under other names, before the first takes its place. Memory: that of one
/// combination's figures and of the summaries.
pub(super) fn publish(
    dir: &Path,
    campaign: &Campaign,
    sources: &mut [Rows],
) -> Result<Published, CampaignError> {
    let refused = |name: &str, error: io::Error| WriteError::file(&dir.join(name), error);
    let mut jsonl = Draft::create(dir, RUNS_JSONL)?;
    let mut csv = Table::create(dir, RUNS_CSV, row::heading(campaign))?;
    let mut summary_csv = Table::create(dir, SUMMARY_CSV, summary::heading(campaign))?;
    let (mut summaries, mut broken) = (Vec::new(), Vec::new());
    let seeds = campaign.runs() / campaign.combinations();
    for combination in 0..campaign.combinations() {
        let mut tally = Tally::default();
        for run in combination * seeds..(combination + 1) * seeds {
            // Of several shards the run is in one; of a shard by itself it may be in none.
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
                broken.push(Broken::new(campaign, &row));
            }
        }
        let summary = tally.summary(campaign, combination);
        if summary.runs > 0 {
            summary_csv.add(summary.record())?;
            summaries.push(summary);
        }
    }
    let mut html = Draft::create(dir, SUMMARY_HTML)?;
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
        .map(Complete::publish)
        .collect::<Result<_, _>>()?;
    Ok(Published {
        campaign: campaign.clone(),
        summaries,
        broken,
        files,
    })
}

/// A file of comma-separated values on its way.
struct Table {
    path: PathBuf,
    writer: csv::Writer<Draft>,
}

impl Table {
    fn create(dir: &Path, name: &str, heading: Vec<String>) -> Result<Self, WriteError> {
        let mut table = Self {
            path: dir.join(name),
            writer: csv::Writer::from_writer(Draft::create(dir, name)?),
        };
        table.add(heading)?;
        Ok(table)
    }

    fn add(&mut self, record: Vec<String>) -> Result<(), WriteError> {
        let written = self.writer.write_record(record);
        written.map_err(|error| WriteError::file(&self.path, error.into()))
    }

    fn complete(self) -> Result<Complete, WriteError> {
        match self.writer.into_inner() {
            Ok(draft) => draft.complete(),
            Err(error) => Err(WriteError::file(&self.path, error.into_error())),
        }
    }
}
