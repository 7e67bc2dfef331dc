use std::collections::BTreeSet;
use std::path::PathBuf;

use clap::{Args, Subcommand};
use muster_machines::identity::NodeId;
use muster_runtime::identity::{Fleet, KeysError};

use super::{Failure, Outcome, terminal};

/// Create the keys of a fleet and its drones, and revoke drones.
///
/// The fleet's secret key signs the roster (which drone has which key), the revocation list, grants and releases. Keep its
/// folder off the drones. A drone needs fleet.pub, roster.toml, revoked.toml and its own drone-ID.key. Existing keys are never
/// overwritten.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  muster keys fleet my-fleet
  muster keys drone my-fleet 0 1 2 3 4
  muster keys revoke my-fleet 3")]
pub(crate) struct Arguments {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Create a fleet's key in a new folder.
    Fleet {
        /// Folder of the fleet; created if it does not exist.
        folder: PathBuf,
    },
    /// Create drones' keys and sign the new roster. Other drones accept the new keys only with the new roster.
    Drone(Drones),
    /// Add drones to the signed revocation list. Drones read it at start and on SIGHUP, and distribute it.
    Revoke(Drones),
}

#[derive(Debug, Args)]
struct Drones {
    /// Fleet folder.
    folder: PathBuf,
    /// Numbers of the drones.
    #[arg(required = true, value_name = "ID", value_parser = id, allow_negative_numbers = true)]
    ids: Vec<u32>,
}

/// Reads a drone's number.
pub(super) fn id(text: &str) -> Result<u32, String> {
    let id = text.parse();
    id.map_err(|_| format!("a drone's number is a whole number from 0 to {}", u32::MAX))
}

impl From<KeysError> for Failure {
    fn from(error: KeysError) -> Self {
        match error {
            KeysError::Refused(input) => input.into(),
            error => Self::Keys(error),
        }
    }
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    match &arguments.action {
        Action::Fleet { folder } => {
            Fleet::create(folder)?;
            let shown = folder.display();
            terminal::print(&format!(
                "created the keys of a fleet in {shown}; keep fleet.key secret\n"
            ))?;
        }
        Action::Drone(drones) => {
            let fleet = Fleet::open(&drones.folder)?;
            let ids: BTreeSet<_> = drones.ids.iter().copied().map(NodeId).collect();
            fleet.check_new(&ids)?;
            for id in ids {
                let path = fleet.add_drone(id)?;
                terminal::print(&format!(
                    "created {}; copy it to drone {id} only\n",
                    path.display()
                ))?;
            }
        }
        Action::Revoke(drones) => {
            let ids: Vec<_> = drones.ids.iter().copied().map(NodeId).collect();
            let revoked = Fleet::open(&drones.folder)?.revoke(&ids)?;
            let all: Vec<_> = revoked.drones().map(|id| id.to_string()).collect();
            terminal::print(&format!(
                "revocation list {} names: {}; copy it to one drone, which distributes it\n",
                revoked.number(),
                all.join(", ")
            ))?;
        }
    }
    Ok(Outcome::Success)
}
