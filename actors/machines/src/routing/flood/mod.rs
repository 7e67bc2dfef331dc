//! Policy `flood`, after the thesis (sections 4.2 and 4.4): before there are routes every drone repeats all it knows;
//! neighbour discovery and hop update then give each drone a parent, and from there on acknowledgements go up through
//! the parents only and orders are repeated by the master and those who must relay.

mod durable;
mod members;
mod neighbours;
mod speak;

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use bytes::Bytes;

pub use durable::{Checkpoint, Phase};

use self::members::Members;
use self::neighbours::Neighbours;
use super::packet::{Flood, Member, Packet};
use super::{Core, Durable, Event, Notice, Policy, PolicyCheckpoint, Routes};
use crate::identity::{Ballot, NodeId, NodeSet};
use crate::leader::{BallotDecision, LinkSymmetry};
use crate::time::Timestamp;
use crate::wire;

/// What it is built with.
#[derive(Debug, Clone)]
pub struct Config {
    /// Whose routing this is.
    pub id: NodeId,
    /// How many drones the swarm has; ids run from 0 to one below.
    pub drones: u32,
    /// How often a drone repeats what it knows.
    pub period: Duration,
    /// How often it does so once it has been going to land for its time to live: nobody waits for it any more, and
    /// whoever it relays to has been told.
    pub keep_alive: Duration,
    /// How often a drone says hello during discovery.
    pub hello_period: Duration,
    /// How long discovery lasts.
    pub discovery: Duration,
    /// How many hellos in a row make a neighbour stable.
    pub stable_after: u32,
    /// The longest pause between two hellos in a row.
    pub hello_gap: Duration,
    /// How long a drone may be silent before it is taken for lost, and the longest a hop update waits.
    pub time_to_live: Duration,
    /// Whether a master misses members before there are routes, too.
    pub misses_early: bool,
}

/// Dissemination by periodic repetition.
#[derive(Debug)]
pub(super) struct FloodPolicy {
    config: Config,
    durable: Checkpoint,
    neighbours: Neighbours,
    members: Members,
    /// Stable neighbours heard again since hop update began.
    heard_again: BTreeSet<NodeId>,
    /// When each neighbour was heard last.
    heard_at: BTreeMap<NodeId, Timestamp>,
    /// When the parent was last heard to hear this drone.
    parent_heard_at: Timestamp,
    heartbeat_rose_at: Timestamp,
    /// When this drone speaks next; `None` until it has something to say.
    next_send: Option<Timestamp>,
}

impl FloodPolicy {
    /// Goes on from what was `kept`; knows nothing without.
    pub(super) fn new(
        config: Config,
        core: &mut Core,
        now: Timestamp,
        kept: Option<(Durable, Checkpoint)>,
    ) -> Self {
        let mut policy = Self {
            neighbours: Neighbours::new(config.stable_after, config.hello_gap),
            members: Members::default(),
            heard_again: BTreeSet::new(),
            heard_at: BTreeMap::new(),
            parent_heard_at: now,
            heartbeat_rose_at: now,
            next_send: None,
            durable: Checkpoint::default(),
            config,
        };
        if let Some((common, own)) = kept {
            policy.neighbours.remember(own.stable.iter().copied(), now);
            policy.durable = own;
            core.resume(common);
            if core.durable.epoch.ballot().is_some() && !core.durable.stopped {
                policy.next_send = Some(now + core.jitter(policy.config.period));
            }
            if core.is_master() {
                policy.expect_members(core, now);
            }
        }
        policy
    }

    /// As master: gives every member its time to live, heard of or not. Who was silent is not any more: while ways were
    /// looked for it could not have been heard.
    fn expect_members(&mut self, core: &mut Core, now: Timestamp) {
        let own = core.id;
        let members = (0..core.drones).map(NodeId).filter(|id| *id != own);
        let returned = self.members.expect(members, now);
        if !returned.is_empty() {
            core.inform(Notice::Returned(returned));
        }
    }

    fn start_speaking(&mut self, core: &mut Core, now: Timestamp) {
        if self.next_send.is_none() {
            self.next_send = Some(now + core.jitter(self.config.period));
        }
    }

    /// Whether a frame under `ballot` is to be heard; turns to a better ballot than the one obeyed so far, unless the
    /// sender does not say that it hears this drone.
    fn follow(
        &mut self,
        core: &mut Core,
        now: Timestamp,
        ballot: Ballot,
        symmetry: LinkSymmetry,
    ) -> bool {
        match core.hear_ballot(ballot, symmetry) {
            BallotDecision::Ignored => return false,
            BallotDecision::Same => {}
            BallotDecision::Turned => {
                self.begin_epoch(core, now);
                core.inform(Notice::Leader(ballot));
            }
        }
        true
    }

    fn leave_routes(&mut self, core: &mut Core, now: Timestamp) {
        if self.durable.phase == Phase::Following {
            self.durable.phase = Phase::Scattered;
            self.durable.routes = Routes::default();
            if core.is_master() {
                self.members.forgive(now);
            }
            core.keep();
        }
    }
}

impl Policy for FloodPolicy {
    fn heard(
        &mut self,
        core: &mut Core,
        now: Timestamp,
        (sender, ballot): (NodeId, Ballot),
        payload: &Bytes,
    ) {
        let packet = wire::decode_packet(payload).ok();
        let Some(packet) = packet.filter(|_| sender.0 < core.drones) else {
            core.show(Event::Ignored(sender));
            return;
        };
        self.heard_at.insert(sender, now);
        let symmetry = match &packet {
            Packet::Flood(flood) if flood.hears.contains(core.id) => LinkSymmetry::Mutual,
            _ => LinkSymmetry::OneWay,
        };
        if symmetry == LinkSymmetry::Mutual && self.durable.routes.parent == Some(sender) {
            self.parent_heard_at = now;
        }
        if !self.follow(core, now, ballot, symmetry) {
            core.show(Event::Ignored(sender));
            return;
        }
        if core.durable.stopped {
            return;
        }
        match packet {
            Packet::Hello { remaining } => self.heard_hello(core, now, sender, remaining),
            Packet::HopUpdate { hops, routing_list } => {
                self.heard_hop_update(core, now, sender, hops, &routing_list);
            }
            Packet::Flood(flood) => self.heard_flood(core, now, sender, &flood),
            Packet::Tree(_) => core.show(Event::Ignored(sender)),
        }
    }

    /// Acknowledgements and routes were those of the epoch before; until there are routes again, everyone repeats
    /// everything.
    fn begin_epoch(&mut self, core: &mut Core, now: Timestamp) {
        self.durable.phase = match self.durable.phase {
            Phase::Following | Phase::Scattered => Phase::Scattered,
            _ => Phase::Gossip,
        };
        self.durable.routes = Routes::default();
        self.members.forget_all();
        self.heard_again.clear();
        self.heartbeat_rose_at = now;
        self.start_speaking(core, now);
    }

    fn lead(&mut self, core: &mut Core, now: Timestamp, ballot: Ballot) {
        if ballot.is_elected() {
            self.expect_members(core, now);
        }
    }

    // What is new is said at the next turn, as everything is.
    fn published(&mut self, _core: &mut Core, _now: Timestamp) {}

    fn carried_out(&mut self, _core: &mut Core, _now: Timestamp) {}

    fn land(&mut self, _core: &mut Core, _now: Timestamp) {}

    /// Starts discovery. Of those that obey an elected master some may have routes already, and some may be past the first
    /// waypoint; there everyone goes on repeating everything.
    fn discover(&mut self, core: &mut Core, now: Timestamp) {
        let ballot = core.durable.epoch.ballot();
        if !ballot.is_some_and(|ballot| ballot.is_elected()) {
            return self.start_discovery(core, now, self.config.discovery);
        }
        self.durable.phase = Phase::Scattered;
        self.expect_members(core, now);
        self.inform_of_routes(core);
        core.keep();
    }

    fn scatter(&mut self, core: &mut Core, now: Timestamp) {
        self.leave_routes(core, now);
    }

    fn stop(&mut self, core: &mut Core, now: Timestamp) {
        self.send_flood(core, now);
        self.next_send = None;
    }

    fn resync(&mut self, core: &mut Core, _now: Timestamp) {
        match self.durable.phase {
            Phase::Gossip | Phase::Scattered => {}
            Phase::Discovery { .. } => core.inform(Notice::DiscoveryStarted),
            Phase::HopUpdate { .. } => core.inform(Notice::HopUpdateStarted),
            Phase::Following => self.inform_of_routes(core),
        }
        let sequence = core.sequence();
        let has_acknowledged = |it: &Member| it.acknowledged >= sequence;
        let silent: NodeSet = self.members.silent().collect();
        core.inform(Notice::Progress {
            sequence,
            acknowledged: ids(self.members.iter().filter(has_acknowledged)),
            landing: ids(self.members.iter().filter(|it| it.landing)),
        });
        if !silent.is_empty() {
            core.inform(Notice::Silent(silent));
        }
    }

    /// What would have been said meanwhile is out of date.
    fn forgive(&mut self, _core: &mut Core, now: Timestamp) {
        self.heartbeat_rose_at = now;
        self.members.forgive(now);
        self.heard_at
            .values_mut()
            .for_each(|heard_at| *heard_at = now);
        self.parent_heard_at = now;
        self.next_send = self.next_send.map(|due| due.max(now));
        if let Phase::HopUpdate { since } = &mut self.durable.phase {
            *since = now;
        }
    }

    fn handle_timeout(&mut self, core: &mut Core, now: Timestamp) {
        while let Some(due) = self.next_send.filter(|due| *due <= now) {
            self.next_send = self.speak(core, now, due);
        }
    }

    fn deadline(&self, _core: &Core) -> Option<Timestamp> {
        self.next_send
    }

    fn checkpoint(&self) -> PolicyCheckpoint {
        PolicyCheckpoint::Flood(Checkpoint {
            stable: self.neighbours.stable().collect(),
            ..self.durable.clone()
        })
    }

    fn occupancy(&self) -> (usize, usize) {
        (
            self.members.len().max(self.heard_at.len()),
            self.config.drones as usize,
        )
    }
}

fn ids(members: impl Iterator<Item = Member>) -> NodeSet {
    members.map(|member| member.id).collect()
}

#[cfg(test)]
mod tests;
