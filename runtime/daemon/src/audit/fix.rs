//! Changes of a host that are undone after a minute, unless the operator can still log in.

use std::fs::{self, File, OpenOptions, Permissions};
use std::io;
use std::os::unix::fs::{FileTypeExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use muster_runtime::file::replace;
use serde::{Deserialize, Serialize};

/// Folder of the program and the list of what to undo.
const HOME: &str = "/opt/muster/audit";
/// The service that undoes.
const UNDO: &str = "muster-audit-undo";
/// Time for the operator to log in again, in seconds.
const CONFIRM_S: u32 = 60;

/// A change of a host.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Change {
    /// Writes a file.
    Write { path: PathBuf, text: String },
    /// Takes all permissions of others from a file.
    Close { path: PathBuf },
    /// Runs a command.
    Run {
        words: Vec<String>,
        /// The command that undoes it.
        undo: Vec<String>,
    },
}

/// What undoes a change.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Undo {
    /// Writes the text that was there; `None` removes the file.
    Write { path: PathBuf, text: Option<String> },
    /// Sets the permissions that were there, if it is still this user's.
    Permit {
        path: PathBuf,
        mode: u32,
        owner: u32,
    },
    /// Runs a command.
    Run { words: Vec<String> },
}

impl Change {
    /// What undoes it, as the host is now.
    pub(super) fn undo(&self) -> io::Result<Undo> {
        Ok(match self {
            Self::Write { path, .. } => Undo::Write {
                path: path.clone(),
                text: fs::read_to_string(path).ok(),
            },
            Self::Close { path } => {
                let is = open_itself(path)?.metadata()?;
                Undo::Permit {
                    path: path.clone(),
                    mode: is.mode(),
                    owner: is.uid(),
                }
            }
            Self::Run { undo, .. } => Undo::Run {
                words: undo.clone(),
            },
        })
    }

    pub(super) fn carry_out(&self) -> io::Result<()> {
        match self {
            Self::Write { path, text } => {
                if let Some(folder) = path.parent() {
                    fs::create_dir_all(folder)?;
                }
                replace(path, text.as_bytes())
            }
            Self::Close { path } => {
                let file = open_itself(path)?;
                let mode = file.metadata()?.mode();
                // A serial port stays its group's.
                let closed = if path.starts_with("/dev") {
                    mode & !0o007
                } else {
                    mode & !0o077
                };
                file.set_permissions(Permissions::from_mode(closed))
            }
            Self::Run { words, .. } => run(words),
        }
    }
}

impl Undo {
    pub(super) fn carry_out(&self) -> io::Result<()> {
        match self {
            Self::Write {
                path,
                text: Some(text),
            } => replace(path, text.as_bytes()),
            Self::Write { path, text: None } => match fs::remove_file(path) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
                _ => Ok(()),
            },
            Self::Permit { path, mode, owner } => {
                let file = open_itself(path)?;
                if file.metadata()?.uid() != *owner {
                    return Err(refused(path, "it is another user's by now"));
                }
                file.set_permissions(Permissions::from_mode(*mode))
            }
            Self::Run { words } => run(words),
        }
    }
}

/// Opens a file or a serial port, and never what a link leads to: users choose what is in their folders.
fn open_itself(path: &Path) -> io::Result<File> {
    use rustix::fs::OFlags;
    let flags = OFlags::NOFOLLOW | OFlags::NONBLOCK | OFlags::NOCTTY;
    let flags = i32::try_from(flags.bits()).expect("the system's flags are of this type");
    let file = OpenOptions::new()
        .read(true)
        .custom_flags(flags)
        .open(path)?;
    let kind = file.metadata()?.file_type();
    if kind.is_file() || (kind.is_char_device() && path.starts_with("/dev")) {
        return Ok(file);
    }
    Err(refused(path, "it is no file"))
}

fn refused(path: &Path, why: &str) -> io::Error {
    io::Error::other(format!("{}: {why}", path.display()))
}

fn run(words: &[String]) -> io::Result<()> {
    let (program, arguments) = words.split_first().ok_or(io::ErrorKind::InvalidInput)?;
    let mut command = Command::new(program);
    command
        .args(arguments)
        .env("PATH", "/usr/sbin:/usr/bin:/sbin:/bin");
    command
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    if command.status()?.success() {
        return Ok(());
    }
    Err(io::Error::other(format!("{} failed", words.join(" "))))
}

/// In which order changes are undone: files first, as they were before, then commands in the order of the changes.
pub(super) fn undo_order(mut undos: Vec<Undo>) -> Vec<Undo> {
    undos.sort_by_key(|undo| matches!(undo, Undo::Run { .. }));
    undos
}

/// List of what is to be undone.
const UNDOS: &str = "undo.json";

/// Makes changes, and lets systemd undo them after a minute.
///
/// # Errors
/// If the last fix is not confirmed and not undone yet, or a change fails.
pub(super) fn carry_out(changes: &[Change]) -> io::Result<()> {
    let home = Path::new(HOME);
    let timer = format!("{UNDO}.timer");
    let is_timed = run(&["systemctl", "is-active", &timer].map(str::to_owned)).is_ok();
    make_way(home, is_timed)?;
    fs::create_dir_all(home)?;
    let program = home.join("musterd");
    fs::copy("/proc/self/exe", &program)?;
    fs::set_permissions(&program, Permissions::from_mode(0o700))?;
    let undos = changes
        .iter()
        .map(Change::undo)
        .collect::<io::Result<Vec<_>>>()?;
    // Disabling comes before its unit is removed.
    let (disabled, rest): (Vec<_>, Vec<_>) = undo_order(undos).into_iter().partition(is_disabling);
    let undos: Vec<_> = disabled.into_iter().chain(rest).collect();
    replace(&home.join(UNDOS), &serde_json::to_vec(&undos)?)?;
    let after = format!("--on-active={CONFIRM_S}");
    let unit = format!("--unit={UNDO}");
    let program = program.display().to_string();
    let words = [
        "systemd-run",
        "--quiet",
        "--collect",
        &unit,
        &after,
        &program,
        "slot",
        "undo-audit",
    ];
    run(&words.map(str::to_owned))?;
    changes.iter().try_for_each(Change::carry_out)
}

/// Refuses while the last fix waits for its confirmation. One that a restart of the host interrupted is undone.
fn make_way(home: &Path, is_timed: bool) -> io::Result<()> {
    if !home.join(UNDOS).exists() {
        return Ok(());
    }
    if is_timed {
        let why = "the last fix is not confirmed yet; within a minute it is, or is undone";
        return Err(io::Error::other(why));
    }
    undo_in(home)
}

fn is_disabling(undo: &Undo) -> bool {
    matches!(undo, Undo::Run { words } if words.iter().any(|it| it == "disable"))
}

/// The operator has logged in again: nothing is undone.
///
/// # Errors
/// If the fix was undone by now, or the system refuses.
pub(crate) fn confirm() -> io::Result<()> {
    // From now on nothing begins to undo it. What has begun goes on to its end.
    let timer = format!("{UNDO}.timer");
    let _ = run(&["systemctl", "stop", &timer].map(str::to_owned));
    let service = format!("{UNDO}.service");
    let undoes = run(&["systemctl", "is-active", &service].map(str::to_owned)).is_ok();
    confirm_in(Path::new(HOME), undoes)
}

fn confirm_in(home: &Path, undoes: bool) -> io::Result<()> {
    if undoes || !home.join(UNDOS).exists() {
        return Err(io::Error::other(
            "it was undone: nobody logged in again within a minute",
        ));
    }
    fs::remove_dir_all(home)
}

/// Undoes the last fix, if it was not confirmed.
///
/// # Errors
/// The first that is met; all else is undone.
pub(crate) fn undo() -> io::Result<()> {
    undo_in(Path::new(HOME))
}

fn undo_in(home: &Path) -> io::Result<()> {
    let text = fs::read(home.join(UNDOS))?;
    let undos: Vec<Undo> = serde_json::from_slice(&text)?;
    let mut result = Ok(());
    for undo in undos {
        result = result.and(undo.carry_out());
    }
    fs::remove_dir_all(home)?;
    result
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    fn mode(path: &Path) -> u32 {
        fs::metadata(path).unwrap().mode() & 0o777
    }

    fn file(folder: &Path, name: &str, mode: u32) -> PathBuf {
        let path = folder.join(name);
        fs::write(&path, "").unwrap();
        fs::set_permissions(&path, Permissions::from_mode(mode)).unwrap();
        path
    }

    #[test]
    fn link_of_a_user_is_not_followed() {
        let folder = tempfile::tempdir().unwrap();
        let other = file(folder.path(), "of-another", 0o666);
        let link = folder.path().join("authorized_keys");
        symlink(&other, &link).unwrap();
        let close = Change::Close { path: link.clone() };
        assert!(close.undo().is_err() && close.carry_out().is_err());
        let undo = Undo::Permit {
            path: link,
            mode: 0o600,
            owner: fs::metadata(&other).unwrap().uid(),
        };
        undo.carry_out().unwrap_err();
        assert_eq!(mode(&other), 0o666);
        let folder = Change::Close {
            path: folder.path().to_owned(),
        };
        folder.carry_out().unwrap_err();
    }

    #[test]
    fn permissions_come_back_only_if_the_file_is_the_same_users() {
        let folder = tempfile::tempdir().unwrap();
        let key = file(folder.path(), "drone-0.key", 0o644);
        let close = Change::Close { path: key.clone() };
        let undo = close.undo().unwrap();
        close.carry_out().unwrap();
        assert_eq!(mode(&key), 0o600);
        undo.carry_out().unwrap();
        assert_eq!(mode(&key), 0o644);
        let Undo::Permit { path, mode, owner } = undo else {
            panic!("{undo:?}");
        };
        let others = Undo::Permit {
            path,
            mode,
            owner: owner + 1,
        };
        others.carry_out().unwrap_err();
    }

    #[test]
    fn fix_that_was_undone_is_not_confirmed() {
        let folder = tempfile::tempdir().unwrap();
        let home = folder.path().join("audit");
        fs::create_dir(&home).unwrap();
        fs::write(home.join(UNDOS), "[]").unwrap();
        confirm_in(&home, true).unwrap_err();
        confirm_in(&home, false).unwrap();
        let refused = confirm_in(&home, false).unwrap_err().to_string();
        assert!(refused.contains("it was undone"), "{refused}");
    }

    #[test]
    fn fix_waits_for_the_one_before_and_undoes_an_interrupted_one() {
        let folder = tempfile::tempdir().unwrap();
        let home = folder.path().join("audit");
        make_way(&home, false).unwrap();
        fs::create_dir(&home).unwrap();
        let key = file(folder.path(), "drone-0.key", 0o600);
        let undo = Undo::Permit {
            owner: fs::metadata(&key).unwrap().uid(),
            path: key.clone(),
            mode: 0o644,
        };
        fs::write(home.join(UNDOS), serde_json::to_vec(&[undo]).unwrap()).unwrap();
        make_way(&home, true).unwrap_err();
        assert_eq!(mode(&key), 0o600);
        make_way(&home, false).unwrap();
        assert_eq!(mode(&key), 0o644);
        assert!(!home.exists());
    }
}
