//! Writes a journal on its own thread, for a sync may take long and must not delay the drone.

use std::io;
use std::sync::mpsc::{self, Receiver, SyncSender};
use std::thread::{self, JoinHandle};

use muster_machines::node::{Checkpoint, Checkpoints};
use thiserror::Error;

use super::{Journal, Storage};

/// The most checkpoints that wait for the disk.
pub const WAITING_MAX: usize = 4_096;

/// A checkpoint was dropped, for the disk does not keep up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("{WAITING_MAX} checkpoints wait for the disk")]
pub struct QueueFull;

/// Result of writing checkpoints, by their numbers.
#[derive(Debug)]
pub enum WriteReport {
    /// All checkpoints up to this number are durable.
    DurableUpTo(u64),
    /// A checkpoint could not be written.
    Failed {
        /// The checkpoint's number.
        number: u64,
        /// The system's error.
        error: io::Error,
    },
}

/// Queue of checkpoints, which a thread writes in order.
#[derive(Debug)]
pub struct Writer {
    /// Number of the last queued checkpoint.
    queued: u64,
    queue: Option<SyncSender<Entry>>,
    thread: Option<JoinHandle<()>>,
}

/// A queued checkpoint.
#[derive(Debug)]
struct Entry {
    number: u64,
    checkpoint: Checkpoint,
    /// Whether actions wait until the checkpoint is durable.
    must_sync: bool,
}

impl Writer {
    /// Starts the thread that writes to a journal with the newest checkpoints `all`. It calls `report` with each result.
    /// Checkpoints that were queued during a sync are written and synced together.
    ///
    /// # Errors
    /// If the system can't start a thread.
    pub fn start<S: Storage + Send + 'static>(
        journal: Journal<S>,
        all: Checkpoints,
        report: impl FnMut(WriteReport) + Send + 'static,
    ) -> io::Result<Self> {
        let (queue, entries) = mpsc::sync_channel(WAITING_MAX);
        let thread = thread::Builder::new().name("journal".to_owned());
        let thread = thread.spawn(move || write_all(journal, all, &entries, report))?;
        Ok(Self {
            queued: 0,
            queue: Some(queue),
            thread: Some(thread),
        })
    }

    /// Queues a checkpoint and returns its number, from 1. With `must_sync` it is synced and reported.
    ///
    /// # Errors
    /// If [`WAITING_MAX`] wait already. The checkpoint is dropped; what waits is still written.
    pub fn keep(&mut self, checkpoint: Checkpoint, must_sync: bool) -> Result<u64, QueueFull> {
        let number = self.queued + 1;
        let entry = Entry {
            number,
            checkpoint,
            must_sync,
        };
        // The thread ends only when the queue is closed, so that it can only be full.
        if let Some(queue) = &self.queue
            && queue.try_send(entry).is_err()
        {
            return Err(QueueFull);
        }
        self.queued = number;
        Ok(number)
    }
}

/// Waits until all queued checkpoints are written.
impl Drop for Writer {
    fn drop(&mut self) {
        self.queue = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn write_all<S: Storage>(
    mut journal: Journal<S>,
    mut all: Checkpoints,
    entries: &Receiver<Entry>,
    mut report: impl FnMut(WriteReport),
) {
    while let Ok(first) = entries.recv() {
        let (mut results, mut needs_sync) = (Vec::new(), false);
        for entry in std::iter::once(first).chain(entries.try_iter()) {
            all.keep(entry.checkpoint.clone());
            let added = journal.add(&entry.checkpoint, &all);
            needs_sync |= entry.must_sync && added.is_ok();
            results.push((entry.number, entry.must_sync, added));
        }
        let synced = if needs_sync { journal.sync() } else { Ok(()) };
        // Reported in order, so that no checkpoint counts as durable before an earlier one.
        let mut durable = None;
        for (number, must_sync, added) in results {
            let failure = match (added, &synced) {
                (Err(error), _) => error,
                (Ok(()), Err(error)) if must_sync => {
                    io::Error::new(error.kind(), error.to_string())
                }
                (Ok(()), _) => {
                    durable = if must_sync { Some(number) } else { durable };
                    continue;
                }
            };
            durable
                .take()
                .map(WriteReport::DurableUpTo)
                .into_iter()
                .for_each(&mut report);
            report(WriteReport::Failed {
                number,
                error: failure,
            });
        }
        durable
            .map(WriteReport::DurableUpTo)
            .into_iter()
            .for_each(&mut report);
    }
}
