use clap::Args;
use muster_indoor_world::compare::{compare, table};

use crate::command::{Failure, Outcome, terminal};

/// Compare potential fields, VFH and VFH+ on three traps.
///
/// A point robot flies through a dead end in the form of a U, a corridor and a door. It sees all walls within 2 m.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  muster map compare")]
pub(super) struct Arguments {}

pub(super) fn run(_: &Arguments) -> Result<Outcome, Failure> {
    terminal::print(&table(&compare()))?;
    Ok(Outcome::Success)
}
