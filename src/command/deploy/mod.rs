mod audit;
mod image;
mod logs;
mod package;
mod promote;
mod rollout;
mod status;

use std::path::PathBuf;

use clap::{Args, Subcommand};
use muster_deploy::hosts::Fleet;
use muster_deploy::image::ImageError;
use muster_deploy::release::{PackageError, Release};
use muster_deploy::rollout::{Desired, check_roster, desired};
use muster_runtime::diagnostic::BadInput;
use muster_runtime::identity::{FleetKey, Roster};

use super::{Failure, Outcome};

/// Put releases on a fleet of hosts, in waves, and take them back if they fail.
///
/// The hosts are reached over ssh, as the hosts file says. Each has two releases at most: the one that runs, and the one before
/// it. A host tries a new release by itself and goes back by itself unless its drones prove themselves in time, whether or not
/// this machine is still there.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    Package(package::Arguments),
    Plan(rollout::PlanArguments),
    Apply(rollout::ApplyArguments),
    Status(status::Arguments),
    Rollback(rollout::RollbackArguments),
    Logs(logs::Arguments),
    Audit(audit::Arguments),
    Promote(promote::Arguments),
    Image(image::Arguments),
}

/// A fleet and a release for it.
#[derive(Debug, Args)]
struct ReleaseArguments {
    /// Hosts file of the fleet.
    #[arg(value_name = "FILE")]
    fleet: PathBuf,
    /// Archive that `muster deploy package` wrote.
    #[arg(long, value_name = "ARCHIVE")]
    release: PathBuf,
    /// Print one JSON object instead of the table.
    #[arg(long)]
    json: bool,
}

impl ReleaseArguments {
    /// Reads the fleet, the release, and what each host should have.
    fn load(&self) -> Result<(Fleet, Release, Vec<Desired>), BadInput> {
        let fleet = Fleet::load(&self.fleet)?;
        let key = FleetKey::load(&fleet.keys.join("fleet.pub"))?;
        check_roster(
            &fleet,
            &Roster::load(&fleet.keys.join("roster.toml"), &key)?,
        )?;
        let release = Release::load(&self.release, &key)?;
        let desired = desired(&fleet, &release)?;
        Ok((fleet, release, desired))
    }
}

/// Why a rollout did not do all that it should. What was done is shown.
#[derive(Debug, thiserror::Error)]
pub(crate) enum DeployFailure {
    /// A gate failed.
    #[error("the rollout was stopped: {0}")]
    Stopped(String),
    /// Hosts were left out.
    #[error("{0} of {1} hosts do not have the release")]
    Incomplete(usize, usize),
    /// Hosts were not rolled back.
    #[error("{0} of {1} hosts were not rolled back")]
    NotRolledBack(usize, usize),
    /// Hosts have findings, or could not be audited.
    #[error("{0} of {1} hosts have findings or were not audited")]
    Unsafe(usize, usize),
    /// Hosts do not answer.
    #[error("{0} of {1} hosts do not answer")]
    NoAnswer(usize, usize),
}

impl From<DeployFailure> for Failure {
    fn from(failure: DeployFailure) -> Self {
        Self::Deploy(failure)
    }
}

impl From<ImageError> for Failure {
    fn from(error: ImageError) -> Self {
        match error {
            ImageError::Refused(input) => input.into(),
            ImageError::Write { path, source } => Self::Create { path, source },
        }
    }
}

impl From<PackageError> for Failure {
    fn from(error: PackageError) -> Self {
        match error {
            PackageError::Refused(input) => input.into(),
            PackageError::Keys(error) => error.into(),
            PackageError::Write { path, source } => Self::Create { path, source },
        }
    }
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    match &arguments.action {
        Action::Package(arguments) => package::run(arguments),
        Action::Plan(arguments) => rollout::plan(arguments),
        Action::Apply(arguments) => rollout::apply(arguments),
        Action::Status(arguments) => status::run(arguments),
        Action::Rollback(arguments) => rollout::roll_back(arguments),
        Action::Logs(arguments) => logs::run(arguments),
        Action::Audit(arguments) => audit::run(arguments),
        Action::Promote(arguments) => promote::run(arguments),
        Action::Image(arguments) => image::run(arguments),
    }
}
