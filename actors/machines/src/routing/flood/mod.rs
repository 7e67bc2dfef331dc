//! Policy `flood`, after the thesis (sections 4.2 and 4.4).
//!
//! Without routes each drone repeats all it knows. Neighbour discovery and hop update then give each drone a parent.
//! From then on only parents forward acknowledgements, and only the master and relays repeat orders.

mod durable;
mod exchange;
mod members;
mod neighbours;
mod routes;

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use bytes::Bytes;

pub use durable::{Checkpoint, Phase};

use self::members::Members;
use self::neighbours::Neighbours;
use super::{Durable, Event, Notice, Policy, PolicyCheckpoint, Routes, SharedState};
use crate::identity::{Ballot, NodeId, NodeSet};
use crate::leader::{BallotDecision, LinkSymmetry};
use crate::time::Timestamp;
use crate::wire::{self, Flood, Member, Packet};

/// Configuration of policy `flood`.
#[derive(Debug, Clone)]
pub struct Config {
    /// This drone.
    pub id: NodeId,
    /// Number of drones in the swarm; their ids are 0 to `drones - 1`.
    pub drones: u32,
    /// Send period.
    pub period: Duration,
    /// Send period of a drone that has been going to land for its time to live, under a master that goes to land, too:
    /// others no longer await it, and its neighbours know all it has to relay.
    pub keep_alive: Duration,
    /// Period of hellos during discovery.
    pub hello_period: Duration,
    /// Duration of discovery.
    pub discovery: Duration,
    /// Number of consecutive hellos that make a neighbour stable.
    pub stable_after: u32,
    /// Longest pause between two consecutive hellos.
    pub hello_gap: Duration,
    /// A drone that is silent for longer counts as lost; also the longest duration of hop update.
    pub time_to_live: Duration,
    /// Whether a master reports silent members before there are routes, too.
    pub monitors_before_routes: bool,
}

/// Dissemination by periodic repetition.
#[derive(Debug)]
pub(super) struct FloodPolicy {
    config: Config,
    durable: Checkpoint,
    neighbours: Neighbours,
    members: Members,
    /// Stable neighbours heard since hop update started.
    reheard: BTreeSet<NodeId>,
    /// When each neighbour was last heard.
    heard_at: BTreeMap<NodeId, Timestamp>,
    /// When the parent last reported that it hears this drone.
    parent_heard_at: Timestamp,
    heartbeat_rose_at: Timestamp,
    /// When this drone sends next; `None` before there is a leader.
    next_send: Option<Timestamp>,
    /// Members of the last frame: their memory is for the next one's.
    spare: Vec<Member>,
}

impl FloodPolicy {
    /// Resumes from `checkpoint`; starts empty if it is `None`.
    pub(super) fn new(
        config: Config,
        shared: &mut SharedState,
        now: Timestamp,
        checkpoint: Option<(Durable, Checkpoint)>,
    ) -> Self {
        let mut policy = Self {
            neighbours: Neighbours::new(config.stable_after, config.hello_gap),
            members: Members::default(),
            reheard: BTreeSet::new(),
            heard_at: BTreeMap::new(),
            parent_heard_at: now,
            heartbeat_rose_at: now,
            next_send: None,
            spare: Vec::new(),
            durable: Checkpoint::default(),
            config,
        };
        if let Some((common, own)) = checkpoint {
            policy.neighbours.restore(own.stable.iter().copied(), now);
            policy.durable = own;
            shared.resume(common);
            if shared.durable.epoch.ballot().is_some() && !shared.durable.stopped {
                policy.next_send = Some(now + shared.jitter(policy.config.period));
            }
            if shared.is_master() {
                policy.expect_members(shared, now);
            }
        }
        policy
    }

    /// On a master: restarts every member's time to live, including unknown ones. Members that were silent are
    /// returned: during discovery their reports could not arrive.
    fn expect_members(&mut self, shared: &mut SharedState, now: Timestamp) {
        let own = shared.id;
        let members = (0..shared.drones).map(NodeId).filter(|id| *id != own);
        let returned = self.members.expect(members, now);
        if !returned.is_empty() {
            shared.notify(Notice::Returned(returned));
        }
    }

    fn start_sending(&mut self, shared: &mut SharedState, now: Timestamp) {
        if self.next_send.is_none() {
            self.next_send = Some(now + shared.jitter(self.config.period));
        }
    }

    /// Whether a frame under `ballot` is processed. Adopts a better ballot, unless the link to its sender is one-way.
    fn accepts_ballot(
        &mut self,
        shared: &mut SharedState,
        now: Timestamp,
        ballot: Ballot,
        symmetry: LinkSymmetry,
    ) -> bool {
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

    fn drop_routes(&mut self, shared: &mut SharedState, now: Timestamp) {
        if self.durable.phase == Phase::Following {
            self.durable.phase = Phase::RoutesLost;
            self.durable.routes = Routes::default();
            if shared.is_master() {
                self.members.reset_timeouts(now);
            }
            shared.mark_changed();
        }
    }
}

impl Policy for FloodPolicy {
    fn receive(
        &mut self,
        shared: &mut SharedState,
        now: Timestamp,
        (sender, ballot): (NodeId, Ballot),
        payload: &Bytes,
    ) {
        let packet = wire::decode_packet_reusing(payload, std::mem::take(&mut self.spare)).ok();
        let Some(packet) = packet.filter(|_| sender.0 < shared.drones) else {
            shared.emit(Event::Ignored(sender));
            return;
        };
        self.heard_at.insert(sender, now);
        if let Packet::Flood(flood) = &packet {
            shared.record_hearing(sender, flood.hears.contains(shared.id));
        }
        let symmetry = match &packet {
            Packet::Flood(flood) if flood.hears.contains(shared.id) => LinkSymmetry::Symmetric,
            _ => LinkSymmetry::OneWay,
        };
        if symmetry == LinkSymmetry::Symmetric && self.durable.routes.parent == Some(sender) {
            self.parent_heard_at = now;
        }
        if !self.accepts_ballot(shared, now, ballot, symmetry) {
            shared.emit(Event::Ignored(sender));
            return;
        }
        if shared.durable.stopped {
            return;
        }
        match packet {
            Packet::Hello { remaining } => self.receive_hello(shared, now, sender, remaining),
            Packet::HopUpdate { hops, routing_list } => {
                self.receive_hop_update(shared, now, sender, hops, &routing_list);
            }
            Packet::Flood(flood) => {
                self.receive_flood(shared, now, sender, &flood);
                self.spare = flood.members;
            }
            Packet::Tree(_) | Packet::Message(_) => shared.emit(Event::Ignored(sender)),
        }
    }

    /// Forgets acknowledgements and routes of the epoch before. Until there are routes again, each drone repeats all it
    /// knows.
    fn start_epoch(&mut self, shared: &mut SharedState, now: Timestamp) {
        self.durable.phase = match self.durable.phase {
            Phase::Following | Phase::RoutesLost => Phase::RoutesLost,
            _ => Phase::Gossip,
        };
        self.durable.routes = Routes::default();
        self.members.forget_all();
        self.reheard.clear();
        self.heartbeat_rose_at = now;
        self.start_sending(shared, now);
    }

    fn lead(&mut self, shared: &mut SharedState, now: Timestamp, ballot: Ballot) {
        if ballot.is_elected() {
            self.expect_members(shared, now);
        }
    }

    // Changes are sent with the next periodic frame.
    fn order_published(&mut self, _shared: &mut SharedState, _now: Timestamp) {}

    fn order_carried_out(&mut self, _shared: &mut SharedState, _now: Timestamp) {}

    fn land(&mut self, _shared: &mut SharedState, _now: Timestamp) {}

    /// Starts discovery. Under an elected master some drones may have routes or be past the first waypoint, so the
    /// swarm goes on without routes.
    fn discover(&mut self, shared: &mut SharedState, now: Timestamp) {
        let ballot = shared.durable.epoch.ballot();
        if !ballot.is_some_and(|ballot| ballot.is_elected()) {
            return self.start_discovery(shared, now, self.config.discovery);
        }
        self.durable.phase = Phase::RoutesLost;
        self.expect_members(shared, now);
        self.notify_routes_ready(shared);
        shared.mark_changed();
    }

    fn topology_changes(&mut self, shared: &mut SharedState, now: Timestamp) {
        self.drop_routes(shared, now);
    }

    fn stop(&mut self, shared: &mut SharedState, now: Timestamp) {
        self.send_flood(shared, now);
        self.next_send = None;
    }

    fn resync(&mut self, shared: &mut SharedState, _now: Timestamp) {
        match self.durable.phase {
            Phase::Gossip | Phase::RoutesLost => {}
            Phase::Discovery { .. } => shared.notify(Notice::DiscoveryStarted),
            Phase::HopUpdate { .. } => shared.notify(Notice::HopUpdateStarted),
            Phase::Following => self.notify_routes_ready(shared),
        }
        let sequence = shared.sequence();
        let has_acknowledged = |it: &Member| it.acknowledged >= sequence;
        let silent: NodeSet = self.members.silent().collect();
        shared.notify(Notice::Progress {
            sequence,
            acknowledged: ids(self.members.iter().filter(has_acknowledged)),
            landing: ids(self.members.iter().filter(|it| it.landing)),
        });
        if !silent.is_empty() {
            shared.notify(Notice::Silent(silent));
        }
    }

    /// Also drops the sends that are overdue.
    fn reset_timeouts(&mut self, _shared: &mut SharedState, now: Timestamp) {
        self.heartbeat_rose_at = now;
        self.members.reset_timeouts(now);
        self.heard_at
            .values_mut()
            .for_each(|heard_at| *heard_at = now);
        self.parent_heard_at = now;
        self.next_send = self.next_send.map(|due| due.max(now));
        if let Phase::HopUpdate { since } = &mut self.durable.phase {
            *since = now;
        }
    }

    fn handle_timeout(&mut self, shared: &mut SharedState, now: Timestamp) {
        while let Some(due) = self.next_send.filter(|due| *due <= now) {
            self.next_send = self.send_due(shared, now, due);
        }
    }

    fn deadline(&self, _shared: &SharedState) -> Option<Timestamp> {
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
