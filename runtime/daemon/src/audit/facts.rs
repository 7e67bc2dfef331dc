//! What an audit looks at.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io;
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use super::card::Prepared;

/// Shells of users that can't log in.
const NO_SHELLS: [&str; 3] = ["nologin", "false", "sync"];

/// What an audit looks at.
#[derive(Debug, Clone, Default)]
pub(super) struct Facts {
    /// sshd's settings, as `sshd -T` prints them: lower-case names.
    pub(super) sshd: BTreeMap<String, String>,
    /// The user who logged in: root, or one who may become root.
    pub(super) operator: String,
    /// Users with a shell and a password.
    pub(super) with_password: BTreeSet<String>,
    /// Whether the firewall of muster is loaded, with all its rules and no other.
    pub(super) has_firewall: bool,
    /// Whether the firewall is loaded at boot.
    pub(super) firewall_starts: bool,
    /// Port of sshd.
    pub(super) ssh_ports: BTreeSet<u16>,
    /// Files with secrets that others than their owner can read, or keys that they can write.
    pub(super) open_keys: Vec<PathBuf>,
    /// Serial ports that everyone can use.
    pub(super) open_ports: Vec<PathBuf>,
    /// Exposure of each drone's service, in tenths, by `systemd-analyze security`.
    pub(super) exposures: BTreeMap<String, u32>,
    /// State of unattended security updates; `None` if nobody asks for them.
    pub(super) updates: Option<Updates>,
    /// What is known of a Raspberry Pi's card.
    pub(super) card: Prepared,
}

/// Unattended security updates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Updates {
    /// Their package is not installed.
    Missing,
    /// They are installed, and not switched on.
    Off,
    /// They install themselves.
    On,
}

impl Facts {
    /// Gathers them below a root folder.
    pub(super) fn gather(root: &Path, asks_for_updates: bool) -> io::Result<Self> {
        let sshd = settings(&output("sshd", &["-T"])?);
        let ports = sshd_ports(&output("sshd", &["-T"])?);
        let passwd = fs::read_to_string(root.join("etc/passwd"))?;
        let shadow = fs::read_to_string(root.join("etc/shadow"))?;
        let rules = output("nft", &["-n", "list", "table", "inet", "muster"]).unwrap_or_default();
        let unit =
            output("systemctl", &["is-enabled", super::rules::FIREWALL_UNIT]).unwrap_or_default();
        Ok(Self {
            sshd,
            operator: std::env::var("SUDO_USER").unwrap_or_else(|_| "root".to_owned()),
            with_password: with_password(&passwd, &shadow),
            has_firewall: super::rules::is_firewall(&rules, &ports),
            firewall_starts: unit.trim() == "enabled",
            ssh_ports: ports,
            card: Prepared::gather(root, &passwd)?,
            open_keys: open_keys(root, &passwd),
            open_ports: open_ports(root),
            exposures: exposures()?,
            updates: if asks_for_updates {
                Some(unattended_updates(root)?)
            } else {
                None
            },
        })
    }
}

/// Runs a command and returns what it prints, also if it fails.
pub(super) fn output(program: &str, arguments: &[&str]) -> io::Result<String> {
    let mut command = Command::new(program);
    command
        .args(arguments)
        .stdin(Stdio::null())
        .stderr(Stdio::null());
    // sshd and nft are in /usr/sbin, which is not in every user's path.
    command.env("PATH", "/usr/sbin:/usr/bin:/sbin:/bin");
    Ok(String::from_utf8_lossy(&command.output()?.stdout).into_owned())
}

pub(super) fn settings(text: &str) -> BTreeMap<String, String> {
    let lines = text.lines().filter_map(|line| line.split_once(' '));
    lines
        .map(|(name, value)| (name.to_lowercase(), value.trim().to_owned()))
        .collect()
}

fn sshd_ports(text: &str) -> BTreeSet<u16> {
    let ports = text.lines().filter_map(|line| line.strip_prefix("port "));
    ports.filter_map(|port| port.trim().parse().ok()).collect()
}

/// Users who can log in with a password.
pub(super) fn with_password(passwd: &str, shadow: &str) -> BTreeSet<String> {
    let shells: BTreeMap<_, _> = passwd
        .lines()
        .filter_map(|line| Some((line.split(':').next()?, line.rsplit(':').next()?)))
        .collect();
    let can_log_in = |user: &str| {
        let shell = shells.get(user).copied().unwrap_or("nologin");
        !NO_SHELLS.iter().any(|it| shell.ends_with(it))
    };
    let users = shadow.lines().filter_map(|line| {
        let mut fields = line.split(':');
        let (user, hash) = (fields.next()?, fields.next()?);
        // A hash that begins with ! or * fits no password. An empty one needs none.
        let is_usable = !hash.starts_with(['!', '*']);
        (is_usable && can_log_in(user)).then(|| user.to_owned())
    });
    users.collect()
}

/// Secret keys that others can read, and lists of keys that others can write.
pub(super) fn open_keys(root: &Path, passwd: &str) -> Vec<PathBuf> {
    let mut open = Vec::new();
    // Users choose what is in their homes: a link may lead anywhere.
    let mut check = |path: PathBuf, forbidden: u32, owner: Option<u32>| {
        let is_open = |it: &fs::Metadata| {
            let is_owners = owner.is_none_or(|owner| it.uid() == owner);
            it.is_file() && is_owners && it.mode() & forbidden != 0
        };
        if fs::symlink_metadata(&path).as_ref().is_ok_and(is_open) {
            open.push(path);
        }
    };
    for folder in [
        root.join("opt/muster/current/config"),
        root.join("etc/muster"),
        root.join("etc/ssh"),
    ] {
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            let is_secret =
                name.ends_with(".key") || (name.starts_with("ssh_host_") && name.ends_with("_key"));
            if is_secret {
                check(entry.path(), 0o077, None);
            }
        }
    }
    for line in passwd.lines() {
        let fields: Vec<_> = line.split(':').collect();
        let (Some(user), Some(home)) = (fields.get(2), fields.get(5)) else {
            continue;
        };
        let home = root.join(home.trim_start_matches('/'));
        check(home.join(".ssh/authorized_keys"), 0o022, user.parse().ok());
    }
    open.sort();
    open.dedup();
    open
}

/// Serial ports that everyone can read or write.
fn open_ports(root: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(root.join("dev"))
        .into_iter()
        .flatten()
        .flatten();
    let ports = entries.filter_map(|entry| {
        let name = entry.file_name().to_string_lossy().into_owned();
        let is_port = ["ttyACM", "ttyAMA", "ttyUSB"]
            .iter()
            .any(|it| name.starts_with(it));
        let metadata = entry.metadata().ok()?;
        let is_open = metadata.file_type().is_char_device() && metadata.mode() & 0o006 != 0;
        (is_port && is_open).then(|| entry.path())
    });
    let mut ports: Vec<_> = ports.collect();
    ports.sort();
    ports
}

fn unattended_updates(root: &Path) -> io::Result<Updates> {
    if !root.join("usr/bin/unattended-upgrade").exists() {
        return Ok(Updates::Missing);
    }
    let dump = output(
        "apt-config",
        &["dump", "--format", "%f %v%n", "APT::Periodic"],
    )?;
    Ok(updates(&dump))
}

/// The state of updates by apt's settings, as `apt-config dump` prints them with a name and a value a line. A period of "0",
/// or none, is never.
pub(super) fn updates(dump: &str) -> Updates {
    let settings = settings(dump);
    let is_on = |name: &str| {
        let period = settings.get(name).map_or("0", String::as_str);
        period != "0" && !period.is_empty()
    };
    let needed = [
        "apt::periodic::update-package-lists",
        "apt::periodic::unattended-upgrade",
    ];
    let is_enabled = settings
        .get("apt::periodic::enable")
        .is_none_or(|it| it != "0");
    if is_enabled && needed.iter().all(|it| is_on(it)) {
        Updates::On
    } else {
        Updates::Off
    }
}

/// Exposures of the drones' services that run.
fn exposures() -> io::Result<BTreeMap<String, u32>> {
    let units = output(
        "systemctl",
        &["list-units", "--plain", "--no-legend", "musterd@*.service"],
    )?;
    let mut exposures = BTreeMap::new();
    for unit in units
        .lines()
        .filter_map(|line| line.split_whitespace().next())
    {
        let text = output("systemd-analyze", &["security", "--no-pager", unit])?;
        if let Some(exposure) = exposure(&text) {
            exposures.insert(unit.to_owned(), exposure);
        }
    }
    Ok(exposures)
}

/// The exposure in tenths that `systemd-analyze security` prints, e.g. 17 for "exposure level for musterd@0.service: 1.7 OK".
pub(super) fn exposure(text: &str) -> Option<u32> {
    let line = text.lines().find(|line| line.contains("exposure level"))?;
    let (whole, tenth) = line
        .rsplit(':')
        .next()?
        .split_whitespace()
        .next()?
        .split_once('.')?;
    Some(whole.parse::<u32>().ok()? * 10 + tenth.parse::<u32>().ok()?)
}
