use std::io;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use indicatif::ProgressBar;
use muster_experiments::output::{self, ReportFiles};
use muster_scenarios::engine::{self, Engine, Watcher};
use muster_scenarios::report::Report;
use muster_scenarios::scenario;

use super::overrides::Overrides;
use super::recordings::Recordings;
use super::{Failure, Outcome, folder, terminal};

/// Simulate a scenario and show the result.
///
/// Prints a table of the drones and writes a report into a folder: report.html, which replays the flight, for people,
/// report.json and tracks.csv for programs. A progress bar is shown on a terminal.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  muster sim thesis-2
  muster sim thesis-1 --seed 7 --set radio.loss=0.2 --set formation.drones=9
  muster sim thesis-1 --set mission.file=river
  muster sim thesis-2 --engine events --json | jq .means
  muster sim kill-at-waypoint --mcap flight.mcap --kml flight.kml --geojson flight.geojson")]
pub(crate) struct Arguments {
    /// A scenario file, or the name of a shipped scenario (`muster list`).
    #[arg(value_name = "SCENARIO")]
    scenario: PathBuf,
    /// Engine that runs the drones; both give the same flight.
    #[arg(long, value_enum, default_value_t = EngineName::Actors)]
    engine: EngineName,
    #[command(flatten)]
    overrides: Overrides,
    /// Skip the safety rules, to measure the cost of the simulation alone.
    #[arg(long)]
    unchecked: bool,
    /// Print the report as one JSON object instead of the table.
    #[arg(long)]
    json: bool,
    /// Output folder; a report there is replaced [default: runs/SCENARIO-SEED, with -2, -3, … appended if another run has
    /// the folder]
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
    let path = &arguments.scenario;
    let mut scenario = scenario::load(path, &arguments.overrides.all(path)?)?;
    scenario.unchecked = arguments.unchecked;
    let default = folder::default_for(Path::new(&scenario.name), scenario.seed);
    let folder = arguments.out.as_deref().unwrap_or(&default);
    folder::check_writable(folder)?;
    arguments.recordings.check(folder)?;
    let bar = terminal::progress_bar(
        "{msg:>18} {bar:40.cyan/dim} {percent:>3} %  {elapsed} elapsed, {eta} left",
    );
    let (report, flight) = engine::run(&scenario, arguments.engine.into(), Some(watch(&bar)))?;
    bar.finish_and_clear();
    let out = arguments.out.clone();
    let out = out.unwrap_or_else(|| output::numbered(&default, |it| output::holds(it, &report)));
    let written = output::write(&out, &report, &flight)?;
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
    let mut text = output::table(report, width, colour);
    let files = [&written.html, &written.json, &written.tracks];
    for path in files.into_iter().chain(recordings) {
        text.push_str(&format!("\n wrote {}", path.display()));
    }
    text.push('\n');
    terminal::print(&text)
}
