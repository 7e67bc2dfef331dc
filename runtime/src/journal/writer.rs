//! Writes a journal on its own thread, for a sync may take long and must not delay the drone.

use std::io;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use muster_machines::node::{Checkpoint, Checkpoints};
use thiserror::Error;

use super::{Journal, Storage};

/// The most checkpoints that wait for the disk.
pub const WAITING_MAX: usize = 1_024;

/// Pause after a failed write, unless a checkpoint comes sooner.
const RETRY_AFTER: Duration = Duration::from_secs(1);

/// A checkpoint was dropped, for the disk does not keep up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("{WAITING_MAX} checkpoints wait for the disk")]
pub struct QueueFull;

/// Result of writing checkpoints, by their numbers.
#[derive(Debug)]
pub enum WriteReport {
    /// Each checkpoint up to this number, or a newer one of its machine, is durable.
    DurableUpTo(u64),
    /// The checkpoint with this number or one before it may not be durable. The journal is written again.
    Failed {
        /// Number of the last checkpoint that was to be written.
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
    /// Boxed, for the queue reserves all its places at once.
    queue: Option<SyncSender<Box<Entry>>>,
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
    /// Checkpoints that were queued during a sync are written and synced together. After a failure the whole journal is
    /// rewritten, with the next checkpoint or after a second, until that succeeds.
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
        let entry = Box::new(Entry {
            number,
            checkpoint,
            must_sync,
        });
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
    entries: &Receiver<Box<Entry>>,
    mut report: impl FnMut(WriteReport),
) {
    // What was written before a failure may be lost: only a journal that is replaced as a whole makes up for it.
    let mut must_rewrite = false;
    let mut number = 0;
    loop {
        let first = match entries.recv_timeout(if must_rewrite {
            RETRY_AFTER
        } else {
            Duration::MAX
        }) {
            Ok(entry) => Some(entry),
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => return,
        };
        // Bounded, so that a caller that queues as fast as this thread takes does not keep it from writing.
        let more = entries.try_iter().take(WAITING_MAX - 1);
        let batch: Vec<_> = first.into_iter().chain(more).collect();
        for entry in &batch {
            all.keep(entry.checkpoint.clone());
            number = entry.number;
        }
        if !must_rewrite {
            match append(&mut journal, &batch, &all) {
                Ok(is_durable) if is_durable => report(WriteReport::DurableUpTo(number)),
                Ok(_) => {}
                Err(error) => {
                    report(WriteReport::Failed { number, error });
                    must_rewrite = true;
                }
            }
        }
        if must_rewrite {
            match journal.compact(&all) {
                Ok(()) => {
                    must_rewrite = false;
                    report(WriteReport::DurableUpTo(number));
                }
                Err(error) => report(WriteReport::Failed { number, error }),
            }
        }
    }
}

/// Appends checkpoints, and syncs them if one of them must be durable. Returns whether they are durable.
fn append<S: Storage>(
    journal: &mut Journal<S>,
    batch: &[Box<Entry>],
    all: &Checkpoints,
) -> io::Result<bool> {
    for entry in batch {
        journal.add(&entry.checkpoint, all)?;
    }
    let must_sync = batch.iter().any(|it| it.must_sync);
    if must_sync {
        journal.sync()?;
    }
    Ok(must_sync)
}
