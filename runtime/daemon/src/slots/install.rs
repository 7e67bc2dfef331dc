//! Writes a slot: the release's files that this host needs, checked against the signed manifest, and the configuration.

use std::collections::BTreeMap;
use std::fs::{self, OpenOptions, Permissions};
use std::io::{self, Read, Write};
use std::os::unix::fs::{OpenOptionsExt, PermissionsExt, chown};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

use muster_runtime::identity::{FleetKey, MANIFEST_MAX, Manifest, RELEASE_FILE_MAX, hex, is_plain};
use rustix::process::{Pid, Signal, kill_process_group};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use thiserror::Error;

use super::disk::{Disk, open_to_all};
use super::facts::SlotFacts;
use super::machine::{Goal, SlotId};
use super::systemd::{BOOT, DRONES};

/// The most files of a slot.
const FILES_MAX: usize = 1_000;

/// The user of the drones' processes.
const USER: &str = "muster";

/// A slot that an operator sends.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Incoming {
    /// What the slot has.
    pub facts: SlotFacts,
    /// Text of the release's manifest.
    pub manifest: String,
    /// The files. Their contents follow in this order.
    pub files: Vec<IncomingFile>,
}

/// A file of a slot.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct IncomingFile {
    /// Its path in the slot.
    pub path: String,
    /// Its path in the release. `None` for a file of the configuration.
    pub in_release: Option<String>,
    /// Its length, in bytes.
    pub bytes: u64,
    /// Whether only the drones' user may read it.
    pub is_secret: bool,
}

/// Why a slot is refused. Nothing of it is left.
#[derive(Debug, Error)]
pub(super) enum Refusal {
    #[error("{0}")]
    Unusable(String),
    #[error("can't write the slot")]
    Disk(#[from] io::Error),
}

fn unusable<T>(why: impl Into<String>) -> Result<T, Refusal> {
    Err(Refusal::Unusable(why.into()))
}

/// Receives a slot.
///
/// # Errors
/// If it is not signed by the fleet that the host belongs to, not what the manifest says, can't be used, or can't be
/// written. `contents` may then be left in the middle.
pub(super) fn receive(
    disk: &Disk,
    incoming: &Incoming,
    contents: &mut dyn Read,
) -> Result<SlotId, Refusal> {
    let received = receive_into(disk, incoming, contents);
    if received.is_err() {
        disk.drop_incoming()?;
    }
    received
}

fn receive_into(
    disk: &Disk,
    incoming: &Incoming,
    contents: &mut dyn Read,
) -> Result<SlotId, Refusal> {
    check(incoming)?;
    disk.create()?;
    let read = |path: &Path| FleetKey::load(path).map_err(|it| Refusal::Unusable(it.to_string()));
    // The key that the host knows counts, so that another fleet's release is not taken here.
    let known = disk.slots()?.good;
    let known = known.map(|good| read(&disk.slot(&good).join("config/fleet.pub")));
    let known = known.transpose()?;
    if let Some(known) = &known {
        // Before anything makes room for it.
        listed(incoming, known)?;
    }
    disk.reach(&Goal::Room)?;
    let folder = disk.new_incoming()?;
    let user = user()?;
    let mut written = BTreeMap::new();
    for file in &incoming.files {
        let digest = write(&folder, file, contents, user)?;
        written.insert(file.path.clone(), digest);
    }
    let sent = read(&folder.join("config/fleet.pub"))?;
    let fleet = known.unwrap_or(sent);
    if sent != fleet {
        return unusable("the host belongs to another fleet");
    }
    verify(incoming, &fleet, &written)?;
    let facts = serde_json::to_vec(&incoming.facts).map_err(io::Error::from)?;
    store(&folder.join("slot.json"), &facts)?;
    store(&folder.join("manifest.toml"), incoming.manifest.as_bytes())?;
    try_out(&folder, user, TRY_OUT_MAX)?;
    let id = incoming.facts.id();
    disk.finish_incoming(&id)?;
    Ok(id)
}

/// Refuses what is no slot, before anything of it is written.
fn check(incoming: &Incoming) -> Result<(), Refusal> {
    let files = &incoming.files;
    let is_good = |file: &IncomingFile| {
        let place = file.path.starts_with("config/") == file.in_release.is_none();
        is_plain(&file.path) && place && file.bytes <= RELEASE_FILE_MAX
    };
    if !files.iter().all(is_good) || files.len() > FILES_MAX || !is_plain(&incoming.facts.id()) {
        return unusable("the slot has a file that it can't have");
    }
    if incoming.manifest.len() > MANIFEST_MAX {
        return unusable("the manifest is too long");
    }
    for needed in ["musterd", DRONES, BOOT] {
        if !files.iter().any(|file| file.path == needed) {
            return unusable(format!("the slot has no {needed}"));
        }
    }
    Ok(())
}

/// The manifest, if the fleet has signed it and it names the slot's files with their lengths.
fn listed(incoming: &Incoming, fleet: &FleetKey) -> Result<Manifest, Refusal> {
    let path = Path::new("manifest.toml");
    let manifest = Manifest::parse(path, incoming.manifest.clone(), fleet)
        .map_err(|error| Refusal::Unusable(error.to_string()))?;
    let facts = &incoming.facts;
    if facts.release != hex(&manifest.digest()) || facts.version != manifest.version {
        return unusable("the slot is not of this release");
    }
    for file in &incoming.files {
        let Some(name) = &file.in_release else {
            continue;
        };
        let bytes = manifest.files.get(name).map(|it| it.bytes);
        if bytes != Some(file.bytes) {
            return unusable(format!("{name} is not the file that the manifest names"));
        }
    }
    Ok(manifest)
}

/// Compares what was written with the manifest and the hashes that the slot is named after.
fn verify(
    incoming: &Incoming,
    fleet: &FleetKey,
    written: &BTreeMap<String, [u8; 32]>,
) -> Result<(), Refusal> {
    let manifest = listed(incoming, fleet)?;
    for file in &incoming.files {
        let Some(name) = &file.in_release else {
            continue;
        };
        let listed = manifest.files.get(name).map(|it| it.sha256);
        if listed != written.get(&file.path).copied() {
            return unusable(format!("{name} is not the file that the manifest names"));
        }
    }
    if incoming.facts.configuration != configuration_digest(written) {
        return unusable("the configuration was changed on its way");
    }
    Ok(())
}

/// SHA-256 of all files of a configuration by their names and hashes, in hexadecimal.
#[must_use]
pub fn configuration_digest(files: &BTreeMap<String, [u8; 32]>) -> String {
    let mut digest = Sha256::new();
    for (path, hash) in files.iter().filter(|(path, _)| path.starts_with("config/")) {
        digest.update((path.len() as u64).to_le_bytes());
        digest.update(path);
        digest.update(hash);
    }
    hex(&digest.finalize())
}

/// Writes a file of a slot in its folder. Returns its SHA-256.
fn write(
    folder: &Path,
    file: &IncomingFile,
    contents: &mut dyn Read,
    user: Option<(u32, u32)>,
) -> Result<[u8; 32], Refusal> {
    let path = &folder.join(&file.path);
    let parent = path.parent().map(Path::to_owned).unwrap_or_default();
    fs::create_dir_all(&parent)?;
    for new in parent.ancestors().take_while(|it| *it != folder) {
        open_to_all(new)?;
    }
    let mode = match (file.is_secret, file.path.as_str()) {
        (true, _) => 0o600,
        (false, "musterd") => 0o755,
        (false, _) => 0o644,
    };
    let mut options = OpenOptions::new();
    let mut written = options.create_new(true).write(true).mode(mode).open(path)?;
    // Whatever the mask of this process is.
    written.set_permissions(Permissions::from_mode(mode))?;
    let (mut digest, mut left) = (Sha256::new(), file.bytes);
    let mut buffer = [0; 64 * 1_024];
    while left > 0 {
        let piece = buffer
            .len()
            .min(usize::try_from(left).unwrap_or(usize::MAX));
        let read = contents.read(&mut buffer[..piece])?;
        if read == 0 {
            return Err(io::Error::from(io::ErrorKind::UnexpectedEof).into());
        }
        digest.update(&buffer[..read]);
        written.write_all(&buffer[..read])?;
        left -= read as u64;
    }
    if let (true, Some((user, group))) = (file.is_secret, user) {
        chown(path, Some(user), Some(group))?;
    }
    written.sync_all()?;
    fs::File::open(parent)?.sync_all()?;
    Ok(digest.finalize().into())
}

fn store(path: &Path, bytes: &[u8]) -> io::Result<()> {
    fs::write(path, bytes)?;
    fs::set_permissions(path, Permissions::from_mode(0o644))?;
    fs::File::open(path)?.sync_all()
}

/// Time for the new program to read all files of drones.
const TRY_OUT_MAX: Duration = Duration::from_secs(20);
/// Time between two looks whether it has.
const TRY_OUT_PERIOD: Duration = Duration::from_millis(20);
/// The most of its errors that is passed on, in bytes.
const ERRORS_MAX: u64 = 16 * 1_024;

/// The new program reads the new configuration, as it would at its start: as the drones' user, in limited time.
fn try_out(folder: &Path, user: Option<(u32, u32)>, limit: Duration) -> Result<(), Refusal> {
    let end = Instant::now() + limit;
    let mut files: Vec<PathBuf> = Vec::new();
    for entry in fs::read_dir(folder.join("config"))? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if name.starts_with("drone-") && name.ends_with(".toml") {
            files.push(path);
        }
    }
    for file in files {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        let mut command = Command::new(folder.join("musterd"));
        command.arg("--check").arg("--config").arg(&file);
        if let Some((user, group)) = user {
            command.uid(user).gid(group);
        }
        match check_by(command, end)? {
            Checked::Good => {}
            Checked::Late => {
                let seconds = limit.as_secs();
                return unusable(format!(
                    "the new musterd has not checked {name} within {seconds} s"
                ));
            }
            Checked::Bad(why) => {
                return unusable(format!("the new musterd refuses {name}: {}", why.trim()));
            }
        }
    }
    Ok(())
}

/// How a check of a file ended.
enum Checked {
    Good,
    Bad(String),
    Late,
}

/// Runs a check with all that it starts, and kills them at this time.
fn check_by(mut command: Command, end: Instant) -> io::Result<Checked> {
    command.stdin(Stdio::null()).stdout(Stdio::null());
    let mut child = command.stderr(Stdio::piped()).process_group(0).spawn()?;
    let stderr = child.stderr.take().expect("stderr is piped");
    let (sender, errors) = channel();
    std::thread::spawn(move || {
        let mut text = Vec::new();
        let _ = stderr.take(ERRORS_MAX).read_to_end(&mut text);
        let _ = sender.send(text);
    });
    let status = loop {
        match child.try_wait()? {
            None if Instant::now() < end => std::thread::sleep(TRY_OUT_PERIOD),
            status => break status,
        }
    };
    if let Some(group) = i32::try_from(child.id()).ok().and_then(Pid::from_raw) {
        // None of it is left, also of a program that has ended.
        let _ = kill_process_group(group, Signal::KILL);
    }
    child.wait()?;
    let text = errors.recv_timeout(TRY_OUT_PERIOD).unwrap_or_default();
    Ok(match status {
        None => Checked::Late,
        Some(status) if status.success() => Checked::Good,
        Some(_) => Checked::Bad(String::from_utf8_lossy(&text).into_owned()),
    })
}

/// Number of the drones' user and of its group; creates the user if there is none. `None` if this process is not root's: then
/// nothing is given to anyone.
fn user() -> io::Result<Option<(u32, u32)>> {
    if !rustix::process::geteuid().is_root() {
        return Ok(None);
    }
    if let Some(user) = find_user()? {
        return Ok(Some(user));
    }
    let mut command = Command::new("useradd");
    command.args(["--system", "--user-group", "--shell", "/usr/sbin/nologin"]);
    command.args(["--home-dir", "/var/lib/muster", USER]);
    if !command.stdin(Stdio::null()).status()?.success() {
        return Err(io::Error::other("useradd can't create the user muster"));
    }
    find_user()
}

fn find_user() -> io::Result<Option<(u32, u32)>> {
    let users = fs::read_to_string("/etc/passwd")?;
    let found = users.lines().find_map(|line| {
        let fields: Vec<_> = line.split(':').collect();
        let numbers = (fields.get(2)?.parse().ok()?, fields.get(3)?.parse().ok()?);
        (*fields.first()? == USER).then_some(numbers)
    });
    Ok(found)
}

#[cfg(test)]
mod tests;
