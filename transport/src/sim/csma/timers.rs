use std::cmp::Reverse;
use std::collections::BinaryHeap;

use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;

use super::FrameId;

/// Something that the medium has to do at an instant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Timer {
    /// A radio's next datagram is ready.
    Ready(NodeId),
    /// A radio may have its turn, unless it has been called off.
    Start(NodeId),
    /// A frame is over.
    End(FrameId),
    /// A radio acknowledges what it has just heard.
    Acknowledge {
        /// Who acknowledges.
        by: NodeId,
        /// Whose frame.
        to: NodeId,
    },
    /// A radio stops waiting for an acknowledgement, unless it has come.
    Expire(NodeId),
}

/// What the medium has to do, in the order of time; at one instant, in the order in which it was planned.
#[derive(Debug, Default)]
pub(super) struct Timers {
    heap: BinaryHeap<Reverse<(Timestamp, u64, Timer)>>,
    planned: u64,
}

impl Timers {
    pub(super) fn plan(&mut self, at: Timestamp, timer: Timer) {
        self.heap.push(Reverse((at, self.planned, timer)));
        self.planned += 1;
    }

    pub(super) fn next(&self) -> Option<Timestamp> {
        self.heap.peek().map(|Reverse((at, ..))| *at)
    }

    pub(super) fn pop_due(&mut self, now: Timestamp) -> Option<(Timestamp, Timer)> {
        if self.next()? > now {
            return None;
        }
        self.heap.pop().map(|Reverse((at, _, timer))| (at, timer))
    }
}
