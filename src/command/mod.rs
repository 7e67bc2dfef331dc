//! The operator's command `muster`: arguments and output. The work is done in the libraries.

mod campaign;
mod chaos;
mod check;
mod completions;
mod deploy;
mod drone;
mod fc;
mod folder;
mod keys;
mod list;
mod map;
mod new;
mod numbers;
mod overrides;
mod recordings;
mod schema;
mod sim;
mod status;
mod swarm;
mod terminal;
mod thesis;

pub(crate) use self::folder::check_ancestors;
use std::io;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use muster_daemon::operator::OperatorError;
use muster_deploy::campaign::SpreadError;
use muster_deploy::swarm::SwarmError;
use muster_experiments::campaign::CampaignError;
use muster_experiments::output::WriteError;
use muster_experiments::tuning::TuneError;
use muster_runtime::diagnostic::BadInput;
use muster_runtime::failure::{report_bad_inputs, report_error};
use muster_runtime::identity::KeysError;
use muster_scenarios::engine::RunError;
use muster_scenarios::report::Report;

/// Simulate and operate swarms of drones.
///
/// A scenario file describes the drones, the mission, the radio and the protocol; `muster sim` flies it and shows the
/// result. `muster list` shows the scenarios that come with the program. The same scenario and seed
/// give the same flight, bit for bit. The simulated drones run the code that is to fly on aircraft.
#[derive(Debug, Parser)]
#[command(
    version,
    arg_required_else_help = true,
    after_help = "Exit codes: 0 success; 1 failure on this machine; 2 unusable file or argument; 3 a safety rule was \
                  broken; 4 all drones landed safely but the mission is incomplete; 5 a flight controller is not fit to fly.\
                  \n\nStart with: muster sim thesis-2"
)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Sim(sim::Arguments),
    List(list::Arguments),
    Map(map::Arguments),
    New(new::Arguments),
    Check(check::Arguments),
    Campaign(campaign::Arguments),
    CampaignMerge(campaign::MergeArguments),
    Chaos(chaos::Arguments),
    Thesis(thesis::Arguments),
    Swarm(swarm::Arguments),
    Status(status::Arguments),
    Deploy(deploy::Arguments),
    Keys(keys::Arguments),
    Drone(drone::Arguments),
    Fc(fc::Arguments),
    Schema(schema::Arguments),
    Completions(completions::Arguments),
}

/// The result of a command that ran, from best to worst.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Outcome {
    Success,
    MissionIncomplete,
    RuleBroken,
    Unfit,
}

impl From<&Report> for Outcome {
    fn from(report: &Report) -> Self {
        if !report.violations.is_empty() {
            Self::RuleBroken
        } else if report.are_missions_completed() {
            Self::Success
        } else {
            Self::MissionIncomplete
        }
    }
}

/// Why a command failed.
#[derive(Debug, thiserror::Error)]
enum Failure {
    /// The user's input can't be used; one error for each file.
    #[error("{} of the files can't be used", .0.len())]
    Input(Vec<BadInput>),
    #[error(transparent)]
    Run(#[from] RunError),
    #[error(transparent)]
    Write(#[from] WriteError),
    #[error("the flight failed")]
    Swarm(#[source] Box<SwarmError>),
    /// A signal ended a flight. Its report is written.
    #[error("interrupted before the end of the flight; no process is left")]
    Interrupted,
    #[error("{0} of {1} drones do not answer")]
    NoAnswer(usize, usize),
    #[error(transparent)]
    Deploy(deploy::DeployFailure),
    #[error("the campaign is not complete")]
    Spread(#[source] SpreadError),
    #[error("can't make the keys")]
    Keys(#[source] KeysError),
    #[error(transparent)]
    Drone(OperatorError),
    #[error(transparent)]
    Controller(#[from] fc::ControllerError),
    #[error("the hover test gives no gains")]
    Tune(#[from] TuneError),
    #[error("can't write {}", path.display())]
    Create {
        path: PathBuf,
        #[source]
        source: io::Error,
    },
    /// A file that the command wrote can't be read back.
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

/// Prints what `describe` says of each file, and refuses all that can't be used at the end.
fn describe_each(
    files: &[PathBuf],
    describe: impl Fn(&Path) -> Result<String, BadInput>,
) -> Result<Outcome, Failure> {
    let mut unusable = Vec::new();
    for file in files {
        match describe(file) {
            Ok(description) => terminal::print(&format!("{}: {description}\n", file.display()))?,
            Err(error) => unusable.push(error),
        }
    }
    if unusable.is_empty() {
        Ok(Outcome::Success)
    } else {
        Err(Failure::Input(unusable))
    }
}

/// Runs the command that the arguments of this process name. Returns its exit code.
pub(crate) fn run() -> ExitCode {
    let outcome = match Arguments::parse().command {
        Command::Sim(arguments) => sim::run(&arguments),
        Command::List(arguments) => list::run(&arguments),
        Command::Map(arguments) => map::run(&arguments),
        Command::New(arguments) => new::run(&arguments),
        Command::Campaign(arguments) => campaign::run(&arguments),
        Command::CampaignMerge(arguments) => campaign::merge(&arguments),
        Command::Chaos(arguments) => chaos::run(&arguments),
        Command::Thesis(arguments) => thesis::run(&arguments),
        Command::Swarm(arguments) => swarm::run(&arguments),
        Command::Status(arguments) => status::run(&arguments),
        Command::Deploy(arguments) => deploy::run(&arguments),
        Command::Check(arguments) => check::run(&arguments),
        Command::Keys(arguments) => keys::run(&arguments),
        Command::Drone(arguments) => drone::run(&arguments),
        Command::Fc(arguments) => fc::run(&arguments),
        Command::Schema(arguments) => schema::run(&arguments),
        Command::Completions(arguments) => completions::run(&arguments),
    };
    match outcome {
        Ok(Outcome::Success) => ExitCode::SUCCESS,
        Ok(Outcome::RuleBroken) => ExitCode::from(3),
        Ok(Outcome::MissionIncomplete) => ExitCode::from(4),
        Ok(Outcome::Unfit) => ExitCode::from(5),
        Err(Failure::Input(inputs)) => report_bad_inputs(&inputs),
        Err(Failure::Drone(error @ OperatorError::Unusable { .. })) => report_error(&error, 2),
        Err(Failure::Write(error @ WriteError::NotAFolder { .. })) => report_error(&error, 2),
        Err(failure) => report_error(&failure, 1),
    }
}
