use std::path::PathBuf;

use clap::Args;
use muster_deploy::release::{PackageRequest, package};

use super::super::{Failure, Outcome, folder, terminal};

/// Pack programs for all processors into a signed release.
///
/// The same programs give the same bytes. No key is packed: keys, lists, scenario and configuration go to the hosts apart.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Folder with x86_64/muster, x86_64/musterd, aarch64/muster and aarch64/musterd, or one of both; `deploy/cross` builds it.
    #[arg(long, value_name = "DIR")]
    programs: PathBuf,
    /// Folder of the fleet's keys; its key signs the release.
    #[arg(long, value_name = "DIR")]
    keys: PathBuf,
    /// Version of the release.
    #[arg(long, value_name = "VERSION", default_value = env!("CARGO_PKG_VERSION"))]
    release_version: String,
    /// Output folder; created if it does not exist.
    #[arg(long, value_name = "DIR", default_value = ".")]
    out: PathBuf,
    /// Write a Debian package for each processor, too, for hosts that are installed by hand.
    #[arg(long)]
    deb: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    folder::check_writable(&arguments.out)?;
    let written = package(&PackageRequest {
        programs: &arguments.programs,
        keys: &arguments.keys,
        version: &arguments.release_version,
        out: &arguments.out,
        deb: arguments.deb,
    })?;
    for path in written {
        terminal::print(&format!("wrote {}\n", path.display()))?;
    }
    Ok(Outcome::Success)
}
