//! Messages that arrive before an agent starts, or while it waits for its restart.

use std::collections::VecDeque;

use bytes::Bytes;

use crate::identity::NodeId;
use crate::routing::messages::limits::{QUEUE_BYTES_MAX, QUEUE_MAX};

/// Messages with their senders, the oldest first.
///
/// Invariant: no more than a drone may send at once, [`QUEUE_MAX`] of [`QUEUE_BYTES_MAX`] in all.
#[derive(Debug, Default)]
pub(super) struct Waiting {
    messages: VecDeque<(NodeId, Bytes)>,
    bytes: usize,
}

impl Waiting {
    /// Adds a message. The oldest are lost if there are too many.
    pub(super) fn push(&mut self, from: NodeId, payload: Bytes) {
        self.bytes += payload.len();
        self.messages.push_back((from, payload));
        while self.messages.len() > QUEUE_MAX || self.bytes > QUEUE_BYTES_MAX {
            self.pop();
        }
    }

    /// Removes and returns the oldest.
    pub(super) fn pop(&mut self) -> Option<(NodeId, Bytes)> {
        let message = self.messages.pop_front()?;
        self.bytes -= message.1.len();
        Some(message)
    }

    pub(super) fn clear(&mut self) {
        *self = Self::default();
    }
}
