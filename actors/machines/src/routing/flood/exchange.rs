//! Policy `flood`: what a drone sends each period, and how it handles packets.

use std::time::Duration;

use super::{
    Config, Event, Flood, FloodPolicy, Member, Notice, Packet, Phase, Routes, SharedState,
};
use crate::flaw::{self, Flaw};
use crate::identity::{NodeId, NodeSet};
use crate::time::Timestamp;
use crate::wire;

/// Longest delay of the first hello, so that neighbours do not answer one at the same instant.
const FIRST_HELLO_MAX: Duration = Duration::from_millis(20);

impl Config {
    /// Longest time until a lost master is reported as silent. A drone does not check it during discovery and hop
    /// update, and then checks once a period.
    #[must_use]
    pub fn detection_max(&self) -> Duration {
        self.discovery + self.time_to_live * 2 + self.period
    }

    /// Number of periods without a newer heartbeat after which the master counts as silent.
    #[must_use]
    pub fn periods_to_timeout(&self) -> u32 {
        let periods = self.time_to_live.as_nanos() / self.period.as_nanos().max(1);
        u32::try_from(periods).unwrap_or(u32::MAX)
    }

    /// Longest pause between two frames of a drone that is not landing.
    #[must_use]
    pub const fn silence_max(&self) -> Duration {
        self.period
    }

    /// Time until a change reaches a neighbour, without the time in the air: at 40 % loss the mean is less than two
    /// periods.
    #[must_use]
    pub fn hop_latency(&self) -> Duration {
        self.period * 2
    }
}

impl FloodPolicy {
    /// Sends what is due at `due`; returns when to send next.
    pub(super) fn send_due(
        &mut self,
        shared: &mut SharedState,
        now: Timestamp,
        due: Timestamp,
    ) -> Option<Timestamp> {
        if shared.durable.stopped {
            return None;
        }
        let pause = match self.durable.phase {
            Phase::Discovery { until } if now >= until => {
                self.start_hop_update(shared, now);
                return Some(due + shared.jitter(self.config.period));
            }
            Phase::Discovery { until } => {
                let remaining = until.since(now);
                Self::send(shared, &Packet::Hello { remaining });
                return Some(until.min(due + self.config.hello_period));
            }
            Phase::HopUpdate { since } => {
                if now.since(since) >= self.config.time_to_live {
                    self.finish_hop_update(shared, now);
                } else if let Some(hops) = self.durable.routes.hops {
                    let routing_list = self.durable.routes.routing_list.clone();
                    Self::send(shared, &Packet::HopUpdate { hops, routing_list });
                }
                self.config.period
            }
            Phase::Gossip | Phase::Following | Phase::RoutesLost => {
                self.check_timeouts(shared, now);
                self.send_flood(shared, now);
                // Under a master that flies on, it may be the only one that relays between others.
                let is_over = shared.is_master() || shared.master_lands();
                match shared.durable.landing {
                    Some(since) if is_over && now.since(since) > self.config.time_to_live => {
                        self.config.keep_alive
                    }
                    _ => self.config.period,
                }
            }
        };
        Some(due + pause)
    }

    fn send(shared: &mut SharedState, packet: &Packet) {
        shared.send(None, wire::encode_packet(packet), false);
    }

    pub(super) fn send_flood(&mut self, shared: &mut SharedState, now: Timestamp) {
        let is_master = shared.is_master();
        if shared.durable.heartbeats.advance(is_master) {
            shared.mark_changed();
        }
        let own = Member {
            id: shared.id,
            number: shared.durable.heartbeats.own,
            acknowledged: shared.durable.epoch.acknowledged(),
            out_of_range: self.durable.routes.out_of_range,
            landing: shared.durable.landing.is_some(),
        };
        let time_to_live = self.config.time_to_live;
        self.heard_at
            .retain(|_, heard_at| now.since(*heard_at) <= time_to_live);
        let heard: NodeSet = self.heard_at.keys().copied().collect();
        shared.report_deaf(shared.deaf().intersection(&heard));
        // The master is no member, but its landing must become known. Drones that hear it themselves may be landing,
        // too.
        let landing_master = shared.master().filter(|_| shared.master_lands());
        let landing_master = landing_master.map(|master| Member {
            id: master,
            number: 0,
            acknowledged: 0,
            out_of_range: false,
            landing: true,
        });
        let members = match (is_master, own.landing) {
            (false, _) => {
                let own = std::iter::once(own);
                own.chain(self.members.iter())
                    .chain(landing_master)
                    .collect()
            }
            (true, true) => vec![own],
            (true, false) => Vec::new(),
        };
        let everyone_repeats = matches!(self.durable.phase, Phase::Gossip | Phase::RoutesLost);
        let repeats_orders = is_master || everyone_repeats || self.durable.routes.relay;
        let order = shared.durable.epoch.order().cloned();
        let order = order.filter(|_| repeats_orders);
        Self::send(
            shared,
            &Packet::Flood(Flood {
                hops: self.durable.routes.hops,
                parent: self.durable.routes.parent,
                heartbeat: shared.durable.heartbeats.master,
                sequence: shared.durable.epoch.sequence(),
                hears: heard,
                members,
                order,
            }),
        );
    }

    /// Detects silent members, a silent master and a lost parent.
    fn check_timeouts(&mut self, shared: &mut SharedState, now: Timestamp) {
        let time_to_live = self.config.time_to_live;
        if !shared.is_master() {
            if self.durable.routes.parent.is_some()
                && now.since(self.parent_heard_at) > time_to_live / 2
            {
                self.drop_routes(shared, now);
            }
            self.members.forget_silent(now, time_to_live);
            if now.since(self.heartbeat_rose_at) > time_to_live {
                shared.report_master_silent();
            }
        } else if self.config.monitors_before_routes || self.durable.phase != Phase::Gossip {
            let silent = self.members.mark_silent(now, time_to_live);
            if !silent.is_empty() {
                shared.notify(Notice::Silent(silent));
            }
        }
    }

    pub(super) fn start_discovery(
        &mut self,
        shared: &mut SharedState,
        now: Timestamp,
        remaining: Duration,
    ) {
        if self.durable.phase == Phase::Gossip {
            // The master has started discovery, so it lives. Hellos carry no heartbeat sequence.
            shared.report_master_returned();
            let until = now + remaining.min(self.config.discovery);
            self.durable.phase = Phase::Discovery { until };
            self.next_send = Some(now + shared.jitter(FIRST_HELLO_MAX));
            shared.notify(Notice::DiscoveryStarted);
            shared.mark_changed();
        }
    }

    pub(super) fn receive_hello(
        &mut self,
        shared: &mut SharedState,
        now: Timestamp,
        sender: NodeId,
        remaining: Duration,
    ) {
        self.start_discovery(shared, now, remaining);
        if matches!(self.durable.phase, Phase::Discovery { .. })
            && self.neighbours.record_hello(sender, now)
        {
            shared.emit(Event::NeighbourStable(sender));
            shared.mark_changed();
        }
    }

    fn start_hop_update(&mut self, shared: &mut SharedState, now: Timestamp) {
        self.durable.phase = Phase::HopUpdate { since: now };
        self.durable.routes = Routes::default();
        self.reheard.clear();
        shared.notify(Notice::HopUpdateStarted);
        if shared.is_master() {
            self.durable.routes.hops = Some(0);
            self.durable.routes.routing_list = self.neighbours.stable().collect();
            self.durable.routes.relay = true;
            self.finish_once_all_heard(shared, now);
        } else {
            let master = shared.durable.epoch.ballot().map(|ballot| ballot.master);
            self.durable.routes.out_of_range =
                !master.is_some_and(|master| self.neighbours.is_stable(master));
        }
        shared.mark_changed();
    }

    pub(super) fn receive_hop_update(
        &mut self,
        shared: &mut SharedState,
        now: Timestamp,
        sender: NodeId,
        hops: u16,
        routing_list: &[NodeId],
    ) {
        let is_updating = matches!(self.durable.phase, Phase::HopUpdate { .. });
        if !is_updating || !self.neighbours.is_stable(sender) {
            return;
        }
        if self.durable.routes.hops.is_none() {
            self.set_parent(shared, now, sender, hops, routing_list);
        }
        self.reheard.insert(sender);
        self.finish_once_all_heard(shared, now);
    }

    /// Sets the parent: the first stable neighbour that is heard (thesis, section 4.2, step 3).
    fn set_parent(
        &mut self,
        shared: &mut SharedState,
        now: Timestamp,
        parent: NodeId,
        hops: u16,
        routing_list: &[NodeId],
    ) {
        let master = shared.durable.epoch.ballot().map(|ballot| ballot.master);
        self.parent_heard_at = now;
        let routes = &mut self.durable.routes;
        routes.hops = Some(hops.saturating_add(1));
        routes.parent = Some(parent);
        routes.routing_list.clear();
        for id in routing_list {
            if id.0 < shared.drones && !routes.routing_list.contains(id) {
                routes.routing_list.push(*id);
            }
        }
        let is_listed = routes.routing_list.contains(&shared.id);
        let listed_by_others = routes.routing_list.len();
        for id in self.neighbours.stable() {
            if Some(id) != master && !routes.routing_list.contains(&id) {
                routes.routing_list.push(id);
            }
        }
        routes.relay = is_listed && routes.routing_list.len() > listed_by_others;
        shared.mark_changed();
    }

    fn finish_once_all_heard(&mut self, shared: &mut SharedState, now: Timestamp) {
        let all_heard = self
            .neighbours
            .stable()
            .all(|id| self.reheard.contains(&id));
        if self.durable.routes.hops.is_some() && all_heard {
            self.finish_hop_update(shared, now);
        }
    }

    fn finish_hop_update(&mut self, shared: &mut SharedState, now: Timestamp) {
        self.durable.phase = Phase::Following;
        if shared.is_master() {
            // Others may wait for as long to hear all their neighbours again.
            self.expect_members(shared, now + self.config.time_to_live);
        } else {
            self.members.forget_all();
        }
        self.heartbeat_rose_at = now;
        shared.emit(Event::Routes(self.durable.routes.clone()));
        self.notify_routes_ready(shared);
        shared.mark_changed();
    }

    /// Notifies the protocol that routes are up; on the master first of its own neighbours.
    pub(super) fn notify_routes_ready(&mut self, shared: &mut SharedState) {
        if shared.is_master() {
            shared.notify(Notice::Neighbours(self.neighbours.stable().collect()));
        }
        shared.notify(Notice::RoutesReady);
    }

    /// Records the master's heartbeat sequence.
    fn record_heartbeat(&mut self, shared: &mut SharedState, now: Timestamp, flood: &Flood) {
        // A neighbour that does not hear this drone proves no route to the master.
        let is_symmetric = flood.hears.contains(shared.id);
        let is_accepted_repeat = flood.heartbeat == shared.durable.heartbeats.master
            && flaw::has(Flaw::AcceptsRepeatedHeartbeats);
        let has_risen = flood.heartbeat > shared.durable.heartbeats.master || is_accepted_repeat;
        if has_risen && !shared.is_master() && is_symmetric {
            shared.durable.heartbeats.master = flood.heartbeat;
            self.heartbeat_rose_at = now;
            shared.report_master_returned();
        }
    }

    pub(super) fn receive_flood(
        &mut self,
        shared: &mut SharedState,
        now: Timestamp,
        sender: NodeId,
        flood: &Flood,
    ) {
        self.record_heartbeat(shared, now, flood);
        shared.accept_order(flood.sequence, flood.order.as_deref());
        let master = shared.master();
        if flood
            .members
            .iter()
            .any(|it| it.landing && Some(it.id) == master)
        {
            shared.record_master_landing(flood.sequence);
        }
        if self.durable.routes.hops.is_none()
            && matches!(
                self.durable.phase,
                Phase::HopUpdate { .. } | Phase::Following
            )
        {
            // This drone has missed discovery; frames count as hellos.
            self.neighbours.record_hello(sender, now);
        }
        let is_parent = self.durable.routes.parent == Some(sender);
        if is_parent && flood.hops.is_none() && self.durable.phase == Phase::Following {
            // The parent has lost its route.
            self.drop_routes(shared, now);
        }
        match self.durable.phase {
            Phase::Gossip | Phase::RoutesLost => {
                self.record_members(shared, now, sender, &flood.members);
            }
            Phase::Following => {
                if flood.parent == Some(shared.id) {
                    self.become_relay(shared);
                    self.record_members(shared, now, sender, &flood.members);
                } else if flood.parent.is_none() {
                    // The sender has no route. Each receiver forwards its acknowledgements, and orders to it.
                    if flood.hops.is_none() {
                        self.become_relay(shared);
                    }
                    self.record_members(shared, now, sender, &flood.members);
                } else if self.is_overdue(now, sender) {
                    // Its parent does not forward its reports.
                    let own = flood.members.iter().copied().filter(|it| it.id == sender);
                    self.record_members(shared, now, sender, &own.collect::<Vec<_>>());
                }
                self.adopt_parent_late(shared, now, sender, flood.hops);
            }
            Phase::HopUpdate { .. } if self.neighbours.is_stable(sender) => {
                // A neighbour that has routes already counts as heard again (thesis, table 7).
                self.adopt_parent_late(shared, now, sender, flood.hops);
                self.reheard.insert(sender);
                self.finish_once_all_heard(shared, now);
            }
            Phase::Discovery { .. } | Phase::HopUpdate { .. } => {}
        }
    }

    /// Whether no report of a member has come for half its time to live.
    fn is_overdue(&self, now: Timestamp, member: NodeId) -> bool {
        self.members
            .is_silent_for(member, now, self.config.time_to_live / 2)
    }

    fn record_members(
        &mut self,
        shared: &mut SharedState,
        now: Timestamp,
        sender: NodeId,
        members: &[Member],
    ) {
        let is_master = shared.is_master();
        let master = shared.durable.epoch.ballot().map(|ballot| ballot.master);
        let sequence = shared.durable.epoch.sequence();
        let mut returned = NodeSet::default();
        let (mut acknowledged, mut landing) = (NodeSet::default(), NodeSet::default());
        for member in members {
            let is_another = member.id.0 < shared.drones && Some(member.id) != master;
            if !is_another || member.id == shared.id {
                continue;
            }
            let change = self.members.record(*member, sender, now);
            if !is_master {
                continue;
            }
            if change.returned {
                returned.insert(member.id);
            }
            if change.progress && member.acknowledged >= sequence {
                acknowledged.insert(member.id);
            }
            if change.progress && member.landing {
                landing.insert(member.id);
            }
            if change.path_changed && self.durable.phase == Phase::Following {
                shared.emit(Event::Reached {
                    member: member.id,
                    via: sender,
                    out_of_range: member.out_of_range,
                });
            }
        }
        if !returned.is_empty() {
            shared.notify(Notice::Returned(returned));
        }
        if !acknowledged.is_empty() || !landing.is_empty() {
            shared.notify(Notice::Progress {
                sequence,
                acknowledged,
                landing,
            });
        }
    }

    /// A drone that is named as a parent relays, whatever its routing list says.
    fn become_relay(&mut self, shared: &mut SharedState) {
        if !self.durable.routes.relay {
            self.durable.routes.relay = true;
            shared.emit(Event::Routes(self.durable.routes.clone()));
            shared.mark_changed();
        }
    }

    /// A drone that missed the hop update takes a stable neighbour with a route as parent.
    fn adopt_parent_late(
        &mut self,
        shared: &mut SharedState,
        now: Timestamp,
        sender: NodeId,
        hops: Option<u16>,
    ) {
        if let (Some(hops), None) = (hops, self.durable.routes.hops)
            && self.neighbours.is_stable(sender)
        {
            self.set_parent(shared, now, sender, hops, &[]);
            shared.emit(Event::Routes(self.durable.routes.clone()));
        }
    }
}
