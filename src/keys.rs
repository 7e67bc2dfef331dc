use std::path::PathBuf;

use clap::{Args, Subcommand};
use muster_machines::identity::NodeId;
use muster_runtime::identity::{Fleet, KeysError};

use crate::{Ended, Failure, terminal};

/// Make the keys of a fleet and its drones, and expel drones.
///
/// A fleet's folder holds its secret key, which signs which drone has which key and who was expelled. Keep it where no
/// drone flies. A drone needs fleet.pub, roster.toml, expelled.toml and its own drone-ID.key. No key is ever written over.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  muster keys fleet my-fleet
  muster keys drone my-fleet 0 1 2 3 4
  muster keys revoke my-fleet 3")]
pub(crate) struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Make a fleet's key, in a folder of its own.
    Fleet {
        /// The folder, which is made if it is not there.
        folder: PathBuf,
    },
    /// Make drones' keys and sign the roster with them; drones that fly need the new roster to believe these.
    Drone(Drones),
    /// Put drones on the signed list of those that are not believed any more; drones read it at their start and on HUP,
    /// and pass it on.
    Revoke(Drones),
}

#[derive(Debug, Args)]
struct Drones {
    /// The fleet's folder.
    folder: PathBuf,
    /// The drones' numbers.
    #[arg(required = true, value_name = "ID")]
    ids: Vec<u32>,
}

impl From<KeysError> for Failure {
    fn from(error: KeysError) -> Self {
        match error {
            KeysError::Refused(input) => input.into(),
            error => Self::Keys(error),
        }
    }
}

pub(crate) fn run(arguments: &Arguments) -> Result<Ended, Failure> {
    match &arguments.what {
        What::Fleet { folder } => {
            Fleet::create(folder)?;
            let shown = folder.display();
            terminal::print(&format!(
                "made the keys of a fleet in {shown}; fleet.key is for you alone\n"
            ))?;
        }
        What::Drone(drones) => {
            let fleet = Fleet::open(&drones.folder)?;
            for id in &drones.ids {
                let path = fleet.add_drone(NodeId(*id))?;
                terminal::print(&format!("made {}, for drone {id} alone\n", path.display()))?;
            }
        }
        What::Revoke(drones) => {
            let ids: Vec<_> = drones.ids.iter().copied().map(NodeId).collect();
            let revoked = Fleet::open(&drones.folder)?.revoke(&ids)?;
            let all: Vec<_> = revoked.drones().map(|id| id.to_string()).collect();
            terminal::print(&format!(
                "list {} of the revoked: {}; give it to a drone, and those that hear it get it too\n",
                revoked.number(),
                all.join(", ")
            ))?;
        }
    }
    Ok(Ended::Well)
}
