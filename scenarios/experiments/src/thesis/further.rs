//! Runs of the scenarios with further seeds, on several threads.

use std::num::NonZeroUsize;
use std::sync::mpsc::sync_channel;
use std::sync::{Mutex, PoisonError};

use muster_scenarios::engine::{self, Engine, RunError};
use muster_scenarios::report::Report;
use muster_scenarios::scenario::Scenario;

/// Engine of these runs.
pub(super) const ENGINE: Engine = Engine::Events;

/// Number of valid seeds, from 0.
const SEEDS: u64 = i64::MAX as u64 + 1;

/// `runs` consecutive seeds from `first`; 0 follows the highest.
pub(super) fn seeds(first: u64, runs: u32) -> Vec<u64> {
    let after = |place| (first % SEEDS + u64::from(place)) % SEEDS;
    (0..runs).map(after).collect()
}

/// Runs each scenario with each seed, `jobs` runs at a time. Returns the reports by scenario, in the order of the seeds.
///
/// Calls `progress` with the number of finished runs and of all runs after each run.
pub(super) fn fly<const SCENARIOS: usize>(
    scenarios: [&Scenario; SCENARIOS],
    seeds: &[u64],
    jobs: NonZeroUsize,
    mut progress: impl FnMut(usize, usize),
) -> Result<[Vec<Report>; SCENARIOS], RunError> {
    let total = SCENARIOS * seeds.len();
    let queue = Mutex::new((0..SCENARIOS).flat_map(|of| seeds.iter().map(move |seed| (of, *seed))));
    let next = || queue.lock().unwrap_or_else(PoisonError::into_inner).next();
    let mut flown = std::thread::scope(|scope| {
        let jobs = jobs.get().min(total);
        let (sender, receiver) = sync_channel(jobs);
        for _ in 0..jobs {
            let (sender, next) = (sender.clone(), &next);
            scope.spawn(move || {
                while let Some((of, seed)) = next() {
                    let mut scenario = scenarios[of].clone();
                    scenario.seed = seed;
                    let run = engine::run(&scenario, ENGINE, None).map(|(report, _)| (of, report));
                    if sender.send(run).is_err() {
                        return;
                    }
                }
            });
        }
        drop(sender);
        // Returning drops the receiver, so each thread stops after its current run.
        let mut flown = Vec::with_capacity(total);
        for run in receiver {
            flown.push(run?);
            progress(flown.len(), total);
        }
        Ok(flown)
    })?;
    let place = |report: &Report| seeds.iter().position(|seed| *seed == report.seed);
    flown.sort_by_key(|(_, report)| place(report));
    let mut reports = [const { Vec::new() }; SCENARIOS];
    for (of, report) in flown {
        reports[of].push(report);
    }
    Ok(reports)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seeds_are_consecutive_and_wrap_around() {
        assert_eq!(seeds(7, 3), [7, 8, 9]);
        let highest = i64::MAX as u64;
        assert_eq!(seeds(highest - 1, 4), [highest - 1, highest, 0, 1]);
    }
}
