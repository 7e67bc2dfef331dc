//! Policy `flood`, after the thesis (sections 4.2 and 4.4): before there are routes every drone repeats all it knows;
//! neighbour discovery and hop update then give each drone a parent, and from there on acknowledgements go up through
//! the parents only and orders are repeated by the master and those who must relay.

mod durable;
mod members;
mod neighbours;
mod speak;

use std::collections::{BTreeMap, BTreeSet};
use std::convert::Infallible;
use std::time::Duration;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

pub use durable::{Checkpoint, Phase};

use self::members::Members;
use self::neighbours::Neighbours;
use super::packet::{Flood, Member, Packet};
use super::{Event, Input, Notice, Routes, Transmit};
use crate::identity::{Ballot, NodeId, NodeSet};
use crate::machine::{Machine, Outbox, Output};
use crate::reign::{Verdict, Way};
use crate::stall::Punctuality;
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

/// The routing of one drone, by periodic repetition.
#[derive(Debug)]
pub struct FloodRouting {
    config: Config,
    rng: ChaCha8Rng,
    durable: Checkpoint,
    neighbours: Neighbours,
    members: Members,
    /// Stable neighbours heard again since hop update began.
    heard_again: BTreeSet<NodeId>,
    /// When each neighbour was heard last.
    heard_at: BTreeMap<NodeId, Timestamp>,
    /// When the parent was last heard to hear this drone.
    parent_heard_at: Timestamp,
    pulse_rose_at: Timestamp,
    master_silent: bool,
    /// Whether the master says that it is going to land.
    master_lands: bool,
    /// When this drone speaks next; `None` until it has something to say.
    next_send: Option<Timestamp>,
    punctuality: Punctuality,
    outbox: Outbox<Transmit, Event>,
}

impl FloodRouting {
    /// A routing as `checkpoint` left it; a default one knows nothing.
    #[must_use]
    pub fn new(config: Config, seed: u64, now: Timestamp, checkpoint: Option<Checkpoint>) -> Self {
        let mut routing = Self {
            rng: ChaCha8Rng::seed_from_u64(seed),
            neighbours: Neighbours::new(config.stable_after, config.hello_gap),
            members: Members::default(),
            heard_again: BTreeSet::new(),
            heard_at: BTreeMap::new(),
            parent_heard_at: now,
            pulse_rose_at: now,
            master_silent: false,
            master_lands: false,
            next_send: None,
            punctuality: Punctuality::default(),
            durable: Checkpoint::default(),
            outbox: Outbox::new(),
            config,
        };
        if let Some(checkpoint) = checkpoint {
            routing.resume(now, checkpoint);
        }
        routing
    }

    /// Entries in the larger of its tables, and the most either takes.
    #[must_use]
    pub fn occupancy(&self) -> (usize, usize) {
        (
            self.members.len().max(self.heard_at.len()),
            self.config.drones as usize,
        )
    }

    fn resume(&mut self, now: Timestamp, checkpoint: Checkpoint) {
        self.neighbours
            .remember(checkpoint.stable.iter().copied(), now);
        self.durable = checkpoint;
        self.durable.beats.skip_reserved(self.is_master());
        if self.durable.reign.ballot().is_some() && self.durable.phase != Phase::Stopped {
            self.next_send = Some(now + self.phase_in(self.config.period));
        }
        if self.is_master() {
            self.expect_members(now);
        }
        self.outbox.transmit(Transmit::Inform(Notice::Resync));
        self.checkpoint();
    }

    /// As master: gives every member its time to live, heard of or not. Who was silent is not any more: while ways were
    /// looked for it could not have been heard.
    fn expect_members(&mut self, now: Timestamp) {
        let own = self.config.id;
        let members = (0..self.config.drones).map(NodeId).filter(|id| *id != own);
        let returned = self.members.expect(members, now);
        if !returned.is_empty() {
            self.inform(Notice::Returned(returned));
        }
    }

    fn is_master(&self) -> bool {
        self.durable.reign.is_led_by(self.config.id)
    }

    fn is_member(&self, id: NodeId) -> bool {
        id.0 < self.config.drones
    }

    /// A random part of a period: drones do not speak in step.
    fn phase_in(&mut self, period: Duration) -> Duration {
        let nanos = u64::try_from(period.as_nanos()).unwrap_or(u64::MAX);
        Duration::from_nanos(self.rng.random_range(0..nanos.max(1)))
    }

    fn inform(&mut self, notice: Notice) {
        self.outbox.transmit(Transmit::Inform(notice));
    }

    fn checkpoint(&mut self) {
        self.durable.stable = self.neighbours.stable().collect();
        let checkpoint = super::Checkpoint::Flood(self.durable.clone());
        self.outbox.event(Event::Checkpoint(Box::new(checkpoint)));
    }

    fn start_speaking(&mut self, now: Timestamp) {
        if self.next_send.is_none() {
            self.next_send = Some(now + self.phase_in(self.config.period));
        }
    }

    fn heard(&mut self, now: Timestamp, sender: NodeId, ballot: Ballot, payload: &[u8]) {
        let Ok(packet) = wire::decode_packet(payload) else {
            self.outbox.event(Event::Ignored(sender));
            return;
        };
        if !self.is_member(sender) {
            self.outbox.event(Event::Ignored(sender));
            return;
        }
        self.heard_at.insert(sender, now);
        let way = match &packet {
            Packet::Flood(flood) if flood.hears.contains(self.config.id) => Way::Mutual,
            _ => Way::OneWay,
        };
        if way == Way::Mutual && self.durable.routes.parent == Some(sender) {
            self.parent_heard_at = now;
        }
        if !self.follow(now, ballot, way) {
            self.outbox.event(Event::Ignored(sender));
            return;
        }
        match packet {
            Packet::Hello { remaining } => self.heard_hello(now, sender, remaining),
            Packet::HopUpdate { hops, routing_list } => {
                self.heard_hop_update(now, sender, hops, &routing_list);
            }
            Packet::Flood(flood) => self.heard_flood(now, sender, flood),
            Packet::Tree(_) => self.outbox.event(Event::Ignored(sender)),
        }
    }

    /// Whether a frame under `ballot` is to be heard; turns to a better ballot than the one obeyed so far, unless the
    /// sender does not say that it hears this drone.
    fn follow(&mut self, now: Timestamp, ballot: Ballot, way: Way) -> bool {
        match self.durable.reign.hear(ballot, way) {
            Verdict::Ignored => return false,
            Verdict::Same => {}
            Verdict::Turned => {
                self.begin_reign(now);
                self.inform(Notice::Reign(ballot));
            }
        }
        true
    }

    /// Another ballot is obeyed than before. Acknowledgements and routes were those of the reign before; until there are
    /// routes again, everyone repeats everything.
    fn begin_reign(&mut self, now: Timestamp) {
        self.durable.phase = match self.durable.phase {
            Phase::Following | Phase::Scattered => Phase::Scattered,
            Phase::Stopped => Phase::Stopped,
            _ => Phase::Gossip,
        };
        self.durable.routes = Routes::default();
        self.durable.beats = self.durable.beats.under_another_master();
        self.members.forget_all();
        self.heard_again.clear();
        self.master_silent = false;
        self.master_lands = false;
        self.pulse_rose_at = now;
        self.start_speaking(now);
        self.checkpoint();
    }

    /// By the protocol; nothing if a better ballot has been heard of meanwhile, of which the protocol is being told.
    fn lead(&mut self, now: Timestamp, ballot: Ballot) {
        match self.durable.reign.hear(ballot, Way::Mutual) {
            Verdict::Ignored => return,
            Verdict::Same => {}
            Verdict::Turned => self.begin_reign(now),
        }
        if ballot.is_elected() {
            self.expect_members(now);
        }
    }

    fn scatter(&mut self, now: Timestamp) {
        if self.durable.phase == Phase::Following {
            self.durable.phase = Phase::Scattered;
            self.durable.routes = Routes::default();
            if self.is_master() {
                self.members.forgive(now);
            }
            self.checkpoint();
        }
    }

    fn resync(&mut self) {
        for notice in self.durable.reign.clone().notices() {
            self.inform(notice);
        }
        match self.durable.phase {
            Phase::Gossip | Phase::Scattered | Phase::Stopped => {}
            Phase::Discovery { .. } => self.inform(Notice::DiscoveryStarted),
            Phase::HopUpdate { .. } => self.inform(Notice::HopUpdateStarted),
            Phase::Following => self.inform_of_routes(),
        }
        let sequence = self.durable.reign.sequence();
        let has_acknowledged = |it: &Member| it.acknowledged >= sequence;
        let silent: NodeSet = self.members.silent().collect();
        self.inform(Notice::Progress {
            sequence,
            acknowledged: ids(self.members.iter().filter(has_acknowledged)),
            landing: ids(self.members.iter().filter(|it| it.landing)),
        });
        if !silent.is_empty() {
            self.inform(Notice::Silent(silent));
        }
        if self.master_silent {
            self.inform(Notice::MasterSilent);
        }
        if self.master_lands {
            self.inform(Notice::MasterLands);
        }
    }

    /// The host stood still: that nobody was heard meanwhile says nothing about anybody, and what would have been said
    /// is out of date.
    fn forgive_if_stalled(&mut self, now: Timestamp) {
        if self.punctuality.stalled_for(now).is_none() {
            return;
        }
        self.pulse_rose_at = now;
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
}

fn ids(members: impl Iterator<Item = Member>) -> NodeSet {
    members.map(|member| member.id).collect()
}

impl Machine for FloodRouting {
    type Input = Input;
    type Transmit = Transmit;
    type Event = Event;
    type Rejection = Infallible;

    fn handle_input(&mut self, now: Timestamp, input: Input) -> Result<(), Infallible> {
        self.forgive_if_stalled(now);
        match input {
            Input::Heard {
                sender,
                ballot,
                payload,
            } => self.heard(now, sender, ballot, &payload),
            Input::Lead(ballot) => self.lead(now, ballot),
            Input::Publish {
                ballot,
                sequence,
                order,
            } => {
                let own = self.config.id;
                if self.durable.reign.publish(own, ballot, sequence, order) {
                    self.checkpoint();
                }
            }
            Input::Acknowledge { ballot, sequence } => {
                if self.durable.reign.acknowledge(ballot, sequence) {
                    self.checkpoint();
                }
            }
            // What is not heard of is said again in any case, each period.
            Input::Outcome { .. } => {}
            Input::Discover => self.discover(now),
            Input::Land => {
                self.durable.landing.get_or_insert(now);
                self.checkpoint();
            }
            Input::Scatter => self.scatter(now),
            Input::Stop => self.stop(now),
            Input::Resync => self.resync(),
        }
        self.punctuality.ask(now, self.next_send);
        Ok(())
    }

    fn handle_timeout(&mut self, now: Timestamp) {
        self.forgive_if_stalled(now);
        while let Some(due) = self.next_send.filter(|due| *due <= now) {
            self.next_send = self.speak(now, due);
        }
        self.punctuality.ask(now, self.next_send);
    }

    fn poll_output(&mut self) -> Output<Transmit, Event> {
        self.outbox.poll(self.next_send)
    }
}

#[cfg(test)]
mod tests;
