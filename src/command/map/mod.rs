//! Maps of buildings, and where a drone is on them.

mod check;
mod locate;

use clap::{Args, Subcommand};

use super::{Failure, Outcome};

/// Check maps of buildings and find drones on them.
///
/// A map is a file as ROS's map_server has it: YAML with a PGM or PNG image. Its field `plan` draws a floor as text instead.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  muster map check floor.yaml
  muster map locate floor.yaml drive.log --seed 7")]
pub(crate) struct Arguments {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    Check(check::Arguments),
    Locate(locate::Arguments),
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    match &arguments.action {
        Action::Check(arguments) => check::run(arguments),
        Action::Locate(arguments) => locate::run(arguments),
    }
}
