use clap::Args;
use muster_scenarios::scenario;

use super::{Failure, Outcome, terminal};

/// List the shipped scenarios and missions.
///
/// They are part of the program: where a scenario file is expected, the name of a shipped one will do, and so will the name
/// of a shipped mission for mission.file. A single word without a dot is a name; all else is the path of a file.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  muster list
  muster sim thesis-2
  muster sim thesis-1 --set mission.file=river")]
pub(crate) struct Arguments {}

pub(crate) fn run(_: &Arguments) -> Result<Outcome, Failure> {
    let groups = scenario::shipped();
    let names = groups.iter().flat_map(|(_, group)| group);
    let width = names.map(|it| it.name.len()).max().unwrap_or(0);
    let mut text = String::new();
    for (heading, group) in groups {
        if !text.is_empty() {
            text.push('\n');
        }
        text.push_str(&format!("{heading}\n"));
        for shipped in group {
            text.push_str(&format!("  {:<width$}  {}\n", shipped.name, shipped.about));
        }
    }
    terminal::print(&text)?;
    Ok(Outcome::Success)
}
