use std::io;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use muster_experiments::campaign::Seeds;
use muster_indoor::avoidance::Method;
use muster_indoor_world::campaign::{self, Row};
use muster_indoor_world::flat::Flat;
use muster_indoor_world::patrols::Patrols;
use muster_indoor_world::world::{Failing, Prepared, Setup};
use muster_indoor_world::{engine, page};
use muster_runtime::diagnostic::BadInput;

use super::place::PageFile;
use crate::command::campaign::jobs;
use crate::command::{Failure, Outcome, terminal};

/// Patrol a flat many times, with noise and people.
///
/// The drone keeps track of its pose by sonars and odometry, and flies until it has seen what can be seen. A patrol must not
/// touch walls or people, must see 99 %, and may take 1.5 times as long as the same patrol among the
/// same people without noise.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  muster map patrol flat --seeds 0..4
  muster map patrol flat --seeds 7..=7 --fail 2=dead,0=stuck
  muster map patrol flat --seeds 0..4 --json | jq '.patrols[].clearance_m'

Exit code 3 if a drone touched something or moved where no sonar looks; 4 if a patrol is incomplete.")]
pub(super) struct Arguments {
    /// A flat's TOML file, or the name of a shipped one.
    #[arg(value_name = "FLAT")]
    flat: PathBuf,
    /// Random seeds: A..B excludes B, A..=B includes it.
    #[arg(long, value_name = "A..B", allow_hyphen_values = true)]
    seeds: Seeds,
    /// Sonars that fail after 10 s: SONAR=dead, SONAR=stuck (at 5 cm) or SONAR=glass (no echo); sonars count from 0, at the right
    #[arg(long, value_name = "SONAR=HOW", value_delimiter = ',', value_parser = failing)]
    fail: Vec<(usize, Failing)>,
    /// Number of parallel patrols [default: one per core]
    #[arg(long, value_name = "N", value_parser = jobs, allow_negative_numbers = true)]
    jobs: Option<NonZeroUsize>,
    /// Print the patrols as one JSON object instead of the table.
    #[arg(long)]
    json: bool,
    /// Page to write [default: runs/FLAT-patrol.html, with -2, -3, … appended if another page has the name]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// When sonars fail.
const FAIL_AFTER: Duration = Duration::from_secs(10);
/// Number of a drone's sonars.
const SONARS: usize = 5;

fn failing(text: &str) -> Result<(usize, Failing), String> {
    let parsed = text.split_once('=').and_then(|(sonar, how)| {
        let sonar = sonar.parse().ok().filter(|it| *it < SONARS)?;
        let how = Failing::ALL.into_iter().find(|it| it.name() == how)?;
        Some((sonar, how))
    });
    parsed.ok_or_else(|| {
        "a sonar from 0 to 4 and `dead`, `stuck` or `glass`, as in 2=dead".to_owned()
    })
}

/// The command that repeats a campaign.
fn command(arguments: &Arguments) -> String {
    let (flat, seeds) = (arguments.flat.display(), arguments.seeds);
    let fail = arguments.fail.iter();
    let fail: Vec<String> = fail
        .map(|(sonar, how)| format!("{sonar}={}", how.name()))
        .collect();
    match fail.as_slice() {
        [] => format!("muster map patrol {flat} --seeds {seeds}"),
        fail => format!(
            "muster map patrol {flat} --seeds {seeds} --fail {}",
            fail.join(",")
        ),
    }
}

/// Refuses a sonar that is given twice.
fn check_sonars(arguments: &Arguments) -> Result<(), BadInput> {
    for (place, (sonar, how)) in arguments.fail.iter().enumerate() {
        let earlier = arguments.fail[..place].iter().find(|it| it.0 == *sonar);
        if let Some((_, earlier)) = earlier {
            let (earlier, how) = (earlier.name(), how.name());
            let message =
                format!("--fail has sonar {sonar} twice, {sonar}={earlier} and {sonar}={how}");
            let help = "--fail takes each sonar once, from 0 to 4";
            return Err(BadInput::without_excerpt(&arguments.flat, message, help));
        }
    }
    Ok(())
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    check_sonars(arguments)?;
    let flat = Flat::read(&arguments.flat)?;
    let file = PageFile::new(arguments.out.as_deref(), &flat.name, "patrol")?;
    let prepared = Prepared::new(flat, Method::default()).map_err(|error| {
        let help = "`start` takes a place that is clear of walls";
        BadInput::without_excerpt(&arguments.flat, error, help)
    })?;
    let failing: Vec<_> = arguments
        .fail
        .iter()
        .map(|(sonar, how)| (*sonar, *how, FAIL_AFTER))
        .collect();
    let jobs = arguments
        .jobs
        .or_else(|| std::thread::available_parallelism().ok());
    let bar = terminal::progress_bar(
        "{pos:>8}/{len} patrols {bar:40.cyan/dim} {percent:>3} %  {elapsed} elapsed, {eta} left",
    );
    bar.set_length(arguments.seeds.number());
    let jobs = jobs.unwrap_or(NonZeroUsize::MIN);
    let campaign = campaign::run(&prepared, arguments.seeds, &failing, jobs, |done| {
        bar.set_position(done);
    });
    bar.finish_and_clear();
    let seed = arguments.seeds.at(0);
    let first = engine::run(
        &prepared,
        Setup {
            failing,
            ..Setup::seeded(seed)
        },
    );
    let page = page::patrol(&prepared, &campaign, &first, &command(arguments));
    let file = file.write(&page)?;
    if arguments.json {
        let patrols = Patrols::of(&prepared.flat.name, &campaign);
        let json = serde_json::to_string(&patrols).map_err(io::Error::from)?;
        terminal::print(&format!("{json}\n"))?;
    } else {
        let table = campaign::table(&campaign);
        terminal::print(&format!("{table}\n wrote {}\n", file.display()))?;
    }
    Ok(if campaign.rows.iter().any(Row::broke_rule) {
        Outcome::RuleBroken
    } else if campaign.rows.iter().all(Row::is_complete) {
        Outcome::Success
    } else {
        Outcome::MissionIncomplete
    })
}
