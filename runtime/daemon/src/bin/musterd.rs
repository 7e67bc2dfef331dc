//! The daemon: one drone as a process. Arguments and exit codes, nothing else.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;
use muster_daemon::agent;
use muster_daemon::config::DroneConfig;
use muster_daemon::daemon::{self, Ended, Start};
use muster_runtime::diagnostic::BadInput;
use muster_runtime::failure::{complain, refuse};

/// Flies one drone as a process, until it is on the ground for good.
///
/// TERM calls the drone down: it lands if it flies, and the process ends. HUP reads the list of the expelled and
/// log_level again, and nothing else.
#[derive(Debug, Parser)]
#[command(
    name = "musterd",
    version,
    after_help = "Exit codes: 0 the mission was flown, or the drone was called down and has landed; 1 something failed \
                  on this machine; 2 a file or an argument can't be used; 4 the drone came down by itself before the end \
                  of the mission.\n\nExample: musterd --config drone.toml --fly"
)]
struct Arguments {
    /// The drone's file.
    #[arg(long, value_name = "FILE", required_unless_present = "agent")]
    config: Option<PathBuf>,
    /// Tell the swarm to fly, as its operator; for the drone that leads, and in the first life of its journal only.
    #[arg(long)]
    fly: bool,
    /// End when standard input does, and read there whom the drone does not hear, as `muster swarm` writes it.
    #[arg(long = "controlled")]
    is_controlled: bool,
    /// Go on with a simulated vehicle that has flown on without this process, as standard input's first line has it.
    #[arg(long, requires = "is_controlled", conflicts_with = "fly")]
    resume: bool,
    /// Check the drone's file and all that it names, and fly nothing.
    #[arg(long, conflicts_with_all = ["fly", "is_controlled", "resume"])]
    check: bool,
    /// Fly nothing, but start drones on this host for a `muster swarm` at the other end of standard input and output, and
    /// end them when it ends.
    #[arg(long, exclusive = true)]
    agent: bool,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let Some(path) = &arguments.config else {
        return match agent::run() {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => complain(&error, 1),
        };
    };
    let config = match load(path, &arguments) {
        Ok(config) => config,
        Err(input) => return refuse(&[input]),
    };
    if arguments.check {
        say(&format!("{}: {}", path.display(), config.description()));
        return ExitCode::SUCCESS;
    }
    let start = Start {
        fly: arguments.fly,
        is_controlled: arguments.is_controlled,
        resume: arguments.resume,
    };
    match daemon::run(config, start) {
        Ok(Ended::Well) => ExitCode::SUCCESS,
        Ok(Ended::Early(_)) => ExitCode::from(4),
        Ok(Ended::Unable(_) | Ended::Abandoned) => ExitCode::FAILURE,
        Err(error) => complain(&error, 1),
    }
}

fn load(path: &Path, arguments: &Arguments) -> Result<DroneConfig, BadInput> {
    let config = DroneConfig::load(path)?;
    if arguments.fly && !config.leads() {
        let message = "this drone does not lead its swarm, so it can't be told to `--fly`";
        let help =
            "give --fly to the drone that leads, which `musterd --check` and `muster check` tell";
        return Err(BadInput::without_excerpt(path, message, help));
    }
    Ok(config)
}

#[expect(clippy::print_stdout, reason = "this is what was asked for")]
fn say(text: &str) {
    println!("{text}");
}
