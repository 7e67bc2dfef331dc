use std::io;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use indicatif::ProgressBar;
use muster_scenarios::engine::{self, Engine, Watcher};
use muster_scenarios::report::{self, Report, ReportFiles};
use muster_scenarios::scenario::{self, Override};

use crate::recordings::Recordings;
use crate::{Failure, Outcome, folder, terminal};

/// Simulate a scenario and show the result.
///
/// Prints a table of the drones and writes a report into a folder: report.html, which replays the flight, for people,
/// report.json and tracks.csv for programs. A progress bar is shown on a terminal.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  muster sim scenarios/thesis-2.toml
  muster sim scenarios/thesis-1.toml --seed 7 --set radio.loss=0.2 --set formation.drones=9
  muster sim scenarios/thesis-2.toml --engine events --json | jq .means
  muster sim scenarios/kill-at-waypoint.toml --mcap flight.mcap --kml flight.kml")]
pub(crate) struct Arguments {
    /// The scenario file.
    scenario: PathBuf,
    /// Random seed; overrides the scenario's.
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    seed: Option<String>,
    /// Engine that runs the drones; both give the same flight.
    #[arg(long, value_enum, default_value_t = EngineName::Actors)]
    engine: EngineName,
    /// Set a field of the scenario, for example radio.range_m=250; may be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<Override>,
    /// Skip the safety rules, to measure the cost of the simulation alone.
    #[arg(long)]
    unchecked: bool,
    /// Print the report as one JSON object instead of the table.
    #[arg(long)]
    json: bool,
    /// Output folder [default: runs/SCENARIO-SEED]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    recordings: Recordings,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum EngineName {
    /// The actors and supervision tree of a real drone, in virtual time.
    Actors,
    /// The same state machines without actors; faster, for many or large runs.
    Events,
}

impl From<EngineName> for Engine {
    fn from(name: EngineName) -> Self {
        match name {
            EngineName::Actors => Self::Actors,
            EngineName::Events => Self::Events,
        }
    }
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let mut overrides = arguments.overrides.clone();
    overrides.extend(arguments.seed.as_deref().map(Override::seed));
    let mut scenario = scenario::load(&arguments.scenario, &overrides)?;
    scenario.unchecked = arguments.unchecked;
    let out = arguments
        .out
        .clone()
        .unwrap_or_else(|| folder::default_for(Path::new(&scenario.name), scenario.seed));
    folder::check_writable(&out)?;
    arguments.recordings.check()?;
    let bar = terminal::progress_bar(
        "{msg:>18} {bar:40.cyan/dim} {percent:>3} %  {elapsed} elapsed, {eta} left",
    );
    let (report, flight) = engine::run(&scenario, arguments.engine.into(), Some(watch(&bar)))?;
    bar.finish_and_clear();
    let written = report::write(&out, &report, &flight)?;
    let recordings = arguments.recordings.write(&report, &flight)?;
    if arguments.json {
        let json = serde_json::to_string(&report).map_err(io::Error::from)?;
        terminal::print(&format!("{json}\n"))?;
    } else {
        print(&report, &written, &recordings)?;
    }
    Ok(Outcome::from(&report))
}

fn watch(bar: &ProgressBar) -> Watcher {
    let bar = bar.clone();
    Box::new(move |progress| {
        bar.set_length(progress.total);
        bar.set_position(progress.done);
        bar.set_message(format!("{} s simulated", progress.simulated_s));
    })
}

pub(crate) fn print(
    report: &Report,
    written: &ReportFiles,
    recordings: &[PathBuf],
) -> io::Result<()> {
    let colour = terminal::colour(&io::stdout());
    let width = terminal_size::terminal_size().map(|(width, _)| width.0);
    let mut text = report::table(report, width, colour);
    let files = [&written.html, &written.json, &written.tracks];
    for path in files.into_iter().chain(recordings) {
        text.push_str(&format!("\n wrote {}", path.display()));
    }
    text.push('\n');
    terminal::print(&text)
}
