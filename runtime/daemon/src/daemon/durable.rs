//! The drone's checkpoints, their journal, and the frames that wait for it.

use bytes::Bytes;
use muster_machines::identity::NodeId;
use muster_machines::node::{Checkpoint, Checkpoints};
use muster_machines::radio::Revoked;
use muster_runtime::journal::{QueueFull, WriteReport, Writer};

use super::held::Held;

/// A frame to send.
#[derive(Debug)]
pub(super) struct Frame {
    /// The receiver; `None` for a broadcast.
    pub(super) to: Option<NodeId>,
    pub(super) bytes: Bytes,
    /// Whether it is sent only because its period has passed.
    pub(super) keep_alive: bool,
}

/// The newest checkpoints, in memory and on the disk.
///
/// Invariant: no frame is sent before the checkpoints that it depends on are durable.
pub(super) struct Durable {
    checkpoints: Checkpoints,
    /// `None` once the process ends.
    journal: Option<Writer>,
    held: Held<Frame>,
    /// Checkpoints that could not be written.
    pub(super) failures: u64,
}

impl Durable {
    pub(super) fn new(checkpoints: Checkpoints, journal: Writer) -> Self {
        Self {
            checkpoints,
            journal: Some(journal),
            held: Held::default(),
            failures: 0,
        }
    }

    pub(super) const fn checkpoints(&self) -> &Checkpoints {
        &self.checkpoints
    }

    /// Sets the revocation list that the next radio starts with.
    pub(super) fn set_revoked(&mut self, list: Revoked) {
        self.checkpoints.set_revoked(list);
    }

    /// Keeps a checkpoint, in the journal too. If it must be durable, later frames wait for it.
    ///
    /// # Errors
    /// If too many wait for the disk.
    pub(super) fn keep(&mut self, checkpoint: &Checkpoint) -> Result<(), QueueFull> {
        if self.checkpoints.holds(checkpoint) {
            return Ok(());
        }
        let must_sync = self.checkpoints.keep(checkpoint.clone());
        if let Some(journal) = &mut self.journal {
            let number = journal.keep(checkpoint.clone(), must_sync)?;
            if must_sync {
                self.held.require(number);
            }
        }
        Ok(())
    }

    /// Holds a frame, or returns it if it may be sent now.
    pub(super) fn hold(&mut self, frame: Frame) -> Option<Frame> {
        self.held.hold(frame)
    }

    /// The frames that may be sent after a report of the journal.
    pub(super) fn release(&mut self, report: &WriteReport) -> Vec<Frame> {
        self.held.release(report)
    }

    /// A checkpoint could not be written. Returns whether it is the first.
    pub(super) const fn fails_first(&mut self) -> bool {
        self.failures += 1;
        self.failures == 1
    }

    /// Closes the journal. Dropping the returned writer waits until all checkpoints are written.
    pub(super) fn close(&mut self) -> Option<Writer> {
        self.journal.take()
    }
}
