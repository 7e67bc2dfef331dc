use std::path::{Path, PathBuf};

use clap::Args;
use muster_indoor::map::{Map, State};
use muster_runtime::diagnostic::BadInput;
use muster_runtime::text::figure;

use super::place;
use crate::command::{Failure, Outcome, describe_each};

/// Check maps, and print what is on them.
///
/// All files are checked, even after an error. One line says whether a map is OK and how large it is.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  muster map check flat
  muster map check maps/*.yaml")]
pub(super) struct Arguments {
    /// Maps' YAML files, flats' TOML files, or names of shipped flats.
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    describe_each(&arguments.files, describe)
}

fn describe(file: &Path) -> Result<String, BadInput> {
    let (_, map) = place::map(file)?;
    let area_m2 = |cells: usize| cells as f64 * map.resolution_m() * map.resolution_m();
    let share = |state: State| {
        let cells = map.cells().filter(|cell| map.state(*cell) == state).count();
        100.0 * cells as f64 / (map.columns() * map.rows()) as f64
    };
    let free = map
        .cells()
        .filter(|cell| map.state(*cell) == State::Free)
        .count();
    let kept_out = map.cells().filter(|cell| map.is_kept_out(*cell)).count();
    let mut text = format!(
        "OK: {} × {} m, {} × {} cells of {} cm, {} m² free; {} % occupied, {} % unknown",
        metres(&map, map.columns()),
        metres(&map, map.rows()),
        map.columns(),
        map.rows(),
        figure(map.resolution_m() * 100.0, 1),
        figure(area_m2(free), 1),
        figure(share(State::Occupied), 1),
        figure(share(State::Unknown), 1),
    );
    if kept_out > 0 {
        text.push_str(&format!(
            "; {} m² not to be entered",
            figure(area_m2(kept_out), 1)
        ));
    }
    if free == 0 {
        text.push_str("; no drone can be anywhere: look at `negate` and the thresholds");
    }
    Ok(text)
}

fn metres(map: &Map, cells: usize) -> String {
    figure(cells as f64 * map.resolution_m(), 1)
}
