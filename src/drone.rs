use std::io;
use std::net::SocketAddr;
use std::path::PathBuf;

use clap::{Args, Subcommand};
use muster_daemon::operator::{self, OperatorError};

use crate::{Ended, Failure, terminal};

/// Speak with one drone that flies over QUIC: hand it a file for its next start, or read its log.
///
/// The fleet's folder has the secret key by which drones know their operator; they have its public one. The address is the
/// drone's own, `bind` in its file.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  muster drone upload my-fleet 10.0.0.7:4700 scenario.toml
  muster drone logs my-fleet 10.0.0.7:4700 --follow")]
pub(crate) struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Replace the drone's scenario (a file that ends in .toml) or the mission that its scenario names (any other). The
    /// drone checks that it could start with it; it flies it after its next start. Refused while it flies.
    Upload {
        #[command(flatten)]
        drone: Drone,
        /// The scenario's or the mission's file.
        file: PathBuf,
    },
    /// Print what the drone has said of late.
    Logs {
        #[command(flatten)]
        drone: Drone,
        /// Go on with what it says, until its process ends.
        #[arg(long)]
        follow: bool,
    },
}

#[derive(Debug, Args)]
struct Drone {
    /// The fleet's folder.
    fleet: PathBuf,
    /// The drone's address and port.
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

pub(crate) fn run(arguments: &Arguments) -> Result<Ended, Failure> {
    match &arguments.what {
        What::Upload { drone, file } => {
            let (id, place) = operator::upload(&drone.fleet, drone.address, file)?;
            terminal::print(&format!(
                "drone {id} has it as {}, and flies it after its next start\n",
                place.display()
            ))?;
        }
        What::Logs { drone, follow } => {
            let mut out = io::stdout().lock();
            operator::logs(&drone.fleet, drone.address, *follow, &mut out)?;
        }
    }
    Ok(Ended::Well)
}
