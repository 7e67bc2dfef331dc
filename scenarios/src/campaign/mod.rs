//! Many runs of one scenario: every combination of varied fields with every seed, a row each, and what they come to.
//!
//! The list of runs follows from the [`Campaign`] alone: by combination, the first variation slowest, then by seed.
//! A shard is every n-th run of it. Rows are kept in a journal as runs end, in whatever order; the files that are
//! published when all are there are in the list's order and hold nothing else than what the runs come to, so that
//! they are the same bytes however often the campaign was interrupted and over however many shards it was spread.

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

pub use merge::merge;
pub(crate) use plan::PROGRAM;
pub use plan::{COMBINATIONS_MAX, Campaign, RUNS_MAX, Request};
pub use publish::{Published, RUNS_CSV, RUNS_JSONL, SUMMARY_CSV, SUMMARY_HTML};
pub use row::Row;
pub use run::{Effort, JOBS_MAX, Progress, RUN_LIMIT, run};
pub use seeds::Seeds;
pub use shard::Shard;
pub use statistics::{Estimate, interval_ranks};
pub use summary::{Broken, FIGURES, Figure, Summary};
pub use table::table;

use std::io;
use std::path::PathBuf;

use muster_runtime::diagnostic::BadInput;
use thiserror::Error;

use crate::engine::RunError;
use crate::report::WriteError;

/// Why a campaign came to no end. Rows that were finished by then are kept in its folder.
#[derive(Debug, Error)]
pub enum CampaignError {
    /// The operator's: a file, an argument or a folder can't be used. Nothing was written.
    #[error(transparent)]
    Refused(#[from] BadInput),
    /// The machine's: a run could not be made.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The machine's: a file could not be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The machine's: a file that was just written could not be read back.
    #[error("can't read {}", path.display())]
    Read {
        /// Which one.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
}
