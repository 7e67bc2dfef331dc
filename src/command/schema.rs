use clap::{Args, ValueEnum};
use muster_daemon::config;
use muster_deploy::hosts;
use muster_runtime::plan;

use super::{Failure, Outcome, terminal};

/// Print the JSON Schema of a file format, for editors, or its reference in Markdown.
///
/// Shipped files name their schema in the first line, where the language servers Taplo and Tombi look for it.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  muster schema scenario > scenario.schema.json\n  muster schema drone --format markdown"
)]
pub(crate) struct Arguments {
    /// File format.
    #[arg(value_enum)]
    files: Files,

    /// Output format.
    #[arg(long, value_enum, default_value_t = Format::Json)]
    format: Format,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Format {
    /// JSON Schema
    Json,
    /// Every field with its description, accepted values and default
    Markdown,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Files {
    /// Scenario file
    Scenario,
    /// Drone file of `musterd`
    Drone,
    /// Hosts file of `muster swarm --hosts` and `muster deploy`
    Hosts,
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let (schema, reference) = match arguments.files {
        Files::Scenario => (plan::schema(), plan::reference as fn() -> String),
        Files::Drone => (config::schema(), config::reference as _),
        Files::Hosts => (hosts::schema(), hosts::reference as _),
    };
    terminal::print(&match arguments.format {
        Format::Json => format!("{:#}\n", schema.json),
        Format::Markdown => reference(),
    })?;
    Ok(Outcome::Success)
}
