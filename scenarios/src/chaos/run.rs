//! Making a search: threads that take plans in the order of their seeds, and one that adds up what they bring.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::time::{Duration, Instant};

use muster_runtime::diagnostic::read_text;

use super::coverage::Coverage;
use super::search::{Drawn, Plan, Search};
use super::shrink::shrink;
use super::state::{self, Broken, Tally};
use crate::campaign::{CampaignError, Effort};
use crate::engine;
use crate::report::{self, Complete, Engine, Report, Violation, is_completed, make_folder};
use crate::scenario::{self, Scenario};

/// How many plans a thread takes at once, and so how many are flown again after an interruption.
const CHUNK: u64 = 50;
/// Wall-clock time that a plan may be flown for, unless the operator says otherwise.
pub const RUN_LIMIT: Duration = Duration::from_secs(60);
/// The scenario that breaks a rule, and the folder of its report.
const FOUND_TOML: &str = "found.toml";
const FOUND: &str = "found";

/// How far a search is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Progress {
    /// Plans are flown.
    Searching {
        /// How many were flown so far.
        plans: u64,
        /// How many of them were flown by an earlier process.
        kept: u64,
        /// How many there are to be.
        total: u64,
        /// For how long they flew, in simulated seconds.
        simulated_s: f64,
    },
    /// One broke a rule, and is made smaller.
    Shrinking {
        /// Its seed.
        seed: u64,
        /// How many faults it has left.
        faults: usize,
        /// How many smaller ones were tried.
        tried: u64,
    },
}

/// What a search came to.
#[derive(Debug)]
pub struct Searched {
    /// Plans that were flown, from the first seed on; without the one that the search ended with.
    pub plans: u64,
    /// Those of them that broke a rule, where the search went on.
    pub broken: Vec<Broken>,
    /// How many of them flew their mission to its end, for whoever was left.
    pub completed: u64,
    /// How many times the values of a plan were drawn anew, as they did not fit each other.
    pub redrawn: u64,
    /// How many combinations of values there are, those included that don't fit each other.
    pub combinations: u64,
    /// For how long they flew, in simulated seconds.
    pub simulated_s: f64,
    /// All their drones together.
    pub drone_s: f64,
    /// How long cores were at it, in seconds.
    pub core_s: f64,
    /// Which faults befell, and what they met.
    pub coverage: Coverage,
    /// The first plan that broke a rule, unless the search went on.
    pub finding: Option<Finding>,
}

/// A plan that breaks a rule, made as small as it gets.
#[derive(Debug)]
pub struct Finding {
    /// The seed that it was drawn from.
    pub seed: u64,
    /// The command that finds it again.
    pub command: String,
    /// How many faults it had, and how many are left.
    pub faults: (usize, usize),
    /// How many smaller plans were tried.
    pub tried: u64,
    /// The rule that the small one breaks.
    pub violation: Violation,
    /// The scenario file that breaks it by itself.
    pub scenario: PathBuf,
    /// What came of it.
    pub report: Box<Report>,
    /// The files of its report.
    pub written: report::Written,
}

/// What a thread brings.
struct Brought {
    chunk: u64,
    tally: Tally,
    last: Option<Last>,
}

/// The plan that a search ends with, as it was drawn: it breaks a rule.
struct Last {
    plan: Plan,
    violation: Violation,
}

/// Flies the plans of a search, `effort.jobs` at a time, until one breaks a rule, and makes that one small, unless it is to
/// go on. How far the search is, is kept in the folder `dir`: whatever stops the process, the same call goes on from there.
///
/// Whatever flies is called within `around`, on each thread by itself.
///
/// # Errors
/// When the folder is another search's, no drawn values fit each other, a run can't be made, or a file can't be
/// written.
pub fn run(
    search: &Search,
    dir: &Path,
    effort: Effort,
    around: &(dyn Fn(&mut dyn FnMut()) + Sync),
    mut watcher: impl FnMut(Progress),
) -> Result<Searched, CampaignError> {
    let mut tally = state::begin(search, dir)?;
    let last = fly(search, dir, effort, around, &mut tally, &mut watcher)?;
    let mut finding = None;
    if let Some(last) = last {
        let (run_limit, mut found) = (effort.run_limit, Ok(None));
        around(&mut || {
            found = find(search, dir, run_limit, &last, &mut watcher).map(Some);
        });
        finding = found?;
    }
    Ok(Searched {
        plans: tally.plans,
        broken: tally.broken,
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

/// Adds what is flown to the tally; the plan that the search ends with.
fn fly(
    search: &Search,
    dir: &Path,
    effort: Effort,
    around: &(dyn Fn(&mut dyn FnMut()) + Sync),
    tally: &mut Tally,
    watcher: &mut impl FnMut(Progress),
) -> Result<Option<Last>, CampaignError> {
    let (kept, total) = (tally.plans, search.seeds().number());
    let mut told = |tally: &Tally| {
        watcher(Progress::Searching {
            plans: tally.plans,
            kept,
            total,
            simulated_s: tally.simulated_s,
        });
    };
    told(tally);
    // Chunks from the first that is not kept on, in order.
    let next = AtomicU64::new(0);
    let chunks = (total - kept).div_ceil(CHUNK);
    std::thread::scope(|scope| {
        let (sender, receiver) = sync_channel(effort.jobs.get());
        for _ in 0..effort.jobs.get() {
            let (sender, next) = (sender.clone(), &next);
            scope.spawn(move || {
                around(&mut || {
                    work(
                        search,
                        effort.run_limit,
                        (kept, total),
                        (next, chunks),
                        &sender,
                    );
                });
            });
        }
        drop(sender);
        let (mut early, mut due) = (BTreeMap::new(), 0);
        // Returning drops the receiver: every thread ends after the chunk that it is at.
        for brought in receiver {
            let brought = brought?;
            if brought.last.is_some() {
                // Those before this one are still looked at: they are taken in order, so all of them are under way.
                next.store(chunks, Ordering::Relaxed);
            }
            early.insert(brought.chunk, brought);
            while let Some(brought) = early.remove(&due) {
                tally.add(&brought.tally);
                state::keep(search, dir, tally)?;
                told(tally);
                if brought.last.is_some() {
                    return Ok(brought.last);
                }
                due += 1;
            }
        }
        Ok(None)
    })
}

/// Takes chunks of plans until there are none left or nobody wants them.
fn work(
    search: &Search,
    run_limit: Duration,
    (kept, total): (u64, u64),
    (next, chunks): (&AtomicU64, u64),
    brings: &SyncSender<Result<Brought, CampaignError>>,
) {
    loop {
        let chunk = next.fetch_add(1, Ordering::Relaxed);
        if chunk >= chunks {
            return;
        }
        let first = kept + chunk * CHUNK;
        let brought = fly_chunk(search, run_limit, first..(first + CHUNK).min(total));
        let brought = brought.map(|(tally, last)| Brought { chunk, tally, last });
        if brings.send(brought).is_err() {
            return;
        }
    }
}

/// Flies some plans, all or up to the first that breaks a rule.
fn fly_chunk(
    search: &Search,
    run_limit: Duration,
    places: std::ops::Range<u64>,
) -> Result<(Tally, Option<Last>), CampaignError> {
    let started = Instant::now();
    let mut tally = Tally::default();
    let mut last = None;
    for place in places {
        let Drawn {
            plan,
            scenario,
            redrawn,
        } = search.draw(search.seeds().at(place))?;
        let outcome = engine::fly_within(run_limit, &scenario, Engine::Events)?;
        if let Some(violation) = outcome.violations.first() {
            let violation = Violation::from(violation);
            if !search.keeps_going() {
                last = Some(Last { plan, violation });
                break;
            }
            tally.broken.push(Broken {
                seed: plan.seed,
                rule: violation.rule,
                what: violation.what,
            });
        }
        let simulated_s = outcome.ended.as_secs_f64();
        tally.plans += 1;
        tally.redrawn += redrawn;
        tally.simulated_s += simulated_s;
        tally.drone_s += simulated_s * f64::from(scenario.plan.nodes());
        tally.completed += u64::from(is_completed(&scenario, &outcome.swarms[0].recorder));
        tally
            .coverage
            .count(search.own_faults(), &scenario.faults, &outcome.struck);
    }
    tally.core_s = started.elapsed().as_secs_f64();
    Ok((tally, last))
}

/// Makes a plan that breaks a rule small, and writes it down as a scenario.
fn find(
    search: &Search,
    dir: &Path,
    run_limit: Duration,
    Last { plan, violation }: &Last,
    watcher: &mut impl FnMut(Progress),
) -> Result<Finding, CampaignError> {
    let breaks = |scenario: &Scenario| {
        let outcome = engine::fly_within(run_limit, scenario, Engine::Events)?;
        let first = outcome.violations.first();
        Ok(first.is_some_and(|it| it.rule == violation.rule))
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
    make_folder(dir)?;
    Complete::new(dir, &mission_name, read_text(&mission)?.as_bytes())?.publish()?;
    let path = Complete::new(dir, FOUND_TOML, text.as_bytes())?.publish()?;
    // What was written, and nothing else, is what breaks the rule.
    let reread = scenario::load(&path, &[])?;
    let (report, flight) = engine::run_within(run_limit, &reread, Engine::Events)?;
    let folder = dir.join(FOUND);
    let _ = fs::remove_dir_all(&folder);
    let written = report::write(&folder, &report, &flight)?;
    // A run that reached its limit may end within it the next time.
    let again = report.violations.first().cloned();
    Ok(Finding {
        seed: plan.seed,
        command,
        faults: (plan.faults.len(), small.faults.len()),
        tried,
        violation: again.unwrap_or_else(|| violation.clone()),
        scenario: path,
        report: Box::new(report),
        written,
    })
}

#[cfg(test)]
mod tests {
    use std::num::NonZeroUsize;

    use super::super::search::Request;
    use super::*;

    /// Small swarms over radios that lose nothing.
    const SIMPLE: [&str; 4] = [
        "formation.drones=5",
        "radio.model=range",
        "radio.loss=0",
        "radio.burst_loss=0",
    ];

    fn search(seeds: &str) -> Search {
        let scenario = Path::new(env!("CARGO_MANIFEST_DIR")).join("chaos.toml");
        Search::load(&Request {
            scenario,
            set: SIMPLE.iter().map(|it| it.parse().unwrap()).collect(),
            seeds: seeds.parse().unwrap(),
            keeps_going: false,
        })
        .unwrap()
    }

    fn effort(jobs: usize) -> Effort {
        Effort {
            jobs: NonZeroUsize::new(jobs).unwrap(),
            run_limit: RUN_LIMIT,
        }
    }

    fn searched(seeds: &str, dir: &Path, jobs: usize) -> (u64, f64, Coverage) {
        let searched = run(&search(seeds), dir, effort(jobs), &|fly| fly(), |_| ()).unwrap();
        assert!(searched.finding.is_none());
        (searched.plans, searched.simulated_s, searched.coverage)
    }

    #[test]
    fn a_search_that_is_gone_on_with_comes_to_what_it_would_have_come_to() {
        let [whole, parts] = [(); 2].map(|()| tempfile::tempdir().unwrap());
        let (plans, simulated_s, coverage) = searched("0..70", whole.path(), 2);
        assert_eq!(plans, 70);
        searched("0..20", parts.path(), 1);
        let again = searched("0..70", parts.path(), 1);
        assert!((again.1 - simulated_s).abs() < 1e-6);
        assert_eq!((again.0, again.2), (plans, coverage));
    }

    #[test]
    fn a_plan_that_reaches_its_limit_is_a_finding_and_so_is_each_try_to_make_it_small() {
        let folder = tempfile::tempdir().unwrap();
        let effort = Effort {
            run_limit: Duration::ZERO,
            ..effort(2)
        };
        let searched = run(&search("3..9"), folder.path(), effort, &|fly| fly(), |_| ());
        let finding = searched.unwrap().finding.unwrap();
        let what = "the run did not end within 0 s of wall-clock time";
        assert_eq!((finding.seed, finding.violation.rule), (3, 10));
        assert_eq!(finding.violation.what, what);
        assert_eq!(finding.faults.1, 0, "every smaller plan reaches it, too");
        let repeats = search("3..9").command("3..4".parse().unwrap());
        assert_eq!(finding.command, format!("{repeats} --run-limit 0"));
        assert!(finding.scenario.exists());
    }

    #[test]
    fn a_search_that_goes_on_lists_the_plans_that_break_a_rule() {
        let folder = tempfile::tempdir().unwrap();
        let mut search = search("3..9");
        search.request.keeps_going = true;
        let effort = |seconds| Effort {
            run_limit: Duration::from_secs(seconds),
            ..effort(2)
        };
        let searched = run(&search, folder.path(), effort(0), &|fly| fly(), |_| ()).unwrap();
        let broken: Vec<_> = searched
            .broken
            .iter()
            .map(|it| (it.seed, it.rule))
            .collect();
        assert_eq!(broken, [3, 4, 5, 6, 7, 8].map(|seed| (seed, 10)));
        assert!(searched.finding.is_none() && searched.plans == 6);
        search.request.seeds = "3..12".parse().unwrap();
        let more = run(&search, folder.path(), effort(60), &|fly| fly(), |_| ()).unwrap();
        assert_eq!(
            (more.plans, more.broken),
            (9, searched.broken),
            "it went on"
        );
    }

    #[test]
    fn a_folder_of_another_search_is_refused_and_left_alone() {
        let dir = tempfile::tempdir().unwrap();
        searched("0..2", dir.path(), 1);
        let kept = fs::read(dir.path().join(state::CHAOS_JSON)).unwrap();
        let refused = run(&search("5..7"), dir.path(), effort(1), &|fly| fly(), |_| ());
        let message = refused.unwrap_err().to_string();
        assert!(message.contains("another search"), "{message}");
        assert_eq!(fs::read(dir.path().join(state::CHAOS_JSON)).unwrap(), kept);
    }
}
