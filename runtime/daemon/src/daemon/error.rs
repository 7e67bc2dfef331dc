//! Why a drone's process could not start or had to stop.

use std::io;
use std::net::SocketAddr;
use std::path::PathBuf;

use muster_runtime::journal::FolderError;
use muster_transport::sockets::OpenError;
use thiserror::Error;
use tokio::task::JoinError;

/// Why a drone's process could not start or had to stop. [`Self::Task`] occurs in flight; the
/// others do if the process was started again there.
#[derive(Debug, Error)]
pub enum DaemonError {
    /// The journal's folder can't be opened.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// The journal can't be read or written, or is damaged.
    #[error("can't use the journal in {}", path.display())]
    Journal {
        /// The journal's folder.
        path: PathBuf,
        /// Why.
        #[source]
        source: io::Error,
    },
    /// The network can't be opened.
    #[error("can't open the network")]
    Network(#[from] OpenError),
    /// The address of `observe.http` can't be opened. In flight this is only logged.
    #[error("can't listen at {address} (`observe.http`)")]
    Endpoint {
        /// The configured address.
        address: SocketAddr,
        /// The system's error.
        #[source]
        source: io::Error,
    },
    /// The system gives no random numbers, which distinguish this incarnation from earlier ones.
    #[error("can't get random numbers from the system")]
    Random(#[source] getrandom::Error),
    /// The asynchronous runtime or the journal's thread does not start, or sockets or signals can't be watched.
    #[error("can't start the asynchronous runtime")]
    Runtime(#[source] io::Error),
    /// The timer task or the network task failed in flight.
    #[error("the timer task or the network task failed")]
    Task(#[source] JoinError),
    /// `--resume` was given, but the control channel does not begin with the vehicle's state.
    #[error("`--resume` needs the vehicle's state as the first line on standard input")]
    NoVehicle,
    /// The flight of the drone's file is over; nothing was started.
    #[error(
        "this flight is over: by its journal, {}, the drone has landed; for another flight set a higher `flight` in the \
         drone's file",
        journal.display()
    )]
    FlightOver {
        /// The flight's journal.
        journal: PathBuf,
    },
    /// An actor could not be started.
    #[error("an actor could not be started")]
    Spawn(#[from] Box<ractor::SpawnErr>),
}
