//! Policy `tree`: a drone sends a change at once to the drones that need it, and repeats it until it is seen to arrive.
//!
//! Each drone keeps the last report of each neighbour (`link_table`). The neighbour with the cheapest route to the
//! master is its parent (`parent`). Orders go from parent to child. Acknowledgements go towards the master and are
//! merged on the way (`aggregation`): a drone sends once its whole subtree has carried the order out.
//!
//! What only one neighbour lacks goes out as a unicast, and the medium may report its delivery. A neighbour's report
//! that contains the information acknowledges that hop, too. What is not acknowledged in time is repeated, at that hop
//! only (`retransmission`).
//!
//! The master's heartbeat goes outwards once a period (`heartbeat_timer`), for example each second. Each drone forwards
//! it. It serves discovery, liveness and routing. A drone probes a silent parent (`probe`) before it drops it.

mod aggregation;
mod compose;
mod config;
mod durable;
mod heartbeat_timer;
mod link;
mod link_table;
mod members;
mod parent;
mod probe;
mod quality;
mod recipients;
mod retransmission;
mod routes;
mod topology;
mod transmitter;

use std::hint::black_box;

use bytes::Bytes;

pub use self::config::Config;
pub use self::durable::Checkpoint;

use self::aggregation::{Aggregation, Forward};
use self::link::Neighbour;
use self::link_table::ReceivedReport;
use self::members::Members;
use self::probe::ProbeStep;
use self::retransmission::Due;
use self::topology::Topology;
use self::transmitter::{Reason, Transmitter, View};
use super::{Durable, Event, Notice, Policy, PolicyCheckpoint, SharedState};
use crate::identity::{Ballot, NodeId};
use crate::leader::BallotDecision;
use crate::time::{Timestamp, first_of};
use crate::wire::{self, TreeFrame};

/// Dissemination along a tree.
#[derive(Debug)]
pub(super) struct TreePolicy {
    durable: Checkpoint,
    topology: Topology,
    /// On the master: which members are alive, and which are missed.
    members: Members,
    aggregation: Aggregation,
    transmitter: Transmitter,
}

impl TreePolicy {
    /// Resumes from `checkpoint`; starts empty if it is `None`.
    pub(super) fn new(
        config: Config,
        shared: &mut SharedState,
        now: Timestamp,
        checkpoint: Option<(Durable, Checkpoint)>,
    ) -> Self {
        let mut policy = Self {
            durable: Checkpoint::default(),
            members: Members::default(),
            aggregation: Aggregation::default(),
            transmitter: Transmitter::new(&config),
            topology: Topology::new(config),
        };
        if let Some((common, own)) = checkpoint {
            policy.durable = own;
            shared.resume(common);
            policy.topology.resume(shared, now);
            if policy.durable.discovered {
                policy.members.expect_all(shared, now);
            }
        }
        policy
    }

    /// The transmitter, and the state that it sends.
    fn split(&mut self, now: Timestamp) -> (&mut Transmitter, View<'_>) {
        let view = View {
            now,
            topology: &mut self.topology,
            aggregation: &self.aggregation,
        };
        (&mut self.transmitter, view)
    }

    fn send_state(&mut self, shared: &mut SharedState, now: Timestamp, reason: Reason) {
        let (transmitter, mut view) = self.split(now);
        transmitter.send_state(shared, reason, &mut view);
    }

    fn needs_retransmission(&mut self, shared: &SharedState, now: Timestamp) -> bool {
        let (_, view) = self.split(now);
        view.recipients(shared).needs_retransmission()
    }

    /// Whether a frame under `ballot` is processed. Adopts a better ballot, unless the link to its sender is one-way.
    fn accepts_ballot(
        &mut self,
        shared: &mut SharedState,
        now: Timestamp,
        (sender, ballot): (NodeId, Ballot),
        frame: &TreeFrame<'_>,
    ) -> bool {
        let symmetry = self.topology.link_symmetry(shared, sender, frame);
        match shared.observe_ballot(ballot, symmetry) {
            BallotDecision::Ignored => return false,
            BallotDecision::Same => {}
            BallotDecision::Adopted => {
                self.start_epoch(shared, now);
                shared.notify(Notice::Leader(ballot));
            }
        }
        true
    }

    /// Acts on a neighbour's report, which is in the link table already, and on a newer order that came with it.
    fn process_report(
        &mut self,
        shared: &mut SharedState,
        now: Timestamp,
        report: (NodeId, ReceivedReport),
        is_new_order: bool,
    ) {
        self.topology.process_report(shared, now, report);
        self.report_members(shared, now);
        self.respond(shared, now, report, is_new_order);
    }

    /// On the master: notifies the protocol of what the members' reports changed.
    fn report_members(&mut self, shared: &mut SharedState, now: Timestamp) {
        if shared.is_master() {
            let times = (now, self.topology.config.time_to_live);
            self.members.report(shared, &self.topology.links, times);
        }
    }

    /// Notifies the protocol that routes are up; on the master first of its own neighbours.
    fn notify_routes_ready(&self, shared: &mut SharedState) {
        if shared.is_master() {
            let neighbours = self.topology.links.iter().map(|link| link.id).collect();
            shared.notify(Notice::Neighbours(neighbours));
        }
        shared.notify(Notice::RoutesReady);
    }

    /// Forwards acknowledgements, or starts to wait for those that are missing in the subtree.
    fn acknowledge(&mut self, shared: &mut SharedState, now: Timestamp) {
        let parent = self.topology.parent_link();
        let (links, times) = (&self.topology.links, (now, self.topology.config.repair));
        match self.aggregation.forward(shared, links, parent, times) {
            Forward::No => {}
            Forward::Now => self.send_state(shared, now, Reason::Change),
            Forward::At(at) => self.transmitter.retransmission.bring_forward(now, at),
        }
    }

    /// Sends what a neighbour's report calls for: an order, an answer, an acknowledgement.
    fn respond(
        &mut self,
        shared: &mut SharedState,
        now: Timestamp,
        (sender, received): (NodeId, ReceivedReport),
        is_new_order: bool,
    ) {
        let Some(link) = self.topology.links.get(sender) else {
            return;
        };
        // Two drones without routes have only orders to exchange.
        let has_route = self.topology.route.routes().hops.is_some();
        let has_answer =
            || has_route || link.report.hops.is_some() || link.report.sequence != shared.sequence();
        let is_new_request = link.report.requests_own && has_answer();
        let mut awaits_answer = link.awaits_answer || is_new_request;
        let requested = usize::from(link.report.request_count);
        let is_child = link.is_child_of(shared.id);
        let (sequence, newest) = (link.report.sequence, shared.sequence());
        let is_parent = self.topology.route.parent() == Some(sender);
        if is_new_request {
            self.topology.links.record_request(sender);
        }
        if is_new_order && self.topology.links.has_children() {
            self.forward_order(shared, now);
            awaits_answer =
                (self.topology.links.get(sender)).is_some_and(|link| link.awaits_answer);
        }
        let retransmission = &mut self.transmitter.retransmission;
        if awaits_answer {
            retransmission.schedule_answer(shared, now, requested);
        }
        if is_new_order {
            return;
        }
        if sequence > newest {
            // This drone has missed an order.
            return retransmission.schedule_request(shared, now, sender);
        }
        if is_child && sequence < newest && !awaits_answer {
            return retransmission.expedite(shared, now);
        }
        if is_child && received.has_progressed || is_parent && self.parent_lacks_pending(shared) {
            self.acknowledge(shared, now);
        }
        self.stop_retransmission_if_done(shared, now);
    }

    /// Sends a new order to the children, in a random slot if others at the same distance forward it, too. A leaf sends
    /// nothing unless it is asked: its parent knows from the medium that the order arrived, or trusts the link.
    fn forward_order(&mut self, shared: &mut SharedState, now: Timestamp) {
        let others = self.topology.competing_relays();
        if others == 0 {
            self.send_state(shared, now, Reason::Change);
        } else {
            (self.transmitter.retransmission).schedule_relay(shared, now, others);
        }
    }

    /// Whether the parent lacks acknowledgements that the master has named as pending.
    fn parent_lacks_pending(&self, shared: &SharedState) -> bool {
        let parent = self.topology.parent_link();
        let is_named =
            parent.is_some_and(|link| aggregation::pending(link, shared.sequence()).is_some());
        let links = &self.topology.links;
        is_named && self.aggregation.parent_lacks(shared, links, parent)
    }

    fn stop_retransmission_if_done(&mut self, shared: &SharedState, now: Timestamp) {
        if self.transmitter.retransmission.is_active() && !self.needs_retransmission(shared, now) {
            self.transmitter.retransmission.stop();
        }
    }

    /// Sends again what is not acknowledged. A parent that stayed silent meanwhile is marked unreachable.
    fn repair(&mut self, shared: &mut SharedState, now: Timestamp) {
        if let Some((id, heard_at)) = self.topology.parent_link().map(|it| (it.id, it.heard_at))
            && (self.transmitter.retransmission).has_exhausted_tries(heard_at)
        {
            self.topology.mark_unreachable(shared, now, id);
        }
        if self.needs_retransmission(shared, now) {
            self.send_state(shared, now, Reason::Repair);
        } else {
            self.transmitter.retransmission.stop();
        }
    }

    /// Takes the probe steps that are due. Each moves the next one into the future, so the loop ends.
    fn probe_while_due(&mut self, shared: &mut SharedState, now: Timestamp) {
        while (self.topology.next_probe(shared)).is_some_and(|due| due <= now) {
            match self.topology.probe_step(shared, now) {
                Some(ProbeStep::Probe { .. }) => self.send_state(shared, now, Reason::Probe),
                Some(ProbeStep::DropParent(_)) => {}
                Some(ProbeStep::Inquire) => self.send_state(shared, now, Reason::Inquiry),
                Some(ProbeStep::ReportMasterSilent) => shared.report_master_silent(),
                None => return,
            }
        }
    }

    fn retransmit_while_due(&mut self, shared: &mut SharedState, now: Timestamp) {
        while let Some(due) = self.transmitter.retransmission.take_due(now) {
            let (transmitter, mut view) = self.split(now);
            match due {
                Due::Relay => transmitter.send_state(shared, Reason::Change, &mut view),
                Due::Repair => self.repair(shared, now),
                Due::Answer => {
                    if !view.recipients(shared).requesting.is_empty() {
                        transmitter.send_state(shared, Reason::Answer, &mut view);
                    }
                }
                Due::Copy(sequence) => {
                    if sequence == shared.sequence() && !view.recipients(shared).trusted.is_empty()
                    {
                        transmitter.send_state(shared, Reason::SecondCopy, &mut view);
                    }
                }
                Due::Request(neighbour) => transmitter.request_order(shared, neighbour, &mut view),
            }
        }
    }

    fn send_heartbeat_if_due(&mut self, shared: &mut SharedState, now: Timestamp) {
        if (self.topology.heartbeat_timer.deadline()).is_none_or(|due| due > now) {
            return;
        }
        self.topology.remove_silent_neighbours(shared, now);
        self.report_members(shared, now);
        self.send_state(shared, now, Reason::KeepAlive);
        self.topology.record_heartbeat_sent(shared, now);
    }
}

impl Policy for TreePolicy {
    fn receive(
        &mut self,
        shared: &mut SharedState,
        now: Timestamp,
        (id, ballot): (NodeId, Ballot),
        payload: &Bytes,
    ) {
        let Ok((header, body)) = wire::split_tree(payload) else {
            return shared.emit(Event::Ignored(id));
        };
        let is_current = shared.durable.epoch.ballot() == Some(ballot) && !shared.durable.stopped;
        let sender = self.topology.sender(shared, id);
        if is_current && self.topology.links.is_unchanged(sender, &header, body) {
            // Only the packet number and the heartbeat sequence are new.
            if let Some(received) = self.topology.links.receive_unchanged(id, &header, now) {
                self.process_report(shared, now, (id, received), false);
            }
            return;
        }
        let Some(frame) = TreeFrame::read(header, body) else {
            return shared.emit(Event::Ignored(id));
        };
        let is_node = id.0 < self.topology.config.drones + self.topology.config.relays;
        let is_accepted = is_node
            && !shared.durable.stopped
            && self.accepts_ballot(shared, now, (id, ballot), &frame);
        if !is_accepted {
            if is_node {
                self.topology
                    .links
                    .receive_of_another_epoch(id, &frame, now);
                self.topology.route.refresh_parent(&self.topology.links);
            }
            return shared.emit(Event::Ignored(id));
        }
        let sender = self.topology.sender(shared, id);
        let body = payload.slice_ref(body);
        if let Some(received) = self.topology.links.receive(sender, &frame, body, now) {
            let is_new_order = shared.accept_order(frame.sequence, frame.order);
            if is_new_order {
                self.transmitter.retransmission.start_order();
                self.topology.links.start_order();
            }
            self.process_report(shared, now, (id, received), is_new_order);
        }
    }

    fn record_delivery(
        &mut self,
        shared: &mut SharedState,
        now: Timestamp,
        to: NodeId,
        payload: &[u8],
        is_delivered: bool,
    ) {
        self.transmitter.enable_delivery_reports();
        if shared.durable.stopped {
            return;
        }
        let Ok(frame) = wire::decode_tree(payload) else {
            return;
        };
        if is_delivered {
            self.topology.links.record_delivery(to, &frame);
        } else {
            self.topology.record_failure(shared, now, to);
            self.transmitter.retransmission.retry(shared, now);
            let is_unreachable = |link: &Neighbour| !link.is_reachable();
            if Some(to) != self.topology.route.parent()
                && self.topology.links.get(to).is_some_and(is_unreachable)
            {
                // The aggregation may have waited for this neighbour only.
                self.acknowledge(shared, now);
            }
        }
        self.stop_retransmission_if_done(shared, now);
    }

    /// Forgets acknowledgements, routes and heartbeats of the epoch before. Link qualities stay known.
    fn start_epoch(&mut self, _shared: &mut SharedState, now: Timestamp) {
        self.topology.start_epoch(now);
        self.members = Members::default();
        self.aggregation.start_epoch();
        self.transmitter.retransmission.start_epoch();
    }

    fn lead(&mut self, shared: &mut SharedState, now: Timestamp, ballot: Ballot) {
        if ballot.is_elected() {
            self.members.expect_all(shared, now);
        }
        self.topology.update_route(shared, now);
        self.topology.heartbeat_timer.schedule_at(now);
    }

    fn order_published(&mut self, shared: &mut SharedState, now: Timestamp) {
        self.transmitter.retransmission.start_order();
        self.topology.links.start_order();
        self.topology.heartbeat_timer.set_fast(false);
        self.send_state(shared, now, Reason::Change);
    }

    fn order_carried_out(&mut self, shared: &mut SharedState, now: Timestamp) {
        self.acknowledge(shared, now);
    }

    fn discover(&mut self, shared: &mut SharedState, now: Timestamp) {
        self.durable.discovered = true;
        self.members.expect_all(shared, now);
        shared.notify(Notice::DiscoveryStarted);
        shared.notify(Notice::HopUpdateStarted);
        self.notify_routes_ready(shared);
        shared.mark_changed();
    }

    /// Heartbeats are faster until the next order, by which all drones have reached their new positions.
    fn topology_changes(&mut self, _shared: &mut SharedState, _now: Timestamp) {
        self.topology.heartbeat_timer.set_fast(true);
    }

    fn land(&mut self, shared: &mut SharedState, now: Timestamp) {
        self.topology.schedule_heartbeat_soon(shared, now);
    }

    fn stop(&mut self, shared: &mut SharedState, now: Timestamp) {
        self.send_state(shared, now, Reason::Change);
        self.topology.heartbeat_timer.stop();
        self.transmitter.retransmission.stop();
    }

    fn resync(&mut self, shared: &mut SharedState, now: Timestamp) {
        if self.durable.discovered {
            self.notify_routes_ready(shared);
        }
        self.members.forget_reported();
        self.report_members(shared, now);
        let silent = self.members.silent();
        if !silent.is_empty() {
            shared.notify(Notice::Silent(silent));
        }
    }

    fn reset_timeouts(&mut self, _shared: &mut SharedState, now: Timestamp) {
        self.topology.reset_timeouts(now);
        self.members.reset_timeouts(now);
    }

    fn handle_timeout(&mut self, shared: &mut SharedState, now: Timestamp) {
        if self.aggregation.ends_hold(now) {
            self.acknowledge(shared, now);
        }
        self.probe_while_due(shared, now);
        self.retransmit_while_due(shared, now);
        self.send_heartbeat_if_due(shared, now);
        // The heartbeat step may have removed the parent.
        self.probe_while_due(shared, now);
    }

    fn read_ahead(&self) {
        self.topology.read_ahead();
        black_box((
            self.transmitter.retransmission.deadline(),
            self.aggregation.deadline(),
            self.transmitter.has_delivery_reports(),
        ));
    }

    fn read_further_ahead(&self, sender: Option<NodeId>) {
        self.topology.links.read_ahead(sender);
    }

    fn deadline(&self, shared: &SharedState) -> Option<Timestamp> {
        let hold = self.aggregation.deadline();
        let retransmission = self.transmitter.retransmission.deadline();
        let probe = self.topology.next_probe(shared);
        first_of([
            self.topology.heartbeat_timer.deadline(),
            retransmission,
            hold,
            probe,
        ])
    }

    fn checkpoint(&self) -> PolicyCheckpoint {
        PolicyCheckpoint::Tree(self.durable.clone())
    }

    fn occupancy(&self) -> (usize, usize) {
        let nodes = self.topology.config.drones + self.topology.config.relays;
        (self.topology.links.len(), nodes as usize)
    }
}

#[cfg(test)]
mod tests;
