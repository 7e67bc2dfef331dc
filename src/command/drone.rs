use std::io;
use std::net::SocketAddr;
use std::path::PathBuf;

use clap::{Args, Subcommand};
use muster_daemon::operator::{self, OperatorError};

use super::{Failure, Outcome, terminal};

/// Upload a file to a drone with QUIC transport, or read its log.
///
/// The secret key in the fleet's folder authenticates the operator; the drone needs the matching public key. The address
/// is `bind` in the drone's file.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  muster drone upload my-fleet 10.0.0.7:4700 scenario.toml
  muster drone logs my-fleet 10.0.0.7:4700 --follow")]
pub(crate) struct Arguments {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Replace the drone's scenario (a .toml file) or its mission (any other file). The drone checks the file and uses it
    /// after its next start. Refused in flight.
    Upload {
        #[command(flatten)]
        drone: Drone,
        /// Scenario or mission file.
        file: PathBuf,
    },
    /// Print the drone's recent log.
    Logs {
        #[command(flatten)]
        drone: Drone,
        /// Follow the log until the drone's process ends.
        #[arg(long)]
        follow: bool,
    },
}

#[derive(Debug, Args)]
struct Drone {
    /// Fleet folder.
    fleet: PathBuf,
    /// Address and port of the drone.
    address: SocketAddr,
}

impl From<OperatorError> for Failure {
    fn from(error: OperatorError) -> Self {
        match error {
            OperatorError::Refused(input) => input.into(),
            error => Self::Drone(error),
        }
    }
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    match &arguments.action {
        Action::Upload { drone, file } => {
            let (id, stored) = operator::upload(&drone.fleet, drone.address, file)?;
            terminal::print(&format!(
                "drone {id} stored it as {} and uses it after its next start\n",
                stored.display()
            ))?;
        }
        Action::Logs { drone, follow } => {
            let mut out = io::stdout().lock();
            operator::logs(&drone.fleet, drone.address, *follow, &mut out)?;
        }
    }
    Ok(Outcome::Success)
}
