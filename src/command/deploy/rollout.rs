use std::io;
use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use muster_deploy::hosts::Fleet;
use muster_deploy::rollout::{self, ApplyRequest, HostOutcome, Progress};
use serde_json::json;

use super::super::{Failure, Outcome, terminal};
use super::{DeployFailure, ReleaseArguments};

/// Show what a rollout would change on each host, and why. Changes nothing.
#[derive(Debug, Args)]
pub(super) struct PlanArguments {
    #[command(flatten)]
    release: ReleaseArguments,
}

pub(super) fn plan(arguments: &PlanArguments) -> Result<Outcome, Failure> {
    let (fleet, release, desired) = arguments.release.load()?;
    let planned = rollout::plan(&fleet, &release, &desired);
    let version = &release.manifest.version;
    if arguments.release.json {
        return print_json(&json!({ "version": version, "hosts": planned }));
    }
    let colour = terminal::colour(&io::stdout());
    terminal::print(&rollout::plan_table(&planned, version, colour))?;
    Ok(Outcome::Success)
}

fn print_json(value: &serde_json::Value) -> Result<Outcome, Failure> {
    terminal::print(&format!("{value}\n"))?;
    Ok(Outcome::Success)
}

/// Put a release and the configuration on all hosts, in waves.
///
/// Each wave must prove itself and stay healthy before the next one begins. If it does not, its hosts are taken back. A host
/// with drones that are armed or take part in a flight is left alone. Interrupt it at any time and run it again: hosts that have
/// the release are not changed.
#[derive(Debug, Args)]
pub(super) struct ApplyArguments {
    #[command(flatten)]
    release: ReleaseArguments,
    /// Call drones in flight down, a host at a time: they land, and their flight is over
    #[arg(long)]
    recall: bool,
    /// With --recall: leave this many drones in flight
    #[arg(
        long,
        value_name = "N",
        requires = "recall",
        default_value_t = 0,
        hide_default_value = true
    )]
    keep_flying: usize,
}

pub(super) fn apply(arguments: &ApplyArguments) -> Result<Outcome, Failure> {
    let (fleet, release, desired) = arguments.release.load()?;
    let start = Instant::now();
    let mut watch = |progress: Progress<'_>| {
        let seconds = start.elapsed().as_secs_f64();
        let line = format!(
            "{seconds:6.1} s  {:<12} {}\n",
            progress.host, progress.words
        );
        // Progress is for people; standard output is for the result.
        let _ = io::Write::write_all(&mut io::stderr(), line.as_bytes());
    };
    let (applied, stopped) = rollout::apply(
        &ApplyRequest {
            fleet: &fleet,
            release: &release,
            desired: &desired,
            operator: &operator(),
            keep_flying: arguments.recall.then_some(arguments.keep_flying),
        },
        &mut watch,
    );
    if arguments.release.json {
        let version = &release.manifest.version;
        let took_s = start.elapsed().as_secs_f64();
        print_json(
            &json!({ "version": version, "stopped": stopped, "took_s": took_s, "hosts": applied }),
        )?;
    } else {
        let colour = terminal::colour(&io::stdout());
        terminal::print(&rollout::applied_table(&applied, colour))?;
    }
    let has_release = |it: &&rollout::Applied| {
        matches!(it.outcome, HostOutcome::Changed | HostOutcome::Unchanged)
    };
    match (stopped, applied.iter().filter(has_release).count()) {
        (Some(why), _) => Err(DeployFailure::Stopped(why).into()),
        (None, have) if have < applied.len() => {
            Err(DeployFailure::Incomplete(applied.len() - have, applied.len()).into())
        }
        _ => Ok(Outcome::Success),
    }
}

/// Who runs this command, for other operators.
pub(super) fn operator() -> String {
    let user = std::env::var("USER").unwrap_or_else(|_| "somebody".to_owned());
    let machine = rustix::system::uname();
    let machine = machine.nodename().to_string_lossy().into_owned();
    format!("{user} on {machine}, process {}", std::process::id())
}

/// Run the release before the current one again.
///
/// Hosts with drones that are armed or take part in a flight are left alone. The others go back all at once, and are waited for
/// until their drones are healthy.
#[derive(Debug, Args)]
pub(super) struct RollbackArguments {
    /// Hosts file of the fleet.
    #[arg(value_name = "FILE")]
    fleet: PathBuf,
    /// Names of the hosts [default: all]
    #[arg(value_name = "HOST")]
    hosts: Vec<String>,
    /// Print one JSON object instead of lines.
    #[arg(long)]
    json: bool,
}

pub(super) fn roll_back(arguments: &RollbackArguments) -> Result<Outcome, Failure> {
    let fleet = Fleet::load(&arguments.fleet)?;
    for name in &arguments.hosts {
        fleet.host(&arguments.fleet, name)?;
    }
    let rolled = rollout::roll_back(&fleet, &arguments.hosts, &operator());
    if arguments.json {
        let hosts = rolled.iter().map(|(name, result)| match result {
            Ok(slot) => json!({ "name": name, "slot": slot }),
            Err(error) => json!({ "name": name, "error": error.to_string() }),
        });
        print_json(&json!({ "hosts": hosts.collect::<Vec<_>>() }))?;
    } else {
        for (name, result) in &rolled {
            let line = match result {
                Ok(slot) => format!("{name}: runs {slot}\n"),
                Err(error) => format!("{name}: not rolled back: {error}\n"),
            };
            terminal::print(&line)?;
        }
    }
    match rolled.iter().filter(|(_, result)| result.is_err()).count() {
        0 => Ok(Outcome::Success),
        failed => Err(DeployFailure::NotRolledBack(failed, rolled.len()).into()),
    }
}
