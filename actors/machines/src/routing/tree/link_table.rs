//! The link table: all neighbours, and the merged reports of the children.

use std::cell::OnceCell;
use std::time::Duration;

use bytes::Bytes;

use super::link::{Neighbour, Sender, reports_hearing};
use crate::flaw::{self, Flaw};
use crate::identity::{NodeId, NodeSet};
use crate::node_map::NodeMap;
use crate::routing::tree::quality::LOSSLESS;
use crate::time::Timestamp;
use crate::wire::{Reception, TreeFrame, TreeHeader};

/// All neighbours, from the frames that were received of them.
///
/// Invariant: `subtree`, if cached, is merged from the current children.
#[derive(Debug, Clone)]
pub(super) struct LinkTable {
    own: NodeId,
    /// Number of drones; reports of other ids are dropped.
    drones: u32,
    /// Longest pause between two frames of a parent.
    heartbeat_period: Duration,
    /// Longest pause between two frames of any neighbour.
    leaf_period: Duration,
    links: NodeMap<Neighbour>,
    /// Cache of the children's merged reports.
    subtree: OnceCell<Subtree>,
}

/// Merged reports of all children.
#[derive(Debug, Clone, Default)]
pub(super) struct Subtree {
    /// The order that `acknowledged` belongs to.
    sequence: u32,
    /// Drones that have carried it out. Reports of unreachable children count, because what is done stays done.
    pub(super) acknowledged: NodeSet,
    pub(super) alive: NodeSet,
    pub(super) landing: NodeSet,
    /// Whether a drone has neither carried it out nor is going to land.
    pub(super) is_incomplete: bool,
}

/// What a received frame changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct ReceivedReport {
    /// The sender knows another order, or more acknowledgements.
    pub(super) has_progressed: bool,
    /// The sender's route or link changed.
    pub(super) route_changed: bool,
    /// It has changed whether the sender may not hear this drone.
    pub(super) hearing_changed: bool,
    /// The sender was unknown.
    pub(super) is_new: bool,
}

impl LinkTable {
    /// An empty table of drone `own`.
    pub(super) fn new(
        own: NodeId,
        drones: u32,
        heartbeat_period: Duration,
        leaf_period: Duration,
    ) -> Self {
        Self {
            own,
            drones,
            heartbeat_period,
            leaf_period,
            links: NodeMap::new(),
            subtree: OnceCell::new(),
        }
    }

    /// Whether a frame equals the sender's last one, apart from header fields that always change, and the sender's role
    /// is the same. Most frames do, and their bodies are not decoded again.
    #[inline]
    pub(super) fn is_unchanged(&self, sender: Sender, header: &TreeHeader, body: &[u8]) -> bool {
        self.get(sender.id).is_some_and(|link| {
            let report = &link.report;
            (report.hops, report.cost, report.parent, report.by_parent)
                == (header.hops, header.cost, header.parent, sender.is_parent)
                && link.body == body
                && !body.is_empty()
        })
    }

    /// Records a frame for which [`Self::is_unchanged`] is true; `None` if its number is not newer than the last.
    #[inline]
    pub(super) fn receive_unchanged(
        &mut self,
        id: NodeId,
        header: &TreeHeader,
        now: Timestamp,
    ) -> Option<ReceivedReport> {
        let link = self.links.get_mut(id)?;
        let missed = link.missed_before(header.number, link.report.unicasts)?;
        (link.report.number, link.report.heartbeat, link.report.lag) =
            (header.number, header.heartbeat, header.lag);
        let is_child = link.is_child_of(self.own);
        let link_change = link.record_reception(now, missed, self.leaf_period);
        if is_child && link_change.is_reachable_again {
            self.subtree.take();
        }
        Some(ReceivedReport {
            has_progressed: false,
            route_changed: link_change.is_reachable_again
                || link_change.symmetry
                || link_change.cost,
            hearing_changed: false,
            is_new: false,
        })
    }

    /// Records a frame; `None` if its number is not newer than the last.
    pub(super) fn receive(
        &mut self,
        sender: Sender,
        frame: &TreeFrame<'_>,
        body: Bytes,
        now: Timestamp,
    ) -> Option<ReceivedReport> {
        let link = match self.links.find(sender.id) {
            Ok(at) => self.links.at(at),
            Err(at) => return Some(self.insert_new(at, sender, frame, body, now)),
        };
        let missed = link.missed_before(frame.header.number, frame.unicasts)?;
        let (was_child, was_deaf) = (link.is_child_of(self.own), link.hearing().may_be_deaf());
        let change = link.update_report(frame, self.own, sender, self.drones);
        link.body = body;
        let is_child = link.is_child_of(self.own);
        let link_change = link.record_reception(now, missed, self.leaf_period);
        let hearing_changed = link.hearing().may_be_deaf() != was_deaf;
        if was_child != is_child || is_child && (change.any || link_change.is_reachable_again) {
            self.subtree.take();
        }
        Some(ReceivedReport {
            has_progressed: change.progress,
            route_changed: change.route
                || link_change.is_reachable_again
                || link_change.symmetry
                || link_change.cost,
            hearing_changed,
            is_new: false,
        })
    }

    /// Records the first frame of a neighbour.
    fn insert_new(
        &mut self,
        at: usize,
        sender: Sender,
        frame: &TreeFrame<'_>,
        body: Bytes,
        now: Timestamp,
    ) -> ReceivedReport {
        let mut link = Neighbour::new(sender.id, now);
        link.update_report(frame, self.own, sender, self.drones);
        link.record_first();
        link.body = body;
        if link.is_child_of(self.own) {
            self.subtree.take();
        }
        let hearing_changed = link.hearing().may_be_deaf();
        self.links.insert(at, sender.id, link);
        ReceivedReport {
            has_progressed: true,
            route_changed: true,
            hearing_changed,
            is_new: true,
        }
    }

    /// Records a frame under another leader. Both drones learn that they hear each other, and this one announces its
    /// epoch.
    pub(super) fn receive_of_another_epoch(
        &mut self,
        id: NodeId,
        frame: &TreeFrame<'_>,
        now: Timestamp,
    ) {
        let sender = Sender {
            id,
            is_parent: false,
            master: None,
        };
        self.receive(sender, &frame.link_part(), Bytes::new(), now);
        if let Some(link) = self.links.get_mut(id) {
            link.epoch_announcements = Some(0);
        }
    }

    /// Whether the link to the sender of a frame is symmetric, as far as this drone knows.
    pub(super) fn is_symmetric(&self, id: NodeId, frame: &TreeFrame<'_>) -> bool {
        reports_hearing(self.own, frame).unwrap_or_else(|| {
            self.get(id)
                .is_some_and(|link| link.hearing().is_symmetric())
        }) || flaw::has(Flaw::AcceptsOneWayLinks)
    }

    /// Forgets reports under the leader before.
    pub(super) fn forget_epoch(&mut self) {
        self.subtree.take();
        self.links.iter_mut().for_each(Neighbour::forget_epoch);
    }

    /// Restarts the silence timeout of all neighbours.
    pub(super) fn reset_timeouts(&mut self, now: Timestamp) {
        for link in self.links.iter_mut() {
            link.heard_at = now;
        }
    }

    pub(super) fn forget(&mut self, id: NodeId) {
        if self.links.remove(id) {
            self.subtree.take();
        }
    }

    /// Records that the medium delivered a unicast.
    pub(super) fn record_delivery(&mut self, id: NodeId, frame: &TreeFrame<'_>) {
        if let Some(link) = self.links.get_mut(id) {
            link.change_sets(|sets| {
                if frame.sequence > sets.delivered.0 {
                    sets.delivered = (frame.sequence, NodeSet::new());
                }
                if frame.sequence == sets.delivered.0 {
                    sets.delivered.1.extend_from(&frame.subtree.acknowledged());
                }
            });
            link.deliveries.record_delivery();
        }
        self.subtree.take();
    }

    /// Records that a unicast was sent.
    pub(super) fn record_send(&mut self, id: NodeId, now: Timestamp) {
        if let Some(link) = self.links.get_mut(id) {
            link.deliveries.record_send(now);
        }
    }

    /// Changes whether a neighbour is reachable.
    pub(super) fn update_link(&mut self, id: NodeId, change: impl FnOnce(&mut Neighbour)) {
        if let Some(link) = self.links.get_mut(id) {
            change(link);
        }
        self.subtree.take();
    }

    /// Records that a neighbour requests this drone's state.
    pub(super) fn record_request(&mut self, id: NodeId) {
        if let Some(link) = self.links.get_mut(id) {
            link.awaits_answer = true;
        }
    }

    /// Records that a neighbour is answered; all are if `to` is `None`.
    pub(super) fn record_answer(&mut self, to: Option<NodeId>) {
        for link in self.links.iter_mut() {
            link.awaits_answer &= to.is_some_and(|to| to != link.id);
            if let Some(times) = &mut link.epoch_announcements {
                *times += 1;
            }
        }
    }

    /// Removes neighbours that have been silent for `time_to_live`, or for the timeout of their lossy link if that is
    /// longer; returns whether there were any.
    pub(super) fn forget_silent(&mut self, now: Timestamp, time_to_live: Duration) -> bool {
        let leaf_period = self.leaf_period;
        let is_alive = |link: &Neighbour| {
            let silent_for = now.since(link.heard_at);
            silent_for <= time_to_live
                || silent_for <= leaf_period * link.quality.lost_heartbeats.into()
        };
        let any_silent = !self.links.iter().all(is_alive);
        if any_silent {
            self.links.retain(is_alive);
            self.subtree.take();
        }
        any_silent
    }

    /// See [`NodeMachine::read_further_ahead`](crate::node::NodeMachine::read_further_ahead).
    pub(super) fn read_ahead(&self, sender: Option<NodeId>) {
        match sender {
            None => self.iter().for_each(Neighbour::read_ahead),
            Some(sender) => self.get(sender).into_iter().for_each(Neighbour::read_ahead),
        }
    }

    #[inline]
    pub(super) fn get(&self, id: NodeId) -> Option<&Neighbour> {
        self.links.get(id)
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &Neighbour> {
        self.links.iter()
    }

    /// Reachable neighbours whose parent is this drone.
    pub(super) fn children(&self) -> impl Iterator<Item = &Neighbour> {
        let is_child = |link: &&Neighbour| link.is_child_of(self.own) && link.is_reachable();
        self.iter().filter(is_child)
    }

    pub(super) fn has_children(&self) -> bool {
        self.children().next().is_some()
    }

    /// The children's merged reports about order `sequence`, the newest known one.
    pub(super) fn subtree(&self, sequence: u32) -> &Subtree {
        let subtree = self.subtree.get_or_init(|| self.merge_children(sequence));
        debug_assert_eq!(subtree.sequence, sequence, "a new order is delivered of");
        subtree
    }

    /// A newer order is known.
    pub(super) fn start_order(&mut self) {
        self.subtree.take();
    }

    fn merge_children(&self, sequence: u32) -> Subtree {
        let mut subtree = Subtree {
            sequence,
            ..Subtree::default()
        };
        for link in self.iter().filter(|link| link.is_child_of(self.own)) {
            let sets = link.sets();
            if link.report.sequence == sequence {
                subtree.acknowledged.extend_from(&sets.acknowledged);
            }
            if link.is_reachable() {
                subtree.alive.extend_from(&sets.alive);
                subtree.landing.extend_from(&sets.landing);
            }
        }
        subtree.is_incomplete = NodeSet::any_where(
            [
                &subtree.alive,
                &subtree.landing,
                &subtree.acknowledged,
                &self.own.into(),
            ],
            |[alive, landing, acknowledged, own]| alive && !landing && !acknowledged && !own,
        );
        subtree
    }

    /// The neighbours that this drone hears, and the receptions of those over lossy links.
    pub(super) fn heard_neighbours(
        &self,
        now: Timestamp,
        time_to_live: Duration,
    ) -> (NodeSet, Vec<Reception>) {
        let mut all = NodeSet::new();
        let mut weak = Vec::new();
        for link in self.iter() {
            if !self.is_heard(link, now, time_to_live) {
                continue;
            }
            all.insert(link.id);
            let sixteenths = link.quality.own_share();
            if sixteenths < LOSSLESS {
                let id = link.id;
                weak.push(Reception { id, sixteenths });
            }
        }
        (all, weak)
    }

    /// Whether this drone hears a neighbour, for its heartbeats. A neighbour is no longer heard once it has been silent
    ///
    /// - for its link timeout and for half of `time_to_live`;
    /// - for its stale time, if it was not heard under the current epoch: a drone that has gone deaf and claims to lead
    ///   must not find followers;
    /// - for longer than it was known before, because a few frames prove little.
    pub(super) fn is_heard(
        &self,
        link: &Neighbour,
        now: Timestamp,
        time_to_live: Duration,
    ) -> bool {
        let silent_for = now.since(link.heard_at);
        if silent_for <= self.heartbeat_period {
            return true;
        }
        let stale = self.heartbeat_period * link.quality.stale_heartbeats.into();
        if silent_for <= stale || link.epoch_announcements.is_some() {
            return silent_for <= stale;
        }
        let known_for = link.heard_at.since(link.known_since);
        let lost = self.leaf_period * link.quality.lost_heartbeats.into();
        silent_for <= lost.min(known_for.max(stale)).max(time_to_live / 2)
    }

    /// The neighbours that may not hear this drone.
    pub(super) fn deaf(&self) -> NodeSet {
        let deaf = self.iter().filter(|link| link.hearing().may_be_deaf());
        deaf.map(|link| link.id).collect()
    }

    /// Forces the next frame of each neighbour to be decoded.
    #[cfg(test)]
    pub(super) fn forget_bodies(&mut self) {
        for link in self.links.iter_mut() {
            link.body = Bytes::new();
        }
    }

    /// Neighbours that have a route without this drone as next hop.
    pub(super) fn with_routes(&self) -> impl Iterator<Item = &Neighbour> {
        self.iter().filter(|link| link.has_route_past(self.own))
    }

    pub(super) const fn len(&self) -> usize {
        self.links.len()
    }
}
