//! Policy `tree`: what has changed is said at once, to whoever must know it, and said again until it is seen to have
//! arrived.
//!
//! Each drone keeps what its neighbours last said and takes the one nearest to the master for its parent. An order
//! goes outwards from parent to child; acknowledgements come inwards, merged: a drone speaks once all below it have
//! carried the order out. What one neighbour alone has yet to learn is said to that one, and the medium may tell what
//! became of it; besides, hearing a neighbour say what it was to learn is the acknowledgement of a hop. Whatever is not
//! known to have arrived in time is said again, at that hop only. With each beacon, once a second say, the master's own
//! number goes outwards, each drone passing it on as it comes in; that one frame serves discovery, liveness and routing.
//! Where beacons are quicker than ten a second, whoever is nobody's parent passes on only as many as that.

mod durable;
mod links;
mod members;
mod seek;
mod speak;

use std::convert::Infallible;
use std::hint::black_box;
use std::time::Duration;

use bytes::Bytes;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

pub use durable::Checkpoint;

use self::links::{Heard, Link, Links, Speaker};
use self::members::Members;
use self::seek::Seek;
use super::packet::{Packet, Tree};
use super::{Event, Input, Notice, Routes, Transmit};
use crate::flaw::{self, Flaw};
use crate::identity::{Ballot, NodeId, NodeSet};
use crate::machine::{Machine, Outbox, Output};
use crate::reign::{Verdict, Way};
use crate::stall::Punctuality;
use crate::time::Timestamp;
use crate::wire::{self, TreeFrame};

/// What it is built with.
#[derive(Debug, Clone)]
pub struct Config {
    /// Whose routing this is.
    pub id: NodeId,
    /// How many drones the swarm has; ids run from 0 to one below.
    pub drones: u32,
    /// How many pure relays there are besides, whose ids follow: they pass on and are not awaited, and their protocol
    /// is told nothing.
    pub relays: u32,
    /// How often the master's number goes out.
    pub beacon: Duration,
    /// How long a drone waits to hear what it said come back before it says it again; grows by half with each time.
    pub repair: Duration,
    /// The longest such wait.
    pub repair_max: Duration,
    /// How long a neighbour may be silent before its link is taken for lost.
    pub link_time_to_live: Duration,
    /// How long a member may be without a way to this drone before it is taken for lost.
    pub time_to_live: Duration,
    /// How long a drone may be without a way to the master before that is taken for lost.
    pub patience: Duration,
}

/// From this share of missed frames on a leaf is not trusted to have heard what was said to all.
const CONFIRM_ABOVE_LOSS: f64 = 0.005;

/// The routing of one drone, along a tree.
#[derive(Debug)]
pub struct TreeRouting {
    config: Config,
    rng: Box<ChaCha8Rng>,
    durable: Checkpoint,
    links: Links,
    routes: Routes,
    /// The parent, as long as nothing but its silence speaks against it and it was not stale when it was chosen.
    good_parent: Option<GoodParent>,
    /// When the way to the master was lost, and how far its number was by then.
    orphaned: Option<(Timestamp, u32)>,
    master_silent: bool,
    /// Whether the master says that it is going to land.
    master_lands: bool,
    /// As master: who is alive, and who is missed.
    members: Members,
    /// What the protocol has been told of the members' acknowledgements: of which order, and who.
    told: (u32, NodeSet),
    told_landing: NodeSet,
    /// What was last heard to be pending, and of which order.
    pending: (u32, NodeSet),
    /// The neighbour that said so last, and has said nothing else since.
    pending_from: Option<NodeId>,
    /// From which id on the next frame tells of others, where not all fit one.
    next_span: u32,
    /// How many frames it has said to one drone alone since it last spoke to all.
    aside: u32,
    /// The order that this drone's last frame told that it knows of.
    said_sequence: u32,
    /// Each how many of the master's numbers a drone passes on that is nobody's parent.
    numbers_a_turn: u32,
    /// The master's number that this drone passed on last.
    passed_on: u32,
    next_beacon: Option<Timestamp>,
    /// When this drone last acknowledged anything by itself.
    acknowledged_at: Option<Timestamp>,
    repair: Option<Repair>,
    /// Whether the parent lives is being found out.
    seek: Option<Seek>,
    /// Until when acknowledgements wait for those still missing below, and of which order.
    hold: Option<Hold>,
    /// When it wants to act next, as of the end of its last step.
    wakes: Option<Timestamp>,
    punctuality: Punctuality,
    outbox: Outbox<Transmit, Event>,
}

/// A parent that there is no reason to leave, so that its link need not be looked at each time.
#[derive(Debug, Clone, Copy)]
struct GoodParent {
    /// How far it is from the master.
    hops: u16,
    /// From when on it is stale, unless it is heard.
    stale_at: Timestamp,
}

/// Something that was said and has not been seen to arrive.
#[derive(Debug, Clone, Copy)]
struct Repair {
    since: Timestamp,
    due: Timestamp,
    pause: Duration,
    tries: u32,
}

/// Acknowledgements of an order that wait to be merged with those still missing.
#[derive(Debug, Clone, Copy)]
struct Hold {
    sequence: u32,
    until: Timestamp,
    is_over: bool,
}

impl TreeRouting {
    /// A routing as `checkpoint` left it; one without knows nothing.
    #[must_use]
    pub fn new(config: Config, seed: u64, now: Timestamp, checkpoint: Option<Checkpoint>) -> Self {
        let mut routing = Self {
            rng: Box::new(ChaCha8Rng::seed_from_u64(seed)),
            durable: Checkpoint::default(),
            links: Links::new(config.id, config.drones, config.beacon, config.pace()),
            routes: Routes::default(),
            good_parent: None,
            orphaned: None,
            master_silent: false,
            master_lands: false,
            members: Members::default(),
            told: (0, NodeSet::default()),
            told_landing: NodeSet::default(),
            pending: (0, NodeSet::default()),
            pending_from: None,
            next_span: 0,
            aside: 0,
            said_sequence: 0,
            numbers_a_turn: config.numbers_a_turn(),
            passed_on: 0,
            next_beacon: None,
            acknowledged_at: None,
            repair: None,
            seek: None,
            hold: None,
            wakes: None,
            punctuality: Punctuality::default(),
            outbox: Outbox::new(),
            config,
        };
        if let Some(checkpoint) = checkpoint {
            routing.durable = checkpoint;
            let is_master = routing.is_master();
            routing.durable.beats.skip_reserved(is_master);
            routing.inform(Notice::Resync);
            if routing.durable.reign.ballot().is_some() && !routing.durable.stopped {
                routing.next_beacon = Some(now);
            }
            routing.update_routes(now);
            if routing.durable.discovered {
                routing.expect_members(now);
            }
            routing.checkpoint();
        }
        routing
    }

    /// Entries in its table of links, and the most that it takes.
    #[must_use]
    pub fn occupancy(&self) -> (usize, usize) {
        let nodes = self.config.drones + self.config.relays;
        (self.links.len(), nodes as usize)
    }

    /// As [`Cell::read_ahead`](crate::cell::Cell::read_ahead) says.
    pub(super) fn read_ahead(&self) {
        black_box((self.durable.reign.sequence(), self.durable.beats.pulse));
        black_box((self.config.id, self.config.beacon, self.routes.parent));
        black_box((self.good_parent, self.master_lands, self.pending_from));
        black_box((self.next_beacon, self.wakes, self.outbox.is_empty()));
        black_box((
            self.repair.is_some(),
            self.hold.is_some(),
            self.seek.is_some(),
        ));
        black_box((
            self.links.len(),
            self.pending.0,
            self.told.0,
            self.passed_on,
        ));
    }

    /// As [`Cell::read_further_ahead`](crate::cell::Cell::read_further_ahead) says.
    pub(super) fn read_further_ahead(&self, sender: Option<NodeId>) {
        self.links.read_further_ahead(sender);
    }

    fn is_master(&self) -> bool {
        self.durable.reign.is_led_by(self.config.id)
    }

    /// Whether this is a pure relay.
    const fn is_relay(&self) -> bool {
        self.config.id.0 >= self.config.drones
    }

    fn inform(&mut self, notice: Notice) {
        if !self.is_relay() {
            self.outbox.transmit(Transmit::Inform(notice));
        }
    }

    fn checkpoint(&mut self) {
        let checkpoint = super::Checkpoint::Tree(self.durable.clone());
        self.outbox.event(Event::Checkpoint(Box::new(checkpoint)));
    }

    fn heard(&mut self, now: Timestamp, sender: NodeId, ballot: Ballot, payload: &Bytes) {
        let Ok((front, words)) = wire::split_tree(payload) else {
            self.outbox.event(Event::Ignored(sender));
            return;
        };
        let is_obeyed = self.durable.reign.ballot() == Some(ballot) && !self.durable.stopped;
        if is_obeyed && self.links.has_said(self.speaker(sender), &front, words) {
            // As is the rule: nothing is news but that the sender lives, and the master.
            if let Some(heard) = self.links.hear_again(sender, &front, now) {
                self.take_in(now, sender, heard, false, || TreeFrame::read(front, words));
            }
            return;
        }
        let is_member = sender.0 < self.config.drones + self.config.relays;
        let Some(said) = TreeFrame::read(front, words) else {
            self.outbox.event(Event::Ignored(sender));
            return;
        };
        if !is_member || self.durable.stopped || !self.obeys(now, sender, ballot, &said) {
            if is_member {
                self.links.hear_of_another_reign(sender, &said, now);
                self.look_at_parent_again();
            }
            self.outbox.event(Event::Ignored(sender));
            return;
        }
        let (speaker, words) = (self.speaker(sender), payload.slice_ref(words));
        if let Some(heard) = self.links.hear(speaker, &said, words, now) {
            self.pending_from = self.pending_from.filter(|from| *from != sender);
            let news = self.take_order(said.sequence, said.order);
            self.take_in(now, sender, heard, news, || Some(said));
        }
    }

    /// A drone as this one knows it.
    fn speaker(&self, id: NodeId) -> Speaker {
        Speaker {
            id,
            is_parent: self.routes.parent == Some(id),
            master: self.durable.reign.ballot().map(|ballot| ballot.master),
        }
    }

    /// Whether a frame under `ballot` is to be heard; turns to a better ballot than the one obeyed so far.
    /// What comes over a link that carries one way only makes nobody turn.
    fn obeys(
        &mut self,
        now: Timestamp,
        sender: NodeId,
        ballot: Ballot,
        said: &TreeFrame<'_>,
    ) -> bool {
        let is_symmetric = self.links.is_symmetric(sender, said);
        let stays = self.is_master() && flaw::has(Flaw::NeverStepsDown);
        let way = if is_symmetric && !stays {
            Way::Mutual
        } else {
            Way::OneWay
        };
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

    /// Another ballot is obeyed than before: acknowledgements, ways and the master's number were those of the reign
    /// before. Who is near, and how well each is heard, is still known.
    fn begin_reign(&mut self, now: Timestamp) {
        self.durable.beats = self.durable.beats.under_another_master();
        self.links.forget_reign();
        self.routes = Routes::default();
        self.good_parent = None;
        self.orphaned = None;
        self.master_silent = false;
        self.master_lands = false;
        self.members = Members::default();
        self.told = (0, NodeSet::default());
        self.told_landing = NodeSet::default();
        self.pending = (0, NodeSet::default());
        self.pending_from = None;
        self.said_sequence = 0;
        self.passed_on = 0;
        self.repair = None;
        self.seek = None;
        self.hold = None;
        self.next_beacon.get_or_insert(now + self.config.beacon);
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
        self.update_routes(now);
        self.next_beacon = Some(now);
    }

    /// Acts on what a neighbour said, which its link keeps by now, and on whether that brought a newer order; all of it can
    /// be had once more.
    fn take_in<'a>(
        &mut self,
        now: Timestamp,
        sender: NodeId,
        heard: Heard,
        news: bool,
        all: impl FnOnce() -> Option<TreeFrame<'a>>,
    ) {
        let Some(link) = self.links.get(sender) else {
            return;
        };
        let (sequence, pulse) = (link.said.sequence, link.said.pulse);
        let master_lands = link.said.master_lands;
        if heard.is_new || link.needs_to_hear() {
            // It learns that it is heard.
            self.beacon_soon(now);
        }
        self.hear_of_landing(sequence, master_lands);
        if self.routes.parent == Some(sender) {
            self.look_at_parent_again();
        }
        if heard.has_moved || !self.keeps_its_way(now, sender) {
            self.update_routes(now);
        }
        self.take_pulse(now, sender, pulse);
        self.report_members(now);
        let is_of_parents_order =
            self.routes.parent == Some(sender) && sequence == self.durable.reign.sequence();
        if is_of_parents_order
            && self.pending_from != Some(sender)
            && let Some(all) = all()
        {
            self.pending = (sequence, self.pending_as_said(&all));
            self.pending_from = Some(sender);
        }
        self.answer(now, sender, heard, news);
    }

    /// Who is pending as the parent says it: whoever it does not tell of is as far as is known.
    fn pending_as_said(&self, said: &TreeFrame<'_>) -> NodeSet {
        let mut pending = said.pending.to_set();
        pending.truncate(self.config.drones);
        if self.pending.0 == said.sequence {
            said.and_before(pending, &self.pending.1)
        } else {
            said.and_before(pending, &NodeSet::from(0..self.config.drones))
        }
    }

    /// Takes in an order; whether it is news.
    fn take_order(&mut self, sequence: u32, order: Option<&[u8]>) -> bool {
        let order = order.filter(|_| sequence > self.durable.reign.sequence());
        let order = order.map(Bytes::copy_from_slice);
        let own = self.config.id;
        let is_news =
            order.is_some_and(|order| self.durable.reign.hear_order(own, sequence, order));
        if is_news {
            self.repair = None;
            if let Some(notice) = self.durable.reign.newest_order() {
                self.inform(notice);
            }
            self.links.begin_order();
            self.checkpoint();
        }
        is_news
    }

    /// Takes in that the master is going to land. A master that takes the swarm down with it says so in its last order;
    /// so only whoever knows that order can tell.
    fn hear_of_landing(&mut self, sequence: u32, master_lands: bool) {
        let is_known = sequence <= self.durable.reign.sequence();
        if master_lands && is_known && !self.master_lands && !self.is_master() {
            self.master_lands = true;
            self.inform(Notice::MasterLands);
        }
    }

    /// A number of the master's own that has risen goes on outwards at once.
    fn take_pulse(&mut self, now: Timestamp, sender: NodeId, pulse: u32) {
        if self.is_master() {
            return;
        }
        if pulse <= self.durable.beats.pulse {
            return self.tell_if_behind(now, pulse);
        }
        self.durable.beats.pulse = pulse;
        let is_by_parent = self.routes.parent == Some(sender);
        if is_by_parent && self.is_its_turn() && !self.is_settled_to_land(now) {
            self.beacon_soon(now);
        }
    }

    /// Brings the next beacon forward.
    fn beacon_soon(&mut self, now: Timestamp) {
        let soon = now + self.jitter(speak::SPREAD);
        self.next_beacon = self.next_beacon.map(|due| due.min(soon));
    }

    /// Chooses the parent anew: the symmetric neighbour nearest to the master, then the one with the least loss; the
    /// one it has unless another is nearer. It takes only a drone that has heard more of the master since or, unless the
    /// parent that it has is lost or stale, one that has heard as much and is nearer to the master than itself: the way of
    /// neither can be through this one, so that no ring of drones follows itself. Nor does it take one that leaves it out of
    /// those that it hears, though it may only have restarted: the parent that it has it keeps for a beacon then.
    fn update_routes(&mut self, now: Timestamp) {
        let routes = self.best_routes(now);
        if !self.is_master() {
            match routes.parent {
                Some(_) => self.found_master(),
                None => {
                    let pulse = self.durable.beats.pulse;
                    self.orphaned.get_or_insert((now, pulse));
                }
            }
        }
        if routes != self.routes {
            let way_changed =
                routes.hops != self.routes.hops || routes.parent != self.routes.parent;
            self.routes = routes;
            self.outbox.event(Event::Routes(self.routes.clone()));
            if way_changed && !self.is_settled_to_land(now) {
                self.beacon_soon(now);
            }
        }
        let is_good = |it: &GoodParent| now <= it.stale_at;
        self.good_parent = self.look_at_parent().filter(is_good);
    }

    /// The parent, unless something speaks against it, or it is out of reach.
    fn look_at_parent(&self) -> Option<GoodParent> {
        let link = self.links.get(self.routes.parent?)?;
        let is_sound =
            link.symmetric && link.is_reachable() && link.said.parent != Some(self.config.id);
        Some(GoodParent {
            hops: link.said.hops.filter(|_| is_sound)?,
            stale_at: link.stale_at(self.config.beacon),
        })
    }

    /// Something about the parent's link has changed, and its way has not.
    fn look_at_parent_again(&mut self) {
        if self.good_parent.is_some() {
            self.good_parent = self.look_at_parent();
        }
    }

    /// Whether a neighbour that has just spoken, whose own way is what it was, leaves this drone's as it is: it is the
    /// parent or no nearer to the master than that, and the parent is as good as when it was chosen. A neighbour that is
    /// better by now without having spoken is taken when it speaks next.
    fn keeps_its_way(&self, now: Timestamp, sender: NodeId) -> bool {
        let hops = self.links.get(sender).and_then(|link| link.said.hops);
        self.good_parent.is_some_and(|parent| {
            let is_nearer = hops.is_some_and(|hops| hops < parent.hops);
            now <= parent.stale_at && (self.routes.parent == Some(sender) || !is_nearer)
        })
    }

    fn best_routes(&self, now: Timestamp) -> Routes {
        let own = self.config.id;
        let is_master = self.is_master();
        let mut routes = Routes {
            relay: self.links.children().next().is_some(),
            ..Routes::default()
        };
        if is_master {
            routes.hops = Some(0);
        } else {
            let parent = self.routes.parent;
            let suspected = parent.filter(|parent| {
                let link = self.links.get(*parent);
                link.is_some_and(|link| !link.is_reachable())
            });
            let stale = parent.filter(|parent| {
                let link = self.links.get(*parent);
                link.is_some_and(|link| link.is_stale(now, self.config.beacon))
            });
            let own_pulse = self.durable.beats.pulse;
            let has_newer_pulse = |link: &Link, pulse: u32| {
                link.said.pulse > pulse || link.said.pulse == pulse && flaw::has(Flaw::CountsEchoes)
            };
            // Whoever has heard as much of the master and is nearer to it: its way can't be through this drone.
            let is_nearer =
                |link: &Link| link.said.pulse == own_pulse && link.said.hops < self.routes.hops;
            let is_elsewhere = |id: NodeId, link: &Link| match (self.orphaned, stale) {
                (Some((_, pulse)), _) => has_newer_pulse(link, pulse),
                (None, Some(_)) => has_newer_pulse(link, own_pulse),
                (None, None) => {
                    parent == Some(id) || has_newer_pulse(link, own_pulse) || is_nearer(link)
                }
            };
            let left = suspected.or(stale);
            // Where beacons are quick, most are left out for a moment under a new master, as few have spoken.
            let is_left_out_by = |link: &Link| link.leaves_out() && !self.are_beacons_quick();
            let usable = |link: &&Link| {
                link.symmetric
                    && (parent == Some(link.id) || !is_left_out_by(link))
                    && link.is_reachable()
                    && link.said.hops.is_some()
                    && link.said.parent != Some(own)
                    && Some(link.id) != left
                    && is_elsewhere(link.id, link)
            };
            let kept = left.and_then(|parent| self.links.get(parent));
            let is_another = |link: &Link| Some(link.id) != self.routes.parent;
            let best = self
                .links
                .iter()
                .filter(usable)
                .min_by(|a, b| {
                    let hops = a.said.hops.cmp(&b.said.hops);
                    hops.then(is_another(a).cmp(&is_another(b)))
                        .then(a.quality.loss.total_cmp(&b.quality.loss))
                        .then(a.id.cmp(&b.id))
                })
                .or(kept);
            routes.parent = best.map(|link| link.id);
            routes.hops = best
                .and_then(|link| link.said.hops)
                .map(|hops| hops.saturating_add(1));
            let master = self.durable.reign.ballot().map(|ballot| ballot.master);
            routes.out_of_range = master.is_none_or(|master| self.links.get(master).is_none());
        }
        routes
    }

    fn found_master(&mut self) {
        self.orphaned = None;
        if self.master_silent {
            self.master_silent = false;
            self.inform(Notice::MasterReturned);
        }
    }

    /// Notices who has fallen silent.
    fn watch(&mut self, now: Timestamp) {
        let time_to_live = self.config.link_time_to_live;
        if self.links.forget_silent(now, time_to_live) {
            self.update_routes(now);
        }
        self.report_members(now);
    }

    fn miss_master(&mut self) {
        if !self.master_silent {
            self.master_silent = true;
            self.inform(Notice::MasterSilent);
        }
    }

    fn jitter(&mut self, up_to: Duration) -> Duration {
        let nanos = u64::try_from(up_to.as_nanos()).unwrap_or(u64::MAX);
        Duration::from_nanos(self.rng.random_range(0..nanos.max(1)))
    }

    fn resync(&mut self, now: Timestamp) {
        for notice in self.durable.reign.clone().notices() {
            self.inform(notice);
        }
        if self.durable.discovered {
            self.inform_of_routes();
        }
        self.told = (0, NodeSet::default());
        self.told_landing = NodeSet::default();
        self.report_members(now);
        let silent = self.members.silent();
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

    /// The host stood still: that nobody was heard meanwhile says nothing about anybody.
    fn forgive_if_stalled(&mut self, now: Timestamp) {
        if self.punctuality.stalled_for(now).is_none() {
            return;
        }
        self.links.forgive(now);
        self.look_at_parent_again();
        self.seek = None;
        if let Some((since, _)) = &mut self.orphaned {
            *since = now;
        }
        self.members.forgive(now);
    }

    fn deadline(&self) -> Option<Timestamp> {
        let repair = self.repair.map(|repair| repair.due);
        let hold = self
            .hold
            .filter(|hold| !hold.is_over)
            .map(|hold| hold.until);
        let deadlines = [self.next_beacon, repair, hold, self.next_seek()];
        deadlines.into_iter().flatten().min()
    }
}

impl Machine for TreeRouting {
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
            Input::Outcome {
                to,
                payload,
                delivered,
            } => self.outcome(now, to, &payload, delivered),
            Input::Lead(ballot) => self.lead(now, ballot),
            Input::Publish {
                ballot,
                sequence,
                order,
            } => {
                let own = self.config.id;
                if self.durable.reign.publish(own, ballot, sequence, order) {
                    self.links.begin_order();
                    self.checkpoint();
                    self.say(now, speak::Occasion::News);
                }
            }
            Input::Acknowledge { ballot, sequence } => {
                if self.durable.reign.acknowledge(ballot, sequence) {
                    self.checkpoint();
                    self.acknowledge(now);
                }
            }
            Input::Discover => {
                self.durable.discovered = true;
                self.expect_members(now);
                self.inform(Notice::DiscoveryStarted);
                self.inform(Notice::HopUpdateStarted);
                self.inform_of_routes();
                self.checkpoint();
            }
            Input::Land => {
                self.durable.landing.get_or_insert(now);
                self.checkpoint();
                self.beacon_soon(now);
            }
            // Its ways follow the drones all the time.
            Input::Scatter => {}
            Input::Stop => self.stop(now),
            Input::Resync => self.resync(now),
        }
        self.wakes = self.deadline();
        self.punctuality.ask(now, self.wakes);
        Ok(())
    }

    fn handle_timeout(&mut self, now: Timestamp) {
        self.forgive_if_stalled(now);
        self.let_go_if_due(now);
        self.seek_if_due(now);
        self.repair_if_due(now);
        self.beacon_if_due(now);
        self.wakes = self.deadline();
        self.punctuality.ask(now, self.wakes);
    }

    fn poll_output(&mut self) -> Output<Transmit, Event> {
        self.outbox.poll(self.wakes)
    }
}

#[cfg(test)]
mod tests;
