use std::collections::{BTreeMap, VecDeque};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use bytes::Bytes;
use muster_machines::identity::NodeId;
use tokio::sync::Notify;

/// Most queued frames of one drone; further ones are dropped and counted. It bounds the delay that one drone causes others.
const QUEUED_MAX: usize = 64;

/// Received frames that wait to be handled, in the order of arrival.
///
/// Invariant: none is longer than the limit, and at most [`QUEUED_MAX`] are of one drone.
#[derive(Debug)]
pub(super) struct Inbox {
    /// Maximum length of a frame, in bytes.
    frame_max: usize,
    queue: Mutex<Queue>,
    /// Frames dropped because of their length.
    too_long: AtomicU64,
    /// Notified after each push.
    pushed: Notify,
}

#[derive(Debug, Default)]
struct Queue {
    frames: VecDeque<(NodeId, Bytes)>,
    /// Number of queued frames of each drone.
    by_drone: BTreeMap<NodeId, usize>,
    overflowed: u64,
}

impl Inbox {
    /// An empty one for frames of up to `frame_max` bytes.
    pub(super) fn new(frame_max: usize) -> Self {
        Self {
            frame_max,
            queue: Mutex::default(),
            too_long: AtomicU64::new(0),
            pushed: Notify::new(),
        }
    }

    /// Maximum length of a frame, in bytes.
    pub(super) const fn frame_max(&self) -> usize {
        self.frame_max
    }

    /// Adds a frame; drops and counts it if it is too long or its sender has too many queued.
    pub(super) fn push(&self, from: NodeId, frame: Bytes) {
        if frame.len() > self.frame_max {
            return self.count_too_long();
        }
        let mut queue = self.lock();
        let queued = queue.by_drone.entry(from).or_default();
        if *queued >= QUEUED_MAX {
            queue.overflowed += 1;
            return;
        }
        *queued += 1;
        queue.frames.push_back((from, frame));
        drop(queue);
        self.pushed.notify_one();
    }

    /// Removes the oldest frame, with the peer that it came from.
    pub(super) fn pop(&self) -> Option<(NodeId, Bytes)> {
        let mut queue = self.lock();
        let (from, frame) = queue.frames.pop_front()?;
        if let Some(queued) = queue.by_drone.get_mut(&from) {
            *queued -= 1;
            if *queued == 0 {
                queue.by_drone.remove(&from);
            }
        }
        Some((from, frame))
    }

    /// Counts a frame that is dropped because of its length.
    pub(super) fn count_too_long(&self) {
        self.too_long.fetch_add(1, Ordering::Relaxed);
    }

    /// Number of frames dropped because of their length.
    pub(super) fn too_long(&self) -> u64 {
        self.too_long.load(Ordering::Relaxed)
    }

    /// Number of frames dropped because the queue was full.
    pub(super) fn overflowed(&self) -> u64 {
        self.lock().overflowed
    }

    /// Waits until there is a frame.
    pub(super) async fn wait_for_frame(&self) {
        while self.lock().frames.is_empty() {
            self.pushed.notified().await;
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
    fn flood_of_one_drone_does_not_displace_frames_of_others() {
        let inbox = Inbox::new(64);
        for _ in 0..1_000 {
            inbox.push(NodeId(1), Bytes::from_static(b"flood"));
        }
        inbox.push(NodeId(2), Bytes::from_static(b"once"));
        assert_eq!(inbox.overflowed(), 1_000 - QUEUED_MAX as u64);
        let popped: Vec<_> = std::iter::from_fn(|| Some(inbox.pop()?.1)).collect();
        assert_eq!(popped.len(), QUEUED_MAX + 1);
        assert_eq!(popped.last(), Some(&Bytes::from_static(b"once")));
        assert!(inbox.lock().by_drone.is_empty());
        inbox.push(NodeId(1), Bytes::from_static(b"after the flood"));
        assert!(inbox.pop().is_some());
    }

    #[test]
    fn frames_above_the_limit_are_dropped_and_counted() {
        let inbox = Inbox::new(4);
        inbox.push(NodeId(1), Bytes::from_static(b"12345"));
        assert_eq!((inbox.pop(), inbox.too_long()), (None, 1));
        inbox.push(NodeId(1), Bytes::from_static(b"1234"));
        assert!(inbox.pop().is_some());
    }
}
