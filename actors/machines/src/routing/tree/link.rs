//! One neighbour: link quality, its last report, and what it is known to have received.

mod deliveries;
mod hearing;

use std::hint::black_box;
use std::time::Duration;

use bytes::Bytes;

use self::deliveries::Deliveries;
use self::hearing::Hearing;
use super::quality::Quality;
use crate::identity::{NodeId, NodeSet};
use crate::time::Timestamp;
use crate::wire::{TreeFrame, TreeHeader};

/// Most announcements of a new leader epoch to a neighbour, in frames that are sent anyway.
const EPOCH_ANNOUNCEMENTS_MAX: u32 = 8;

/// A neighbour.
#[derive(Debug, Clone)]
pub(super) struct Neighbour {
    pub(super) id: NodeId,
    /// When it was first heard, and last.
    pub(super) known_since: Timestamp,
    pub(super) heard_at: Timestamp,
    hearing: Hearing,
    pub(super) quality: Quality,
    pub(super) deliveries: Deliveries,
    /// Whether it requested this drone's state and has not been answered.
    pub(super) awaits_answer: bool,
    /// Number of announcements of the current epoch; `None` once it was heard under it.
    pub(super) epoch_announcements: Option<u32>,
    /// Its last report.
    pub(super) report: Report,
    /// Its sets; `None` if all are empty.
    sets: Option<Box<MemberSets>>,
    /// Body of the frame that `report` and `sets` come from; empty if that was sent under another epoch.
    pub(super) body: Bytes,
}

/// The sender of a frame, in its role for this drone.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sender {
    pub(super) id: NodeId,
    /// Whether it is the parent.
    pub(super) is_parent: bool,
    /// The current leader.
    pub(super) master: Option<NodeId>,
}

/// The scalar fields of a neighbour's last frame.
#[derive(Debug, Clone, Default)]
pub(super) struct Report {
    pub(super) number: u32,
    pub(super) unicasts: u32,
    pub(super) hops: Option<u16>,
    pub(super) cost: u16,
    pub(super) parent: Option<NodeId>,
    pub(super) heartbeat: u32,
    pub(super) lag: u32,
    pub(super) sequence: u32,
    /// Whether it requested this drone's state.
    pub(super) requests_own: bool,
    /// Number of neighbours whose state it requested.
    pub(super) request_count: u16,
    /// Whether it hears this drone; `None` if the frame does not contain it.
    pub(super) hears_own: Option<bool>,
    /// Of the parent: whether this drone may be in its subtree.
    pub(super) counts_own: bool,
    /// Whether the master is going to land.
    pub(super) master_lands: bool,
    /// Whether the sender was the parent at that time.
    pub(super) by_parent: bool,
}

/// The sets of a neighbour; most have none.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct MemberSets {
    /// Delivered to it as the medium reports: number of the order, and the members known to have carried it out.
    pub(super) delivered: (u32, NodeSet),
    /// As last reported, of children and the parent.
    pub(super) acknowledged: NodeSet,
    /// As last reported, of children.
    pub(super) alive: NodeSet,
    /// As last reported, of children.
    pub(super) landing: NodeSet,
    /// As last reported, of the parent: members whose acknowledgement the master lacks.
    pub(super) pending: NodeSet,
}

/// The sets of a neighbour without any.
static NO_SETS: MemberSets = MemberSets {
    delivered: (0, NodeSet::new()),
    acknowledged: NodeSet::new(),
    alive: NodeSet::new(),
    landing: NodeSet::new(),
    pending: NodeSet::new(),
};

/// Acknowledgements of an order that a neighbour has not reported.
static NO_MEMBERS: NodeSet = NodeSet::new();

/// What a received frame changed about the link.
#[derive(Debug, Clone, Copy)]
pub(super) struct LinkChange {
    /// It was unreachable before.
    pub(super) is_reachable_again: bool,
    /// It has become symmetric or one-way.
    pub(super) symmetry: bool,
    /// Its cost has changed.
    pub(super) cost: bool,
}

/// What a report changed.
#[derive(Debug, Clone, Copy)]
pub(super) struct ReportChange {
    /// It knows another order, or more acknowledgements.
    pub(super) progress: bool,
    /// That, or its subtree or the landing drones changed.
    pub(super) any: bool,
    /// Its distance to the master, its parent, or the peer's reception changed.
    pub(super) route: bool,
}

impl Neighbour {
    /// The link to a neighbour that is heard for the first time.
    pub(super) fn new(id: NodeId, now: Timestamp) -> Self {
        Self {
            id,
            known_since: now,
            heard_at: now,
            hearing: Hearing::OneWay,
            quality: Quality::new(),
            deliveries: Deliveries::default(),
            awaits_answer: false,
            epoch_announcements: None,
            report: Report::default(),
            sets: None,
            body: Bytes::new(),
        }
    }

    /// Number of broadcasts missed before a frame with these numbers; `None` if the frame is not newer than the last.
    #[inline]
    pub(super) fn missed_before(&self, number: u32, unicasts: u32) -> Option<u32> {
        let report = &self.report;
        let is_newer = (number, unicasts) > (report.number, report.unicasts);
        let is_for_all = unicasts == 0;
        is_newer.then(|| number - report.number - u32::from(is_for_all))
    }

    /// Whether it hears this drone.
    pub(super) const fn hearing(&self) -> Hearing {
        self.hearing
    }

    /// Records its first frame, whose report is stored already.
    pub(super) fn record_first(&mut self) {
        self.hearing = Hearing::of_first(self.report.hears_own);
    }

    /// Records a received frame, whose report is stored already, after `missed` broadcasts.
    #[inline]
    pub(super) fn record_reception(
        &mut self,
        now: Timestamp,
        missed: u32,
        leaf_period: Duration,
    ) -> LinkChange {
        let before = self.quality;
        self.quality.record_missed(missed);
        if self.report.unicasts == 0 {
            self.quality.record_received();
        }
        self.heard_at = now;
        let was_reachable = self.is_reachable();
        self.deliveries.forget_failures();
        self.epoch_announcements = None;
        let stale_time = || leaf_period * self.quality.stale_heartbeats.into();
        let symmetry = (self.hearing).record(now, self.report.hears_own, stale_time);
        if !self.confirms_delivered() {
            // It restarted, or sent the report before it received the frame.
            self.change_sets(|sets| sets.delivered = (0, NodeSet::new()));
        }
        LinkChange {
            is_reachable_again: !was_reachable,
            symmetry,
            cost: self.quality.cost_differs_from(&before),
        }
    }

    /// Whether it can be reached, as far as this drone knows.
    pub(super) fn is_reachable(&self) -> bool {
        self.deliveries.is_reachable(&self.quality)
    }

    /// Whether frames to it are taken as received: a lossless link without failures since it was heard, and no open
    /// request.
    pub(super) fn is_trusted(&self) -> bool {
        self.quality.is_good() && !self.deliveries.has_failed() && !self.awaits_answer
    }

    /// Whether it hears this drone but may not know the leader epoch.
    pub(super) fn needs_epoch_announcement(&self) -> bool {
        let delivered = self.epoch_announcements;
        self.hearing.is_symmetric()
            && delivered.is_some_and(|times| times < EPOCH_ANNOUNCEMENTS_MAX)
    }

    /// Whether it has an order, as it or the medium reported.
    pub(super) fn has_order(&self, sequence: u32) -> bool {
        self.report.sequence.max(self.sets().delivered.0) >= sequence
    }

    /// Members that it knows to have carried out an order: as it reported, and as the medium reported.
    pub(super) fn known_acknowledged(&self, sequence: u32) -> [&NodeSet; 2] {
        let sets = self.sets();
        let reported = (self.report.sequence, &sets.acknowledged);
        let delivered = (sets.delivered.0, &sets.delivered.1);
        [reported, delivered].map(|(of, known)| if of == sequence { known } else { &NO_MEMBERS })
    }

    /// Whether its report contains what was delivered to it.
    #[inline]
    fn confirms_delivered(&self) -> bool {
        let sets = self.sets();
        let (sequence, acknowledged) = &sets.delivered;
        self.report.sequence > *sequence
            || self.report.sequence == *sequence && sets.acknowledged.is_superset(acknowledged)
    }

    #[inline]
    pub(super) fn sets(&self) -> &MemberSets {
        self.sets.as_deref().unwrap_or(&NO_SETS)
    }

    /// Changes its sets. They are dropped once all are empty.
    pub(super) fn change_sets<T>(&mut self, change: impl FnOnce(&mut MemberSets) -> T) -> T {
        let mut sets = self.sets.take().unwrap_or_default();
        let changed = change(&mut sets);
        self.sets = Some(sets).filter(|sets| **sets != NO_SETS);
        changed
    }

    /// Forgets its report of another leader epoch. Its link quality stays known.
    pub(super) fn forget_epoch(&mut self) {
        self.report = Report {
            number: self.report.number,
            unicasts: self.report.unicasts,
            ..Report::default()
        };
        self.body = Bytes::new();
        self.sets = None;
        self.deliveries.forget_failures();
        self.awaits_answer = false;
        self.epoch_announcements = Some(0);
    }

    pub(super) const fn is_child_of(&self, id: NodeId) -> bool {
        matches!(self.report.parent, Some(parent) if parent.0 == id.0)
    }

    /// Whether it has a route to the master on which `id` is not the next hop.
    pub(super) const fn has_route_past(&self, id: NodeId) -> bool {
        self.report.hops.is_some() && !self.is_child_of(id)
    }

    /// Whether it is a child of `id` with no drones in its subtree, so that it forwards nothing.
    pub(super) fn is_leaf_of(&self, id: NodeId) -> bool {
        self.is_child_of(id) && NodeSet::from(self.id).is_superset(&self.sets().alive)
    }

    /// Heartbeat sequence of its route.
    pub(super) const fn route_heartbeat(&self) -> u32 {
        self.report.heartbeat.saturating_sub(self.report.lag)
    }

    /// Cost of the route through it; `None` if it has no route.
    pub(super) fn cost_through(&self) -> Option<u16> {
        self.report.hops?;
        Some(self.report.cost.saturating_add(self.quality.cost()))
    }

    /// Touches each cache line of it.
    pub(super) fn read_ahead(&self) {
        black_box((
            self.hearing.is_symmetric(),
            self.report.number,
            self.report.by_parent,
        ));
        black_box((self.body.len(), self.heard_at, self.quality.is_proven()));
        black_box((
            self.sets().delivered.0,
            self.awaits_answer,
            self.deliveries.has_failed(),
        ));
    }

    /// Whether it has been silent for so long that another parent would be better.
    pub(super) fn is_stale(&self, now: Timestamp, heartbeat_period: Duration) -> bool {
        now > self.stale_at(heartbeat_period)
    }

    /// When it becomes stale, unless it is heard before.
    pub(super) fn stale_at(&self, heartbeat_period: Duration) -> Timestamp {
        self.heard_at + heartbeat_period * self.quality.stale_heartbeats.into()
    }

    /// Stores the report of a frame, as far as `own` needs it; returns what changed.
    pub(super) fn update_report(
        &mut self,
        frame: &TreeFrame<'_>,
        own: NodeId,
        sender: Sender,
        drones: u32,
    ) -> ReportChange {
        let is_another_order = frame.sequence != self.report.sequence;
        let is_child = frame.header.parent == Some(own);
        let is_relative = is_child || sender.is_parent;
        let (mut progress, mut any) = (is_another_order, false);
        if is_relative || self.sets.is_some() {
            self.change_sets(|sets| {
                let keep = |stored: &mut NodeSet, set: NodeSet| {
                    let mut set = frame.merged_with_previous(set, stored);
                    set.truncate(drones);
                    let differs = set != *stored;
                    *stored = set;
                    differs
                };
                if is_another_order || !is_relative {
                    sets.acknowledged = NodeSet::new();
                    sets.pending = NodeSet::new();
                    if frame.span.is_some() && sender.is_parent {
                        sets.pending = NodeSet::from(0..drones);
                    }
                }
                if is_relative {
                    progress |= keep(&mut sets.acknowledged, frame.subtree.acknowledged());
                }
                if sender.is_parent {
                    keep(&mut sets.pending, frame.pending.to_set());
                } else {
                    sets.pending = NodeSet::new();
                }
                if is_child {
                    any |= keep(&mut sets.alive, frame.subtree.alive());
                    any |= keep(&mut sets.landing, frame.subtree.landing());
                } else {
                    (sets.alive, sets.landing) = (NodeSet::new(), NodeSet::new());
                }
            });
        }
        let mut report = Report::of(frame, own, sender);
        // A packet of a large swarm may not cover it.
        report.counts_own = sender.is_parent && frame.counts(own).unwrap_or(true);
        let before = std::mem::replace(&mut self.report, report);
        let reception = frame.reception_of(own);
        let peer_share_changed = reception.is_some_and(|it| self.quality.record_peer_share(it));
        let route = |report: &Report| (report.hops, report.cost, report.parent);
        ReportChange {
            progress,
            any: any || progress,
            route: peer_share_changed || route(&before) != route(&self.report),
        }
    }
}

impl Report {
    /// The report of a frame, as far as `own` needs it.
    fn of(frame: &TreeFrame<'_>, own: NodeId, sender: Sender) -> Self {
        let TreeHeader {
            number,
            hops,
            cost,
            parent,
            heartbeat,
            lag,
        } = frame.header;
        Self {
            number,
            unicasts: frame.unicasts,
            hops,
            cost,
            parent,
            heartbeat,
            lag,
            sequence: frame.sequence,
            requests_own: frame.requests.contains(own),
            request_count: frame.requests.member_count(),
            hears_own: reports_hearing(own, frame),
            counts_own: false,
            master_lands: (sender.master).is_some_and(|master| frame.subtree.is_landing(master)),
            by_parent: sender.is_parent,
        }
    }
}

/// Whether a neighbour reports or shows that it hears `own`; `None` if the frame does not contain it.
pub(super) fn reports_hearing(own: NodeId, frame: &TreeFrame<'_>) -> Option<bool> {
    if frame.header.parent == Some(own) || frame.to == Some(own) || frame.requests.contains(own) {
        Some(true)
    } else {
        frame.hears(own)
    }
}

#[cfg(test)]
mod tests;
