//! The operators that are connected to this drone.

use quinn::Connection;
use tokio::sync::{Semaphore, mpsc};

use super::stream::Stream;

/// Most connected operators, and most of their streams that wait to be handled.
const OPERATORS_MAX: usize = 4;

/// Places for operators, and the channel to which their streams go.
///
/// Invariant: at most [`OPERATORS_MAX`] connections are served at once.
pub(super) struct Operators {
    places: Semaphore,
    streams: mpsc::Sender<Stream>,
}

/// No place for another operator.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Full;

impl Operators {
    /// No operator is connected. The receiver gets the streams of all.
    pub(super) fn new() -> (Self, mpsc::Receiver<Stream>) {
        let (sender, streams) = mpsc::channel(OPERATORS_MAX);
        let operators = Self {
            places: Semaphore::new(OPERATORS_MAX),
            streams: sender,
        };
        (operators, streams)
    }

    /// Forwards the streams of an operator until its connection ends.
    ///
    /// # Errors
    /// If too many operators are connected; the connection is left open.
    pub(super) async fn serve(&self, connection: &Connection) -> Result<(), Full> {
        let _place = self.places.try_acquire().map_err(|_| Full)?;
        while let Ok((writer, reader)) = connection.accept_bi().await {
            // A stream that does not fit is dropped, which resets it.
            let _ = self.streams.try_send(Stream { writer, reader });
        }
        Ok(())
    }
}
