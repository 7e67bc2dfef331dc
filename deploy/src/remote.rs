//! Commands on other hosts, over a command that runs others there.

use std::io::{self, BufRead, Read, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::mpsc::channel;
use std::thread;
use std::time::Duration;

use thiserror::Error;

/// Exit code of ssh without a connection.
pub(crate) const NO_CONNECTION: i32 = 255;

/// The longest line that is read, in bytes; the rest of it counts as another line.
pub(crate) const LINE_MAX: u64 = 4 * 1_024 * 1_024;
/// The longest output of a command, in bytes.
const OUTPUT_MAX: u64 = 512 * 1_024 * 1_024;

/// Time for a short command, with the connection.
const SHORT_MAX: Duration = Duration::from_secs(30);
/// Slowest connection that a file is sent over, in bytes a second.
pub(crate) const SLOWEST: u64 = 20_000;
/// The temporary folders of this program on hosts, without the letters and digits at the end.
const TEMPORARY: &str = "/var/tmp/muster.";

/// Lines of what a host sends, each of limited length. They end with the input, or at its first error.
pub(crate) struct Lines<R>(pub(crate) R);

impl<R: BufRead> Iterator for Lines<R> {
    type Item = String;

    fn next(&mut self) -> Option<String> {
        let mut line = Vec::new();
        let mut limited = (&mut self.0).take(LINE_MAX);
        limited
            .read_until(b'\n', &mut line)
            .ok()
            .filter(|read| *read > 0)?;
        Some(String::from_utf8_lossy(&line).trim_end().to_owned())
    }
}

/// The command that reaches a host, with a connection of its own: ssh may otherwise share one that was there before.
pub(crate) fn own_connection(run: &[String]) -> Vec<String> {
    with_option(run, "ControlPath=none")
}

/// Adds an option to a command that is ssh.
fn with_option(run: &[String], option: &str) -> Vec<String> {
    let mut all = run.to_vec();
    if run.first().is_some_and(|it| Path::new(it).ends_with("ssh")) {
        // The first setting counts.
        all.splice(1..1, ["-o", option].map(str::to_owned));
    }
    all
}

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

/// A command on a host. Its words have no characters that a shell there would read as more. ssh ends within half a minute if
/// the host falls silent.
pub(crate) fn command(run: &[String], words: &[&str]) -> Command {
    let run = with_option(run, "ServerAliveInterval=10");
    let mut all = run.iter().map(String::as_str).chain(words.iter().copied());
    let mut command = Command::new(all.next().unwrap_or("false"));
    command.args(all);
    command
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    command
}

/// Runs a command on a host with this input, however long it takes. Returns what it prints.
pub(crate) fn output(run: &[String], words: &[&str], input: &[u8]) -> Result<Vec<u8>, RemoteError> {
    output_within(run, words, input, None)
}

/// As [`output`]. A command that takes longer than `limit` is ended here, and its host counts as lost.
fn output_within(
    run: &[String],
    words: &[&str],
    input: &[u8],
    limit: Option<Duration>,
) -> Result<Vec<u8>, RemoteError> {
    let lost = |error: io::Error| RemoteError::Lost(error.to_string());
    let failed = |why: String, code| RemoteError::Failed {
        command: words.join(" "),
        why,
        code,
    };
    let mut child = command(run, words).spawn().map_err(lost)?;
    let mut stdin = child.stdin.take().expect("stdin is piped");
    let stdout = child.stdout.take().expect("stdout is piped");
    let stderr = child.stderr.take().expect("stderr is piped");
    let input = input.to_vec();
    // A command that does not read its input fails by itself.
    thread::spawn(move || drop(stdin.write_all(&input)));
    let errors = thread::spawn(|| last_line(io::BufReader::new(stderr)));
    let (sender, printed) = channel();
    // The receiver is gone once the time is over.
    thread::spawn(move || drop(sender.send(read_all(stdout, OUTPUT_MAX))));
    let printed = match limit {
        Some(limit) => printed.recv_timeout(limit).map_err(|_| limit),
        None => Ok(printed.recv().expect("the reading thread sends once")),
    };
    if !matches!(printed, Ok(Ok(Some(_)))) {
        let _ = child.kill();
    }
    let status = child.wait().map_err(lost)?;
    let printed = printed.map_err(|limit| {
        // What the command has started may hold its output open: the threads are left to it.
        let why = format!(
            "`{}` has not ended within {} s",
            words.join(" "),
            limit.as_secs()
        );
        RemoteError::Lost(why)
    })?;
    let why = errors.join().unwrap_or_default();
    let Some(printed) = printed.map_err(lost)? else {
        return Err(failed(format!("prints more than {OUTPUT_MAX} bytes"), None));
    };
    match status.code() {
        Some(0) => Ok(printed),
        Some(NO_CONNECTION) => Err(RemoteError::Lost(why)),
        code => Err(failed(why, code)),
    }
}

/// Reads to the end. `None` if that is more than `max` bytes.
fn read_all(from: impl Read, max: u64) -> io::Result<Option<Vec<u8>>> {
    let mut bytes = Vec::new();
    let read = from.take(max + 1).read_to_end(&mut bytes)?;
    Ok((read as u64 <= max).then_some(bytes))
}

/// Reads to the end and returns the last line that is not blank.
pub(crate) fn last_line(errors: impl BufRead) -> String {
    Lines(errors)
        .filter(|line| !line.trim().is_empty())
        .last()
        .unwrap_or_default()
}

/// Runs a short command on a host. Returns the last line that it prints: a shell there may greet before.
pub(crate) fn line(run: &[String], words: &[&str]) -> Result<String, RemoteError> {
    let output = output_within(run, words, &[], Some(SHORT_MAX))?;
    Ok(last_line(&output[..]).trim().to_owned())
}

/// Makes a folder on a host that only its user can read. Returns its path, which is no other: it is removed at the end.
pub(crate) fn temporary_folder(run: &[String]) -> Result<String, RemoteError> {
    let words = ["mktemp", "-d", "/var/tmp/muster.XXXXXXXX"];
    let folder = line(run, &words)?;
    let random = folder.strip_prefix(TEMPORARY).unwrap_or_default();
    if !random.is_empty() && random.chars().all(|it| it.is_ascii_alphanumeric()) {
        return Ok(folder);
    }
    Err(RemoteError::Failed {
        command: words.join(" "),
        why: format!("prints {folder:?}; accepted: a path of {TEMPORARY} and letters and digits"),
        code: Some(0),
    })
}

/// Writes a file on a host.
pub(crate) fn upload(run: &[String], path: &str, content: &[u8]) -> Result<(), RemoteError> {
    let to = format!("of={path}");
    let limit = SHORT_MAX + Duration::from_secs(content.len() as u64 / SLOWEST);
    let words = ["dd", &to, "bs=64k", "status=none"];
    output_within(run, &words, content, Some(limit)).map(drop)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn endless_line_is_read_in_parts() {
        let endless = io::BufReader::new(io::repeat(b'x'));
        let first = Lines(endless).next().unwrap();
        assert_eq!(first.len() as u64, LINE_MAX);
        let lines: Vec<_> = Lines(&b"one\r\n\ntwo"[..]).collect();
        assert_eq!(lines, ["one", "", "two"]);
    }

    #[test]
    fn endless_output_is_refused() {
        assert_eq!(read_all(io::repeat(b'x'), 10).unwrap(), None);
        assert_eq!(read_all(&b"0123456789"[..], 10).unwrap().unwrap().len(), 10);
    }

    #[test]
    fn command_gives_its_output_or_the_last_line_of_its_errors() {
        let here: [String; 0] = [];
        assert_eq!(output(&here, &["cat"], b"input").unwrap(), b"input");
        let failed = output(
            &here,
            &["sh", "-c", "echo one >&2; echo two >&2; exit 3"],
            &[],
        );
        let words = failed.unwrap_err().to_string();
        assert!(words.ends_with("two"), "{words}");
    }

    /// A host of which the shell greets each command on standard output.
    fn greeting(greeting: &str) -> Vec<String> {
        let script = format!("printf '{greeting}'; exec \"$0\" \"$@\"");
        ["sh", "-c", &script].map(str::to_owned).to_vec()
    }

    #[test]
    fn a_greeting_of_the_host_is_no_answer() {
        let host = greeting("/home/pi\\nWelcome\\n\\n");
        assert_eq!(line(&host, &["echo", "aarch64"]).unwrap(), "aarch64");
        let folder = temporary_folder(&host).unwrap();
        assert!(folder.starts_with("/var/tmp/muster."), "{folder}");
        std::fs::remove_dir(folder).unwrap();
    }

    #[test]
    fn only_a_folder_of_this_program_is_a_temporary_folder() {
        for printed in [
            "",
            "/home/pi",
            "/var/tmp/muster.",
            "/var/tmp/muster.a/..",
            "/var/tmp/muster.a b",
        ] {
            let script = format!("echo '{printed}'");
            let host = ["sh", "-c", &script].map(str::to_owned);
            let refused = temporary_folder(&host).unwrap_err().to_string();
            assert!(
                refused.contains("accepted: a path of /var/tmp/muster."),
                "{refused}"
            );
        }
    }

    #[test]
    fn a_host_that_says_nothing_is_lost_after_a_time() {
        // The shell waits for a child that holds the output open.
        let host = ["sh", "-c", "sleep 60; true"].map(str::to_owned);
        let begun = std::time::Instant::now();
        let limit = Some(Duration::from_millis(200));
        let lost = output_within(&host, &["uname"], &[], limit).unwrap_err();
        assert!(matches!(lost, RemoteError::Lost(_)), "{lost}");
        assert!(begun.elapsed() < Duration::from_secs(30));
    }

    #[test]
    fn ssh_has_options_to_notice_a_silent_host() {
        let ssh = ["ssh", "pi@a"].map(str::to_owned);
        let command_line = command(&ssh, &["uname"]);
        let arguments: Vec<_> = command_line.get_args().collect();
        assert_eq!(arguments, ["-o", "ServerAliveInterval=10", "pi@a", "uname"]);
    }

    #[test]
    fn own_connection_shares_none_of_ssh() {
        let words = |words: &[&str]| words.iter().map(ToString::to_string).collect::<Vec<_>>();
        let own = own_connection(&words(&["/usr/bin/ssh", "-F", "config", "pi@a"]));
        let expected = [
            "/usr/bin/ssh",
            "-o",
            "ControlPath=none",
            "-F",
            "config",
            "pi@a",
        ];
        assert_eq!(own, words(&expected));
        assert_eq!(
            own_connection(&words(&["nsenter", "-t", "1"])),
            words(&["nsenter", "-t", "1"])
        );
        assert!(own_connection(&[]).is_empty());
    }
}
