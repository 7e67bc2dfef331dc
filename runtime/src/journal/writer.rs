//! Writes a journal on a thread of its own: a disk may take long to say that something lasts, and the drone flies meanwhile.

use std::io;
use std::sync::mpsc::{self, Receiver, Sender};
use std::thread::{self, JoinHandle};

use muster_machines::node::{Checkpoint, Checkpoints};

use super::{Journal, Storage};

/// What has become of checkpoints, by the numbers that they were taken with.
#[derive(Debug)]
pub enum Written {
    /// All up to this one last.
    UpTo(u64),
    /// This one could not be written.
    Failed {
        /// Its number.
        number: u64,
        /// What the system says.
        error: io::Error,
    },
}

/// Takes checkpoints to be written, in their order.
#[derive(Debug)]
pub struct Writer {
    taken: u64,
    orders: Option<Sender<Order>>,
    thread: Option<JoinHandle<()>>,
}

/// A checkpoint to be written; whether anything rests on it.
type Order = (u64, Checkpoint, bool);

impl Writer {
    /// Writes to a journal, whose newest checkpoints are `all`, and tells from its own thread what has become of it. Those
    /// that wait when the disk is done with others are written together.
    ///
    /// # Errors
    /// When the system has no thread.
    pub fn start<S: Storage + Send + 'static>(
        journal: Journal<S>,
        all: Checkpoints,
        tell: impl FnMut(Written) + Send + 'static,
    ) -> io::Result<Self> {
        let (orders, waiting) = mpsc::channel();
        let thread = thread::Builder::new().name("journal".to_owned());
        let thread = thread.spawn(move || write_all(journal, all, &waiting, tell))?;
        Ok(Self {
            taken: 0,
            orders: Some(orders),
            thread: Some(thread),
        })
    }

    /// Takes a checkpoint; its number, from 1. If it `must_last`, what rests on it must wait until it does.
    pub fn keep(&mut self, checkpoint: Checkpoint, must_last: bool) -> u64 {
        self.taken += 1;
        if let Some(orders) = &self.orders {
            // It ends with this alone.
            let _ = orders.send((self.taken, checkpoint, must_last));
        }
        self.taken
    }
}

/// Returns once all that was taken is written.
impl Drop for Writer {
    fn drop(&mut self) {
        self.orders = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn write_all<S: Storage>(
    mut journal: Journal<S>,
    mut all: Checkpoints,
    waiting: &Receiver<Order>,
    mut tell: impl FnMut(Written),
) {
    while let Ok(first) = waiting.recv() {
        let (mut results, mut must_sync) = (Vec::new(), false);
        for (number, checkpoint, must_last) in std::iter::once(first).chain(waiting.try_iter()) {
            all.keep(checkpoint.clone());
            let added = journal.add(&checkpoint, &all);
            must_sync |= must_last && added.is_ok();
            results.push((number, must_last, added));
        }
        let synced = if must_sync { journal.sync() } else { Ok(()) };
        // In their order, so that nothing is taken to last before what was taken earlier.
        let mut lasting = None;
        for (number, must_last, added) in results {
            let failure = match (added, &synced) {
                (Err(error), _) => error,
                (Ok(()), Err(error)) if must_last => {
                    io::Error::new(error.kind(), error.to_string())
                }
                (Ok(()), _) => {
                    lasting = if must_last { Some(number) } else { lasting };
                    continue;
                }
            };
            lasting
                .take()
                .map(Written::UpTo)
                .into_iter()
                .for_each(&mut tell);
            tell(Written::Failed {
                number,
                error: failure,
            });
        }
        lasting.map(Written::UpTo).into_iter().for_each(&mut tell);
    }
}
