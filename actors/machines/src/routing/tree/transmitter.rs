//! Sending: to whom a frame goes, what it carries, and when it must have been acknowledged.

use super::Config;
use super::aggregation::Aggregation;
use super::compose::Composer;
use super::link::Neighbour;
use super::recipients::Recipients;
use super::retransmission::Retransmission;
use super::topology::Topology;
use crate::identity::{NodeId, NodeSet};
use crate::routing::SharedState;
use crate::time::Timestamp;

/// Up to this many neighbours get unicasts instead of one broadcast, if the medium reports deliveries and one of their
/// links is lossy: the medium repeats a lost unicast, or this drone does at once.
const UNICASTS_MAX: usize = 3;

/// Why a drone sends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Reason {
    /// The heartbeat is due.
    KeepAlive,
    /// Something has changed that others need to know.
    Change,
    /// Something is not acknowledged.
    Repair,
    /// The newest order is broadcast a second time.
    SecondCopy,
    /// Neighbours requested this drone's state.
    Answer,
    /// The parent is silent.
    Probe,
    /// There is no route, and all neighbours are asked for one.
    Inquiry,
}

/// The state from which a frame and its receivers follow.
#[derive(Debug)]
pub(super) struct View<'a> {
    pub(super) now: Timestamp,
    pub(super) topology: &'a mut Topology,
    pub(super) aggregation: &'a Aggregation,
}

impl View<'_> {
    /// The neighbours that need something from this drone.
    pub(super) fn recipients(&self, shared: &SharedState) -> Recipients {
        let Topology {
            config,
            links,
            route,
            ..
        } = &*self.topology;
        let parent = route.parent();
        let link = parent.and_then(|parent| links.get(parent));
        let lacks = self.aggregation.parent_lacks(shared, links, link);
        let times = (self.now, config.heartbeat_period);
        Recipients::of(shared, links, parent.filter(|_| lacks), times)
    }
}

/// Composes frames, sends them and repeats them.
#[derive(Debug)]
pub(super) struct Transmitter {
    pub(super) retransmission: Retransmission,
    composer: Composer,
    /// Whether the medium reports the delivery of unicasts.
    has_delivery_reports: bool,
}

impl Transmitter {
    pub(super) fn new(config: &Config) -> Self {
        Self {
            retransmission: Retransmission::new(config.repair, config.repair_max),
            composer: Composer::default(),
            has_delivery_reports: false,
        }
    }

    pub(super) const fn has_delivery_reports(&self) -> bool {
        self.has_delivery_reports
    }

    /// The medium has reported a delivery, so it reports all.
    pub(super) const fn enable_delivery_reports(&mut self) {
        self.has_delivery_reports = true;
    }

    /// Sends now, as unicasts or as one broadcast, and schedules the retransmission.
    pub(super) fn send_state(
        &mut self,
        shared: &mut SharedState,
        reason: Reason,
        view: &mut View<'_>,
    ) {
        let may_send = shared.durable.epoch.ballot().is_some()
            && !shared.durable.stopped
            && !view.topology.is_rejoining(view.now);
        if !may_send {
            return self.retransmission.stop();
        }
        let is_rate_limited =
            !matches!(reason, Reason::KeepAlive | Reason::Probe | Reason::Inquiry);
        if is_rate_limited && !self.retransmission.may_send(view.now) {
            return;
        }
        let recipients = if reason == Reason::KeepAlive {
            // It is for all neighbours and requests nothing.
            Recipients::default()
        } else {
            view.recipients(shared)
        };
        let targets = self.unicast_targets(reason, &recipients, view);
        if targets.is_empty() {
            self.send_frame(shared, (reason, None), &recipients, view);
        }
        for to in targets.iter() {
            let is_in_flight = |link: &Neighbour| link.deliveries.is_in_flight(view.now);
            if reason != Reason::Repair || !view.topology.links.get(to).is_some_and(is_in_flight) {
                self.send_frame(shared, (reason, Some(to)), &recipients, view);
            }
        }
        let is_unconfirmed = targets.is_empty() || !self.has_delivery_reports;
        if is_unconfirmed && reason == Reason::Change {
            let leaves = recipients.trusted.len();
            self.retransmission.schedule_copy(shared, view.now, leaves);
        }
        self.schedule_retransmission(shared, reason, view);
    }

    /// The neighbours that get a unicast each; empty if the frame is a broadcast. A neighbour that this drone does not
    /// hear gets no unicast, because a unicast shows its receiver that it is heard.
    fn unicast_targets(&self, reason: Reason, recipients: &Recipients, view: &View<'_>) -> NodeSet {
        let targets = match reason {
            Reason::KeepAlive | Reason::SecondCopy | Reason::Inquiry => return NodeSet::new(),
            Reason::Probe => return view.topology.route.parent().into_iter().collect(),
            Reason::Change => recipients.all(),
            Reason::Answer => recipients.requesting.clone(),
            Reason::Repair => {
                let mut targets = recipients.unaware.clone();
                targets.extend_from(&recipients.requesting);
                targets
            }
        };
        let links = || targets.iter().filter_map(|id| view.topology.links.get(id));
        let time_to_live = view.topology.config.link_time_to_live;
        let are_heard =
            links().all(|link| view.topology.links.is_heard(link, view.now, time_to_live));
        let is_unsure =
            |link: &Neighbour| !link.quality.is_good() || link.is_leaf_of(view.topology.config.id);
        let unicasts_max = if self.has_delivery_reports && links().any(is_unsure) {
            UNICASTS_MAX
        } else {
            1
        };
        if are_heard && (1..=unicasts_max).contains(&targets.len()) {
            targets
        } else {
            NodeSet::new()
        }
    }

    fn send_frame(
        &mut self,
        shared: &mut SharedState,
        (reason, to): (Reason, Option<NodeId>),
        recipients: &Recipients,
        view: &mut View<'_>,
    ) {
        if self.composer.count(to) {
            // The master raises its heartbeat sequence with heartbeats only: each rise makes every drone send once.
            let raises_heartbeat = shared.is_master() && reason == Reason::KeepAlive;
            if shared.durable.heartbeats.advance(raises_heartbeat) {
                shared.mark_changed();
            }
        }
        let mut state = self
            .composer
            .state(shared, &view.topology.links, &view.topology.route, to);
        if reason == Reason::KeepAlive {
            let time_to_live = view.topology.config.link_time_to_live;
            let (hears, weak) = view.topology.links.heard_neighbours(view.now, time_to_live);
            (state.hears, state.weak) = (Some(hears), weak);
            if shared.master_lands() {
                // For drones that do not hear the master.
                state.landing.extend(shared.master());
            }
        }
        state.requests = self.requests(shared, (reason, to), recipients, view);
        view.topology.links.record_answer(to);
        let nodes = view.topology.config.drones + view.topology.config.relays;
        let payload = self.composer.encode(&state, nodes);
        shared.send(to, payload, reason == Reason::KeepAlive);
        if let Some(to) = to.filter(|_| self.has_delivery_reports) {
            view.topology.links.record_send(to, view.now);
        }
        self.retransmission.record_sent(view.now);
    }

    /// The neighbours that are asked for their state, because nothing else would show it.
    fn requests(
        &self,
        shared: &SharedState,
        (reason, to): (Reason, Option<NodeId>),
        recipients: &Recipients,
        view: &View<'_>,
    ) -> NodeSet {
        match (reason, to) {
            (Reason::KeepAlive | Reason::SecondCopy | Reason::Answer, _) => NodeSet::new(),
            (Reason::Probe, _) => to.into_iter().collect(),
            // Also neighbours that may not hear this drone: the request shows them that they are heard.
            (Reason::Inquiry, _) => (view.topology.links.iter().map(|link| link.id))
                .chain(view.topology.probe.dropped_parent())
                .collect(),
            (Reason::Repair, None) => recipients.unaware.clone(),
            (Reason::Repair, Some(to)) => {
                let is_confirmed = self.has_delivery_reports || !recipients.unaware.contains(to);
                (!is_confirmed).then_some(to).into_iter().collect()
            }
            // Relays forward the change, which confirms it; leaves are asked.
            (Reason::Change, None) => {
                let unaware = recipients.unaware.iter();
                let links = unaware.filter_map(|id| view.topology.links.get(id));
                let leaves = links.filter(|link| link.is_leaf_of(shared.id));
                leaves.map(|link| link.id).collect()
            }
            (Reason::Change, Some(_)) => NodeSet::new(),
        }
    }

    fn schedule_retransmission(
        &mut self,
        shared: &mut SharedState,
        reason: Reason,
        view: &View<'_>,
    ) {
        if !view.recipients(shared).needs_retransmission() {
            return self.retransmission.stop();
        }
        match reason {
            Reason::Repair => self.retransmission.back_off(shared, view.now),
            Reason::Change => self.retransmission.start(shared, view.now),
            _ if self.retransmission.is_active() => {}
            _ => self.retransmission.start(shared, view.now),
        }
    }

    /// Asks a neighbour for a missed order, if that neighbour still knows a newer one.
    pub(super) fn request_order(
        &mut self,
        shared: &mut SharedState,
        neighbour: NodeId,
        view: &mut View<'_>,
    ) {
        let sequence = shared.sequence();
        let has_newer = |link: &Neighbour| link.report.sequence > sequence;
        if view.topology.links.get(neighbour).is_some_and(has_newer) {
            let recipients = Recipients::default();
            self.send_frame(shared, (Reason::Probe, Some(neighbour)), &recipients, view);
        }
    }
}
