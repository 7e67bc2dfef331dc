//! Cards: a stock Raspberry Pi OS Lite, whose partitions are mounted, is made to start without a screen and to be reached over ssh
//! in the drones' own radio network.
//!
//! All files are read, and what they shall say is decided, before the first is written. Each is replaced whole, and if one
//! can't be, those before it are put back.

mod edit;
mod settings;
mod users;

use std::fs;
use std::io;
use std::net::Ipv4Addr;
use std::path::{Path, PathBuf};

use muster_runtime::diagnostic::{BadInput, read_text};
use thiserror::Error;

use self::edit::Edit;
pub use self::settings::{RATES_MBPS, address, country, host_name, ssid, user_name};

/// What a card is made for.
#[derive(Debug, Clone)]
pub struct Card {
    /// Name of the host.
    pub name: String,
    /// The user who logs in, in the place of the default one.
    pub user: String,
    /// File with the public keys of who may log in.
    pub authorized_keys: PathBuf,
    /// Address in the drones' network, and the length of the network's prefix.
    pub address: (Ipv4Addr, u8),
    /// Name of the ad hoc network.
    pub ssid: String,
    /// Its channel at 2.4 GHz, 1 to 13.
    pub channel: u8,
    /// Its fixed rate, in Mbit/s: one of [`RATES_MBPS`].
    pub rate_mbps: u8,
    /// Country code of the radio regulations: two letters.
    pub country: String,
    /// Address of a time server. `None`: those of the distribution.
    pub time_server: Option<Ipv4Addr>,
}

/// Why a card was not prepared. It is as it was.
#[derive(Debug, Error)]
pub enum ImageError {
    /// A folder is not a card's, or a file can't be used.
    #[error(transparent)]
    Refused(#[from] BadInput),
    /// A file could not be written; those before it were put back.
    #[error("can't write {}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The cause.
        #[source]
        source: io::Error,
    },
}

/// Prepares a card whose boot and root partitions are mounted. Returns the paths that were changed, from the card's root. Prepared
/// again, it is changed to what is asked for now.
///
/// # Errors
/// If the folders are no Raspberry Pi OS, or something can't be written.
pub fn prepare(boot: &Path, root: &Path, card: &Card) -> Result<Vec<PathBuf>, ImageError> {
    let edits = plan(boot, root, card)?;
    edit::carry_out(&edits)?;
    let changed = edits.iter().map(|it| it.path().to_owned());
    Ok(changed.collect())
}

/// What to change.
fn plan(boot: &Path, root: &Path, card: &Card) -> Result<Vec<Edit>, BadInput> {
    let os = read_text(&root.join("etc/os-release"))?;
    if !os
        .lines()
        .any(|line| ["ID=raspbian", "ID=debian"].contains(&line))
    {
        let message = "this is no Raspberry Pi OS";
        let help = "mount the second partition of a Raspberry Pi OS Lite card, and name its folder";
        return Err(BadInput::without_excerpt(
            &root.join("etc/os-release"),
            message,
            help,
        ));
    }
    let keys = read_text(&card.authorized_keys)?;
    if let Some(what) = settings::is_no_public_key(&keys) {
        let help = "name a file with public keys, such as ~/.ssh/id_ed25519.pub";
        return Err(BadInput::without_excerpt(&card.authorized_keys, what, help));
    }
    let config = boot.join("config.txt");
    if let Some(what) = settings::is_no_config(&read_text(&config)?) {
        let help =
            "write the other mark back, or remove the lines of `muster deploy image` by hand";
        return Err(BadInput::without_excerpt(&config, what, help));
    }
    let mut edits = users::edits(root, card)?;
    let home = users::home(root, card)?;
    let ssh = root.join("home").join(&card.user).join(".ssh");
    edits.push(Edit::folder(&ssh, 0o700, home));
    edits.push(Edit::owned(&ssh.join("authorized_keys"), keys, 0o600, home));
    for (name, edit) in [
        (
            "cmdline.txt",
            settings::cmdline as fn(&str, &Card) -> String,
        ),
        ("config.txt", settings::config),
    ] {
        let path = boot.join(name);
        edits.push(Edit::kept(&path, edit(&read_text(&path)?, card)));
    }
    // Starts sshd, and makes the host's keys, at the first boot.
    edits.push(Edit::write(&boot.join("ssh"), String::new(), None));
    let hosts = fs::read_to_string(root.join("etc/hosts")).unwrap_or_default();
    edits.push(Edit::write(
        &root.join("etc/hosts"),
        settings::hosts(&hosts, card),
        Some(0o644),
    ));
    for (path, mode, text) in settings::files(card) {
        edits.push(Edit::write(&root.join(path), text, Some(mode)));
    }
    edits.push(Edit::link(
        &root.join("etc/systemd/system/multi-user.target.wants/muster-radio.service"),
        "/etc/systemd/system/muster-radio.service",
    ));
    // Asks for a user's name on the screen, before anything else.
    edits.push(Edit::remove(&root.join(
        "etc/systemd/system/multi-user.target.wants/userconfig.service",
    )));
    for edit in &edits {
        edit.refuse_links([boot, root])?;
    }
    Ok(edits)
}

#[cfg(test)]
mod tests;
