use std::time::Duration;

use super::link_table::LinkTable;
use crate::identity::{NodeId, NodeSet};
use crate::routing::SharedState;
use crate::time::Timestamp;

/// Neighbours that need something from this drone.
#[derive(Debug, Clone, Default)]
pub(super) struct Recipients {
    /// Neighbours that may not know what this drone has for them, without the trusted ones.
    pub(super) unaware: NodeSet,
    /// Leaves over lossless links that have not confirmed the newest order yet, and are trusted to have received it.
    pub(super) trusted: NodeSet,
    /// Neighbours that requested this drone's state.
    pub(super) requesting: NodeSet,
}

impl Recipients {
    /// Collects the recipients; `parent` is `Some` if the parent lacks something. A stale child needs nothing until it
    /// is heard again: it may have taken another parent out of range.
    pub(super) fn of(
        shared: &SharedState,
        links: &LinkTable,
        parent: Option<NodeId>,
        (now, heartbeat_period): (Timestamp, Duration),
    ) -> Self {
        let sequence = shared.sequence();
        let mut recipients = Self::default();
        for link in links.iter() {
            if link.awaits_answer {
                recipients.requesting.insert(link.id);
            }
            let is_child_behind = link.is_child_of(shared.id) && !link.has_order(sequence);
            if parent == Some(link.id) || link.needs_epoch_announcement() {
                recipients.unaware.insert(link.id);
            } else if is_child_behind && !link.is_stale(now, heartbeat_period) {
                if link.is_leaf_of(shared.id) && link.is_trusted() {
                    recipients.trusted.insert(link.id);
                } else {
                    recipients.unaware.insert(link.id);
                }
            }
        }
        recipients
    }

    /// Whether something must be sent again, as far as this drone knows.
    pub(super) fn needs_retransmission(&self) -> bool {
        !self.unaware.is_empty() || !self.requesting.is_empty()
    }

    /// All recipients.
    pub(super) fn all(&self) -> NodeSet {
        let mut all = self.unaware.clone();
        all.extend_from(&self.trusted);
        all.extend_from(&self.requesting);
        all
    }
}

#[cfg(test)]
mod tests;
