//! The neighbours of a drone and its route to the master.

use std::hint::black_box;

use super::Config;
use super::heartbeat_timer::{Contention, HeartbeatTimer};
use super::link::{Neighbour, Sender};
use super::link_table::{LinkTable, ReceivedReport};
use super::parent::{ParentSelection, RouteContext};
use super::probe::{ParentProbe, ProbeStep, WatchedRoute};
use crate::flaw::{self, Flaw};
use crate::identity::NodeId;
use crate::leader::LinkSymmetry;
use crate::routing::{Event, SharedState};
use crate::time::Timestamp;
use crate::wire::TreeFrame;

/// The link table, the route that is chosen from it, and the timers that keep both up to date.
///
/// Invariant: the route is updated in the step that changes a link on which it depends.
#[derive(Debug)]
pub(super) struct Topology {
    pub(super) config: Config,
    pub(super) links: LinkTable,
    pub(super) route: ParentSelection,
    pub(super) probe: ParentProbe,
    pub(super) heartbeat_timer: HeartbeatTimer,
    /// End of the silence after a restart; `None` once a heartbeat has arrived. A restart forgets the route, and the next
    /// heartbeat brings it back. A frame without a route would make this drone's children drop it, and those without other
    /// neighbours take the master for lost.
    silent_until: Option<Timestamp>,
}

impl Topology {
    pub(super) fn new(config: Config) -> Self {
        let period = config.heartbeat_period;
        Self {
            links: LinkTable::new(config.id, config.drones, period, config.leaf_period()),
            route: ParentSelection::new(&config),
            probe: ParentProbe::default(),
            heartbeat_timer: HeartbeatTimer::new(&config),
            silent_until: None,
            config,
        }
    }

    /// After a restart: the durable state is in `shared`.
    pub(super) fn resume(&mut self, shared: &mut SharedState, now: Timestamp) {
        self.route.resume(shared.durable.heartbeats.master);
        self.probe.resume();
        if shared.durable.epoch.ballot().is_some() && !shared.durable.stopped {
            self.silent_until =
                (!shared.is_master()).then(|| now + self.config.heartbeat_period * 3 / 2);
            let next = self.silent_until.unwrap_or(now);
            self.heartbeat_timer.schedule_at(next);
        }
        self.update_route(shared, now);
    }

    /// Forgets routes and heartbeats of the epoch before. Neighbours and their link quality stay known.
    pub(super) fn start_epoch(&mut self, now: Timestamp) {
        self.silent_until = None;
        self.links.forget_epoch();
        self.route.start_epoch();
        self.probe.forget();
        self.heartbeat_timer.start_epoch(now);
    }

    /// Restarts all silence timeouts.
    pub(super) fn reset_timeouts(&mut self, now: Timestamp) {
        self.links.reset_timeouts(now);
        self.route.refresh_parent(&self.links);
        self.route.reset_timeouts(now);
        self.probe.forget();
    }

    /// The neighbour `id` in its role for this drone.
    pub(super) fn sender(&self, shared: &SharedState, id: NodeId) -> Sender {
        Sender {
            id,
            is_parent: self.route.parent() == Some(id),
            master: shared.master(),
        }
    }

    pub(super) fn parent_link(&self) -> Option<&Neighbour> {
        self.links.get(self.route.parent()?)
    }

    /// Whether the drone has restarted and waits silently for the next heartbeat.
    pub(super) fn is_rejoining(&self, now: Timestamp) -> bool {
        self.silent_until.is_some_and(|until| now < until)
    }

    fn is_settled_to_land(&self, shared: &SharedState, now: Timestamp) -> bool {
        shared.is_settled_to_land(now, self.config.time_to_live)
    }

    /// Forwards a heartbeat sequence that has risen: at once if it comes from the parent, otherwise after a delay,
    /// because the parent's frame may be lost.
    fn process_heartbeat(
        &mut self,
        shared: &mut SharedState,
        now: Timestamp,
        sender: NodeId,
        heartbeat: u32,
    ) {
        if shared.is_master() {
            return;
        }
        let known = shared.durable.heartbeats.master;
        let is_settled = self.is_settled_to_land(shared, now);
        if heartbeat <= known {
            // One sequence behind may be a heartbeat in flight. Two behind means that the sender's route may be broken,
            // where leaves do not forward each heartbeat.
            let is_behind = known.saturating_sub(heartbeat) > 1;
            if self.heartbeat_timer.throttles_leaves() && is_behind && !is_settled {
                self.schedule_heartbeat_soon(shared, now);
            }
            return;
        }
        shared.durable.heartbeats.master = heartbeat;
        if self.silent_until.take().is_some() {
            return self.schedule_heartbeat_soon(shared, now);
        }
        let is_due = self
            .heartbeat_timer
            .is_forward_due(shared, self.links.has_children());
        if !is_due || is_settled {
            return;
        }
        if self.route.parent() == Some(sender) {
            self.schedule_heartbeat_soon(shared, now);
        } else if self.route.parent().is_some() {
            self.heartbeat_timer.schedule_later(shared, now);
        }
    }

    pub(super) fn schedule_heartbeat_soon(&mut self, shared: &mut SharedState, now: Timestamp) {
        let contention = Contention {
            has_children: self.links.has_children(),
            neighbours: self.links.len(),
        };
        self.heartbeat_timer.schedule_soon(shared, now, contention);
    }

    pub(super) fn update_route(&mut self, shared: &mut SharedState, now: Timestamp) {
        let context = RouteContext {
            is_master: shared.is_master(),
            master: shared.master(),
            heartbeat: shared.durable.heartbeats.master,
            throttles_leaves: self.heartbeat_timer.throttles_leaves(),
        };
        let change = self.route.update(now, context, &self.links);
        if self.route.parent().is_some() {
            shared.report_master_returned();
        }
        if change.routes {
            shared.emit(Event::Routes(self.route.routes().clone()));
        }
        if change.hops_or_parent && !self.is_settled_to_land(shared, now) {
            self.schedule_heartbeat_soon(shared, now);
        }
    }

    fn watched_route(&self) -> WatchedRoute {
        WatchedRoute {
            parent: self.route.parent(),
            stale_at: self.route.stale_at(&self.links),
            orphaned_since: self.route.orphaned_since(),
        }
    }

    pub(super) fn next_probe(&self, shared: &SharedState) -> Option<Timestamp> {
        let route = self.watched_route();
        (self.probe).deadline(shared, &self.links, route, &self.config)
    }

    /// Takes the probe step that is due; `None` if there is none.
    pub(super) fn probe_step(
        &mut self,
        shared: &mut SharedState,
        now: Timestamp,
    ) -> Option<ProbeStep> {
        let route = self.watched_route();
        let step = (self.probe).step(shared, &self.links, route, (now, &self.config))?;
        match step {
            ProbeStep::Probe { is_first: true } if self.heartbeat_timer.throttles_leaves() => {
                // Neighbours with a newer heartbeat sequence answer it.
                self.schedule_heartbeat_soon(shared, now);
            }
            ProbeStep::DropParent(parent) => {
                self.links.forget(parent);
                self.update_route(shared, now);
            }
            _ => {}
        }
        Some(step)
    }

    /// How a ballot from `sender` counts: over a one-way link it does not replace the current leader.
    pub(super) fn link_symmetry(
        &self,
        shared: &SharedState,
        sender: NodeId,
        frame: &TreeFrame<'_>,
    ) -> LinkSymmetry {
        let keeps_leading = shared.is_master() && flaw::has(Flaw::NeverStepsDown);
        if self.links.is_symmetric(sender, frame) && !keeps_leading {
            LinkSymmetry::Symmetric
        } else {
            LinkSymmetry::OneWay
        }
    }

    /// Updates the route and the heartbeat timer after a neighbour's report, which is in the link table already.
    pub(super) fn process_report(
        &mut self,
        shared: &mut SharedState,
        now: Timestamp,
        (sender, received): (NodeId, ReceivedReport),
    ) {
        let Some(link) = self.links.get(sender) else {
            return;
        };
        let (sequence, heartbeat) = (link.report.sequence, link.report.heartbeat);
        if received.is_new || link.hearing().lost_this_drone() {
            // The heartbeat shows the neighbour that it is heard.
            self.heartbeat_timer.schedule_for_new_neighbour(shared, now);
        }
        if received.hearing_changed {
            shared.report_deaf(self.links.deaf());
        }
        if link.report.master_lands {
            shared.record_master_landing(sequence);
        }
        if self.route.parent() == Some(sender) {
            self.route.refresh_parent(&self.links);
            self.route.follow_parent(&self.links);
        }
        if received.route_changed || !self.route.keeps_route(now, link) {
            self.update_route(shared, now);
        }
        self.process_heartbeat(shared, now, sender, heartbeat);
    }

    /// Number of neighbours at the same distance from the master, which forward an order at the same time.
    pub(super) fn competing_relays(&self) -> usize {
        let hops = self.route.routes().hops;
        let competes = |link: &&Neighbour| hops.is_some() && link.report.hops == hops;
        self.links.iter().filter(competes).count()
    }

    /// Records that a unicast to a neighbour was not delivered.
    pub(super) fn record_failure(&mut self, shared: &mut SharedState, now: Timestamp, id: NodeId) {
        (self.links).update_link(id, |link| link.deliveries.record_failure());
        self.update_route(shared, now);
    }

    /// Marks a neighbour unreachable until it is heard again.
    pub(super) fn mark_unreachable(
        &mut self,
        shared: &mut SharedState,
        now: Timestamp,
        id: NodeId,
    ) {
        (self.links).update_link(id, |link| link.deliveries.mark_unreachable());
        self.update_route(shared, now);
    }

    /// Removes neighbours whose link has timed out, and reports those that may not hear this drone.
    pub(super) fn remove_silent_neighbours(&mut self, shared: &mut SharedState, now: Timestamp) {
        let time_to_live = self.config.link_time_to_live;
        if self.links.forget_silent(now, time_to_live) {
            self.update_route(shared, now);
        }
        shared.report_deaf(self.links.deaf());
    }

    /// Schedules the next heartbeat after one was sent.
    pub(super) fn record_heartbeat_sent(&mut self, shared: &mut SharedState, now: Timestamp) {
        // Only the master's period depends on it.
        let has_lossy_links =
            shared.is_master() && self.links.iter().any(|link| !link.quality.is_good());
        let links = (self.links.has_children(), has_lossy_links);
        let is_settled = self.is_settled_to_land(shared, now);
        (self.heartbeat_timer).record_sent(shared, now, links, is_settled);
    }

    pub(super) fn read_ahead(&self) {
        black_box((self.config.repair, self.config.id, self.links.len()));
        black_box((self.route.parent(), self.route.orphaned_since()));
        black_box((self.heartbeat_timer.deadline(), self.probe.dropped_parent()));
    }
}
