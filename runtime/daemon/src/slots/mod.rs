//! The releases on a host: slots that are switched atomically, and the rollback to the last one that proved itself.
//!
//! | path | |
//! | --- | --- |
//! | `/opt/muster/slots/NAME` | a release and its configuration, whole |
//! | `/opt/muster/current` | the slot that runs |
//! | `/opt/muster/good` | the slot that has proven itself last |
//! | `/opt/muster/previous` | the good slot before it |
//!
//! [What happens when](../../../docs/src/how/deploy.md).

mod disk;
mod facts;
mod flight;
mod gate;
mod install;
mod machine;
mod observe;
pub mod protocol;
mod serve;
mod systemd;
mod trial;

use std::io;
use std::path::Path;

use clap::Subcommand;

use self::disk::Disk;
pub use self::disk::Failure;
pub use self::facts::{DroneFacts, HostFacts, SlotFacts};
pub use self::gate::{DroneHealth, GateLimits};
pub use self::install::{Incoming, IncomingFile, configuration_digest};
use self::systemd::Systemd;
use crate::audit;

/// What `musterd slot` does on a host.
#[derive(Debug, Subcommand)]
pub(crate) enum SlotAction {
    /// Answer `muster deploy`, connected by standard input and output.
    Serve,
    /// Run a slot on trial. It becomes the good one if its drones prove themselves.
    Trial {
        /// Name of the slot.
        slot: String,
    },
    /// Go back to the good slot, unless it runs.
    Settle,
    /// Undo what an audit set, since the operator did not log in again.
    UndoAudit,
}

/// A host: its disk and its services.
#[derive(Debug)]
struct Host {
    disk: Disk,
    systemd: Systemd,
}

/// Carries it out on this host. Returns whether all went well.
///
/// # Errors
/// If the disk or systemd refuses.
pub(crate) fn run(action: &SlotAction) -> io::Result<bool> {
    let host = Host {
        disk: Disk::at(Path::new("/")),
        systemd: Systemd {
            program: "systemctl".into(),
        },
    };
    match action {
        SlotAction::Serve => serve::serve(&host).map(|()| true),
        SlotAction::Trial { slot } => trial::run(&host, slot),
        SlotAction::Settle => trial::settle(&host).map(|()| true),
        SlotAction::UndoAudit => audit::undo().map(|()| true),
    }
}
