//! Acknowledgements on their way inwards: merged with those from below, held back for those that are missing there.

use std::time::Duration;

use super::link::Link;
use super::link_table::LinkTable;
use crate::identity::NodeSet;
use crate::routing::core::Core;
use crate::time::Timestamp;

/// How long acknowledgements wait for those still missing below, in repairs: a drone that has gone to another parent
/// out of hearing is missed here until its link is given up.
const HOLD_REPAIRS: u32 = 8;

/// How long, in repairs, acknowledgements that come in after one was said wait to be said in one frame: a drone with many
/// below it would otherwise speak more often than others listen to it.
const MERGED_REPAIRS: u32 = 2;

/// What has come in and waits to be passed on.
///
/// Invariant: once a hold is over nothing below its order is waited for again.
#[derive(Debug, Default)]
pub(super) struct Aggregation {
    hold: Option<Hold>,
    /// When this drone last acknowledged anything by itself.
    passed_on_at: Option<Timestamp>,
}

/// Acknowledgements of an order that wait to be merged with those still missing.
#[derive(Debug, Clone, Copy)]
struct Hold {
    sequence: u32,
    until: Timestamp,
    is_over: bool,
}

/// What is to be done with acknowledgements.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Pass {
    /// Nothing: the parent knows them, or they are held back.
    No,
    /// Say them now.
    Now,
    /// Say them then, with what comes in meanwhile.
    At(Timestamp),
}

impl Aggregation {
    pub(super) fn begin_epoch(&mut self) {
        self.hold = None;
    }

    /// When a hold ends.
    pub(super) fn deadline(&self) -> Option<Timestamp> {
        self.hold.filter(|it| !it.is_over).map(|it| it.until)
    }

    /// Whether a hold has just ended.
    pub(super) fn ends_hold(&mut self, now: Timestamp) -> bool {
        match &mut self.hold {
            Some(hold) if !hold.is_over && hold.until <= now => {
                hold.is_over = true;
                true
            }
            _ => false,
        }
    }

    /// Whether what has come in so far may be passed on: all of it has, or what is missing was waited for long enough.
    pub(super) fn may_pass(&self, core: &Core, links: &LinkTable) -> bool {
        let sequence = core.sequence();
        let waited = self
            .hold
            .is_some_and(|hold| hold.is_over && hold.sequence == sequence);
        waited || is_complete(core, links)
    }

    /// What is to be done with what has come in by now, beginning to wait for what is missing.
    pub(super) fn pass(
        &mut self,
        core: &Core,
        links: &LinkTable,
        parent: Option<&Link>,
        (now, repair): (Timestamp, Duration),
    ) -> Pass {
        let sequence = core.sequence();
        let has_any =
            core.durable.epoch.is_carried_out() || !links.below(sequence).acknowledged.is_empty();
        if core.is_master() || !has_any {
            return Pass::No;
        }
        if !self.may_pass(core, links) {
            if self.hold.is_none_or(|hold| hold.sequence != sequence) {
                self.hold = Some(Hold {
                    sequence,
                    until: now + repair * HOLD_REPAIRS,
                    is_over: false,
                });
            }
            return Pass::No;
        }
        if !self.parent_lacks(core, links, parent) {
            return Pass::No;
        }
        let next = self.passed_on_at.map(|at| at + repair * MERGED_REPAIRS);
        match next.filter(|next| now < *next) {
            Some(next) => Pass::At(next),
            None => {
                self.passed_on_at = Some(now);
                Pass::Now
            }
        }
    }

    /// Whether the parent is not known to know what this drone has for it.
    pub(super) fn parent_lacks(
        &self,
        core: &Core,
        links: &LinkTable,
        parent: Option<&Link>,
    ) -> bool {
        let sequence = core.sequence();
        let Some(parent) = parent else {
            return false;
        };
        if parent.said.sequence > sequence || !self.may_pass(core, links) {
            return false;
        }
        if !parent.knows(sequence) {
            return true;
        }
        // Once the master has named who is pending, only they answer.
        let pending = pending(parent, sequence);
        let is_pending = |id| pending.is_none_or(|pending| pending.contains(id));
        let [said, told] = parent.known(sequence);
        let is_own_missed = core.durable.epoch.is_carried_out()
            && ![said, told].iter().any(|known| known.contains(core.id))
            && is_pending(core.id);
        let below = &links.below(sequence).acknowledged;
        let is_known = said.is_superset(below) || told.is_superset(below);
        is_own_missed
            || !is_known
                && NodeSet::any_where(
                    [below, said, told, pending.unwrap_or(below)],
                    |[below, said, told, pending]| below && !said && !told && pending,
                )
    }
}

/// Who the master misses, as the parent says it of order `sequence`; `None` if it has not said.
pub(super) fn pending(parent: &Link, sequence: u32) -> Option<&NodeSet> {
    let has_said = parent.said.by_parent && parent.said.sequence == sequence;
    has_said.then(|| &parent.sets().pending)
}

/// Whether this drone and all below it have carried the newest order out, those apart that are landing.
fn is_complete(core: &Core, links: &LinkTable) -> bool {
    let sequence = core.sequence();
    let is_awaited =
        !core.is_relay() && core.durable.landing.is_none() && !core.durable.epoch.is_carried_out();
    sequence > 0 && !is_awaited && !links.below(sequence).is_awaited
}

#[cfg(test)]
mod tests;
