//! Running a search: worker threads take plans in the order of their seeds, and one thread adds up the results.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::time::{Duration, Instant};

use muster_scenarios::engine;
use muster_scenarios::report::{Engine, Report, Violation};
use muster_scenarios::scenario::{self, Scenario};

use super::coverage::Coverage;
use super::search::{DrawnPlan, Plan, Search};
use super::shrink::shrink;
use super::state::{self, AcceptedPlan, BrokenPlan, Tally, accepted_exposures};
use crate::campaign::{CampaignError, RunOptions};
use crate::output::{self, CompleteFile, create_folder};

/// Plans per work item; this many are repeated after an interruption.
const CHUNK: u64 = 10;
/// Default wall-clock limit of a plan.
pub const RUN_LIMIT: Duration = Duration::from_secs(60);
/// File of the scenario that breaks a rule, and folder of its report.
const FOUND_TOML: &str = "found.toml";
const FOUND: &str = "found";

/// Progress of a search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Progress {
    /// Plans are run.
    Searching {
        /// Plans run so far.
        plans: u64,
        /// Plans of them run by an earlier process.
        kept: u64,
        /// All plans of the search.
        total: u64,
        /// Total simulated seconds.
        simulated_s: f64,
    },
    /// A plan broke a rule and is being shrunk.
    Shrinking {
        /// Seed of the plan.
        seed: u64,
        /// Remaining faults.
        faults: usize,
        /// Smaller plans tried.
        tried: u64,
    },
}

/// Result of a search.
#[derive(Debug)]
pub struct SearchResult {
    /// Plans run from the first seed, without the one that ended the search.
    pub plans: u64,
    /// Plans of them that broke a rule, if the search kept going.
    pub broken: Vec<BrokenPlan>,
    /// Plans of them in which drones came too close in an exposure that `limits.accept` lists.
    pub accepted: Vec<AcceptedPlan>,
    /// Plans of them in which the remaining drones completed the mission.
    pub completed: u64,
    /// Number of redraws because the values of a plan were incompatible.
    pub redrawn: u64,
    /// Number of combinations of values, including incompatible ones.
    pub combinations: u64,
    /// Total simulated seconds.
    pub simulated_s: f64,
    /// Total simulated seconds of all drones.
    pub drone_s: f64,
    /// Processor time, in core-seconds.
    pub core_s: f64,
    /// Injected faults by state of the target.
    pub coverage: Coverage,
    /// The first plan that broke a rule, unless the search kept going.
    pub finding: Option<Finding>,
}

/// A shrunk plan that breaks a rule.
#[derive(Debug)]
pub struct Finding {
    /// Seed of the plan.
    pub seed: u64,
    /// Command that finds it again.
    pub command: String,
    /// Number of faults before and after shrinking.
    pub faults: (usize, usize),
    /// Smaller plans tried.
    pub tried: u64,
    /// Violation of the shrunk plan.
    pub violation: Violation,
    /// Scenario file that reproduces the violation.
    pub scenario: PathBuf,
    /// Report of that scenario.
    pub report: Box<Report>,
    /// Files of that report.
    pub written: output::ReportFiles,
}

/// Result of one work item.
struct ChunkResult {
    chunk: u64,
    tally: Tally,
    breaking: Option<BreakingPlan>,
}

/// The drawn plan that breaks a rule and ends the search.
struct BreakingPlan {
    plan: Plan,
    violation: Violation,
}

/// Runs the plans of a search, `options.jobs` at a time, until one breaks a rule, and shrinks that one.
///
/// With [`Request::keeps_going`](super::Request::keeps_going), it runs all plans. The progress is stored in the folder
/// `dir`; the same call resumes.
///
/// `around` wraps the work of each thread.
///
/// # Errors
/// If the folder belongs to another search, all drawn values are incompatible, a run can't be started, or a file can't be
/// written.
pub fn run(
    search: &Search,
    dir: &Path,
    options: RunOptions,
    around: &(dyn Fn(&mut dyn FnMut()) + Sync),
    mut watcher: impl FnMut(Progress),
) -> Result<SearchResult, CampaignError> {
    let mut tally = state::load(search, dir)?;
    let breaking = fly(search, dir, options, around, &mut tally, &mut watcher)?;
    let mut finding = None;
    if let Some(breaking) = breaking {
        let (run_limit, mut found) = (options.run_limit, Ok(None));
        around(&mut || {
            found = find(search, dir, run_limit, &breaking, &mut watcher).map(Some);
        });
        finding = found?;
    }
    Ok(SearchResult {
        plans: tally.plans,
        broken: tally.broken,
        accepted: tally.accepted,
        completed: tally.completed,
        redrawn: tally.redrawn,
        combinations: search.combinations(),
        simulated_s: tally.simulated_s,
        drone_s: tally.drone_s,
        core_s: tally.core_s,
        coverage: tally.coverage,
        finding,
    })
}

/// Runs the plans and adds them to the tally. Returns the plan that ends the search, if any.
fn fly(
    search: &Search,
    dir: &Path,
    options: RunOptions,
    around: &(dyn Fn(&mut dyn FnMut()) + Sync),
    tally: &mut Tally,
    watcher: &mut impl FnMut(Progress),
) -> Result<Option<BreakingPlan>, CampaignError> {
    let (kept, total) = (tally.plans, search.seeds().number());
    let mut report_progress = |tally: &Tally| {
        watcher(Progress::Searching {
            plans: tally.plans,
            kept,
            total,
            simulated_s: tally.simulated_s,
        });
    };
    report_progress(tally);
    // Chunks in order, from the first plan that is not stored.
    let next = AtomicU64::new(0);
    let chunks = (total - kept).div_ceil(CHUNK);
    std::thread::scope(|scope| {
        let (sender, receiver) = sync_channel(options.jobs.get());
        for _ in 0..options.jobs.get() {
            let (sender, next) = (sender.clone(), &next);
            scope.spawn(move || {
                around(&mut || {
                    work(
                        search,
                        options.run_limit,
                        (kept, total),
                        (next, chunks),
                        &sender,
                    );
                });
            });
        }
        drop(sender);
        let (mut waiting, mut next_chunk) = (BTreeMap::new(), 0);
        // Returning drops the receiver, so each thread stops after its current chunk.
        for result in receiver {
            let result = result?;
            if result.breaking.is_some() {
                // Chunks are taken in order, so all earlier ones are finished or running. They still count.
                next.store(chunks, Ordering::Relaxed);
            }
            waiting.insert(result.chunk, result);
            while let Some(result) = waiting.remove(&next_chunk) {
                tally.add(&result.tally);
                state::store(search, dir, tally)?;
                report_progress(tally);
                if result.breaking.is_some() {
                    return Ok(result.breaking);
                }
                next_chunk += 1;
            }
        }
        Ok(None)
    })
}

/// Runs chunks of plans until none is left or the receiver is dropped.
fn work(
    search: &Search,
    run_limit: Duration,
    (kept, total): (u64, u64),
    (next, chunks): (&AtomicU64, u64),
    results: &SyncSender<Result<ChunkResult, CampaignError>>,
) {
    loop {
        let chunk = next.fetch_add(1, Ordering::Relaxed);
        if chunk >= chunks {
            return;
        }
        let first = kept + chunk * CHUNK;
        let result = fly_chunk(search, run_limit, first..(first + CHUNK).min(total));
        let result = result.map(|(tally, breaking)| ChunkResult {
            chunk,
            tally,
            breaking,
        });
        if results.send(result).is_err() {
            return;
        }
    }
}

/// Runs some plans: all, or up to the first that breaks a rule.
fn fly_chunk(
    search: &Search,
    run_limit: Duration,
    places: std::ops::Range<u64>,
) -> Result<(Tally, Option<BreakingPlan>), CampaignError> {
    let started = Instant::now();
    let mut tally = Tally::default();
    let mut breaking = None;
    for place in places {
        let DrawnPlan {
            plan,
            scenario,
            redrawn,
        } = search.draw(search.seeds().at(place))?;
        let outcome = engine::fly_within(run_limit, &scenario, Engine::Events)?;
        if let Some(violation) = outcome.violation() {
            let exposures = accepted_exposures(&scenario, &outcome, &violation);
            if !exposures.is_empty() {
                tally.accept(plan.seed, &exposures, violation.what);
            } else if search.keeps_going() {
                tally.broken.push(BrokenPlan {
                    seed: plan.seed,
                    rule: violation.rule,
                    what: violation.what,
                });
            } else {
                breaking = Some(BreakingPlan { plan, violation });
                break;
            }
        }
        let simulated_s = outcome.ended.as_secs_f64();
        tally.plans += 1;
        tally.redrawn += redrawn;
        tally.simulated_s += simulated_s;
        tally.drone_s += simulated_s * f64::from(scenario.plan.nodes());
        tally.completed += u64::from(outcome.is_completed(&scenario));
        tally
            .coverage
            .count(search.own_faults(), &scenario.faults, &outcome.injections);
    }
    tally.core_s = started.elapsed().as_secs_f64();
    Ok((tally, breaking))
}

/// Shrinks a plan that breaks a rule, and writes it as a scenario with its report.
fn find(
    search: &Search,
    dir: &Path,
    run_limit: Duration,
    BreakingPlan { plan, violation }: &BreakingPlan,
    watcher: &mut impl FnMut(Progress),
) -> Result<Finding, CampaignError> {
    let breaks = |scenario: &Scenario| {
        let outcome = engine::fly_within(run_limit, scenario, Engine::Events)?;
        Ok(outcome.violation().is_some_and(|it| {
            it.rule == violation.rule && accepted_exposures(scenario, &outcome, &it).is_empty()
        }))
    };
    let (small, tried) = shrink(search, plan, breaks, watcher)?;
    let mission = search.mission(&small)?;
    let mission_name = mission
        .file_name()
        .map_or_else(|| "mission.waypoints".into(), |name| name.to_string_lossy());
    let seed = format!("{}..={}", plan.seed, plan.seed);
    let mut command = search.command(seed.parse().expect("one seed is a range"));
    if run_limit != RUN_LIMIT {
        command.push_str(&format!(" --run-limit {}", run_limit.as_secs()));
    }
    let text = search.written(&small, &mission_name)?;
    let text = format!("# Breaks a rule, as found by: {command}\n\n{text}");
    create_folder(dir)?;
    CompleteFile::new(dir, &mission_name, scenario::read(&mission)?.as_bytes())?.publish()?;
    let path = CompleteFile::new(dir, FOUND_TOML, text.as_bytes())?.publish()?;
    // The written file must reproduce the violation, so it is read back.
    let reread = scenario::load(&path, &[])?;
    let (report, flight) = engine::run_within(run_limit, &reread, Engine::Events)?;
    let folder = dir.join(FOUND);
    let _ = fs::remove_dir_all(&folder);
    let written = output::write(&folder, &report, &flight)?;
    // A run that exceeded its time limit may stay within it the next time.
    let reproduced = report.violations.first().cloned();
    Ok(Finding {
        seed: plan.seed,
        command,
        faults: (plan.faults.len(), small.faults.len()),
        tried,
        violation: reproduced.unwrap_or_else(|| violation.clone()),
        scenario: path,
        report: Box::new(report),
        written,
    })
}

#[cfg(test)]
mod tests;
