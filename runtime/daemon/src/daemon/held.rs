//! Frames that wait until the checkpoint that they depend on is durable.
//!
//! While the journal can't be written, the drone sends no frame, and lands on the spot. To the others it is like a drone whose
//! process has died: they wait for it, then miss it. If frames left nevertheless, they could carry a ballot or numbers that
//! the drone's next incarnation does not know, and uses again. Operators are still answered: their connections are not held.

use std::collections::VecDeque;

use muster_runtime::journal::WriteReport;

/// The most frames that wait; the oldest are dropped for newer ones.
const WAITING_MAX: usize = 1_024;

/// In place of the number of a checkpoint that the journal's queue had no room for.
const NOT_QUEUED: u64 = u64::MAX;

/// A queue of frames, in the order in which they are sent.
///
/// Invariant: a frame leaves the queue only after all checkpoints that were kept before it are durable, or newer ones of the
/// same machines.
#[derive(Debug)]
pub(super) struct Held<T> {
    /// Number of the newest checkpoint that must be durable.
    required: u64,
    /// Number of the newest one that is.
    durable: u64,
    waiting: VecDeque<(u64, T)>,
}

impl<T> Default for Held<T> {
    fn default() -> Self {
        Self {
            required: 0,
            durable: 0,
            waiting: VecDeque::new(),
        }
    }
}

impl<T> Held<T> {
    /// Later frames depend on the checkpoint with this number, as do those that depend on one that was not queued.
    pub(super) fn require(&mut self, number: u64) {
        self.required = number;
        let waiting = self.waiting.iter_mut();
        waiting
            .filter(|(required, _)| *required == NOT_QUEUED)
            .for_each(|(required, _)| *required = number);
    }

    /// Later frames depend on a checkpoint that could not be queued. They wait until a number is required again.
    pub(super) const fn require_unqueued(&mut self) {
        self.required = NOT_QUEUED;
    }

    /// Queues a frame, or returns it if all that it depends on is durable.
    pub(super) fn hold(&mut self, frame: T) -> Option<T> {
        if self.required <= self.durable {
            return Some(frame);
        }
        if self.waiting.len() == WAITING_MAX {
            self.waiting.pop_front();
        }
        self.waiting.push_back((self.required, frame));
        None
    }

    /// The frames that may be sent after this report, in order. After a failure, frames that depend on a checkpoint that may
    /// not be durable are dropped: they are outdated once it is. Later ones wait.
    pub(super) fn release(&mut self, report: &WriteReport) -> Vec<T> {
        match report {
            WriteReport::DurableUpTo(number) => {
                self.durable = self.durable.max(*number);
                let ready = self.waiting.iter();
                let ready = ready.take_while(|(required, _)| required <= number).count();
                self.waiting
                    .drain(..ready)
                    .map(|(_, frame)| frame)
                    .collect()
            }
            WriteReport::Failed { number, .. } => {
                self.waiting.retain(|(required, _)| required > number);
                Vec::new()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io;

    use super::*;

    fn held() -> Held<char> {
        let mut held = Held::default();
        assert_eq!(held.hold('a'), Some('a'));
        held.require(1);
        assert_eq!(held.hold('b'), None);
        held.require(3);
        assert_eq!(held.hold('c'), None);
        assert_eq!(held.hold('d'), None);
        held
    }

    #[test]
    fn frame_waits_for_its_checkpoint_only() {
        let mut held = held();
        assert_eq!(held.release(&WriteReport::DurableUpTo(2)), ['b']);
        assert_eq!(held.hold('e'), None);
        assert_eq!(held.release(&WriteReport::DurableUpTo(4)), ['c', 'd', 'e']);
        assert_eq!(held.hold('f'), Some('f'));
    }

    #[test]
    fn frames_wait_after_a_failed_write_until_a_later_one_succeeds() {
        let failed = |number| WriteReport::Failed {
            number,
            error: io::Error::other("the disk is full"),
        };
        let mut held = held();
        assert!(held.release(&failed(1)).is_empty());
        assert!(held.release(&failed(3)).is_empty());
        assert_eq!(held.hold('e'), None);
        held.require(4);
        assert_eq!(held.hold('f'), None);
        assert_eq!(held.release(&WriteReport::DurableUpTo(4)), ['e', 'f']);
        assert_eq!(held.hold('g'), Some('g'));
    }

    #[test]
    fn frames_of_a_checkpoint_that_was_not_queued_wait_until_it_is() {
        let mut held = held();
        held.require_unqueued();
        assert_eq!(held.hold('e'), None);
        assert_eq!(held.release(&WriteReport::DurableUpTo(3)), ['b', 'c', 'd']);
        assert_eq!(held.hold('f'), None);
        held.require(7);
        assert!(held.release(&WriteReport::DurableUpTo(6)).is_empty());
        assert_eq!(held.release(&WriteReport::DurableUpTo(7)), ['e', 'f']);
    }

    #[test]
    fn full_queue_drops_oldest_frame() {
        let mut held = Held::default();
        held.require(1);
        (0..=WAITING_MAX).for_each(|frame| assert_eq!(held.hold(frame), None));
        let ready = held.release(&WriteReport::DurableUpTo(1));
        assert_eq!((ready.len(), ready[0]), (WAITING_MAX, 1));
    }
}
