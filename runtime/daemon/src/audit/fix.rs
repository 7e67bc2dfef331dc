//! Changes of a host that are undone after a minute, unless the operator can still log in.

use std::fs::{self, Permissions};
use std::io;
use std::os::unix::fs::PermissionsExt;
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
    /// Sets the permissions that were there.
    Permit { path: PathBuf, mode: u32 },
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
            Self::Close { path } => Undo::Permit {
                path: path.clone(),
                mode: fs::metadata(path)?.permissions().mode(),
            },
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
                let mode = fs::metadata(path)?.permissions().mode();
                // A serial port stays its group's.
                let closed = if path.starts_with("/dev") {
                    mode & !0o007
                } else {
                    mode & !0o077
                };
                fs::set_permissions(path, Permissions::from_mode(closed))
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
            Self::Permit { path, mode } => fs::set_permissions(path, Permissions::from_mode(*mode)),
            Self::Run { words } => run(words),
        }
    }
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

/// Makes changes, and lets systemd undo them after a minute.
pub(super) fn carry_out(changes: &[Change]) -> io::Result<()> {
    let home = Path::new(HOME);
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
    replace(&home.join("undo.json"), &serde_json::to_vec(&undos)?)?;
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

fn is_disabling(undo: &Undo) -> bool {
    matches!(undo, Undo::Run { words } if words.iter().any(|it| it == "disable"))
}

/// The operator has logged in again: nothing is undone.
///
/// # Errors
/// If systemd refuses.
pub(crate) fn confirm() -> io::Result<()> {
    // Without a fix there is nothing to stop.
    let _ = run(&["systemctl", "stop", "muster-audit-undo.timer"].map(str::to_owned));
    match fs::remove_dir_all(HOME) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

/// Undoes the last fix, if it was not confirmed.
///
/// # Errors
/// The first that is met; all else is undone.
pub(crate) fn undo() -> io::Result<()> {
    let text = fs::read(Path::new(HOME).join("undo.json"))?;
    let undos: Vec<Undo> = serde_json::from_slice(&text)?;
    let mut result = Ok(());
    for undo in undos {
        result = result.and(undo.carry_out());
    }
    fs::remove_dir_all(HOME)?;
    result
}
