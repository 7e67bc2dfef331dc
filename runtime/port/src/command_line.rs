//! Betaflight's command line, for settings that no message has. It is entered on the same port by `#`, the only byte outside
//! a frame that this program ever writes; while it is open the controller answers no message and can't arm.

use std::io;
use std::time::{Duration, Instant};

use muster_msp::{CommandLineSettings, Identity, Mode, Status, ask};

use crate::session::{AskError, Session};

/// How long an answer may take.
const ANSWER_MAX: Duration = Duration::from_secs(3);
/// The longest answer that is read, in bytes.
const ANSWER_BYTES_MAX: usize = 64 * 1024;
/// What ends an answer.
const PROMPT: &[u8] = b"\r\n# ";

/// Why the command line tells nothing.
#[derive(Debug, thiserror::Error)]
pub enum CommandLineError {
    /// It is for disarmed controllers only. Nothing was sent to it.
    #[error(
        "the controller does not report that it is disarmed; its command line is for disarmed ones"
    )]
    NotDisarmed,
    /// The controller could not be asked whether it is armed. Nothing was sent to the command line.
    #[error("the controller does not report whether it is armed")]
    Unknown(#[from] AskError),
    /// It is open, and doesn't answer. The controller may need a restart.
    #[error("the command line doesn't answer")]
    Silent,
    /// It is open, and the port failed. The controller may need a restart.
    #[error("the port failed")]
    Port(#[from] io::Error),
}

/// Reads the settings that no message has from a disarmed controller. It may restart, so the session ends here.
///
/// # Errors
/// If it is armed, or the command line doesn't answer.
pub fn read_command_line(
    mut session: Session,
    identity: &Identity,
) -> Result<CommandLineSettings, CommandLineError> {
    let status: Status = ask(&mut session)?;
    if identity.boxes.is_active(Mode::Arm, status.modes()) != Some(false) {
        return Err(CommandLineError::NotDisarmed);
    }
    session.wire.write(b"#")?;
    let answers = read_settings(&session);
    // Without `noreboot` older firmware restarts; with it, newer firmware doesn't.
    session.wire.write(b"exit noreboot\n")?;
    Ok(CommandLineSettings::from_answers(&answers?))
}

fn read_settings(session: &Session) -> Result<String, CommandLineError> {
    let mut all = read_answer(session)?;
    for name in CommandLineSettings::NAMES {
        session.wire.write(format!("get {name}\n").as_bytes())?;
        all.push_str(&read_answer(session)?);
    }
    Ok(all)
}

fn read_answer(session: &Session) -> Result<String, CommandLineError> {
    let started = Instant::now();
    let mut answer = Vec::new();
    let mut buffer = [0; 512];
    while !answer.ends_with(PROMPT) {
        if started.elapsed() > ANSWER_MAX || answer.len() > ANSWER_BYTES_MAX {
            return Err(CommandLineError::Silent);
        }
        let length = session.wire.read(&mut buffer)?;
        answer.extend(&buffer[..length]);
    }
    Ok(String::from_utf8_lossy(&answer).into_owned())
}
