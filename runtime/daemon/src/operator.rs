//! The operator's connection to one drone, with the fleet's key: uploads a file for the next flight, or reads the log.

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

/// Longest request line, in bytes.
pub(crate) const REQUEST_MAX: usize = 1_024;

/// Longest answer to an upload, in bytes.
const ANSWER_MAX: usize = 64 * 1_024;

/// A request, the first line of a stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(crate) enum Request {
    /// Replaces a file with the bytes that follow.
    Upload { what: Upload, bytes: usize },
    /// Sends the latest log lines and, with `follow`, all further ones.
    Logs { follow: bool },
}

/// The file that an upload replaces.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Upload {
    /// The scenario named in the drone's file.
    Scenario,
    /// The mission named in that scenario.
    Mission,
}

impl Upload {
    /// The kind of a file by its name: scenarios end in `.toml`.
    #[must_use]
    pub fn of(path: &Path) -> Self {
        if path.extension().is_some_and(|it| it == "toml") {
            Self::Scenario
        } else {
            Self::Mission
        }
    }

    /// The largest file, in bytes: far above files written by hand, and a fraction of the service's memory limit.
    pub(crate) const fn bytes_max(self) -> usize {
        match self {
            Self::Scenario => 64 * 1_024,
            Self::Mission => 1_024 * 1_024,
        }
    }
}

/// A drone's answer to an upload.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(crate) enum Answer {
    /// The upload has replaced this file, durably.
    Taken(PathBuf),
    /// The file is invalid: the error for a terminal. Nothing has changed.
    Unusable(String),
    /// The drone takes part in a flight. Nothing has changed.
    Flies,
    /// Another upload is running. Nothing has changed.
    Busy,
    /// The drone's system could not write the file: its error.
    Unwritten(String),
}

/// Why a request failed. Unless the variant says otherwise, nothing has changed at the drone.
#[derive(Debug, Error)]
pub enum OperatorError {
    /// One of the operator's files is invalid.
    #[error(transparent)]
    Refused(#[from] BadInput),
    /// The drone refuses the file as invalid.
    #[error("drone {drone} can't use {}\n{message}", path.display())]
    Unusable {
        /// The drone.
        drone: NodeId,
        /// The operator's file.
        path: PathBuf,
        /// The drone's error for a terminal.
        message: String,
    },
    /// Drones take no uploads while they take part in a flight.
    #[error(
        "drone {0} takes part in a flight; it takes uploads before it has heard of a master, or after its flight"
    )]
    Flies(NodeId),
    /// Drones take one upload at a time.
    #[error("drone {0} is busy with another upload; try again later")]
    Busy(NodeId),
    /// The drone's system could not write the file. The old file may still be there.
    #[error("drone {drone} can't write the file: {message}")]
    Unwritten {
        /// The drone.
        drone: NodeId,
        /// The system's error.
        message: String,
    },
    /// No drone of the fleet answers at the address.
    #[error("can't connect to a drone of the fleet")]
    Connect(#[from] quic::OperatorError),
    /// The connection was lost, or the drone closed it. The upload may have succeeded.
    #[error("lost the connection to the drone")]
    Lost(#[source] io::Error),
    /// The asynchronous runtime does not start, or the log can't be printed.
    #[error("can't run the request")]
    Machine(#[from] io::Error),
}

/// Uploads a file to the drone at an address, for its next start. Returns the drone and the file that was replaced there.
///
/// # Errors
/// If the drone does not take the file.
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
    let request = [line(&request), text.into_bytes()].concat();
    let (drone, answer) = connect(fleet, address, async |stream| {
        // A drone that refuses the file stops reading; the reason is in its answer.
        let _ = send(stream, &request).await;
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

/// Prints the latest log lines of the drone at an address and, with `follow`, all further ones until its process ends.
///
/// # Errors
/// If the connection fails, or the log can't be printed.
pub fn logs(
    fleet: &Path,
    address: SocketAddr,
    follow: bool,
    out: &mut dyn Write,
) -> Result<(), OperatorError> {
    let request = line(&Request::Logs { follow });
    let (_, printed) = connect(fleet, address, async |stream| {
        send(stream, &request).await?;
        let mut buffer = [0; 4_096];
        loop {
            let read = match stream.read(&mut buffer).await {
                Ok(0) => return Ok(Ok(())),
                // The process has ended.
                Err(_) if follow => return Ok(Ok(())),
                read => read?,
            };
            match out.write_all(&buffer[..read]).and_then(|()| out.flush()) {
                Ok(()) => {}
                // The reader has closed the pipe.
                Err(error) if error.kind() == io::ErrorKind::BrokenPipe => return Ok(Ok(())),
                Err(error) => return Ok(Err(error)),
            }
        }
    })?;
    Ok(printed?)
}

/// Connects to the drone at an address and runs `exchange` on one stream. Returns the drone and the result.
fn connect<T>(
    fleet: &Path,
    address: SocketAddr,
    exchange: impl AsyncFnOnce(&mut Stream) -> io::Result<T>,
) -> Result<(NodeId, T), OperatorError> {
    let identities = Arc::new(OperatorIdentities(OperatorKey::load(fleet)?));
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()?;
    runtime.block_on(async {
        let operator = quic::Operator::connect(address, identities).await?;
        let mut stream = operator.open().await?;
        let result = exchange(&mut stream).await.map_err(OperatorError::Lost)?;
        let drone = operator.drone();
        operator.end().await;
        Ok((drone, result))
    })
}

async fn send(stream: &mut Stream, request: &[u8]) -> io::Result<()> {
    stream.write(request).await?;
    stream.finish();
    Ok(())
}

fn line(request: &Request) -> Vec<u8> {
    let mut line = serde_json::to_vec(request).expect("requests are valid JSON");
    line.push(b'\n');
    line
}
