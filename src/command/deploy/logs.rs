use std::path::PathBuf;

use clap::Args;
use muster_deploy::hosts::Fleet;
use muster_deploy::rollout::pass_through;

use super::super::{Failure, Outcome};
use super::DeployFailure;
use crate::command::numbers;

/// Show the logs of drones and of trials on a host, from its journal.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Hosts file of the fleet.
    #[arg(value_name = "FILE")]
    fleet: PathBuf,
    /// Name of the host.
    host: String,
    /// The newest lines to show.
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = numbers::whole::<u32>(0..=u64::from(u32::MAX)), allow_negative_numbers = true)]
    lines: u32,
    /// Print new lines until interrupted.
    #[arg(long)]
    follow: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let fleet = Fleet::load(&arguments.fleet)?;
    let lines = arguments.lines.to_string();
    let mut words = vec![
        "journalctl",
        "--no-pager",
        "--output=short-iso",
        "--lines",
        &lines,
    ];
    if arguments.follow {
        words.push("--follow");
    }
    let host = fleet.host(&arguments.fleet, &arguments.host)?;
    let drones = host
        .drones
        .iter()
        .map(|id| format!("--unit=musterd@{id}.service"));
    let units: Vec<_> = drones.collect();
    words.extend(["--unit=muster-trial.service", "--unit=muster-slots.service"]);
    words.extend(units.iter().map(String::as_str));
    if !pass_through(&host.run, &words)? {
        return Err(DeployFailure::NoAnswer(1, 1).into());
    }
    Ok(Outcome::Success)
}
