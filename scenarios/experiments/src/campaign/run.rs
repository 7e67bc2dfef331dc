//! Running a campaign: worker threads take runs from a queue, and one thread stores the rows.

use std::num::NonZeroUsize;
use std::path::Path;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use muster_runtime::diagnostic::BadInput;
use muster_scenarios::engine;
use muster_scenarios::report::quoted;
use muster_scenarios::scenario::{self, Override, Scenario};

use super::CampaignError;
use super::folder::Folder;
use super::plan::Campaign;
use super::publish::{Published, publish};
use super::row::Row;
use super::rows::Rows;

/// Maximum number of concurrent runs.
pub const JOBS_MAX: usize = 1_024;
/// Default wall-clock limit of a run.
pub const RUN_LIMIT: Duration = Duration::from_secs(600);

/// Number of concurrent runs, and the time limit of each.
#[derive(Debug, Clone, Copy)]
pub struct RunOptions {
    /// Concurrent runs.
    pub jobs: NonZeroUsize,
    /// Wall-clock limit of a run. A run that exceeds it is stopped and breaks rule 10.
    pub run_limit: Duration,
}

/// Progress of a campaign.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Runs with a stored row.
    pub done: u64,
    /// Rows that existed before this process.
    pub kept: u64,
    /// All runs of the shard.
    pub total: u64,
    /// Runs of this process that broke a rule.
    pub broken: u64,
}

/// Simulates the runs without a row in the folder `dir`, `options.jobs` at a time, and publishes all rows.
///
/// `scenarios` are those of [`Campaign::load`]. A row is stored as soon as its run ends. After an interruption, the same
/// call resumes and gives the same files. Only runs that exceed their time limit depend on the machine.
///
/// # Errors
/// If the folder belongs to another campaign or is in use, a run can't be started, or a file can't be written. Stored
/// rows stay.
pub fn run(
    campaign: &Campaign,
    scenarios: &[Scenario],
    dir: &Path,
    options: RunOptions,
    mut watcher: impl FnMut(Progress),
) -> Result<Published, CampaignError> {
    let (mut folder, campaign) = Folder::open(dir, campaign)?;
    let mut rows = folder.rows(&campaign)?;
    if !rows.is_complete() {
        folder.truncate_journal(&rows)?;
        fly(
            &campaign,
            scenarios,
            &mut folder,
            &rows,
            options,
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
    options: RunOptions,
    watcher: &mut impl FnMut(Progress),
) -> Result<(), CampaignError> {
    let mut progress = Progress {
        done: rows.found(),
        kept: rows.found(),
        total: campaign.shard_runs(),
        broken: 0,
    };
    watcher(progress);
    let pending = campaign
        .shard
        .runs(campaign.runs())
        .filter(|run| !rows.has(*run));
    let queue = Mutex::new(pending);
    let jobs = options.jobs.get().min(JOBS_MAX);
    let run_limit = options.run_limit;
    std::thread::scope(|scope| {
        let (sender, receiver) = sync_channel(jobs);
        for _ in 0..jobs {
            let (sender, queue) = (sender.clone(), &queue);
            scope.spawn(move || work(campaign, scenarios, run_limit, queue, &sender));
        }
        drop(sender);
        // Returning drops the receiver, so each thread stops after its current run.
        for row in receiver {
            let row = row?;
            folder.append(&row)?;
            progress.done += 1;
            progress.broken += u64::from(row.is_broken());
            watcher(progress);
        }
        Ok(())
    })
}

/// Simulates runs from the queue until it is empty or the receiver is dropped.
fn work(
    campaign: &Campaign,
    scenarios: &[Scenario],
    run_limit: Duration,
    queue: &Mutex<impl Iterator<Item = u64>>,
    rows: &SyncSender<Result<Row, CampaignError>>,
) {
    let next = || queue.lock().unwrap_or_else(PoisonError::into_inner).next();
    while let Some(run) = next() {
        let (combination, seed) = campaign.run(run);
        let place = usize::try_from(combination).expect("at most COMBINATIONS_MAX");
        let scenario = &scenarios[place];
        let read_anew =
            |overrides: &[Override]| scenario::load(Path::new(&scenario.name), overrides);
        let row = scenario
            .with_seed_from(seed, read_anew)
            .map_err(|error| refused(campaign, (combination, seed), &error).into())
            .and_then(|scenario| {
                let (report, _) = engine::run_within(run_limit, &scenario, campaign.engine)?;
                Ok(Row::new(campaign, run, &report))
            });
        if rows.send(row).is_err() {
            return;
        }
    }
}

/// The places that a seed draws can't be flown.
fn refused(campaign: &Campaign, (combination, seed): (u64, u64), error: &BadInput) -> BadInput {
    let message = format!("seed {seed} draws places that can't be flown: {error}");
    let set = campaign.overrides(combination).into_iter();
    let set = set.chain([Override::seed(&seed.to_string())]);
    let set: String = set
        .map(|it| format!(" --set {}", quoted(&it.to_string())))
        .collect();
    let help = format!(
        "`muster check {}{set}` shows more; set `seed` of the formation to fly the same places with all seeds",
        quoted(&campaign.scenario)
    );
    BadInput::without_excerpt(Path::new(&campaign.scenario), message, help)
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use muster_scenarios::report::Engine;
    use muster_scenarios::scenario;
    use tempfile::TempDir;

    use super::super::Request;
    use super::super::shard::Shard;
    use super::*;

    fn thesis() -> PathBuf {
        Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/..")).join("thesis-1.toml")
    }

    /// Runs thesis-1 with these fields and seeds in a new folder, one run at a time.
    fn run_thesis(
        set: &[Override],
        seeds: &str,
        run_limit: Duration,
    ) -> (TempDir, Result<Published, CampaignError>) {
        let (campaign, scenarios) = Campaign::load(&Request {
            scenario: thesis(),
            engine: Engine::Events,
            set: set.to_vec(),
            vary: Vec::new(),
            seeds: seeds.parse().unwrap(),
            shard: Shard::WHOLE,
        })
        .unwrap();
        let folder = tempfile::tempdir().unwrap();
        let options = RunOptions {
            jobs: NonZeroUsize::MIN,
            run_limit,
        };
        let published = run(&campaign, &scenarios, folder.path(), options, |_| ());
        (folder, published)
    }

    fn overrides(set: &[&str]) -> Vec<Override> {
        set.iter().map(|it| it.parse().unwrap()).collect()
    }

    #[test]
    fn run_is_that_of_its_command_also_where_its_seed_draws_the_places() {
        let set = overrides(&["formation.kind=random", "formation.drones=5"]);
        let (folder, published) = run_thesis(&set, "3..5", RUN_LIMIT);
        published.unwrap();
        let rows = std::fs::read_to_string(folder.path().join("runs.jsonl")).unwrap();
        for seed in ["3", "4"] {
            let set: Vec<_> = (set.iter().cloned())
                .chain([Override::seed(seed)])
                .collect();
            let alone = scenario::load(&thesis(), &set).unwrap();
            let (report, _) = engine::run(&alone, Engine::Events, None).unwrap();
            assert!(
                rows.contains(&report.trace.unwrap()),
                "seed {seed}:\n{rows}"
            );
        }
    }

    #[test]
    fn places_that_cannot_be_flown_end_a_campaign_with_the_command_that_shows_why() {
        let set = overrides(&[
            "formation.kind=random",
            "formation.drones=30",
            "formation.spacing_m=20",
            "mission.file=paddock",
            "limits.altitude_max_m=30",
        ]);
        let (_folder, published) = run_thesis(&set, "3..4", RUN_LIMIT);
        let Err(CampaignError::Refused(error)) = published else {
            panic!("{published:?}");
        };
        let shown = error.rendered();
        assert!(
            shown.contains("seed 3 draws places that can't be flown"),
            "{shown}"
        );
        assert!(shown.contains("--set seed=3"), "{shown}");
    }

    #[test]
    fn run_that_exceeds_its_limit_has_a_row_and_the_campaign_continues() {
        let (_folder, published) = run_thesis(&[], "0..3", Duration::ZERO);
        let published = published.unwrap();
        let broken: Vec<_> = published
            .broken
            .iter()
            .map(|it| (it.run, it.rule))
            .collect();
        assert_eq!(broken, [0, 1, 2].map(|run| (run, Some(10))));
        let [first, ..] = &published.broken[..] else {
            panic!("no broken run is listed");
        };
        assert_eq!(
            first.what,
            "the run did not end within 0 s of wall-clock time"
        );
        assert!(first.command.contains("--seed 0"), "{}", first.command);
    }
}
