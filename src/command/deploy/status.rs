use std::io;
use std::path::PathBuf;

use clap::Args;
use muster_deploy::hosts::Fleet;
use muster_deploy::rollout;
use serde_json::{Value, json};

use super::super::{Failure, Outcome, terminal};
use super::DeployFailure;

/// Show which release each host runs, and how its drones do.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Hosts file of the fleet.
    #[arg(value_name = "FILE")]
    fleet: PathBuf,
    /// Print one JSON object instead of the table.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let fleet = Fleet::load(&arguments.fleet)?;
    let looked = rollout::look(&fleet);
    if arguments.json {
        let hosts = looked.iter().map(|it| match &it.facts {
            Ok(facts) => json!({ "name": it.name, "facts": facts }),
            Err(error) => json!({ "name": it.name, "error": error.to_string() }),
        });
        let json = json!({ "hosts": hosts.collect::<Vec<Value>>() });
        terminal::print(&format!("{json}\n"))?;
    } else {
        let colour = terminal::colour(&io::stdout());
        terminal::print(&rollout::status_table(&looked, colour))?;
    }
    match looked.iter().filter(|it| it.facts.is_err()).count() {
        0 => Ok(Outcome::Success),
        failed => Err(DeployFailure::NoAnswer(failed, looked.len()).into()),
    }
}
