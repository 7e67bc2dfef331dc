//! An operator speaks with one drone, by the fleet's own key: it hands it a file for its next flight, or reads its log.

use std::io::{self, Write};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use muster_machines::identity::NodeId;
use muster_runtime::diagnostic::{BadInput, read_text};
use muster_runtime::identity::OperatorKey;
use muster_transport::quic::{self, Stream};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::identities::OperatorIdentities;

/// How long the line may be that says what is wanted, in bytes.
pub(crate) const REQUEST_MAX: usize = 1_024;

/// How long an answer may be that is no log, in bytes.
const ANSWER_MAX: usize = 64 * 1_024;

/// What an operator wants, as the first line of what it says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(crate) enum Request {
    /// What follows is to take a file's place: so many bytes.
    Upload { what: Upload, bytes: usize },
    /// What the drone has said of late and, to follow it, what it goes on to say.
    Logs { follow: bool },
}

/// Which file is to be replaced.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Upload {
    /// The scenario that the drone's file names.
    Scenario,
    /// The mission that that scenario names.
    Mission,
}

impl Upload {
    /// What a file is, going by its name: scenarios end in `.toml`.
    #[must_use]
    pub fn of(path: &Path) -> Self {
        if path.extension().is_some_and(|it| it == "toml") {
            Self::Scenario
        } else {
            Self::Mission
        }
    }

    /// How long such a file may be, in bytes: many times what is written by hand, and so little that reading it takes a
    /// drone's process a fraction of the memory that a service gives it.
    pub(crate) const fn bytes_max(self) -> usize {
        match self {
            Self::Scenario => 64 * 1_024,
            Self::Mission => 1_024 * 1_024,
        }
    }
}

/// What a drone says to an upload.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(crate) enum Answer {
    /// It is in the place of this file, to last.
    Taken(PathBuf),
    /// The drone could not use it: why, as it is shown on a terminal; nothing has changed.
    Unusable(String),
    /// It takes part in a flight; nothing has changed.
    Flies,
    /// It is being handed another file; nothing has changed.
    Busy,
    /// Its machine could not write it, as it says.
    Unwritten(String),
}

/// Why an operator could not have what it wanted. Unless it says otherwise, nothing has changed at the drone.
#[derive(Debug, Error)]
pub enum OperatorError {
    /// A file of the operator's can't be used.
    #[error(transparent)]
    Refused(#[from] BadInput),
    /// The drone could not use the file.
    #[error("drone {drone} can't use {}\n{message}", path.display())]
    Unusable {
        /// Which drone.
        drone: NodeId,
        /// The operator's file.
        path: PathBuf,
        /// What is wrong with it, as it is shown on a terminal.
        message: String,
    },
    /// A drone takes no files while it takes part in a flight.
    #[error(
        "drone {0} flies, or has heard of a master: it takes a file before that, or once it is on the ground for good"
    )]
    Flies(NodeId),
    /// A drone takes one file at a time.
    #[error("drone {0} is being handed another file: try again once it has that")]
    Busy(NodeId),
    /// The drone's machine could not write the file; what was there before may be there still.
    #[error("drone {drone} can't write it: {message}")]
    Unwritten {
        /// Which drone.
        drone: NodeId,
        /// What its machine says.
        message: String,
    },
    /// There is no connection with a drone of the fleet.
    #[error("no connection")]
    Connect(#[from] quic::OperatorError),
    /// The connection was lost, or the drone ended it: whether a file was taken is not known.
    #[error("the drone has ended the connection, or it was lost")]
    Lost(#[source] io::Error),
    /// The asynchronous runtime does not start, or what the drone said can't be printed.
    #[error("can't go on")]
    Machine(#[from] io::Error),
}

/// Hands a file to the drone at an address, for its next start; which drone it is, and the file that it has replaced there.
///
/// # Errors
/// When the drone does not take it.
pub fn upload(
    fleet: &Path,
    address: SocketAddr,
    path: &Path,
) -> Result<(NodeId, PathBuf), OperatorError> {
    let text = read_text(path)?;
    let request = Request::Upload {
        what: Upload::of(path),
        bytes: text.len(),
    };
    let asked = [line(&request), text.into_bytes()].concat();
    let (drone, answer) = speak(fleet, address, async |stream| {
        // A drone that refuses it reads no further: why, it says.
        let _ = ask(stream, &asked).await;
        stream.read_to_end(ANSWER_MAX).await
    })?;
    match serde_json::from_slice(&answer) {
        Ok(Answer::Taken(place)) => Ok((drone, place)),
        Ok(Answer::Unusable(message)) => Err(OperatorError::Unusable {
            drone,
            path: path.to_owned(),
            message,
        }),
        Ok(Answer::Flies) => Err(OperatorError::Flies(drone)),
        Ok(Answer::Busy) => Err(OperatorError::Busy(drone)),
        Ok(Answer::Unwritten(message)) => Err(OperatorError::Unwritten { drone, message }),
        Err(error) => Err(OperatorError::Lost(error.into())),
    }
}

/// Prints what the drone at an address has said of late and, if it is followed, what it goes on to say, until its process
/// ends.
///
/// # Errors
/// When the drone can't be spoken with, or this can't be printed.
pub fn logs(
    fleet: &Path,
    address: SocketAddr,
    follow: bool,
    out: &mut dyn Write,
) -> Result<(), OperatorError> {
    let asked = line(&Request::Logs { follow });
    let (_, printed) = speak(fleet, address, async |stream| {
        ask(stream, &asked).await?;
        let mut buffer = [0; 4_096];
        loop {
            let read = match stream.read(&mut buffer).await {
                Ok(0) => return Ok(Ok(())),
                // A drone that is followed says nothing more once its process ends.
                Err(_) if follow => return Ok(Ok(())),
                read => read?,
            };
            match out.write_all(&buffer[..read]).and_then(|()| out.flush()) {
                Ok(()) => {}
                // Whoever has stopped reading has seen enough.
                Err(error) if error.kind() == io::ErrorKind::BrokenPipe => return Ok(Ok(())),
                Err(error) => return Ok(Err(error)),
            }
        }
    })?;
    Ok(printed?)
}

/// Speaks with the drone at an address over one stream; which drone it is, and what came of it.
fn speak<T>(
    fleet: &Path,
    address: SocketAddr,
    speak: impl AsyncFnOnce(&mut Stream) -> io::Result<T>,
) -> Result<(NodeId, T), OperatorError> {
    let identities = Arc::new(OperatorIdentities(OperatorKey::load(fleet)?));
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()?;
    runtime.block_on(async {
        let operator = quic::Operator::connect(address, identities).await?;
        let mut stream = operator.open().await?;
        let came = speak(&mut stream).await.map_err(OperatorError::Lost)?;
        let drone = operator.drone();
        operator.end().await;
        Ok((drone, came))
    })
}

async fn ask(stream: &mut Stream, asked: &[u8]) -> io::Result<()> {
    stream.write(asked).await?;
    stream.finish();
    Ok(())
}

fn line(request: &Request) -> Vec<u8> {
    let mut line = serde_json::to_vec(request).expect("a request has a form in JSON");
    line.push(b'\n');
    line
}
