//! The daemon's command line: arguments and exit codes.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use muster_runtime::diagnostic::BadInput;
use muster_runtime::failure::{report_bad_inputs, report_error};
use muster_runtime::journal::{self, Peeked};

use crate::config::DroneConfig;
use crate::daemon::{self, DaemonError, Ended, Start};
use crate::launcher;
use crate::slots::{self, SlotAction};

/// Flies one drone until it has landed for the last time.
///
/// TERM recalls the drone: it lands if it flies, then the process ends. HUP reloads the revocation list and log_level.
#[derive(Debug, Parser)]
#[command(
    name = "musterd",
    version,
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_help = "Exit codes: 0 the mission was flown, or the drone was recalled and has landed; 1 a failure on this \
                  machine; 2 an invalid file or argument, or a \
                  flight that is over; 4 the drone landed by itself before the end of the mission.\n\nExample: musterd --config drone.toml --fly"
)]
struct Arguments {
    /// The drone's file.
    #[arg(long, value_name = "FILE", required_unless_present_any = ["launcher", "show_journal"])]
    config: Option<PathBuf>,
    /// Order the swarm to fly. Only the leader accepts it, and only at the first start of its journal.
    #[arg(long)]
    fly: bool,
    /// Use standard input as the control channel of `muster swarm`: execute its messages and end when it closes.
    #[arg(long = "controlled")]
    is_controlled: bool,
    /// Resume a simulated vehicle that kept flying without a process. The first control message is its state.
    #[arg(long, requires = "is_controlled", conflicts_with = "fly")]
    resume: bool,
    /// Check the drone's file and all files that it names, then exit without flying.
    #[arg(long, conflicts_with_all = ["fly", "is_controlled", "resume"])]
    check: bool,
    /// Run as the launcher of `muster swarm`, connected by standard input and output: start drones on this host, and end
    /// them when the connection closes.
    #[arg(long, exclusive = true)]
    launcher: bool,
    /// Print the newest checkpoints of a journal as JSON, one a line, then exit. FOLDER is that of one flight.
    #[arg(long, value_name = "FOLDER", exclusive = true)]
    show_journal: Option<PathBuf>,
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Manage the releases on this host, for `muster deploy`.
    #[command(subcommand)]
    Slot(SlotAction),
}

/// Runs the program `musterd` with the arguments of this process. Returns its exit code.
#[must_use]
pub fn main() -> ExitCode {
    let arguments = Arguments::parse();
    if let Some(Command::Slot(action)) = &arguments.command {
        return match slots::run(action) {
            Ok(true) => ExitCode::SUCCESS,
            Ok(false) => ExitCode::FAILURE,
            Err(error) => report_error(&error, 1),
        };
    }
    if let Some(folder) = &arguments.show_journal {
        return show_journal(folder);
    }
    let Some(path) = &arguments.config else {
        return match launcher::run() {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => report_error(&error, 1),
        };
    };
    let config = match load(path, &arguments) {
        Ok(config) => config,
        Err(input) => return report_bad_inputs(&[input]),
    };
    if arguments.check {
        print_line(&format!("{}: {}", path.display(), config.description()));
        return ExitCode::SUCCESS;
    }
    let start = Start {
        fly: arguments.fly,
        is_controlled: arguments.is_controlled,
        resume: arguments.resume,
    };
    match daemon::run(config, start) {
        Ok(Ended::Completed) => ExitCode::SUCCESS,
        Ok(Ended::LandedEarly(_)) => ExitCode::from(4),
        Ok(Ended::Failed(_) | Ended::Abandoned) => ExitCode::FAILURE,
        Err(error @ DaemonError::FlightOver { .. }) => report_error(&error, 2),
        Err(error) => report_error(&error, 1),
    }
}

fn show_journal(folder: &Path) -> ExitCode {
    let refuse = |message: String| {
        let help = "give the folder of one flight, e.g. journal/flight-1";
        report_bad_inputs(&[BadInput::without_excerpt(folder, message, help)])
    };
    let found = match journal::peek(folder) {
        Ok(found) => found,
        Err(error) => return refuse(error.to_string()),
    };
    let Some(checkpoints) = found.readable() else {
        return refuse("this folder has no journal".to_owned());
    };
    for checkpoint in checkpoints.iter() {
        match serde_json::to_string(&checkpoint) {
            Ok(line) => print_line(&line),
            Err(error) => return report_error(&error, 1),
        }
    }
    if let Peeked::Damaged { defect, .. } = found {
        let help = "newer checkpoints than the printed ones may be lost";
        return report_bad_inputs(&[BadInput::without_excerpt(folder, defect, help)]);
    }
    ExitCode::SUCCESS
}

fn load(path: &Path, arguments: &Arguments) -> Result<DroneConfig, BadInput> {
    let config = DroneConfig::load(path)?;
    if arguments.fly && !config.leads() {
        let message = "this drone does not lead its swarm; only the leader accepts `--fly`";
        let help =
            "`musterd --check` prints which drone leads, and so does `muster check --explain`";
        return Err(BadInput::without_excerpt(path, message, help));
    }
    Ok(config)
}

#[expect(clippy::print_stdout, reason = "standard output is the result")]
fn print_line(text: &str) {
    println!("{text}");
}
