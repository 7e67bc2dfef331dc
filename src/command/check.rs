use std::path::{Path, PathBuf};

use clap::Args;
use muster_runtime::diagnostic::BadInput;
use muster_runtime::mission_file;
use muster_runtime::text::plural;
use muster_scenarios::scenario;

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
  muster check scenarios/thesis-*.toml scenarios/missions/*")]
pub(crate) struct Arguments {
    /// Scenario files (.toml) and mission files (.plan, .waypoints, .kml), or names of shipped ones (`muster list`).
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Also show separation by phase, exposures, the time to re-elect, altitude layers and notes
    #[arg(long)]
    explain: bool,
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    describe_each(&arguments.files, |file| describe(file, arguments.explain))
}

/// The verdict on a file, and the lines that explain it.
struct Checked {
    verdict: String,
    lines: Vec<String>,
    notes: Vec<String>,
}

fn describe(file: &Path, explain: bool) -> Result<String, BadInput> {
    let is_file_of_scenario = file.extension().is_some_and(|it| it == "toml");
    let checked = if is_file_of_scenario || scenario::is_shipped(file) {
        check_scenario(file)?
    } else {
        check_mission(file)?
    };
    let Checked {
        mut verdict,
        lines,
        notes,
    } = checked;
    if explain {
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

fn check_scenario(file: &Path) -> Result<Checked, BadInput> {
    let scenario = scenario::load(file, &[])?;
    let mut notes = scenario.plan.notes.clone();
    for (swarm, _) in &scenario.others {
        let of_swarm = |note: &String| format!("{}: {note}", swarm.name);
        notes.extend(swarm.plan.notes.iter().map(of_swarm));
    }
    let mut lines = vec![scenario.description()];
    lines.extend(scenario.preview());
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
    let verdict = format!(
        "OK: mission with {}, length {length_m:.0} m, altitude {:.0} to {:.0} m",
        plural(waypoints.len(), "waypoint"),
        altitudes.clone().fold(f64::INFINITY, f64::min),
        altitudes.fold(0.0, f64::max),
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
