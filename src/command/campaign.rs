mod slurm;
mod spread;

use std::io;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Args;
use muster_experiments::campaign::{
    self, Campaign, JOBS_MAX, Published, RUN_LIMIT, Request, RunOptions, Seeds, Shard,
};
use muster_experiments::output;
use muster_runtime::text::plural;
use muster_scenarios::scenario::{Override, Variation};

use super::overrides::check_distinct;
use super::sim::EngineName;
use super::{Failure, Outcome, folder, numbers, terminal};

/// Largest accepted run limit, in seconds: a week.
const RUN_LIMIT_MAX_S: u64 = 604_800;

/// Simulate a scenario many times and show medians with 95 % confidence intervals.
///
/// Runs every combination of the varied values with every seed. Writes one row per run (runs.csv, runs.jsonl) and a
/// summary (summary.csv, summary.html). An interrupted campaign resumes with the same command and gives the same bytes.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  muster campaign thesis-1 --seeds 0..20
  muster campaign thesis-1 --seeds 0..6 --vary radio.loss=0,0.1 --out runs/loss
  muster campaign thesis-1 --seeds 1..=6 --set radio.loss=0.1 --shard 1/2

Exit code 3 if a run broke a rule; 4 if no rule was broken but a mission is incomplete.
At most 10,000,000 runs and 10,000 combinations.")]
pub(crate) struct Arguments {
    /// A scenario file, or the name of a shipped scenario (`muster list`).
    #[arg(value_name = "SCENARIO")]
    scenario: PathBuf,
    /// Random seeds of each combination: A..B excludes B, A..=B includes it.
    #[arg(long, value_name = "A..B", allow_hyphen_values = true)]
    seeds: Seeds,
    /// Vary a field over several values, for example radio.loss=0,0.1 or faults=[],[{...}]; may be repeated for all combinations.
    #[arg(long, value_name = "KEY=V1,V2,…")]
    vary: Vec<Variation>,
    /// Set a field of the scenario in every run, for example radio.range_m=250; may be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<Override>,
    /// Engine that runs the drones; both give the same flights.
    #[arg(long, value_enum, default_value_t = EngineName::Events)]
    engine: EngineName,
    /// Run only shard I of N; `muster campaign-merge` joins the shards.
    #[arg(
        long,
        value_name = "I/N",
        default_value = "1/1",
        hide_default_value = true
    )]
    shard: Shard,
    /// Run on the hosts of a hosts file instead of this machine: muster is sent to each, and the shards are joined. Hosts need
    /// this machine's processor and system.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["shard", "jobs"])]
    hosts: Option<PathBuf>,
    /// Write a script for Slurm instead of running: an array job of N shards, which are queued again if their node is lost, and
    /// a job that joins them.
    #[arg(long, value_name = "N", conflicts_with_all = ["shard", "hosts", "jobs"],
          value_parser = numbers::whole::<u32>(1..=1_000), allow_negative_numbers = true)]
    slurm: Option<u32>,
    /// Number of parallel runs [default: one per core]
    #[arg(long, value_name = "N", value_parser = jobs, allow_negative_numbers = true)]
    jobs: Option<NonZeroUsize>,
    /// Wall-clock limit of a run; a longer run breaks rule 10 and the campaign continues
    #[arg(long, value_name = "SECONDS", value_parser = run_limit, allow_negative_numbers = true, default_value_t = RUN_LIMIT.as_secs())]
    run_limit: u64,
    /// Output folder; resumes a campaign found there [default: runs/SCENARIO-campaign or -campaign-I-of-N, with -2, -3, …
    /// appended if another campaign has the folder]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// Join the shards of a campaign; the result equals an undivided campaign byte for byte.
#[derive(Debug, Args)]
#[command(
    after_help = "Example, with two shards written with --out part-1 and --out part-2:
  muster campaign-merge part-1 part-2 --out whole"
)]
pub(crate) struct MergeArguments {
    /// Folders of all shards, in any order; they are not changed.
    #[arg(required = true, value_name = "DIR")]
    shards: Vec<PathBuf>,
    /// Output folder.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

pub(crate) fn jobs(text: &str) -> Result<NonZeroUsize, String> {
    let jobs = text
        .parse()
        .ok()
        .filter(|jobs: &NonZeroUsize| jobs.get() <= JOBS_MAX);
    jobs.ok_or_else(|| format!("a whole number from 1 to {JOBS_MAX}"))
}

pub(crate) fn run_limit(text: &str) -> Result<u64, String> {
    let seconds = text.parse().ok();
    let seconds = seconds.filter(|seconds| (1..=RUN_LIMIT_MAX_S).contains(seconds));
    seconds.ok_or_else(|| format!("a whole number of seconds from 1 to {RUN_LIMIT_MAX_S}"))
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    check_distinct(&arguments.scenario, &arguments.overrides)?;
    let (campaign, scenarios) = Campaign::load(&Request {
        scenario: arguments.scenario.clone(),
        engine: arguments.engine.into(),
        set: arguments.overrides.clone(),
        vary: arguments.vary.clone(),
        seeds: arguments.seeds,
        shard: arguments.shard,
    })?;
    let out = arguments
        .out
        .clone()
        .unwrap_or_else(|| default_folder(&arguments.scenario, &campaign));
    if let Some(hosts) = &arguments.hosts {
        return spread::run(arguments, &campaign, (hosts, &out));
    }
    if let Some(shards) = arguments.slurm {
        return slurm::run(arguments, &campaign, (shards, &out));
    }
    folder::check_writable(&out)?;
    let jobs = arguments
        .jobs
        .or_else(|| std::thread::available_parallelism().ok());
    let options = RunOptions {
        jobs: jobs.unwrap_or(NonZeroUsize::MIN),
        run_limit: Duration::from_secs(arguments.run_limit),
    };
    let bar = terminal::progress_bar(
        "{pos:>8}/{len} runs {bar:40.cyan/dim} {percent:>3} %  {elapsed} elapsed, {eta} left{msg}",
    );
    let (started, mut flown, mut kept) = (Instant::now(), 0, None);
    let watcher = |progress: campaign::Progress| {
        if kept.is_none() {
            kept = Some(progress.kept);
            // Reset the estimate, so that it counts only runs of this process.
            bar.update(|state| {
                state.set_len(progress.total);
                state.set_pos(progress.kept);
            });
            bar.reset_eta();
        }
        bar.set_position(progress.done);
        if progress.broken > 0 {
            bar.set_message(format!(", {} broke a rule", progress.broken));
        }
        flown = progress.done - progress.kept;
    };
    let published = campaign::run(&campaign, &scenarios, &out, options, watcher)?;
    bar.finish_and_clear();
    print(&published)?;
    let took_s = started.elapsed().as_secs_f64();
    let kept = kept.unwrap_or(campaign.shard_runs());
    let flown = plural(usize::try_from(flown).unwrap_or(usize::MAX), "run");
    let resumed = folder::resumed(("campaign", "run"), &out, kept);
    let resumed = resumed.map_or_else(String::new, |it| format!("; {it}"));
    terminal::print(&format!(" flew {flown} in {took_s:.1} s{resumed}\n"))?;
    Ok(outcome(&published))
}

pub(crate) fn merge(arguments: &MergeArguments) -> Result<Outcome, Failure> {
    folder::check_writable(&arguments.out)?;
    let published = campaign::merge(&arguments.shards, &arguments.out)?;
    print(&published)?;
    Ok(outcome(&published))
}

/// First default folder that is unused or holds this campaign.
fn default_folder(scenario: &Path, campaign: &Campaign) -> PathBuf {
    let shard = campaign.shard();
    let suffix = if shard == Shard::WHOLE {
        "campaign".to_owned()
    } else {
        format!("campaign-{}-of-{}", shard.index(), shard.of())
    };
    let folder = folder::default_for(scenario, suffix);
    output::numbered(&folder, |folder| campaign.can_use(folder))
}

fn print(published: &Published) -> io::Result<()> {
    let mut text = campaign::table(published, terminal::colour(&io::stdout()));
    for path in &published.files {
        text.push_str(&format!("\n wrote {}", path.display()));
    }
    text.push('\n');
    terminal::print(&text)
}

fn outcome(published: &Published) -> Outcome {
    if published.broken_runs() > 0 {
        Outcome::RuleBroken
    } else if published.incomplete_runs() > 0 {
        Outcome::MissionIncomplete
    } else {
        Outcome::Success
    }
}
