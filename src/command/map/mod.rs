//! Maps of buildings: where a drone is on them, paths over them, and patrols.

mod check;
mod compare;
mod cover;
mod locate;
mod path;
mod patrol;
mod place;

use clap::{Args, Subcommand};

use super::{Failure, Outcome};

/// Check maps of buildings, find drones and paths on them, and patrol them.
///
/// A map is a file as ROS's map_server has it: YAML with a PGM or PNG image. Its field `plan` draws a floor as text instead. A
/// single word without a dot is the name of a shipped flat.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  muster map check flat
  muster map locate floor.yaml drive.log --seed 7
  muster map path flat 1,3.9 9,7
  muster map cover flat --drones 2
  muster map compare
  muster map patrol flat --seeds 0..4")]
pub(crate) struct Arguments {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    Check(check::Arguments),
    Locate(locate::Arguments),
    Path(path::Arguments),
    Cover(cover::Arguments),
    Compare(compare::Arguments),
    Patrol(patrol::Arguments),
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    match &arguments.action {
        Action::Check(arguments) => check::run(arguments),
        Action::Locate(arguments) => locate::run(arguments),
        Action::Path(arguments) => path::run(arguments),
        Action::Cover(arguments) => cover::run(arguments),
        Action::Compare(arguments) => compare::run(arguments),
        Action::Patrol(arguments) => patrol::run(arguments),
    }
}
