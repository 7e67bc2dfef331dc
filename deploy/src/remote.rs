//! Commands on other hosts, over a command that runs others there.

use std::io::{self, Write};
use std::process::{Command, Stdio};
use std::thread;

use thiserror::Error;

/// Exit code of ssh without a connection.
pub(crate) const NO_CONNECTION: i32 = 255;

/// Why a command on a host did not succeed.
#[derive(Debug, Error)]
pub(crate) enum RemoteError {
    /// The host can't be reached.
    #[error("no connection: {0}")]
    Lost(String),
    /// The command failed.
    #[error("{command}: {why}")]
    Failed {
        /// The command.
        command: String,
        /// The last line of its standard error.
        why: String,
        /// Its exit code. `None` if it was killed.
        code: Option<i32>,
    },
}

/// A command on a host. Its words have no characters that a shell there would read as more.
pub(crate) fn command(run: &[String], words: &[&str]) -> Command {
    let mut all = run.iter().map(String::as_str).chain(words.iter().copied());
    let mut command = Command::new(all.next().unwrap_or("false"));
    command.args(all);
    command
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    command
}

/// Runs a command on a host with this input. Returns what it prints.
pub(crate) fn output(run: &[String], words: &[&str], input: &[u8]) -> Result<Vec<u8>, RemoteError> {
    let lost = |error: io::Error| RemoteError::Lost(error.to_string());
    let mut child = command(run, words).spawn().map_err(lost)?;
    let mut stdin = child.stdin.take().expect("stdin is piped");
    let output = thread::scope(|scope| {
        scope.spawn(move || {
            // A command that does not read its input fails by itself.
            let _ = stdin.write_all(input);
        });
        child.wait_with_output()
    });
    let output = output.map_err(lost)?;
    if output.status.success() {
        return Ok(output.stdout);
    }
    let why = String::from_utf8_lossy(&output.stderr);
    let why = why.trim().lines().last().unwrap_or_default().to_owned();
    match output.status.code() {
        Some(NO_CONNECTION) => Err(RemoteError::Lost(why)),
        code => Err(RemoteError::Failed {
            command: words.join(" "),
            why,
            code,
        }),
    }
}

/// As [`output`], for one line of text.
pub(crate) fn line(run: &[String], words: &[&str]) -> Result<String, RemoteError> {
    let output = output(run, words, &[])?;
    Ok(String::from_utf8_lossy(&output).trim().to_owned())
}

/// Makes a folder on a host that only its user can read. Returns its path.
pub(crate) fn temporary_folder(run: &[String]) -> Result<String, RemoteError> {
    line(run, &["mktemp", "-d", "/var/tmp/muster.XXXXXXXX"])
}

/// Writes a file on a host.
pub(crate) fn upload(run: &[String], path: &str, content: &[u8]) -> Result<(), RemoteError> {
    let to = format!("of={path}");
    output(run, &["dd", &to, "bs=64k", "status=none"], content).map(drop)
}

/// Runs a command on a host with this process's output and errors, as `journalctl`.
///
/// # Errors
/// If it can't be started.
pub fn pass_through(run: &[String], words: &[&str]) -> io::Result<bool> {
    let mut command = command(run, words);
    command
        .stdin(Stdio::null())
        .stdout(Stdio::inherit())
        .stderr(Stdio::inherit());
    Ok(command.status()?.success())
}
