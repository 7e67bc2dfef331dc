//! Many runs of one scenario: each combination of varied fields with each seed, one row per run, and statistics.
//!
//! The list of runs depends on the [`Campaign`] only: ordered by combination (the first variation changes slowest), then
//! by seed. A shard is every n-th run. Rows go to a journal in the order in which runs end. Files are published in list
//! order once all rows exist. They hold results only, so interruptions and the number of shards don't change their bytes.

mod figures;
mod folder;
mod html;
mod merge;
mod plan;
mod publish;
mod row;
mod rows;
mod run;
mod seeds;
mod shard;
mod statistics;
mod summary;
mod table;

pub use figures::{FIGURES, Figure};
pub(crate) use folder::CAMPAIGN_JSON;
pub use merge::merge;
pub(crate) use plan::PROGRAM;
pub use plan::{COMBINATIONS_MAX, Campaign, RUNS_MAX, Request};
pub use publish::{Published, RUNS_CSV, RUNS_JSONL, SUMMARY_CSV, SUMMARY_HTML};
pub use row::Row;
pub use run::{JOBS_MAX, Progress, RUN_LIMIT, RunOptions, run};
pub use seeds::Seeds;
pub use shard::Shard;
pub use statistics::{Estimate, interval_ranks, median, p99};
pub use summary::{BrokenRun, Summary};
pub use table::table;

use std::io;
use std::path::PathBuf;

use muster_runtime::diagnostic::BadInput;
use muster_scenarios::engine::RunError;
use thiserror::Error;

use crate::output::WriteError;

/// Why a campaign stopped early. Finished rows stay in its folder.
#[derive(Debug, Error)]
pub enum CampaignError {
    /// Operator: a file, an argument, a folder or a seed can't be used. Rows that were stored before stay.
    #[error(transparent)]
    Refused(#[from] BadInput),
    /// Host: a run could not be started.
    #[error(transparent)]
    Run(#[from] RunError),
    /// Host: a file could not be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// Host: a file could not be read back.
    #[error("can't read {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Error of the system.
        source: io::Error,
    },
}
