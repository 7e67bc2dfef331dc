//! The policy `flood`: what is said each period, and what is made of what others say.

use std::time::Duration;

use super::{Config, Core, Event, Flood, FloodPolicy, Member, Notice, Packet, Phase, Routes};
use crate::flaw::{self, Flaw};
use crate::identity::{NodeId, NodeSet};
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

    /// For how many turns a drone waits for a higher number of the master's before it misses it.
    #[must_use]
    pub fn awaited_turns(&self) -> u32 {
        let turns = self.time_to_live.as_nanos() / self.period.as_nanos().max(1);
        u32::try_from(turns).unwrap_or(u32::MAX)
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

impl FloodPolicy {
    /// Says what is due at `due`; when to speak next.
    pub(super) fn speak(
        &mut self,
        core: &mut Core,
        now: Timestamp,
        due: Timestamp,
    ) -> Option<Timestamp> {
        if core.durable.stopped {
            return None;
        }
        let pause = match self.durable.phase {
            Phase::Discovery { until } if now >= until => {
                self.start_hop_update(core, now);
                return Some(due + core.jitter(self.config.period));
            }
            Phase::Discovery { until } => {
                let remaining = until.since(now);
                Self::send(core, &Packet::Hello { remaining });
                return Some(until.min(due + self.config.hello_period));
            }
            Phase::HopUpdate { since } => {
                if now.since(since) >= self.config.time_to_live {
                    self.finish_hop_update(core, now);
                } else if let Some(hops) = self.durable.routes.hops {
                    let routing_list = self.durable.routes.routing_list.clone();
                    Self::send(core, &Packet::HopUpdate { hops, routing_list });
                }
                self.config.period
            }
            Phase::Gossip | Phase::Following | Phase::Scattered => {
                self.watch(core, now);
                self.send_flood(core, now);
                match core.durable.landing {
                    Some(since) if now.since(since) > self.config.time_to_live => {
                        self.config.keep_alive
                    }
                    _ => self.config.period,
                }
            }
        };
        Some(due + pause)
    }

    fn send(core: &mut Core, packet: &Packet) {
        core.send(None, wire::encode_packet(packet), false);
    }

    pub(super) fn send_flood(&mut self, core: &mut Core, now: Timestamp) {
        let is_master = core.is_master();
        if core.durable.heartbeats.advance(is_master) {
            core.keep();
        }
        let own = Member {
            id: core.id,
            number: core.durable.heartbeats.own,
            acknowledged: core.durable.epoch.acknowledged(),
            out_of_range: self.durable.routes.out_of_range,
            landing: core.durable.landing.is_some(),
        };
        let time_to_live = self.config.time_to_live;
        self.heard_at
            .retain(|_, heard_at| now.since(*heard_at) <= time_to_live);
        // A master is no member, but that it is going to land is to be known.
        // Those who hear it themselves may be going to land, too, and lead nobody.
        let lost = core.master().filter(|_| core.master_lands());
        let lost = lost.map(|master| Member {
            id: master,
            number: 0,
            acknowledged: 0,
            out_of_range: false,
            landing: true,
        });
        let members = match (is_master, own.landing) {
            (false, _) => {
                let own = std::iter::once(own);
                own.chain(self.members.iter()).chain(lost).collect()
            }
            (true, true) => vec![own],
            (true, false) => Vec::new(),
        };
        let everyone_repeats = matches!(self.durable.phase, Phase::Gossip | Phase::Scattered);
        let repeats_orders = is_master || everyone_repeats || self.durable.routes.relay;
        let order = core.durable.epoch.order().cloned();
        let order = order.filter(|_| repeats_orders);
        Self::send(
            core,
            &Packet::Flood(Flood {
                hops: self.durable.routes.hops,
                parent: self.durable.routes.parent,
                heartbeat: core.durable.heartbeats.master,
                sequence: core.durable.epoch.sequence(),
                hears: self.heard_at.keys().copied().collect(),
                members,
                order,
            }),
        );
    }

    /// Notices who has fallen silent.
    fn watch(&mut self, core: &mut Core, now: Timestamp) {
        let time_to_live = self.config.time_to_live;
        if !core.is_master() {
            if self.durable.routes.parent.is_some()
                && now.since(self.parent_heard_at) > time_to_live / 2
            {
                self.leave_routes(core, now);
            }
            self.members.forget_silent(now, time_to_live);
            if now.since(self.heartbeat_rose_at) > time_to_live {
                core.miss_master();
            }
        } else if self.config.misses_early || self.durable.phase != Phase::Gossip {
            let silent = self.members.fall_silent(now, time_to_live);
            if !silent.is_empty() {
                core.inform(Notice::Silent(silent));
            }
        }
    }

    pub(super) fn start_discovery(&mut self, core: &mut Core, now: Timestamp, remaining: Duration) {
        if self.durable.phase == Phase::Gossip {
            // The master has begun it, and nobody says its number until there are ways.
            core.find_master();
            let until = now + remaining.min(self.config.discovery);
            self.durable.phase = Phase::Discovery { until };
            self.next_send = Some(now + core.jitter(FIRST_HELLO_MAX));
            core.inform(Notice::DiscoveryStarted);
            core.keep();
        }
    }

    pub(super) fn heard_hello(
        &mut self,
        core: &mut Core,
        now: Timestamp,
        sender: NodeId,
        remaining: Duration,
    ) {
        self.start_discovery(core, now, remaining);
        if matches!(self.durable.phase, Phase::Discovery { .. })
            && self.neighbours.hear(sender, now)
        {
            core.show(Event::NeighbourStable(sender));
            core.keep();
        }
    }

    fn start_hop_update(&mut self, core: &mut Core, now: Timestamp) {
        self.durable.phase = Phase::HopUpdate { since: now };
        self.durable.routes = Routes::default();
        self.heard_again.clear();
        core.inform(Notice::HopUpdateStarted);
        if core.is_master() {
            self.durable.routes.hops = Some(0);
            self.durable.routes.routing_list = self.neighbours.stable().collect();
            self.durable.routes.relay = true;
            self.finish_once_all_heard(core, now);
        } else {
            let master = core.durable.epoch.ballot().map(|ballot| ballot.master);
            self.durable.routes.out_of_range =
                !master.is_some_and(|master| self.neighbours.is_stable(master));
        }
        core.keep();
    }

    pub(super) fn heard_hop_update(
        &mut self,
        core: &mut Core,
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
            self.take_parent(core, now, sender, hops, routing_list);
        }
        self.heard_again.insert(sender);
        self.finish_once_all_heard(core, now);
    }

    /// Takes the first stable neighbour that is heard as parent (thesis, section 4.2, step 3).
    fn take_parent(
        &mut self,
        core: &mut Core,
        now: Timestamp,
        parent: NodeId,
        hops: u16,
        routing_list: &[NodeId],
    ) {
        let master = core.durable.epoch.ballot().map(|ballot| ballot.master);
        self.parent_heard_at = now;
        let routes = &mut self.durable.routes;
        routes.hops = Some(hops.saturating_add(1));
        routes.parent = Some(parent);
        routes.routing_list.clear();
        for id in routing_list {
            if id.0 < core.drones && !routes.routing_list.contains(id) {
                routes.routing_list.push(*id);
            }
        }
        let is_listed = routes.routing_list.contains(&core.id);
        let listed_by_others = routes.routing_list.len();
        for id in self.neighbours.stable() {
            if Some(id) != master && !routes.routing_list.contains(&id) {
                routes.routing_list.push(id);
            }
        }
        routes.relay = is_listed && routes.routing_list.len() > listed_by_others;
        core.keep();
    }

    fn finish_once_all_heard(&mut self, core: &mut Core, now: Timestamp) {
        let all_heard = self
            .neighbours
            .stable()
            .all(|id| self.heard_again.contains(&id));
        if self.durable.routes.hops.is_some() && all_heard {
            self.finish_hop_update(core, now);
        }
    }

    fn finish_hop_update(&mut self, core: &mut Core, now: Timestamp) {
        self.durable.phase = Phase::Following;
        if core.is_master() {
            // Others may still wait as long to hear all their neighbours again.
            self.expect_members(core, now + self.config.time_to_live);
        } else {
            self.members.forget_all();
        }
        self.heartbeat_rose_at = now;
        core.show(Event::Routes(self.durable.routes.clone()));
        self.inform_of_routes(core);
        core.keep();
    }

    /// Says that routes are up; to a master also to whom they need not lead over others.
    pub(super) fn inform_of_routes(&mut self, core: &mut Core) {
        if core.is_master() {
            core.inform(Notice::Hears(self.neighbours.stable().collect()));
        }
        core.inform(Notice::RoutesReady);
    }

    pub(super) fn heard_flood(
        &mut self,
        core: &mut Core,
        now: Timestamp,
        sender: NodeId,
        flood: &Flood,
    ) {
        // Of a drone that does not hear this one, it is no sign that there is a way to the master.
        let is_mutual = flood.hears.contains(core.id);
        let is_echo =
            flood.heartbeat == core.durable.heartbeats.master && flaw::has(Flaw::CountsEchoes);
        let is_rise = flood.heartbeat > core.durable.heartbeats.master || is_echo;
        if is_rise && !core.is_master() && is_mutual {
            core.durable.heartbeats.master = flood.heartbeat;
            self.heartbeat_rose_at = now;
            core.find_master();
        }
        core.take_order(flood.sequence, flood.order.as_deref());
        let master = core.master();
        if flood
            .members
            .iter()
            .any(|it| it.landing && Some(it.id) == master)
        {
            core.hear_of_landing(flood.sequence);
        }
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
            self.leave_routes(core, now);
        }
        match self.durable.phase {
            Phase::Gossip | Phase::Scattered => {
                self.hear_members(core, now, sender, &flood.members);
            }
            Phase::Following => {
                if flood.parent == Some(core.id) {
                    self.become_relay(core);
                    self.hear_members(core, now, sender, &flood.members);
                } else if flood.parent.is_none() {
                    // It has no way: whoever hears it passes on what it says, and orders to it.
                    if flood.hops.is_none() {
                        self.become_relay(core);
                    }
                    self.hear_members(core, now, sender, &flood.members);
                }
                self.adopt_parent_late(core, now, sender, flood.hops);
            }
            Phase::HopUpdate { .. } if self.neighbours.is_stable(sender) => {
                // A neighbour that follows the mission already counts as heard again (thesis, table 7).
                self.adopt_parent_late(core, now, sender, flood.hops);
                self.heard_again.insert(sender);
                self.finish_once_all_heard(core, now);
            }
            Phase::Discovery { .. } | Phase::HopUpdate { .. } => {}
        }
    }

    fn hear_members(
        &mut self,
        core: &mut Core,
        now: Timestamp,
        sender: NodeId,
        members: &[Member],
    ) {
        let is_master = core.is_master();
        let master = core.durable.epoch.ballot().map(|ballot| ballot.master);
        let sequence = core.durable.epoch.sequence();
        let mut returned = NodeSet::default();
        let (mut acknowledged, mut landing) = (NodeSet::default(), NodeSet::default());
        for member in members {
            let is_another = member.id.0 < core.drones && Some(member.id) != master;
            if !is_another || member.id == core.id {
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
                core.show(Event::Reached {
                    member: member.id,
                    via: sender,
                    out_of_range: member.out_of_range,
                });
            }
        }
        if !returned.is_empty() {
            core.inform(Notice::Returned(returned));
        }
        if !acknowledged.is_empty() || !landing.is_empty() {
            core.inform(Notice::Progress {
                sequence,
                acknowledged,
                landing,
            });
        }
    }

    /// Whoever is named as a parent must relay, whatever its routing list said.
    fn become_relay(&mut self, core: &mut Core) {
        if !self.durable.routes.relay {
            self.durable.routes.relay = true;
            core.show(Event::Routes(self.durable.routes.clone()));
            core.keep();
        }
    }

    /// A drone that missed the hop update takes its parent from a neighbour that has routes.
    fn adopt_parent_late(
        &mut self,
        core: &mut Core,
        now: Timestamp,
        sender: NodeId,
        hops: Option<u16>,
    ) {
        if let (Some(hops), None) = (hops, self.durable.routes.hops)
            && self.neighbours.is_stable(sender)
        {
            self.take_parent(core, now, sender, hops, &[]);
            core.show(Event::Routes(self.durable.routes.clone()));
        }
    }
}
