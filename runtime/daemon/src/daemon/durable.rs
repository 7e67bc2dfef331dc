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
/// Invariant: no frame is sent before the checkpoints that it depends on are durable, or newer ones of the same machines.
pub(super) struct Durable {
    checkpoints: Checkpoints,
    /// `None` once the process ends.
    journal: Option<Writer>,
    held: Held<Frame>,
    /// Whether the journal's queue lacks a checkpoint, because it was full.
    lacks_checkpoint: bool,
    /// How often the journal could not be written.
    pub(super) failures: u64,
}

impl Durable {
    pub(super) fn new(checkpoints: Checkpoints, journal: Writer) -> Self {
        Self {
            checkpoints,
            journal: Some(journal),
            held: Held::default(),
            lacks_checkpoint: false,
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
    /// If too many wait for the disk. It is kept in memory and queued again later; until then, later frames wait.
    pub(super) fn keep(&mut self, checkpoint: &Checkpoint) -> Result<(), QueueFull> {
        if self.checkpoints.holds(checkpoint) {
            return Ok(());
        }
        let must_sync = self.checkpoints.keep(checkpoint.clone());
        if self.lacks_checkpoint {
            return self.queue_all();
        }
        let Some(journal) = &mut self.journal else {
            return Ok(());
        };
        match journal.keep(checkpoint.clone(), must_sync) {
            Ok(number) if must_sync => self.held.require(number),
            Ok(_) => {}
            Err(full) => {
                self.lacks_checkpoint = true;
                self.held.require_unqueued();
                return Err(full);
            }
        }
        Ok(())
    }

    /// Queues the newest checkpoint of each machine, after one could not be queued.
    fn queue_all(&mut self) -> Result<(), QueueFull> {
        let Some(journal) = &mut self.journal else {
            return Ok(());
        };
        let mut last = None;
        for checkpoint in self.checkpoints.iter() {
            last = Some(journal.keep(checkpoint, true)?);
        }
        if let Some(number) = last {
            self.held.require(number);
        }
        self.lacks_checkpoint = false;
        Ok(())
    }

    /// Holds a frame, or returns it if it may be sent now.
    pub(super) fn hold(&mut self, frame: Frame) -> Option<Frame> {
        self.held.hold(frame)
    }

    /// The frames that may be sent after a report of the journal.
    pub(super) fn release(&mut self, report: &WriteReport) -> Vec<Frame> {
        if self.lacks_checkpoint {
            // Tried again at the next report if the queue is still full.
            let _ = self.queue_all();
        }
        self.held.release(report)
    }

    /// The journal could not be written. Returns whether it is the first time.
    pub(super) const fn fails_first(&mut self) -> bool {
        self.failures += 1;
        self.failures == 1
    }

    /// Closes the journal. Dropping the returned writer waits until all checkpoints are written.
    pub(super) fn close(&mut self) -> Option<Writer> {
        self.journal.take()
    }
}

#[cfg(test)]
mod tests {
    use std::io;
    use std::sync::mpsc;
    use std::time::Duration;

    use muster_machines::radio;
    use muster_runtime::journal::{Journal, PowerCutStorage, Storage, WAITING_MAX};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// A disk that takes what is written once a message has come, each time.
    struct Disk {
        bytes: Vec<u8>,
        may_sync: mpsc::Receiver<()>,
    }

    impl Storage for Disk {
        fn read(&mut self) -> io::Result<Vec<u8>> {
            Ok(self.bytes.clone())
        }

        fn append(&mut self, bytes: &[u8]) -> io::Result<()> {
            self.bytes.extend_from_slice(bytes);
            Ok(())
        }

        fn sync(&mut self) -> io::Result<()> {
            self.may_sync.recv().map_err(io::Error::other)
        }

        fn replace(&mut self, bytes: &[u8]) -> io::Result<()> {
            self.bytes = bytes.to_vec();
            Ok(())
        }

        fn last_synced(&mut self) -> io::Result<u64> {
            Ok(0)
        }

        fn set_last_synced(&mut self, _: u64) -> io::Result<()> {
            Ok(())
        }
    }

    fn counter(counter: u64) -> Checkpoint {
        Checkpoint::Radio(radio::Checkpoint { counter })
    }

    fn frame() -> Frame {
        Frame {
            to: None,
            bytes: Bytes::from_static(b"frame"),
            keep_alive: false,
        }
    }

    #[test]
    fn checkpoint_for_which_the_queue_had_no_room_is_durable_before_later_frames_leave() {
        let (sync, may_sync) = mpsc::channel();
        let disk = Disk {
            bytes: Vec::new(),
            may_sync,
        };
        let (journal, checkpoints) = Journal::open(disk).unwrap();
        let (sender, reports) = mpsc::channel();
        let report = move |it| drop(sender.send(it));
        let writer = Writer::start(journal, checkpoints.clone(), report).unwrap();
        let mut durable = Durable::new(checkpoints, writer);
        let first_refused = (1..)
            .find(|it| durable.keep(&counter(*it)).is_err())
            .unwrap();
        assert!(first_refused > WAITING_MAX as u64);
        assert!(durable.hold(frame()).is_none());
        // The machine's checkpoint stays as it was, so that it is not kept again.
        assert!(durable.keep(&counter(first_refused)).is_ok());
        (0..8).for_each(|_| sync.send(()).unwrap());
        let mut released = 0;
        while released == 0 {
            let report = reports.recv().unwrap();
            released = durable.release(&report).len();
        }
        assert!(durable.hold(frame()).is_some());
        drop(sync);
        drop(durable.close());
    }

    /// Each frame carries the number of the checkpoint that it depends on.
    #[test]
    fn frames_that_left_before_a_power_cut_rest_on_checkpoints_that_survive_it() {
        let mut random = ChaCha8Rng::seed_from_u64(20);
        let mut left_in_all = 0;
        for _ in 0..200 {
            let disk = PowerCutStorage::default();
            let (journal, checkpoints) = Journal::open(disk.clone()).unwrap();
            let (sender, reports) = mpsc::channel();
            let report = move |it| drop(sender.send(it));
            let writer = Writer::start(journal, checkpoints.clone(), report).unwrap();
            let mut durable = Durable::new(checkpoints, writer);
            let mut left = 0;
            let mut leave = |frame: &Frame| left = frame.bytes[0].into();
            for number in 1..=random.random_range(1..100_u8) {
                durable.keep(&counter(number.into())).unwrap();
                let bytes = Bytes::copy_from_slice(&[number]);
                let frame = durable.hold(Frame { bytes, ..frame() });
                frame.iter().for_each(&mut leave);
                for report in reports.try_iter() {
                    durable.release(&report).iter().for_each(&mut leave);
                }
                if random.random_range(0..5) == 0 {
                    std::thread::sleep(Duration::from_micros(200));
                }
            }
            left_in_all += left;
            // The cut comes at any moment: the thread may still write.
            let cut = disk.after_power_cut(|below| random.random_range(0..below));
            let Ok((_, found)) = Journal::open(cut) else {
                continue;
            };
            let known = found.iter().find_map(|it| match it {
                Checkpoint::Radio(radio) => Some(radio.counter),
                _ => None,
            });
            assert!(known >= Some(left), "{known:?} < {left}");
        }
        assert!(left_in_all > 200, "{left_in_all}");
    }
}
