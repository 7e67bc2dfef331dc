//! Acknowledgements on their way to the master: merged with those of the subtree, and held until the subtree is
//! complete.

use std::time::Duration;

use super::link::Neighbour;
use super::link_table::LinkTable;
use crate::identity::NodeSet;
use crate::routing::shared::SharedState;
use crate::time::Timestamp;

/// Longest hold, in repair intervals. A drone that has moved to another parent out of range stays in this subtree until
/// its link times out.
const HOLD_REPAIRS: u32 = 8;

/// Shortest pause between two acknowledgements, in repair intervals; those that arrive meanwhile are merged. Otherwise
/// a drone with a large subtree would exceed its receivers' rate limit.
const MERGE_REPAIRS: u32 = 2;

/// Acknowledgements that wait to be forwarded.
///
/// Invariant: after a hold has ended, no acknowledgement of its order is held again.
#[derive(Debug, Default)]
pub(super) struct Aggregation {
    hold: Option<Hold>,
    /// When this drone last forwarded acknowledgements.
    forwarded_at: Option<Timestamp>,
}

/// Acknowledgements of an order, held until the missing ones arrive.
#[derive(Debug, Clone, Copy)]
struct Hold {
    sequence: u32,
    until: Timestamp,
    is_over: bool,
}

/// What to do with acknowledgements.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Forward {
    /// Send nothing: the parent knows them, or they are held.
    No,
    /// Send them now.
    Now,
    /// Send them then, merged with those that arrive meanwhile.
    At(Timestamp),
}

impl Aggregation {
    pub(super) fn start_epoch(&mut self) {
        self.hold = None;
    }

    /// End of the hold.
    pub(super) fn deadline(&self) -> Option<Timestamp> {
        self.hold.filter(|it| !it.is_over).map(|it| it.until)
    }

    /// Whether a hold ends at `now`; true once.
    pub(super) fn ends_hold(&mut self, now: Timestamp) -> bool {
        match &mut self.hold {
            Some(hold) if !hold.is_over && hold.until <= now => {
                hold.is_over = true;
                true
            }
            _ => false,
        }
    }

    /// Whether acknowledgements may be forwarded: the subtree is complete, or the hold has ended.
    pub(super) fn may_forward(&self, shared: &SharedState, links: &LinkTable) -> bool {
        let sequence = shared.sequence();
        let hold_is_over = self
            .hold
            .is_some_and(|hold| hold.is_over && hold.sequence == sequence);
        hold_is_over || is_complete(shared, links)
    }

    /// What to do now. Starts a hold if acknowledgements are missing in the subtree.
    pub(super) fn forward(
        &mut self,
        shared: &SharedState,
        links: &LinkTable,
        parent: Option<&Neighbour>,
        (now, repair): (Timestamp, Duration),
    ) -> Forward {
        let sequence = shared.sequence();
        let has_any = shared.durable.epoch.is_carried_out()
            || !links.subtree(sequence).acknowledged.is_empty();
        if shared.is_master() || !has_any {
            return Forward::No;
        }
        if !self.may_forward(shared, links) {
            if self.hold.is_none_or(|hold| hold.sequence != sequence) {
                self.hold = Some(Hold {
                    sequence,
                    until: now + repair * HOLD_REPAIRS,
                    is_over: false,
                });
            }
            return Forward::No;
        }
        if !self.parent_lacks(shared, links, parent) {
            return Forward::No;
        }
        let next = self.forwarded_at.map(|at| at + repair * MERGE_REPAIRS);
        match next.filter(|next| now < *next) {
            Some(next) => Forward::At(next),
            None => {
                self.forwarded_at = Some(now);
                Forward::Now
            }
        }
    }

    /// Whether the parent lacks something that this drone could tell it.
    pub(super) fn parent_lacks(
        &self,
        shared: &SharedState,
        links: &LinkTable,
        parent: Option<&Neighbour>,
    ) -> bool {
        let sequence = shared.sequence();
        let Some(parent) = parent else {
            return false;
        };
        if parent.report.sequence > sequence || !self.may_forward(shared, links) {
            return false;
        }
        if !parent.has_order(sequence) {
            return true;
        }
        // Once the master has named pending members, only their acknowledgements count.
        let pending = pending(parent, sequence);
        let is_pending = |id| pending.is_none_or(|pending| pending.contains(id));
        let [reported, delivered] = parent.known_acknowledged(sequence);
        let lacks_own = shared.durable.epoch.is_carried_out()
            && ![reported, delivered]
                .iter()
                .any(|known| known.contains(shared.id))
            && is_pending(shared.id);
        let subtree = &links.subtree(sequence).acknowledged;
        let is_known = reported.is_superset(subtree) || delivered.is_superset(subtree);
        lacks_own
            || !is_known
                && NodeSet::any_where(
                    [subtree, reported, delivered, pending.unwrap_or(subtree)],
                    |[subtree, reported, delivered, pending]| {
                        subtree && !reported && !delivered && pending
                    },
                )
    }
}

/// Members whose acknowledgement of order `sequence` the master lacks, as the parent reports; `None` if it has not
/// reported that.
pub(super) fn pending(parent: &Neighbour, sequence: u32) -> Option<&NodeSet> {
    let has_reported = parent.report.by_parent && parent.report.sequence == sequence;
    has_reported.then(|| &parent.sets().pending)
}

/// Whether this drone and its subtree have carried out the newest order, without those that land.
fn is_complete(shared: &SharedState, links: &LinkTable) -> bool {
    let sequence = shared.sequence();
    let is_own_missing = !shared.is_relay()
        && shared.durable.landing.is_none()
        && !shared.durable.epoch.is_carried_out();
    sequence > 0 && !is_own_missing && !links.subtree(sequence).is_incomplete
}

#[cfg(test)]
mod tests;
