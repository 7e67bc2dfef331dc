//! The policy `flood`: what is said each period, and what is made of what others say.

use std::time::Duration;

use super::{Config, Event, Flood, FloodRouting, Member, Notice, Packet, Phase, Routes, Transmit};
use crate::flaw::{self, Flaw};
use crate::identity::{Ballot, NodeId, NodeSet};
use crate::time::Timestamp;
use crate::wire;

/// The longest that a first hello waits, so that neighbours do not all answer one at the same instant.
const FIRST_HELLO_MAX: Duration = Duration::from_millis(20);

impl Config {
    /// How long a drone takes at most until it misses its master: nobody watches while routes are looked for, which
    /// ends with the time to live at the latest, and who watches looks at its own turn.
    #[must_use]
    pub fn detection(&self) -> Duration {
        self.discovery + self.time_to_live * 2 + self.period
    }

    /// The longest that a drone keeps silent that is not landing.
    #[must_use]
    pub const fn turn(&self) -> Duration {
        self.period
    }

    /// How long news takes to a neighbour whether or not it gets there at the first try, the way through the air
    /// apart: of two in five lost frames the mean is less than two turns.
    #[must_use]
    pub fn hop(&self) -> Duration {
        self.period * 2
    }
}

impl FloodRouting {
    /// Says what is due at `due`; when to speak next.
    pub(super) fn speak(&mut self, now: Timestamp, due: Timestamp) -> Option<Timestamp> {
        let pause = match self.durable.phase {
            Phase::Stopped => return None,
            Phase::Discovery { until } if now >= until => {
                self.start_hop_update(now);
                return Some(due + self.phase_in(self.config.period));
            }
            Phase::Discovery { until } => {
                let remaining = until.since(now);
                self.send(&Packet::Hello { remaining });
                return Some(until.min(due + self.config.hello_period));
            }
            Phase::HopUpdate { since } => {
                if now.since(since) >= self.config.time_to_live {
                    self.finish_hop_update(now);
                } else if let Some(hops) = self.durable.routes.hops {
                    let routing_list = self.durable.routes.routing_list.clone();
                    self.send(&Packet::HopUpdate { hops, routing_list });
                }
                self.config.period
            }
            Phase::Gossip | Phase::Following | Phase::Scattered => {
                self.watch(now);
                self.send_flood(now);
                match self.durable.landing {
                    Some(since) if now.since(since) > self.config.time_to_live => {
                        self.config.keep_alive
                    }
                    _ => self.config.period,
                }
            }
        };
        Some(due + pause)
    }

    /// Says for the last time how far this drone has got.
    pub(super) fn stop(&mut self, now: Timestamp) {
        if self.durable.phase != Phase::Stopped {
            self.durable.landing.get_or_insert(now);
            if self.durable.reign.ballot().is_some() {
                self.send_flood(now);
            }
            self.durable.phase = Phase::Stopped;
            self.next_send = None;
            self.checkpoint();
        }
    }

    fn send(&mut self, packet: &Packet) {
        if let Some(ballot) = self.durable.reign.ballot() {
            let payload = wire::encode_packet(packet);
            self.outbox.transmit(Transmit::Send {
                to: None,
                ballot,
                payload,
                keep_alive: false,
            });
        }
    }

    fn send_flood(&mut self, now: Timestamp) {
        let is_master = self.is_master();
        if self.durable.beats.advance(is_master) {
            self.checkpoint();
        }
        let own = Member {
            id: self.config.id,
            beat: self.durable.beats.own,
            acknowledged: self.durable.reign.acknowledged(),
            out_of_range: self.durable.routes.out_of_range,
            landing: self.durable.landing.is_some(),
        };
        let time_to_live = self.config.time_to_live;
        self.heard_at
            .retain(|_, heard_at| now.since(*heard_at) <= time_to_live);
        // A master is no member, but that it is going to land is to be known.
        let members = match (is_master, own.landing) {
            (false, _) => std::iter::once(own).chain(self.members.iter()).collect(),
            (true, true) => vec![own],
            (true, false) => Vec::new(),
        };
        let everyone_repeats = matches!(self.durable.phase, Phase::Gossip | Phase::Scattered);
        let repeats_orders = is_master || everyone_repeats || self.durable.routes.relay;
        let order = self
            .durable
            .reign
            .order()
            .cloned()
            .filter(|_| repeats_orders);
        self.send(&Packet::Flood(Flood {
            hops: self.durable.routes.hops,
            parent: self.durable.routes.parent,
            pulse: self.durable.beats.pulse,
            sequence: self.durable.reign.sequence(),
            hears: self.heard_at.keys().copied().collect(),
            members,
            order,
        }));
    }

    /// Notices who has fallen silent.
    fn watch(&mut self, now: Timestamp) {
        let time_to_live = self.config.time_to_live;
        if !self.is_master() {
            if self.durable.routes.parent.is_some()
                && now.since(self.parent_heard_at) > time_to_live / 2
            {
                self.scatter(now);
            }
            self.members.forget_silent(now, time_to_live);
            if !self.master_silent && now.since(self.pulse_rose_at) > time_to_live {
                self.master_silent = true;
                self.inform(Notice::MasterSilent);
            }
        } else if self.config.misses_early || self.durable.phase != Phase::Gossip {
            let silent = self.members.fall_silent(now, time_to_live);
            if !silent.is_empty() {
                self.inform(Notice::Silent(silent));
            }
        }
    }

    pub(super) fn start_discovery(&mut self, now: Timestamp, remaining: Duration) {
        if self.durable.phase == Phase::Gossip {
            // The master has begun it, and nobody says its number until there are ways.
            self.found_master();
            let until = now + remaining.min(self.config.discovery);
            self.durable.phase = Phase::Discovery { until };
            self.next_send = Some(now + self.phase_in(FIRST_HELLO_MAX));
            self.inform(Notice::DiscoveryStarted);
            self.checkpoint();
        }
    }

    /// As master, by its protocol: starts discovery. Of those that obey one that was elected some may have ways already,
    /// and some may be past the first waypoint; there everyone goes on repeating everything.
    pub(super) fn discover(&mut self, now: Timestamp) {
        let is_elected = |ballot: Ballot| ballot.is_elected();
        if !self.durable.reign.ballot().is_some_and(is_elected) {
            return self.start_discovery(now, self.config.discovery);
        }
        self.durable.phase = Phase::Scattered;
        self.expect_members(now);
        self.inform_of_routes();
        self.checkpoint();
    }

    fn found_master(&mut self) {
        if self.master_silent {
            self.master_silent = false;
            self.inform(Notice::MasterReturned);
        }
    }

    pub(super) fn heard_hello(&mut self, now: Timestamp, sender: NodeId, remaining: Duration) {
        self.start_discovery(now, remaining);
        if matches!(self.durable.phase, Phase::Discovery { .. })
            && self.neighbours.hear(sender, now)
        {
            self.outbox.event(Event::NeighbourStable(sender));
            self.checkpoint();
        }
    }

    fn start_hop_update(&mut self, now: Timestamp) {
        self.durable.phase = Phase::HopUpdate { since: now };
        self.durable.routes = Routes::default();
        self.heard_again.clear();
        self.inform(Notice::HopUpdateStarted);
        if self.is_master() {
            self.durable.routes.hops = Some(0);
            self.durable.routes.routing_list = self.neighbours.stable().collect();
            self.durable.routes.relay = true;
            self.finish_once_all_heard(now);
        } else {
            let master = self.durable.reign.ballot().map(|ballot| ballot.master);
            self.durable.routes.out_of_range =
                !master.is_some_and(|master| self.neighbours.is_stable(master));
        }
        self.checkpoint();
    }

    pub(super) fn heard_hop_update(
        &mut self,
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
            self.take_parent(now, sender, hops, routing_list);
        }
        self.heard_again.insert(sender);
        self.finish_once_all_heard(now);
    }

    /// Takes the first stable neighbour that is heard as parent (thesis, section 4.2, step 3).
    fn take_parent(&mut self, now: Timestamp, parent: NodeId, hops: u16, routing_list: &[NodeId]) {
        let master = self.durable.reign.ballot().map(|ballot| ballot.master);
        self.parent_heard_at = now;
        let routes = &mut self.durable.routes;
        routes.hops = Some(hops.saturating_add(1));
        routes.parent = Some(parent);
        routes.routing_list.clear();
        for id in routing_list {
            if id.0 < self.config.drones && !routes.routing_list.contains(id) {
                routes.routing_list.push(*id);
            }
        }
        let is_listed = routes.routing_list.contains(&self.config.id);
        let listed_by_others = routes.routing_list.len();
        for id in self.neighbours.stable() {
            if Some(id) != master && !routes.routing_list.contains(&id) {
                routes.routing_list.push(id);
            }
        }
        routes.relay = is_listed && routes.routing_list.len() > listed_by_others;
        self.checkpoint();
    }

    fn finish_once_all_heard(&mut self, now: Timestamp) {
        let all_heard = self
            .neighbours
            .stable()
            .all(|id| self.heard_again.contains(&id));
        if self.durable.routes.hops.is_some() && all_heard {
            self.finish_hop_update(now);
        }
    }

    fn finish_hop_update(&mut self, now: Timestamp) {
        self.durable.phase = Phase::Following;
        if self.is_master() {
            // Others may still wait as long to hear all their neighbours again.
            self.expect_members(now + self.config.time_to_live);
        } else {
            self.members.forget_all();
        }
        self.pulse_rose_at = now;
        self.outbox
            .event(Event::Routes(self.durable.routes.clone()));
        self.inform_of_routes();
        self.checkpoint();
    }

    /// Says that routes are up; to a master also to whom they need not lead over others.
    pub(super) fn inform_of_routes(&mut self) {
        if self.is_master() {
            self.inform(Notice::Hears(self.neighbours.stable().collect()));
        }
        self.inform(Notice::RoutesReady);
    }

    pub(super) fn heard_flood(&mut self, now: Timestamp, sender: NodeId, flood: Flood) {
        // Of a drone that does not hear this one, it is no sign that there is a way to the master.
        let is_mutual = flood.hears.contains(self.config.id);
        let is_echo = flood.pulse == self.durable.beats.pulse && flaw::has(Flaw::CountsEchoes);
        let is_rise = flood.pulse > self.durable.beats.pulse || is_echo;
        if is_rise && !self.is_master() && is_mutual {
            self.durable.beats.pulse = flood.pulse;
            self.pulse_rose_at = now;
            self.found_master();
        }
        self.heard_order(flood.sequence, flood.order);
        self.hear_of_landing(flood.sequence, &flood.members);
        if self.durable.routes.hops.is_none()
            && matches!(
                self.durable.phase,
                Phase::HopUpdate { .. } | Phase::Following
            )
        {
            // Discovery has passed it by: whoever is heard often enough now is as good a neighbour.
            self.neighbours.hear(sender, now);
        }
        let is_parent = self.durable.routes.parent == Some(sender);
        if is_parent && flood.hops.is_none() && self.durable.phase == Phase::Following {
            // It has lost its own way.
            self.scatter(now);
        }
        match self.durable.phase {
            Phase::Gossip | Phase::Scattered => {
                self.hear_members(now, sender, &flood.members);
            }
            Phase::Following => {
                if flood.parent == Some(self.config.id) {
                    self.become_relay();
                    self.hear_members(now, sender, &flood.members);
                } else if flood.parent.is_none() {
                    // It has no way: whoever hears it passes on what it says, and orders to it.
                    if flood.hops.is_none() {
                        self.become_relay();
                    }
                    self.hear_members(now, sender, &flood.members);
                }
                self.adopt_parent_late(now, sender, flood.hops);
            }
            Phase::HopUpdate { .. } if self.neighbours.is_stable(sender) => {
                // A neighbour that follows the mission already counts as heard again (thesis, table 7).
                self.adopt_parent_late(now, sender, flood.hops);
                self.heard_again.insert(sender);
                self.finish_once_all_heard(now);
            }
            Phase::Discovery { .. } | Phase::HopUpdate { .. } | Phase::Stopped => {}
        }
    }

    fn heard_order(&mut self, sequence: u32, order: Option<bytes::Bytes>) {
        let own = self.config.id;
        if order.is_some_and(|order| self.durable.reign.hear_order(own, sequence, order)) {
            if let Some(notice) = self.durable.reign.newest_order() {
                self.inform(notice);
            }
            self.checkpoint();
        }
    }

    /// Takes in that the master is going to land. A master that takes the swarm down with it says so in its last order;
    /// so only whoever knows that order can tell.
    fn hear_of_landing(&mut self, sequence: u32, members: &[Member]) {
        let Some(ballot) = self.durable.reign.ballot().filter(|_| !self.is_master()) else {
            return;
        };
        let is_known = sequence <= self.durable.reign.sequence();
        let mut landing = members.iter().filter(|member| member.landing);
        if is_known && landing.any(|member| member.id == ballot.master) && !self.master_lands {
            self.master_lands = true;
            self.inform(Notice::MasterLands);
        }
    }

    fn hear_members(&mut self, now: Timestamp, sender: NodeId, members: &[Member]) {
        let is_master = self.is_master();
        let master = self.durable.reign.ballot().map(|ballot| ballot.master);
        let sequence = self.durable.reign.sequence();
        let mut returned = NodeSet::default();
        let (mut acknowledged, mut landing) = (NodeSet::default(), NodeSet::default());
        for member in members {
            let is_another = self.is_member(member.id) && Some(member.id) != master;
            if !is_another || member.id == self.config.id {
                continue;
            }
            let change = self.members.hear(*member, sender, now);
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
            if change.moved && self.durable.phase == Phase::Following {
                self.outbox.event(Event::Reached {
                    member: member.id,
                    via: sender,
                    out_of_range: member.out_of_range,
                });
            }
        }
        if !returned.is_empty() {
            self.inform(Notice::Returned(returned));
        }
        if !acknowledged.is_empty() || !landing.is_empty() {
            self.inform(Notice::Progress {
                sequence,
                acknowledged,
                landing,
            });
        }
    }

    /// Whoever is named as a parent must relay, whatever its routing list said.
    fn become_relay(&mut self) {
        if !self.durable.routes.relay {
            self.durable.routes.relay = true;
            self.outbox
                .event(Event::Routes(self.durable.routes.clone()));
            self.checkpoint();
        }
    }

    /// A drone that missed the hop update takes its parent from a neighbour that has routes.
    fn adopt_parent_late(&mut self, now: Timestamp, sender: NodeId, hops: Option<u16>) {
        if let (Some(hops), None) = (hops, self.durable.routes.hops)
            && self.neighbours.is_stable(sender)
        {
            self.take_parent(now, sender, hops, &[]);
            self.outbox
                .event(Event::Routes(self.durable.routes.clone()));
        }
    }
}
