//! The operator's command: arguments and printing, nothing else.

mod campaign;
mod chaos;
mod check;
mod completions;
mod drone;
mod folder;
mod keys;
mod schema;
mod sim;
mod status;
mod swarm;
mod terminal;
mod thesis;

use std::io;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use muster_daemon::operator::OperatorError;
use muster_deploy::swarm::SwarmError;
use muster_runtime::diagnostic::BadInput;
use muster_runtime::failure::{complain, refuse};
use muster_runtime::identity::KeysError;
use muster_scenarios::campaign::CampaignError;
use muster_scenarios::engine::RunError;
use muster_scenarios::report::{Report, WriteError};

/// Flies swarms of drones: in simulation today, the very same drones on aircraft.
///
/// A scenario file says who flies, where, over which radio and by which protocol; `muster sim` flies it and shows
/// what came of it. The same scenario and seed give the same flight, bit for bit.
#[derive(Debug, Parser)]
#[command(
    version,
    arg_required_else_help = true,
    after_help = "Exit codes: 0 all is well; 1 something failed on this machine; 2 a file or an argument can't be \
                  used; 3 a rule that must always hold was broken; 4 all came down safely but the mission \
                  was not flown to its end.\n\nStart with: muster sim scenarios/thesis-2.toml"
)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Sim(sim::Arguments),
    Campaign(campaign::Arguments),
    CampaignMerge(campaign::MergeArguments),
    Chaos(chaos::Arguments),
    Thesis(thesis::Arguments),
    Swarm(swarm::Arguments),
    Status(status::Arguments),
    Check(check::Arguments),
    Keys(keys::Arguments),
    Drone(drone::Arguments),
    Schema(schema::Arguments),
    Completions(completions::Arguments),
}

/// How a command ended that could do what it was asked for, from good to bad.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Ended {
    Well,
    MissionIncomplete,
    RuleBroken,
}

impl From<&Report> for Ended {
    fn from(report: &Report) -> Self {
        if !report.violations.is_empty() {
            Self::RuleBroken
        } else if report.are_missions_completed() {
            Self::Well
        } else {
            Self::MissionIncomplete
        }
    }
}

/// Why a command could not do what it was asked for.
#[derive(Debug, thiserror::Error)]
enum Failure {
    /// The user's input can't be used; each file's fault by itself.
    #[error("{} of the files can't be used", .0.len())]
    Input(Vec<BadInput>),
    #[error(transparent)]
    Run(#[from] RunError),
    #[error(transparent)]
    Write(#[from] WriteError),
    #[error("no flight")]
    Swarm(#[source] Box<SwarmError>),
    #[error("{0} of {1} drones do not answer")]
    NoAnswer(usize, usize),
    #[error("no keys")]
    Keys(#[source] KeysError),
    #[error(transparent)]
    Drone(OperatorError),
    /// What was just written can't be read back.
    #[error("can't read {}", path.display())]
    Read {
        path: PathBuf,
        #[source]
        source: io::Error,
    },
    #[error("can't write to standard output")]
    Print(#[from] io::Error),
}

impl From<BadInput> for Failure {
    fn from(input: BadInput) -> Self {
        Self::Input(vec![input])
    }
}

impl From<CampaignError> for Failure {
    fn from(error: CampaignError) -> Self {
        match error {
            CampaignError::Refused(input) => input.into(),
            CampaignError::Run(error) => error.into(),
            CampaignError::Write(error) => error.into(),
            CampaignError::Read { path, source } => Self::Read { path, source },
        }
    }
}

fn main() -> ExitCode {
    let ended = match Arguments::parse().command {
        Command::Sim(arguments) => sim::run(&arguments),
        Command::Campaign(arguments) => campaign::run(&arguments),
        Command::CampaignMerge(arguments) => campaign::merge(&arguments),
        Command::Chaos(arguments) => chaos::run(&arguments),
        Command::Thesis(arguments) => thesis::run(&arguments),
        Command::Swarm(arguments) => swarm::run(&arguments),
        Command::Status(arguments) => status::run(&arguments),
        Command::Check(arguments) => check::run(&arguments),
        Command::Keys(arguments) => keys::run(&arguments),
        Command::Drone(arguments) => drone::run(&arguments),
        Command::Schema(arguments) => schema::run(&arguments),
        Command::Completions(arguments) => completions::run(&arguments),
    };
    match ended {
        Ok(Ended::Well) => ExitCode::SUCCESS,
        Ok(Ended::RuleBroken) => ExitCode::from(3),
        Ok(Ended::MissionIncomplete) => ExitCode::from(4),
        Err(Failure::Input(inputs)) => refuse(&inputs),
        Err(Failure::Drone(error @ OperatorError::Unusable { .. })) => complain(&error, 2),
        Err(Failure::Write(error @ WriteError::NotAFolder { .. })) => complain(&error, 2),
        Err(failure) => complain(&failure, 1),
    }
}
