use std::path::{Path, PathBuf};

use clap::Args;
use muster_runtime::diagnostic::BadInput;
use muster_runtime::mission_file;
use muster_scenarios::scenario;

use super::{Failure, Outcome, terminal};

/// Check scenario and mission files without flying them.
///
/// A .toml file is checked as a scenario, together with its mission. Any other file is checked as a mission: a
/// QGroundControl plan, a waypoint file or a KML path. All files are checked, even after an error.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  muster check scenarios/thesis-*.toml scenarios/missions/*")]
pub(crate) struct Arguments {
    /// Scenario files (.toml) and mission files (.plan, .waypoints, .kml).
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let mut unusable = Vec::new();
    for file in &arguments.files {
        match describe(file) {
            Ok(description) => terminal::print(&format!("{}: {description}\n", file.display()))?,
            Err(error) => unusable.push(error),
        }
    }
    if unusable.is_empty() {
        Ok(Outcome::Success)
    } else {
        Err(Failure::Input(unusable))
    }
}

fn describe(file: &Path) -> Result<String, BadInput> {
    if file
        .extension()
        .is_some_and(|extension| extension == "toml")
    {
        describe_scenario(file)
    } else {
        describe_mission(file)
    }
}

fn describe_scenario(file: &Path) -> Result<String, BadInput> {
    let scenario = scenario::load(file, &[])?;
    let mut notes = scenario.plan.notes.clone();
    for (swarm, _) in &scenario.others {
        let of_swarm = |note: &String| format!("{}: {note}", swarm.name);
        notes.extend(swarm.plan.notes.iter().map(of_swarm));
    }
    let mut description = scenario.description();
    for line in scenario.preview() {
        description.push_str("\n  ");
        description.push_str(&line);
    }
    Ok(with_notes(description, &notes))
}

fn describe_mission(file: &Path) -> Result<String, BadInput> {
    let mission = mission_file::load(file)?;
    let waypoints = mission.waypoints();
    let length_m = waypoints
        .windows(2)
        .map(|leg| leg[0].horizontal_distance_m(leg[1]))
        .fold(0.0, |length_m, leg_m| length_m + leg_m);
    let altitudes = waypoints.iter().map(|waypoint| waypoint.altitude_m());
    let waypoints = match waypoints.len() {
        1 => "1 waypoint".to_owned(),
        waypoints => format!("{waypoints} waypoints"),
    };
    let mut description = format!(
        "mission with {waypoints}, length {length_m:.0} m, altitude {:.0} to {:.0} m",
        altitudes.clone().fold(f64::INFINITY, f64::min),
        altitudes.fold(0.0, f64::max),
    );
    let holds = scenario::describe_holds(mission.holds());
    for line in holds
        .into_iter()
        .chain(scenario::describe_fence(mission.fence()))
    {
        description.push_str("\n  ");
        description.push_str(&line);
    }
    let notes: Vec<_> = mission.notes().iter().map(ToString::to_string).collect();
    Ok(with_notes(description, &notes))
}

fn with_notes(mut description: String, notes: &[String]) -> String {
    for note in notes {
        description.push_str("\n  note: ");
        description.push_str(note);
    }
    description
}
