use std::io;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use clap::Args;
use indicatif::ProgressBar;
use muster_experiments::output;
use muster_experiments::thesis::{self, Comparison, Flights};
use muster_scenarios::engine::Watcher;
use muster_scenarios::scenario::{Override, Scenario};

use super::sim::EngineName;
use super::{Failure, Outcome, folder, numbers, terminal};

/// Simulate the thesis's five experiments and compare the results with its tables and figures.
///
/// Prints the thesis's tables 9 to 13 with ours. Writes thesis.html for people and thesis.json for programs. The scenarios
/// are built in.
///
/// Experiment 2 runs in two more variants. In both, the master waits at a waypoint only for its direct neighbours; in one,
/// the vehicles also settle as slowly as those of the thesis's ancestor project. Their settling times are compared with
/// that project's one-hop measurement. Waiting times are means over several seeds; runs after the first always use the
/// events engine.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  muster thesis
  muster thesis --seed 7 --engine events --json | jq .waits")]
pub(crate) struct Arguments {
    /// First random seed; the mean waiting times also use the seeds after it.
    #[arg(
        long,
        value_name = "N",
        default_value = "1",
        allow_hyphen_values = true
    )]
    seed: String,
    /// Number of runs behind each mean waiting time.
    #[arg(long, value_name = "N", default_value_t = thesis::RUNS, value_parser = numbers::whole::<u32>(1..=u64::from(thesis::RUNS_MAX)), allow_negative_numbers = true)]
    runs: u32,
    /// Engine that runs the drones; both give the same flights.
    #[arg(long, value_enum, default_value_t = EngineName::Actors)]
    engine: EngineName,
    /// Print the comparison as one JSON object instead of the tables.
    #[arg(long)]
    json: bool,
    /// Output folder [default: runs/thesis-seed-N, with -2, -3, … appended if other runs have the folder]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let flights = Flights::load(&[Override::seed(&arguments.seed)], arguments.runs)?;
    let default = folder::default_for(Path::new("thesis"), format_args!("seed-{}", flights.seed()));
    folder::check_writable(arguments.out.as_deref().unwrap_or(&default))?;
    let bar = terminal::progress_bar(
        "{msg:>32} {bar:40.cyan/dim} {percent:>3} %  {elapsed} elapsed, {eta} left",
    );
    let jobs = std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
    let comparison = flights.fly(
        arguments.engine.into(),
        jobs,
        |scenario| Some(watch(&bar, scenario)),
        |done, total| {
            bar.set_length(total as u64);
            bar.set_position(done as u64);
            bar.set_message("runs for waiting times");
        },
    )?;
    bar.finish_and_clear();
    let out = arguments.out.clone();
    let out = out.unwrap_or_else(|| output::numbered(&default, |folder| comparison.is_in(folder)));
    let written = thesis::write(&out, &comparison)?;
    if arguments.json {
        let json = serde_json::to_string(&comparison).map_err(io::Error::from)?;
        terminal::print(&format!("{json}\n"))?;
    } else {
        print(&comparison, &written)?;
    }
    let outcomes = comparison.reports().map(Outcome::from);
    Ok(outcomes.max().unwrap_or(Outcome::Success))
}

fn watch(bar: &ProgressBar, scenario: &Scenario) -> Watcher {
    let (bar, name) = (bar.clone(), scenario.name.clone());
    Box::new(move |progress| {
        bar.set_length(progress.total);
        bar.set_position(progress.done);
        bar.set_message(name.clone());
    })
}

fn print(comparison: &Comparison, written: &[PathBuf]) -> io::Result<()> {
    let mut text = thesis::table(comparison, terminal::colour(&io::stdout()));
    for path in written {
        text.push_str(&format!("\n wrote {}", path.display()));
    }
    text.push('\n');
    terminal::print(&text)
}
