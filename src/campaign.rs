use std::io;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Args;
use muster_scenarios::campaign::{
    self, Campaign, Effort, JOBS_MAX, Published, RUN_LIMIT, Request, Seeds, Shard,
};
use muster_scenarios::scenario::{Override, Variation};

use crate::sim::EngineName;
use crate::{Ended, Failure, folder, terminal};

/// The longest limit of a run, in seconds: a week.
const RUN_LIMIT_MAX_S: u64 = 604_800;
/// The most folders of one scenario's campaigns that are named without being told.
const FOLDERS_MAX: u32 = 1_000;

/// Fly a scenario many times and show medians with their 95 % intervals.
///
/// Every combination of the varied values is flown with every seed. A folder takes a row a run (runs.csv,
/// runs.jsonl) and what they come to (summary.csv, and summary.html to look at). Rows are kept as runs end:
/// interrupted, the same command goes on from there, to the same bytes.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  muster campaign scenarios/thesis-1.toml --seeds 0..20
  muster campaign scenarios/thesis-1.toml --seeds 0..6 --vary radio.loss=0,0.1 --out runs/loss
  muster campaign scenarios/thesis-1.toml --seeds 1..=6 --set radio.loss=0.1 --shard 1/2

A run that breaks a rule has its row, and the command ends with exit code 3; with 4 if all rules were kept and a
mission was not flown to its end.
At most 10,000,000 runs and 10,000 combinations.")]
pub(crate) struct Arguments {
    /// The scenario file.
    scenario: PathBuf,
    /// The seeds that each combination is flown with: A..B leaves B out, A..=B does not.
    #[arg(long, value_name = "A..B", allow_hyphen_values = true)]
    seeds: Seeds,
    /// Fly with each of several values of a field, as in radio.loss=0,0.1; may be given several times, for every
    /// combination.
    #[arg(long, value_name = "KEY=V1,V2,…")]
    vary: Vec<Variation>,
    /// Set a field of the scenario in every run, as in radio.range_m=250; may be given several times.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<Override>,
    /// What runs the drones; both give the same flights.
    #[arg(long, value_enum, default_value_t = EngineName::Events)]
    engine: EngineName,
    /// Fly the I-th of N disjoint parts only; `muster campaign-merge` puts them together.
    #[arg(
        long,
        value_name = "I/N",
        default_value = "1/1",
        hide_default_value = true
    )]
    shard: Shard,
    /// How many runs are flown at once [default: one a core]
    #[arg(long, value_name = "N", value_parser = jobs)]
    jobs: Option<NonZeroUsize>,
    /// Wall-clock seconds that a run may take; one that takes longer breaks rule 10, and the others go on
    #[arg(long, value_name = "SECONDS", value_parser = run_limit, default_value_t = RUN_LIMIT.as_secs())]
    run_limit: u64,
    /// The folder to write to, and to go on in [default: runs/SCENARIO-campaign, or -campaign-I-of-N; where that is
    /// another campaign's, with the first of -2, -3, … that is not]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// Put the shards of a campaign together, to the bytes of one that was not divided.
#[derive(Debug, Args)]
#[command(
    after_help = "Example, of two shards flown with --out part-1 and --out part-2:
  muster campaign-merge part-1 part-2 --out whole"
)]
pub(crate) struct MergeArguments {
    /// The folders of all shards, in any order; they are left as they are.
    #[arg(required = true, value_name = "DIR")]
    shards: Vec<PathBuf>,
    /// The folder to write to.
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

pub(crate) fn run(arguments: &Arguments) -> Result<Ended, Failure> {
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
        .unwrap_or_else(|| own_folder(&arguments.scenario, &campaign));
    let jobs = arguments
        .jobs
        .or_else(|| std::thread::available_parallelism().ok());
    let effort = Effort {
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
            // At once, so that the time left is reckoned from what is flown now.
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
    let published = campaign::run(&campaign, &scenarios, &out, effort, watcher)?;
    bar.finish_and_clear();
    print(&published)?;
    let took_s = started.elapsed().as_secs_f64();
    let kept = kept.unwrap_or(campaign.runs_at_hand());
    let kept = match kept {
        0 => String::new(),
        kept => format!("; {kept} were there already"),
    };
    terminal::print(&format!(" flew {flown} runs in {took_s:.1} s{kept}\n"))?;
    Ok(ended(&published))
}

pub(crate) fn merge(arguments: &MergeArguments) -> Result<Ended, Failure> {
    let published = campaign::merge(&arguments.shards, &arguments.out)?;
    print(&published)?;
    Ok(ended(&published))
}

/// The first folder that is free for this campaign, or its own already.
fn own_folder(scenario: &Path, campaign: &Campaign) -> PathBuf {
    let shard = campaign.shard();
    let what = if shard == Shard::WHOLE {
        "campaign".to_owned()
    } else {
        format!("campaign-{}-of-{}", shard.index(), shard.of())
    };
    let of = |what: &str| folder::of(scenario, what);
    let others = (2..=FOLDERS_MAX).map(|n| of(&format!("{what}-{n}")));
    std::iter::once(of(&what))
        .chain(others)
        .find(|folder| campaign.may_use(folder))
        .unwrap_or_else(|| of(&what))
}

fn print(published: &Published) -> io::Result<()> {
    let mut text = campaign::table(published, terminal::colour(&io::stdout()));
    for path in &published.files {
        text.push_str(&format!("\n wrote {}", path.display()));
    }
    text.push('\n');
    terminal::print(&text)
}

fn ended(published: &Published) -> Ended {
    if published.broken_runs() > 0 {
        Ended::RuleBroken
    } else if published.incomplete_runs() > 0 {
        Ended::MissionIncomplete
    } else {
        Ended::Well
    }
}
