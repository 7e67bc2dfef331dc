//! Flying a campaign: a queue of runs, threads that take from it, and one that keeps what they bring.

use std::num::NonZeroUsize;
use std::path::Path;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::sync::{Mutex, PoisonError};

use super::CampaignError;
use super::folder::Folder;
use super::plan::Campaign;
use super::publish::{Published, publish};
use super::row::Row;
use super::rows::Rows;
use crate::engine::{self, RunError};
use crate::scenario::Scenario;

/// The most runs that are flown at once.
pub const JOBS_MAX: usize = 1_024;

/// How far a campaign is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Runs whose rows are kept.
    pub done: u64,
    /// How many of them were there from the start.
    pub kept: u64,
    /// How many runs there are to be.
    pub total: u64,
    /// How many of this process's runs broke a rule.
    pub broken: u64,
}

/// Flies whatever runs of a campaign have no row in the folder `dir` yet, `jobs` at a time, and publishes them all.
///
/// The scenarios are those that [`Campaign::load`] gave with it. A row is kept as soon as its run ends: whatever
/// stops the process, even at once, the same call goes on from there and comes to the same files.
///
/// # Errors
/// When the folder is another campaign's or another process works in it, a run can't be made, or a file can't be
/// written. All rows that were kept stay.
pub fn run(
    campaign: &Campaign,
    scenarios: &[Scenario],
    dir: &Path,
    jobs: NonZeroUsize,
    mut watcher: impl FnMut(Progress),
) -> Result<Published, CampaignError> {
    let (mut folder, campaign) = Folder::take(dir, campaign)?;
    let mut rows = folder.rows(&campaign)?;
    if !rows.is_complete() {
        folder.cut_journal(&rows)?;
        fly(&campaign, scenarios, &mut folder, &rows, jobs, &mut watcher)?;
        rows = folder.rows(&campaign)?;
    }
    let published = publish(folder.dir(), &campaign, &mut [rows])?;
    folder.close()?;
    Ok(published)
}

fn fly(
    campaign: &Campaign,
    scenarios: &[Scenario],
    folder: &mut Folder,
    rows: &Rows,
    jobs: NonZeroUsize,
    watcher: &mut impl FnMut(Progress),
) -> Result<(), CampaignError> {
    let mut progress = Progress {
        done: rows.found(),
        kept: rows.found(),
        total: campaign.runs_at_hand(),
        broken: 0,
    };
    watcher(progress);
    let pending = campaign
        .shard
        .runs(campaign.runs())
        .filter(|run| !rows.has(*run));
    let queue = Mutex::new(pending);
    let jobs = jobs.get().min(JOBS_MAX);
    std::thread::scope(|scope| {
        let (sender, receiver) = sync_channel(jobs);
        for _ in 0..jobs {
            let (sender, queue) = (sender.clone(), &queue);
            scope.spawn(move || work(campaign, scenarios, queue, &sender));
        }
        drop(sender);
        // Returning drops the receiver: every thread ends after the run that it is at.
        for row in receiver {
            let row = row?;
            folder.keep(&row)?;
            progress.done += 1;
            progress.broken += u64::from(row.is_broken());
            watcher(progress);
        }
        Ok(())
    })
}

/// Takes runs from the queue until it is empty or nobody wants their rows.
fn work(
    campaign: &Campaign,
    scenarios: &[Scenario],
    queue: &Mutex<impl Iterator<Item = u64>>,
    rows: &SyncSender<Result<Row, RunError>>,
) {
    let next = || queue.lock().unwrap_or_else(PoisonError::into_inner).next();
    while let Some(run) = next() {
        let (combination, seed) = campaign.run(run);
        let combination = usize::try_from(combination).expect("at most COMBINATIONS_MAX");
        let scenario = Scenario {
            seed,
            ..scenarios[combination].clone()
        };
        let row = engine::run(&scenario, campaign.engine, None)
            .map(|(report, _)| Row::new(campaign, run, &report));
        if rows.send(row).is_err() {
            return;
        }
    }
}
