//! A session with a host over the command that runs others there, ssh as a rule.

use std::io::{self, BufReader, Write};
use std::process::Child;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use muster_daemon::slots::protocol::{PROTOCOL, SlotOrder, SlotReply};
use thiserror::Error;

use crate::remote::{
    Lines, NO_CONNECTION, RemoteError, SLOWEST, command, last_line, line, temporary_folder, upload,
};

/// The good release's program on a host.
const INSTALLED: &str = "/opt/muster/good/musterd";
/// Time for a host to answer, beyond what the bytes to send take.
const ANSWER_MAX: Duration = Duration::from_secs(30);
/// Time for a command to end once its output has.
const EXIT_MAX: Duration = Duration::from_secs(2);
/// Lines of a host that wait to be read; the host waits for the rest.
const LINES_MAX: usize = 64;
/// Time between two looks whether it has.
const EXIT_PERIOD: Duration = Duration::from_millis(10);

/// Why a host did not do as told.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum SessionError {
    /// The host can't be reached, or the connection was lost.
    #[error("can't connect to the host: {0}")]
    Lost(String),
    /// The host runs no release, and none was given.
    #[error("the host has no release: give one with `--release`")]
    NoRelease,
    /// The host's program speaks another protocol.
    #[error("musterd {0} on the host speaks another protocol; install the release by hand")]
    OtherProtocol(String),
    /// Neither root nor `sudo` without a password.
    #[error("needs root: log in as root, or allow sudo without a password")]
    NoRoot,
    /// Another operator has the host locked.
    #[error("locked by {0}")]
    Busy(String),
    /// The host refused an order.
    #[error("{0}")]
    Refused(String),
    /// The release has no programs for the host.
    #[error("the release has no programs for {0}")]
    OtherProcessor(String),
}

impl From<RemoteError> for SessionError {
    fn from(error: RemoteError) -> Self {
        match error {
            RemoteError::Lost(why) => Self::Lost(why),
            failed @ RemoteError::Failed { .. } => Self::Refused(failed.to_string()),
        }
    }
}

/// Gives the program of a release for a processor, for a host that has none yet.
pub(super) type Programs<'a> = &'a dyn Fn(&str) -> Option<&'a [u8]>;

/// A session with a host.
pub(super) struct Session {
    child: Child,
    input: Sender<Vec<u8>>,
    lines: Receiver<String>,
    /// Reads what the command says on standard error; gives the last line.
    errors: Option<thread::JoinHandle<String>>,
    /// The host's processor.
    pub(super) processor: String,
    /// The folder of the program there.
    temporary: Option<Temporary>,
}

/// A temporary folder on a host, removed at the end.
struct Temporary {
    run: Vec<String>,
    folder: String,
}

impl Drop for Temporary {
    fn drop(&mut self) {
        let _ = line(&self.run, &["rm", "-r", &self.folder]);
    }
}

impl Session {
    /// Opens a session. A host without a release gets its program from `programs`, in a temporary folder.
    pub(super) fn open(
        run: &[String],
        programs: Option<Programs<'_>>,
    ) -> Result<Self, SessionError> {
        match (Self::of_program(run, INSTALLED), programs) {
            (Err(SessionError::NoRelease), Some(programs)) => Self::bring(run, programs),
            (opened, _) => opened,
        }
    }

    /// Opens a session with a program of the host, as root.
    fn of_program(run: &[String], program: &str) -> Result<Self, SessionError> {
        let (session, is_root) = Self::start(run, &[program, "slot", "serve"])?;
        if is_root {
            return Ok(session);
        }
        drop(session);
        let words = ["sudo", "-n", program, "slot", "serve"];
        match Self::start(run, &words) {
            Ok((session, true)) => Ok(session),
            Ok((_, false)) | Err(SessionError::NoRelease) => Err(SessionError::NoRoot),
            Err(error) => Err(error),
        }
    }

    /// Sends the program to the host, and opens a session with it.
    fn bring(run: &[String], programs: Programs<'_>) -> Result<Self, SessionError> {
        let machine = line(run, &["uname", "-m"])?;
        let program = programs(&machine);
        let program = program.ok_or(SessionError::OtherProcessor(machine))?;
        let temporary = Temporary {
            run: run.to_vec(),
            folder: temporary_folder(run)?,
        };
        let path = format!("{}/musterd", temporary.folder);
        upload(run, &path, program)?;
        line(run, &["chmod", "700", &path])?;
        let mut session = Self::of_program(run, &path)?;
        session.temporary = Some(temporary);
        Ok(session)
    }

    /// Starts a program that serves a session. Returns whether it is root's.
    fn start(run: &[String], words: &[&str]) -> Result<(Self, bool), SessionError> {
        let spawned = command(run, words).spawn();
        let mut child = spawned.map_err(|error| match error.kind() {
            io::ErrorKind::NotFound if run.is_empty() => SessionError::NoRelease,
            _ => SessionError::Lost(error.to_string()),
        })?;
        let mut input = child.stdin.take().expect("stdin is piped");
        let output = child.stdout.take().expect("stdout is piped");
        let errors = child.stderr.take().expect("stderr is piped");
        let (sender, to_write) = channel::<Vec<u8>>();
        thread::spawn(move || {
            for bytes in to_write {
                if input
                    .write_all(&bytes)
                    .and_then(|()| input.flush())
                    .is_err()
                {
                    return;
                }
            }
        });
        let (to_read, lines) = sync_channel(LINES_MAX);
        thread::spawn(move || {
            for line in Lines(BufReader::new(output)) {
                if to_read.send(line).is_err() {
                    return;
                }
            }
        });
        let mut session = Self {
            child,
            input: sender,
            lines,
            errors: Some(thread::spawn(move || last_line(BufReader::new(errors)))),
            processor: String::new(),
            temporary: None,
        };
        match session.reply(ANSWER_MAX) {
            Ok(SlotReply::Hello {
                protocol: PROTOCOL,
                processor,
                is_root,
                ..
            }) => {
                session.processor = processor;
                Ok((session, is_root))
            }
            Ok(SlotReply::Hello { version, .. }) => Err(SessionError::OtherProtocol(version)),
            Ok(_) | Err(_) => Err(session.why_none()),
        }
    }

    /// Why the program did not begin a session.
    fn why_none(mut self) -> SessionError {
        let mut code = None;
        for _ in 0..EXIT_MAX.as_millis() / EXIT_PERIOD.as_millis() {
            match self.child.try_wait() {
                Ok(None) => thread::sleep(EXIT_PERIOD),
                Ok(Some(status)) => {
                    code = status.code();
                    break;
                }
                Err(_) => break,
            }
        }
        let _ = self.child.kill();
        if code.is_some_and(|code| code != NO_CONNECTION) {
            return SessionError::NoRelease;
        }
        let errors = self.errors.take().and_then(|it| it.join().ok());
        SessionError::Lost(errors.unwrap_or_default())
    }

    /// Sends an order and waits for its reply.
    pub(super) fn ask(&mut self, order: &SlotOrder) -> Result<SlotReply, SessionError> {
        self.ask_with(order, Vec::new())
    }

    /// Sends an order with the bytes that follow it, and waits for its reply.
    pub(super) fn ask_with(
        &mut self,
        order: &SlotOrder,
        bytes: Vec<u8>,
    ) -> Result<SlotReply, SessionError> {
        let mut line = serde_json::to_vec(order).expect("every order has a form in JSON");
        line.push(b'\n');
        let limit = ANSWER_MAX + Duration::from_secs(bytes.len() as u64 / SLOWEST);
        for part in [line, bytes] {
            // If the writer is gone, the reply does not come either.
            let _ = self.input.send(part);
        }
        match self.reply(limit)? {
            SlotReply::Refused(why) => Err(SessionError::Refused(why)),
            SlotReply::Busy { operator } => Err(SessionError::Busy(operator)),
            reply => Ok(reply),
        }
    }

    /// The next reply within this time; lines of others, as of a greeting, are skipped.
    fn reply(&mut self, limit: Duration) -> Result<SlotReply, SessionError> {
        let start = Instant::now();
        loop {
            let left = limit.saturating_sub(start.elapsed());
            match self.lines.recv_timeout(left) {
                Ok(line) => {
                    if let Ok(reply) = serde_json::from_str(&line) {
                        return Ok(reply);
                    }
                }
                Err(RecvTimeoutError::Timeout) => {
                    let why = format!("no answer within {} s", limit.as_secs());
                    return Err(SessionError::Lost(why));
                }
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(SessionError::Lost("the session ended".to_owned()));
                }
            }
        }
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        // A closed input ends the program; a lost connection's command is ended here.
        let (closed, _) = channel();
        self.input = closed;
        let _ = self.lines.recv_timeout(Duration::from_secs(1));
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
