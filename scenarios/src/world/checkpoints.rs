//! A simulated drone's checkpoints.

use muster_machines::node::{Checkpoint, Checkpoints};
use muster_runtime::journal::Journal;
use rand::Rng;

use super::disk::Disk;

/// A simulated disk accepts everything.
const NEVER_FAILS: &str = "a simulated disk never fails";

/// The checkpoints of a drone's actors.
///
/// Invariant: with a journal, `current` is what the journal would yield if all of it were synchronised.
#[derive(Debug)]
pub(super) struct CheckpointStore {
    current: Checkpoints,
    /// What outlives the process; `None` in a world in which no process is restarted.
    journal: Option<Box<Journal<Disk>>>,
}

impl CheckpointStore {
    pub(super) fn new(has_journal: bool) -> Self {
        let opened = has_journal.then(|| Journal::open(Disk::default()).expect(NEVER_FAILS));
        let (journal, current) = opened.unzip();
        Self {
            current: current.unwrap_or_default(),
            journal: journal.map(Box::new),
        }
    }

    pub(super) const fn current(&self) -> &Checkpoints {
        &self.current
    }

    /// Keeps a checkpoint; synchronises the journal where an effect may depend on it.
    pub(super) fn keep(&mut self, checkpoint: Checkpoint) {
        let Some(journal) = &mut self.journal else {
            self.current.keep(checkpoint);
            return;
        };
        let must_last = self.current.keep(checkpoint.clone());
        journal.add(&checkpoint, &self.current).expect(NEVER_FAILS);
        if must_last {
            journal.sync().expect(NEVER_FAILS);
        }
    }

    /// The process ends and power fails: only what the journal holds is left. Without a journal all is kept.
    pub(super) fn lose_power(&mut self, rng: &mut impl Rng) {
        if let Some(journal) = self.journal.take() {
            let mut disk = journal.into_storage();
            disk.lose_power(rng);
            let (journal, current) = Journal::open(disk).expect(NEVER_FAILS);
            self.journal = Some(Box::new(journal));
            self.current = current;
        }
    }
}
