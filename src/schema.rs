use clap::{Args, ValueEnum};

use crate::{Ended, Failure, terminal};

/// Print what files may say, as a JSON Schema, for editors.
///
/// Shipped files name theirs in their first line, where Taplo and Tombi, which editors use, look for it.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  muster schema scenario > scenario.schema.json")]
pub(crate) struct Arguments {
    /// Of which files.
    #[arg(value_enum)]
    files: Files,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Files {
    /// Scenarios
    Scenario,
    /// Drones' files
    Drone,
    /// Hosts files, of `muster swarm --hosts`
    Hosts,
}

pub(crate) fn run(arguments: &Arguments) -> Result<Ended, Failure> {
    let schema = match arguments.files {
        Files::Scenario => muster_runtime::plan::schema(),
        Files::Drone => muster_daemon::config::schema(),
        Files::Hosts => muster_deploy::swarm::schema(),
    };
    terminal::print(&format!("{schema:#}\n"))?;
    Ok(Ended::Well)
}
