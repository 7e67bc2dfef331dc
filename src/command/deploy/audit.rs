use std::io;
use std::path::PathBuf;

use clap::Args;
use muster_deploy::hosts::Fleet;
use muster_deploy::release::Release;
use muster_deploy::rollout;
use muster_runtime::identity::FleetKey;
use serde_json::{Value, json};

use super::super::{Failure, Outcome, terminal};
use super::DeployFailure;
use super::rollout::operator;

/// Show what is not safe about the hosts: logins, firewall, permissions, the drones' sandbox.
///
/// With --fix it is set. What was set is undone after a minute, unless this command can log in again. The exit code is 1 if
/// something is left.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Hosts file of the fleet.
    #[arg(value_name = "FILE")]
    fleet: PathBuf,
    /// Set what can be set.
    #[arg(long)]
    fix: bool,
    /// Also ask for unattended security updates. A host needs the package `unattended-upgrades`.
    #[arg(long)]
    updates: bool,
    /// Archive that `muster deploy package` wrote, for hosts that have no release yet
    #[arg(long, value_name = "ARCHIVE")]
    release: Option<PathBuf>,
    /// Print one JSON object instead of the table.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let fleet = Fleet::load(&arguments.fleet)?;
    let release = match &arguments.release {
        None => None,
        Some(path) => {
            let key = FleetKey::load(&fleet.keys.join("fleet.pub"))?;
            Some(Release::load(path, &key)?)
        }
    };
    let operator = operator();
    let audited = rollout::audit(
        &fleet,
        release.as_ref(),
        arguments.fix.then_some(operator.as_str()),
        arguments.updates,
    );
    if arguments.json {
        let hosts = audited.iter().map(|(name, found)| match found {
            Ok(findings) => json!({ "name": name, "findings": findings }),
            Err(error) => json!({ "name": name, "error": error.to_string() }),
        });
        let json = json!({ "hosts": hosts.collect::<Vec<Value>>() });
        terminal::print(&format!("{json}\n"))?;
    } else {
        let colour = terminal::colour(&io::stdout());
        terminal::print(&rollout::audit_table(&audited, colour))?;
    }
    let is_safe = |found: &Result<Vec<_>, _>| found.as_ref().is_ok_and(Vec::is_empty);
    match audited.iter().filter(|(_, found)| !is_safe(found)).count() {
        0 => Ok(Outcome::Success),
        unsafe_hosts => Err(DeployFailure::Unsafe(unsafe_hosts, audited.len()).into()),
    }
}
