//! Frames that wait until the checkpoint that they depend on is durable.

use std::collections::VecDeque;

use muster_runtime::journal::WriteReport;

/// The most frames that wait; the oldest are dropped for newer ones.
const WAITING_MAX: usize = 1_024;

/// A queue of frames, in the order in which they are sent.
///
/// Invariant: a frame leaves the queue only after all checkpoints that were queued before it are durable.
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
    /// Later frames depend on the checkpoint with this number.
    pub(super) const fn require(&mut self, number: u64) {
        self.required = number;
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

    /// The frames that may be sent after this report, in order. Frames that depend on a checkpoint that could not be
    /// written are dropped.
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
                self.durable = self.durable.max(*number);
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
    fn frames_of_failed_checkpoints_are_dropped() {
        let failed = |number| WriteReport::Failed {
            number,
            error: io::Error::other("the disk is full"),
        };
        let mut held = held();
        assert!(held.release(&failed(1)).is_empty());
        assert!(held.release(&failed(3)).is_empty());
        assert_eq!(held.hold('e'), Some('e'));
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
