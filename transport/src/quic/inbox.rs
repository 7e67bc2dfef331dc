use std::collections::{BTreeMap, VecDeque};
use std::sync::{Mutex, MutexGuard, PoisonError};

use bytes::Bytes;
use muster_machines::identity::NodeId;
use tokio::sync::Notify;

/// How many frames of one drone may wait to be looked at; further ones are dropped, and counted. So none keeps others
/// waiting for more than that.
const WAITING_MAX: usize = 64;

/// Frames that came in and were not looked at yet, in the order in which they came.
#[derive(Debug, Default)]
pub(super) struct Inbox {
    queue: Mutex<Queue>,
    /// There may be something in it.
    came: Notify,
}

#[derive(Debug, Default)]
struct Queue {
    frames: VecDeque<(NodeId, Bytes)>,
    /// How many of each drone are among them.
    waiting: BTreeMap<NodeId, usize>,
    overflowed: u64,
}

impl Inbox {
    /// Takes in a frame, unless too many of this drone's wait already.
    pub(super) fn put(&self, from: NodeId, frame: Bytes) {
        let mut queue = self.lock();
        let waiting = queue.waiting.entry(from).or_default();
        if *waiting >= WAITING_MAX {
            queue.overflowed += 1;
            return;
        }
        *waiting += 1;
        queue.frames.push_back((from, frame));
        drop(queue);
        self.came.notify_one();
    }

    /// Hands out the frame that came first, and whose connection it came by.
    pub(super) fn take(&self) -> Option<(NodeId, Bytes)> {
        let mut queue = self.lock();
        let (from, frame) = queue.frames.pop_front()?;
        if let Some(waiting) = queue.waiting.get_mut(&from) {
            *waiting -= 1;
            if *waiting == 0 {
                queue.waiting.remove(&from);
            }
        }
        Some((from, frame))
    }

    /// How many frames were dropped for want of room.
    pub(super) fn overflowed(&self) -> u64 {
        self.lock().overflowed
    }

    /// Returns once frames are there, or at once if they are.
    pub(super) async fn filled(&self) {
        while self.lock().frames.is_empty() {
            self.came.notified().await;
        }
    }

    fn lock(&self) -> MutexGuard<'_, Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drone_that_says_too_much_is_cut_short_and_others_are_heard() {
        let inbox = Inbox::default();
        for _ in 0..1_000 {
            inbox.put(NodeId(1), Bytes::from_static(b"again"));
        }
        inbox.put(NodeId(2), Bytes::from_static(b"once"));
        assert_eq!(inbox.overflowed(), 1_000 - WAITING_MAX as u64);
        let taken: Vec<_> = std::iter::from_fn(|| Some(inbox.take()?.1)).collect();
        assert_eq!(taken.len(), WAITING_MAX + 1);
        assert_eq!(taken.last(), Some(&Bytes::from_static(b"once")));
        assert!(inbox.lock().waiting.is_empty());
        inbox.put(NodeId(1), Bytes::from_static(b"there is room again"));
        assert!(inbox.take().is_some());
    }
}
