use std::io;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use clap::Args;
use indicatif::ProgressBar;
use muster_scenarios::engine::Watcher;
use muster_scenarios::scenario::{Override, Scenario};
use muster_scenarios::thesis::{self, Comparison, Flights};

use crate::sim::EngineName;
use crate::{Ended, Failure, folder, terminal};

/// Fly the thesis's five experiments and show them beside its tables and figures.
///
/// The second is flown twice more with a master that waits at a waypoint only for the drones that it hears itself, once
/// with vehicles that take as long to come to rest as those of the thesis's ancestor; their settling is set beside the
/// ancestor's own measurement, in one hop. These waits scatter: they are the means of runs with 20 seeds, those after the
/// first always on the events engine. Prints the thesis's tables 9 to 13 with ours, and writes thesis.html to look at and
/// thesis.json for programs. The scenarios are a part of the program.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  muster thesis
  muster thesis --seed 7 --engine events --json | jq .waits")]
pub(crate) struct Arguments {
    /// Where every random draw of every run starts from; the waits take the seeds after it, too.
    #[arg(
        long,
        value_name = "N",
        default_value = "1",
        allow_hyphen_values = true
    )]
    seed: String,
    /// How many runs the waits are the means of.
    #[arg(long, value_name = "N", default_value_t = thesis::RUNS, value_parser = clap::value_parser!(u32).range(1..=i64::from(thesis::RUNS_MAX)))]
    runs: u32,
    /// What runs the drones; both give the same flights.
    #[arg(long, value_enum, default_value_t = EngineName::Actors)]
    engine: EngineName,
    /// Print one JSON object on standard output, and nothing else there.
    #[arg(long)]
    json: bool,
    /// The folder to write to [default: runs/thesis-seed-N]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

pub(crate) fn run(arguments: &Arguments) -> Result<Ended, Failure> {
    let flights = Flights::load(&[Override::seed(&arguments.seed)], arguments.runs)?;
    let default = || folder::of(Path::new("thesis"), format_args!("seed-{}", flights.seed()));
    let out = arguments.out.clone().unwrap_or_else(default);
    folder::check(&out)?;
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
            bar.set_message("runs for the waits");
        },
    )?;
    bar.finish_and_clear();
    let written = thesis::write(&out, &comparison)?;
    if arguments.json {
        let json = serde_json::to_string(&comparison).map_err(io::Error::from)?;
        terminal::print(&format!("{json}\n"))?;
    } else {
        print(&comparison, &written)?;
    }
    let ended = comparison.reports().map(Ended::from);
    Ok(ended.max().unwrap_or(Ended::Well))
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
