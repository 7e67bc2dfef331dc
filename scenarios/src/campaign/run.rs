//! Flying a campaign: a queue of runs, threads that take from it, and one that keeps what they bring.

use std::num::NonZeroUsize;
use std::path::Path;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

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
/// Wall-clock time that a run of a campaign may take, unless the operator says otherwise.
pub const RUN_LIMIT: Duration = Duration::from_secs(600);

/// How many runs are flown at once, and how long each may take.
#[derive(Debug, Clone, Copy)]
pub struct Effort {
    /// Runs at once.
    pub jobs: NonZeroUsize,
    /// Wall-clock time for each run. One that takes longer is ended, and has broken rule 10.
    pub run_limit: Duration,
}

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

/// Flies whatever runs of a campaign have no row in the folder `dir` yet, `effort.jobs` at a time, and publishes them all.
///
/// The scenarios are those that [`Campaign::load`] gave with it. A row is kept as soon as its run ends: whatever
/// stops the process, even at once, the same call goes on from there and comes to the same files. Only for a run that
/// reached its limit do the files depend on the machine.
///
/// # Errors
/// When the folder is another campaign's or another process works in it, a run can't be made, or a file can't be
/// written. All rows that were kept stay.
pub fn run(
    campaign: &Campaign,
    scenarios: &[Scenario],
    dir: &Path,
    effort: Effort,
    mut watcher: impl FnMut(Progress),
) -> Result<Published, CampaignError> {
    let (mut folder, campaign) = Folder::take(dir, campaign)?;
    let mut rows = folder.rows(&campaign)?;
    if !rows.is_complete() {
        folder.cut_journal(&rows)?;
        fly(
            &campaign,
            scenarios,
            &mut folder,
            &rows,
            effort,
            &mut watcher,
        )?;
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
    effort: Effort,
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
    let jobs = effort.jobs.get().min(JOBS_MAX);
    let run_limit = effort.run_limit;
    std::thread::scope(|scope| {
        let (sender, receiver) = sync_channel(jobs);
        for _ in 0..jobs {
            let (sender, queue) = (sender.clone(), &queue);
            scope.spawn(move || work(campaign, scenarios, run_limit, queue, &sender));
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
    run_limit: Duration,
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
        let row = engine::run_within(run_limit, &scenario, campaign.engine)
            .map(|(report, _)| Row::new(campaign, run, &report));
        if rows.send(row).is_err() {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Request;
    use super::super::shard::Shard;
    use super::*;
    use crate::report::Engine;

    #[test]
    fn a_run_that_reaches_its_limit_has_a_row_and_the_next_is_flown() {
        let (campaign, scenarios) = Campaign::load(&Request {
            scenario: Path::new(env!("CARGO_MANIFEST_DIR")).join("thesis-1.toml"),
            engine: Engine::Events,
            set: Vec::new(),
            vary: Vec::new(),
            seeds: "0..3".parse().unwrap(),
            shard: Shard::WHOLE,
        })
        .unwrap();
        let folder = tempfile::tempdir().unwrap();
        let effort = Effort {
            jobs: NonZeroUsize::MIN,
            run_limit: Duration::ZERO,
        };
        let published = run(&campaign, &scenarios, folder.path(), effort, |_| ()).unwrap();
        let broken: Vec<_> = published
            .broken
            .iter()
            .map(|it| (it.run, it.rule))
            .collect();
        assert_eq!(broken, [0, 1, 2].map(|run| (run, Some(10))));
        let [first, ..] = &published.broken[..] else {
            panic!("no run is told of");
        };
        assert_eq!(
            first.what,
            "the run did not end within 0 s of wall-clock time"
        );
        assert!(first.command.contains("--seed 0"), "{}", first.command);
    }
}
