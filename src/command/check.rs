use std::path::{Path, PathBuf};

use clap::Args;
use muster_runtime::diagnostic::BadInput;
use muster_runtime::mission_file;
use muster_runtime::text::{figure, plural};
use muster_scenarios::scenario::{self, Override};

use super::overrides::check_distinct;
use super::{Failure, Outcome, describe_each};

/// Check scenario and mission files without flying them.
///
/// A .toml file is checked as a scenario, together with its mission. Any other file is checked as a mission: a
/// QGroundControl plan, a waypoint file or a KML path. All files are checked, even after an error. One line says whether a
/// file is OK; --explain prints how near drones come to each other, by which faults, and more.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  muster check thesis-2 river
  muster check --explain thesis-2
  muster check thesis-2 --set formation.drones=25
  muster check scenarios/thesis-*.toml scenarios/missions/*")]
pub(crate) struct Arguments {
    /// Scenario files (.toml) and mission files (.plan, .waypoints, .kml), or names of shipped ones (`muster list`).
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Set a field of each scenario, for example radio.range_m=250; may be repeated. A path starts at the current folder.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<Override>,
    /// Also show separation by phase, exposures, the time to re-elect, altitude layers and notes
    #[arg(long)]
    explain: bool,
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    describe_each(&arguments.files, |file| describe(file, arguments))
}

/// The verdict on a file, and the lines that explain it, if asked for.
struct Checked {
    verdict: String,
    lines: Vec<String>,
    notes: Vec<String>,
}

fn describe(file: &Path, arguments: &Arguments) -> Result<String, BadInput> {
    let overrides = &arguments.overrides;
    check_distinct(file, overrides)?;
    scenario::scenario_or_mission(file)?;
    let is_file_of_scenario = file.extension().is_some_and(|it| it == "toml");
    let checked = if is_file_of_scenario || scenario::is_shipped(file) {
        check_scenario(file, arguments)?
    } else if overrides.is_empty() {
        check_mission(file)?
    } else {
        let help = "leave out --set, or check a scenario";
        let message = "is a mission, and --set sets fields of scenarios";
        return Err(BadInput::without_excerpt(file, message, help));
    };
    let Checked {
        mut verdict,
        lines,
        notes,
    } = checked;
    if arguments.explain {
        let notes = notes.iter().map(|note| format!("note: {note}"));
        for line in lines.into_iter().chain(notes) {
            verdict.push_str("\n  ");
            verdict.push_str(&line);
        }
    } else if !notes.is_empty() {
        verdict.push_str(&format!("; {}: see --explain", plural(notes.len(), "note")));
    }
    Ok(verdict)
}

fn check_scenario(file: &Path, arguments: &Arguments) -> Result<Checked, BadInput> {
    let scenario = scenario::load(file, &arguments.overrides)?;
    let mut notes = scenario.notes();
    for (swarm, _) in &scenario.others {
        let of_swarm = |note: &String| format!("{}: {note}", swarm.name);
        notes.extend(swarm.notes().iter().map(of_swarm));
    }
    let mut lines = Vec::new();
    if arguments.explain {
        lines.push(scenario.description());
        lines.extend(scenario.preview());
    }
    Ok(Checked {
        verdict: scenario.verdict(),
        lines,
        notes,
    })
}

fn check_mission(file: &Path) -> Result<Checked, BadInput> {
    let path = scenario::mission_path(file)?;
    let mission = mission_file::parse(&path, &scenario::read(&path)?)?;
    let waypoints = mission.waypoints();
    let length_m = waypoints
        .windows(2)
        .map(|leg| leg[0].horizontal_distance_m(leg[1]))
        .fold(0.0, |length_m, leg_m| length_m + leg_m);
    let altitudes = waypoints.iter().map(|waypoint| waypoint.altitude_m());
    let lowest = figure(altitudes.clone().fold(f64::INFINITY, f64::min), 0);
    let highest = figure(altitudes.fold(0.0, f64::max), 0);
    let altitudes = if lowest == highest {
        lowest
    } else {
        format!("{lowest} to {highest}")
    };
    let verdict = format!(
        "OK: mission with {}, length {length_m:.0} m, altitude {altitudes} m",
        plural(waypoints.len(), "waypoint"),
    );
    let holds = scenario::describe_holds(mission.holds());
    let lines = holds
        .into_iter()
        .chain(scenario::describe_fence(mission.fence()));
    Ok(Checked {
        verdict,
        lines: lines.collect(),
        notes: mission.notes().iter().map(ToString::to_string).collect(),
    })
}
