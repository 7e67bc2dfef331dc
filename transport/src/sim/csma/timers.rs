use std::cmp::Reverse;
use std::collections::BinaryHeap;

use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;

use super::FrameId;

/// A planned action of the medium.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Timer {
    /// A radio's next datagram is ready.
    Ready(NodeId),
    /// A radio starts to send, unless the start was cancelled.
    Start(NodeId),
    /// A frame ends.
    End(FrameId),
    /// A radio acknowledges a unicast.
    Acknowledge {
        /// The receiver of the unicast.
        by: NodeId,
        /// Its sender.
        to: NodeId,
    },
    /// The deadline of an acknowledgement, unless it has arrived.
    Expire(NodeId),
}

/// Planned actions in the order of time; at the same time, in the order of planning.
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
