//! Policy `tree`: what has changed is said at once, to whoever must know it, and said again until it is seen to have
//! arrived.
//!
//! Each drone keeps what its neighbours last said (`link_table`) and takes the one with the cheapest route to the master
//! for its parent (`parent`). An order goes outwards from parent to child; acknowledgements come inwards, merged
//! (`aggregation`): a drone speaks once all below it have carried the order out. What one neighbour alone has yet to
//! learn is said to that one, and the medium may tell what became of it; besides, hearing a neighbour say what it was to
//! learn is the acknowledgement of a hop. Whatever is not known to have arrived in time is said again, at that hop only
//! (`retransmission`). With each `beacon`, once a second say, the master's heartbeat goes outwards, each drone passing
//! it on as it comes in; that one frame serves discovery, liveness and routing. A parent that falls silent is probed
//! (`probe`) before it is left.

mod aggregation;
mod beacon;
mod compose;
mod durable;
mod link;
mod link_table;
mod members;
mod parent;
mod probe;
mod quality;
mod retransmission;

use std::hint::black_box;
use std::time::Duration;

use bytes::Bytes;

pub use durable::Checkpoint;

use self::aggregation::{Aggregation, Pass};
use self::beacon::{Audience, Beacon};
use self::compose::Composer;
use self::link::{Link, Speaker};
use self::link_table::{Heard, LinkTable};
use self::members::Members;
use self::parent::{ParentSelection, Place};
use self::probe::{ParentProbe, Route, Step};
use self::retransmission::{Due, Owed, Retransmission};
use super::{Core, Durable, Event, Notice, Policy, PolicyCheckpoint};
use crate::flaw::{self, Flaw};
use crate::identity::{Ballot, NodeId, NodeSet};
use crate::leader::{BallotDecision, LinkSymmetry};
use crate::time::{Timestamp, first_of};
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
    /// How often the master's heartbeat goes out.
    pub beacon: Duration,
    /// How long a drone waits to hear what it said come back before it says it again.
    pub repair: Duration,
    /// The longest such wait.
    pub repair_max: Duration,
    /// How long a neighbour may be silent before its link is taken for lost.
    pub link_time_to_live: Duration,
    /// How long a member may be without a route to this drone before it is taken for lost.
    pub time_to_live: Duration,
    /// How long a drone may be without a route to the master before that is taken for lost.
    pub patience: Duration,
}

/// Up to so many neighbours are told one by one, where the medium tells what became of it and one of their links loses
/// much: each by itself is tried again by the medium, or at once.
const ONE_BY_ONE_MAX: usize = 3;

/// Why a drone speaks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Reason {
    /// Its time has come.
    KeepAlive,
    /// Something has changed that others must know.
    News,
    /// Something was not seen to arrive.
    Repair,
    /// The newest order is said to all once more.
    Copy,
    /// Others ask.
    Answer,
    /// The parent has not been heard for a while.
    Probe,
    /// There is no route, and nobody near is known to have heard of the master.
    Inquiry,
}

/// Dissemination along a tree.
#[derive(Debug)]
pub(super) struct TreePolicy {
    config: Config,
    durable: Checkpoint,
    links: LinkTable,
    route: ParentSelection,
    probe: ParentProbe,
    /// As master: who is alive, and who is missed.
    members: Members,
    aggregation: Aggregation,
    retransmission: Retransmission,
    beacon: Beacon,
    composer: Composer,
    /// Whether the medium tells what becomes of a frame for one drone.
    medium_tells: bool,
}

impl TreePolicy {
    /// Goes on from what was `kept`; knows nothing without.
    pub(super) fn new(
        config: Config,
        core: &mut Core,
        now: Timestamp,
        kept: Option<(Durable, Checkpoint)>,
    ) -> Self {
        let mut policy = Self {
            durable: Checkpoint::default(),
            links: LinkTable::new(config.id, config.drones, config.beacon, config.pace()),
            route: ParentSelection::new(config.id, config.beacon),
            probe: ParentProbe::default(),
            members: Members::default(),
            aggregation: Aggregation::default(),
            retransmission: Retransmission::default(),
            beacon: Beacon::new(&config),
            composer: Composer::default(),
            medium_tells: false,
            config,
        };
        if let Some((common, own)) = kept {
            policy.durable = own;
            core.resume(common);
            policy.route.resume(core.durable.heartbeats.master);
            policy.probe.resume();
            if core.durable.epoch.ballot().is_some() && !core.durable.stopped {
                policy.beacon.set(now);
            }
            policy.update_route(core, now);
            if policy.durable.discovered {
                policy.members.expect_all(core, now);
            }
        }
        policy
    }

    /// A drone as this one knows it.
    fn speaker(&self, core: &Core, id: NodeId) -> Speaker {
        Speaker {
            id,
            is_parent: self.route.parent() == Some(id),
            master: core.master(),
        }
    }

    fn parent_link(&self) -> Option<&Link> {
        self.links.get(self.route.parent()?)
    }

    fn is_settled_to_land(&self, core: &Core, now: Timestamp) -> bool {
        core.is_settled_to_land(now, self.config.time_to_live)
    }

    /// Whether a frame under `ballot` is to be heard; turns to a better ballot than the one obeyed so far.
    /// What comes over a link that carries one way only makes nobody turn.
    fn obeys(
        &mut self,
        core: &mut Core,
        now: Timestamp,
        (sender, ballot): (NodeId, Ballot),
        said: &TreeFrame<'_>,
    ) -> bool {
        let is_symmetric = self.links.is_symmetric(sender, said);
        let stays = core.is_master() && flaw::has(Flaw::NeverStepsDown);
        let symmetry = if is_symmetric && !stays {
            LinkSymmetry::Mutual
        } else {
            LinkSymmetry::OneWay
        };
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

    /// Acts on what a neighbour said, which its link keeps by now, and on whether that brought a newer order.
    fn take_in(
        &mut self,
        core: &mut Core,
        now: Timestamp,
        (sender, heard): (NodeId, Heard),
        is_news: bool,
    ) {
        let Some(link) = self.links.get(sender) else {
            return;
        };
        let (sequence, heartbeat) = (link.said.sequence, link.said.heartbeat);
        let master_lands = link.said.master_lands;
        if heard.is_new || link.needs_to_hear() {
            // It learns that it is heard.
            self.beacon.for_new_neighbour(core, now);
        }
        if master_lands {
            core.hear_of_landing(sequence);
        }
        if self.route.parent() == Some(sender) {
            self.route.look_at_parent_again(&self.links);
            self.route.follow_parent(&self.links);
        }
        if heard.has_moved || !self.route.keeps_route(now, link) {
            self.update_route(core, now);
        }
        self.take_heartbeat(core, now, sender, heartbeat);
        self.report_members(core, now);
        self.answer(core, now, (sender, heard), is_news);
    }

    /// A heartbeat sequence that has risen goes on outwards: at once if the parent brings it, and soon in any case, for
    /// the parent's word may be lost.
    fn take_heartbeat(&mut self, core: &mut Core, now: Timestamp, sender: NodeId, heartbeat: u32) {
        if core.is_master() {
            return;
        }
        let known = core.durable.heartbeats.master;
        let is_settled = self.is_settled_to_land(core, now);
        if heartbeat <= known {
            // Not only because the newest one is still on its way: where drones do not speak at each, its route to the
            // master may be gone.
            let is_behind = known.saturating_sub(heartbeat) > 1;
            if self.beacon.are_quick() && is_behind && !is_settled {
                self.beacon_soon(core, now);
            }
            return;
        }
        core.durable.heartbeats.master = heartbeat;
        let is_its_turn = self.beacon.is_its_turn(core, self.links.has_children());
        if !is_its_turn || is_settled {
            return;
        }
        if self.route.parent() == Some(sender) {
            self.beacon_soon(core, now);
        } else if self.route.parent().is_some() {
            self.beacon.in_a_while(core, now);
        }
    }

    fn beacon_soon(&mut self, core: &mut Core, now: Timestamp) {
        let audience = Audience {
            has_children: self.links.has_children(),
            neighbours: self.links.len(),
        };
        self.beacon.soon(core, now, audience);
    }

    fn update_route(&mut self, core: &mut Core, now: Timestamp) {
        let place = Place {
            is_master: core.is_master(),
            master: core.master(),
            heartbeat: core.durable.heartbeats.master,
            are_beacons_quick: self.beacon.are_quick(),
        };
        let moved = self.route.update(now, place, &self.links);
        if self.route.parent().is_some() {
            core.find_master();
        }
        if moved.routes {
            core.show(Event::Routes(self.route.routes().clone()));
        }
        if moved.hops_or_parent && !self.is_settled_to_land(core, now) {
            self.beacon_soon(core, now);
        }
    }

    /// As master: tells the protocol what the members' reports have changed.
    fn report_members(&mut self, core: &mut Core, now: Timestamp) {
        if core.is_master() {
            let times = (now, self.config.time_to_live);
            self.members.report(core, &self.links, times);
        }
    }

    /// Says that routes are up; to a master also to whom they need not lead over others.
    fn inform_of_routes(&self, core: &mut Core) {
        if core.is_master() {
            let heard = self.links.iter().map(|link| link.id).collect();
            core.inform(Notice::Hears(heard));
        }
        core.inform(Notice::RoutesReady);
    }

    /// Acknowledges, or begins to wait for what is still missing below.
    fn acknowledge(&mut self, core: &mut Core, now: Timestamp) {
        let parent = self
            .route
            .parent()
            .and_then(|parent| self.links.get(parent));
        let times = (now, self.config.repair);
        match self.aggregation.pass(core, &self.links, parent, times) {
            Pass::No => {}
            Pass::Now => self.say(core, now, Reason::News),
            Pass::At(at) => self
                .retransmission
                .bring_forward(now, at, self.config.repair),
        }
    }

    fn owed(&self, core: &Core, now: Timestamp) -> Owed {
        let parent = self.parent_link();
        let lacks = self.aggregation.parent_lacks(core, &self.links, parent);
        let parent = self.route.parent().filter(|_| lacks);
        Owed::of(core, &self.links, parent, (now, self.config.beacon))
    }

    /// What a neighbour's words call for.
    fn answer(
        &mut self,
        core: &mut Core,
        now: Timestamp,
        (sender, heard): (NodeId, Heard),
        is_news: bool,
    ) {
        let Some(link) = self.links.get(sender) else {
            return;
        };
        // Two without a route have nothing to tell each other, unless it is an order.
        let has_route = self.route.routes().hops.is_some();
        let is_told =
            || has_route || link.said.hops.is_some() || link.said.sequence != core.sequence();
        let asks_anew = link.said.asks_own && is_told();
        let (mut asks, asked) = (link.asks || asks_anew, usize::from(link.said.asked));
        let is_child = link.is_child_of(core.id);
        let (sequence, newest) = (link.said.sequence, core.sequence());
        let is_parent = self.route.parent() == Some(sender);
        if asks_anew {
            self.links.asks(sender);
        }
        if is_news && self.links.has_children() {
            self.pass_on(core, now);
            asks = self.links.get(sender).is_some_and(|link| link.asks);
        }
        if asks {
            let repair = self.config.repair;
            self.retransmission.answer(core, now, (asked, repair));
        }
        if is_news {
            return;
        }
        if sequence > newest {
            // There is an order that this drone has missed.
            return self
                .retransmission
                .ask(core, now, sender, self.config.repair);
        }
        if is_child && sequence < newest && !asks {
            return self.retransmission.hurry(core, now, self.config.repair);
        }
        if is_child && heard.has_progressed || is_parent && self.is_missed(core) {
            self.acknowledge(core, now);
        }
        self.end_repair_if_done(core, now);
    }

    /// Says a new order to those below, in turn with others that do. A leaf is silent unless it is asked: the drone that
    /// told it knows from the medium, or trusts it.
    fn pass_on(&mut self, core: &mut Core, now: Timestamp) {
        let hops = self.route.routes().hops;
        let competes = |link: &&Link| hops.is_some() && link.said.hops == hops;
        let others = self.links.iter().filter(competes).count();
        if others == 0 {
            self.say(core, now, Reason::News);
        } else {
            self.retransmission.relay(core, now, others);
        }
    }

    /// Whether the master misses, and the parent does not have, what this drone could tell.
    fn is_missed(&self, core: &Core) -> bool {
        let parent = self.parent_link();
        let is_named =
            parent.is_some_and(|link| aggregation::pending(link, core.sequence()).is_some());
        is_named && self.aggregation.parent_lacks(core, &self.links, parent)
    }

    fn end_repair_if_done(&mut self, core: &Core, now: Timestamp) {
        if self.retransmission.is_under_way() && !self.owed(core, now).is_anyone_behind() {
            self.retransmission.end();
        }
    }

    /// Speaks now, to one, to a few one by one, or to all, and sets the time by which it must have been seen to arrive.
    fn say(&mut self, core: &mut Core, now: Timestamp, reason: Reason) {
        if core.durable.epoch.ballot().is_none() || core.durable.stopped {
            return self.retransmission.end();
        }
        let waits = !matches!(reason, Reason::KeepAlive | Reason::Probe | Reason::Inquiry);
        if waits && !self.retransmission.may_speak(now, self.config.repair) {
            return;
        }
        let owed = if reason == Reason::KeepAlive {
            // It is for all, and asks nobody.
            Owed::default()
        } else {
            self.owed(core, now)
        };
        let receivers = self.receivers(now, reason, &owed);
        if receivers.is_empty() {
            self.send(core, now, reason, None, &owed);
        }
        for to in receivers.iter() {
            let is_waited_for = |link: &Link| link.is_on_its_way(now);
            if reason != Reason::Repair || !self.links.get(to).is_some_and(is_waited_for) {
                self.send(core, now, reason, Some(to), &owed);
            }
        }
        let is_unsure = receivers.is_empty() || !self.medium_tells;
        if is_unsure && reason == Reason::News {
            let (leaves, repair) = (owed.trusted.len(), self.config.repair);
            self.retransmission.copy_for(core, now, leaves, repair);
        }
        self.wait_for_arrival(core, now, reason);
    }

    /// Whom something is said to one by one; to all, if nobody. What one alone is to hear is said to that one, and the
    /// medium sees to it that it arrives; but not to one that is not heard itself: to be spoken to shows that one is.
    fn receivers(&self, now: Timestamp, reason: Reason, owed: &Owed) -> NodeSet {
        let receivers = match reason {
            Reason::KeepAlive | Reason::Copy | Reason::Inquiry => return NodeSet::new(),
            Reason::Probe => return self.route.parent().into_iter().collect(),
            Reason::News => owed.all(),
            Reason::Answer => owed.asking.clone(),
            Reason::Repair => {
                let mut receivers = owed.unaware.clone();
                receivers.extend_from(&owed.asking);
                receivers
            }
        };
        let links = || receivers.iter().filter_map(|id| self.links.get(id));
        let time_to_live = self.config.link_time_to_live;
        let are_heard = links().all(|link| self.links.hears(link, now, time_to_live));
        let is_unsure = |link: &Link| !link.quality.is_good() || link.is_leaf_of(self.config.id);
        let most = if self.medium_tells && links().any(is_unsure) {
            ONE_BY_ONE_MAX
        } else {
            1
        };
        if are_heard && (1..=most).contains(&receivers.len()) {
            receivers
        } else {
            NodeSet::new()
        }
    }

    fn send(
        &mut self,
        core: &mut Core,
        now: Timestamp,
        reason: Reason,
        to: Option<NodeId>,
        owed: &Owed,
    ) {
        if self.composer.count(to) {
            // The master's number rises with its beacons only: each rise makes every drone speak once.
            let raises_heartbeat = core.is_master() && reason == Reason::KeepAlive;
            if core.durable.heartbeats.advance(raises_heartbeat) {
                core.keep();
            }
        }
        let mut state = self.composer.state(core, &self.links, &self.route, to);
        if reason == Reason::KeepAlive {
            let time_to_live = self.config.link_time_to_live;
            let (hears, weak) = self.links.heard_lately(now, time_to_live);
            (state.hears, state.weak) = (Some(hears), weak);
            if core.master_lands() {
                // Whoever does not hear it itself is to know, too.
                state.landing.extend(core.master());
            }
        }
        state.asks = self.asks(core, reason, to, owed);
        self.links.answered(to);
        let nodes = self.config.drones + self.config.relays;
        let payload = self.composer.encode(&state, nodes);
        core.send(to, payload, reason == Reason::KeepAlive);
        if let Some(to) = to.filter(|_| self.medium_tells) {
            self.links.sent(to, now);
        }
        self.retransmission.spoken(now);
    }

    /// Who is to say what it knows: whoever would show it by nothing else.
    fn asks(&self, core: &Core, reason: Reason, to: Option<NodeId>, owed: &Owed) -> NodeSet {
        match (reason, to) {
            (Reason::KeepAlive | Reason::Copy | Reason::Answer, _) => NodeSet::new(),
            (Reason::Probe, _) => to.into_iter().collect(),
            // Those too that do not hear this drone, as far as it knows: to be asked shows that they are heard.
            (Reason::Inquiry, _) => (self.links.iter().map(|link| link.id))
                .chain(self.probe.left())
                .collect(),
            (Reason::Repair, None) => owed.unaware.clone(),
            (Reason::Repair, Some(to)) => {
                let shows = self.medium_tells || !owed.unaware.contains(to);
                (!shows).then_some(to).into_iter().collect()
            }
            // Those with drones below them pass it on, which shows that they know.
            (Reason::News, None) => {
                let unaware = owed.unaware.iter().filter_map(|id| self.links.get(id));
                let leaves = unaware.filter(|link| link.is_leaf_of(core.id));
                leaves.map(|link| link.id).collect()
            }
            (Reason::News, Some(_)) => NodeSet::new(),
        }
    }

    fn wait_for_arrival(&mut self, core: &mut Core, now: Timestamp, reason: Reason) {
        let owed = self.owed(core, now);
        if !owed.is_anyone_behind() {
            return self.retransmission.end();
        }
        let (repair, repair_max) = (self.config.repair, self.config.repair_max);
        match reason {
            Reason::Repair => (self.retransmission).go_on(core, now, (repair, repair_max)),
            Reason::News => self.retransmission.begin(core, now, repair),
            _ if self.retransmission.is_under_way() => {}
            _ => self.retransmission.begin(core, now, repair),
        }
    }

    /// What was not seen to arrive is said again. A parent of which nothing was heard meanwhile may be out of reach.
    fn repair(&mut self, core: &mut Core, now: Timestamp) {
        if let Some((parent, heard_at)) = self.parent_link().map(|link| (link.id, link.heard_at))
            && self.retransmission.has_tried_in_vain(heard_at)
        {
            self.links.change_reach(parent, Link::suspect);
            self.update_route(core, now);
        }
        if self.owed(core, now).is_anyone_behind() {
            self.say(core, now, Reason::Repair);
        } else {
            self.retransmission.end();
        }
    }

    /// A neighbour has said more than this drone knows, and may still be the only one.
    fn ask(&mut self, core: &mut Core, now: Timestamp, neighbour: NodeId) {
        let sequence = core.sequence();
        let knows_more = |link: &Link| link.said.sequence > sequence;
        if self.links.get(neighbour).is_some_and(knows_more) {
            let owed = Owed::default();
            self.send(core, now, Reason::Probe, Some(neighbour), &owed);
        }
    }

    fn watched_route(&self) -> Route {
        Route {
            parent: self.route.parent(),
            stale_at: self.route.stale_at(&self.links),
            orphaned_since: self.route.orphaned_since(),
        }
    }

    fn next_probe(&self, core: &Core) -> Option<Timestamp> {
        let route = self.watched_route();
        self.probe.deadline(core, &self.links, route, &self.config)
    }

    /// Takes what steps are due. Each is one less that can be: a parent is probed later, or left, or the master is missed.
    fn probe_while_due(&mut self, core: &mut Core, now: Timestamp) {
        while self.next_probe(core).is_some_and(|due| due <= now) {
            let route = self.watched_route();
            let step = (self.probe).step(core, &self.links, route, (now, &self.config));
            match step {
                Some(Step::Probe { is_first }) => {
                    if is_first && self.beacon.are_quick() {
                        // All hear that it is there, and whoever has heard more of the master says so.
                        self.beacon_soon(core, now);
                    }
                    self.say(core, now, Reason::Probe);
                }
                Some(Step::Leave(parent)) => {
                    self.links.forget(parent);
                    self.update_route(core, now);
                }
                Some(Step::Inquire) => self.say(core, now, Reason::Inquiry),
                Some(Step::Miss) => core.miss_master(),
                None => return,
            }
        }
    }

    fn retransmit_while_due(&mut self, core: &mut Core, now: Timestamp) {
        while let Some(due) = self.retransmission.take_due(now) {
            match due {
                Due::Relay => self.say(core, now, Reason::News),
                Due::Repair => self.repair(core, now),
                Due::Answer => {
                    if !self.owed(core, now).asking.is_empty() {
                        self.say(core, now, Reason::Answer);
                    }
                }
                Due::Copy(sequence) => {
                    if sequence == core.sequence() && !self.owed(core, now).trusted.is_empty() {
                        self.say(core, now, Reason::Copy);
                    }
                }
                Due::Ask(neighbour) => self.ask(core, now, neighbour),
            }
        }
    }

    fn beacon_if_due(&mut self, core: &mut Core, now: Timestamp) {
        if self.beacon.deadline().is_none_or(|due| due > now) {
            return;
        }
        let time_to_live = self.config.link_time_to_live;
        if self.links.forget_silent(now, time_to_live) {
            self.update_route(core, now);
        }
        self.report_members(core, now);
        self.say(core, now, Reason::KeepAlive);
        // Only a master's pause depends on it.
        let has_lossy_links =
            core.is_master() && self.links.iter().any(|link| !link.quality.is_good());
        let links = (self.links.has_children(), has_lossy_links);
        let is_settled = self.is_settled_to_land(core, now);
        self.beacon.said(core, now, links, is_settled);
    }
}

impl Policy for TreePolicy {
    fn heard(
        &mut self,
        core: &mut Core,
        now: Timestamp,
        (sender, ballot): (NodeId, Ballot),
        payload: &Bytes,
    ) {
        let Ok((front, words)) = wire::split_tree(payload) else {
            return core.show(Event::Ignored(sender));
        };
        let is_followed = core.durable.epoch.ballot() == Some(ballot) && !core.durable.stopped;
        if is_followed
            && self
                .links
                .has_said(self.speaker(core, sender), &front, words)
        {
            // Nothing is news but that the sender lives, and the master.
            if let Some(heard) = self.links.hear_again(sender, &front, now) {
                self.take_in(core, now, (sender, heard), false);
            }
            return;
        }
        let Some(said) = TreeFrame::read(front, words) else {
            return core.show(Event::Ignored(sender));
        };
        let is_member = sender.0 < self.config.drones + self.config.relays;
        let is_heard =
            is_member && !core.durable.stopped && self.obeys(core, now, (sender, ballot), &said);
        if !is_heard {
            if is_member {
                self.links.hear_of_another_epoch(sender, &said, now);
                self.route.look_at_parent_again(&self.links);
            }
            return core.show(Event::Ignored(sender));
        }
        let speaker = self.speaker(core, sender);
        let words = payload.slice_ref(words);
        if let Some(heard) = self.links.hear(speaker, &said, words, now) {
            let is_news = core.take_order(said.sequence, said.order);
            if is_news {
                self.retransmission.begin_order();
                self.links.begin_order();
            }
            self.take_in(core, now, (sender, heard), is_news);
        }
    }

    fn outcome(
        &mut self,
        core: &mut Core,
        now: Timestamp,
        to: NodeId,
        payload: &[u8],
        delivered: bool,
    ) {
        self.medium_tells = true;
        if core.durable.stopped {
            return;
        }
        let Ok(told) = wire::decode_tree(payload) else {
            return;
        };
        if delivered {
            self.links.told(to, &told);
        } else {
            self.links.change_reach(to, Link::give_up_once);
            self.update_route(core, now);
            self.retransmission.retry(core, now, self.config.repair);
            let is_lost = |link: &Link| !link.is_reachable();
            if Some(to) != self.route.parent() && self.links.get(to).is_some_and(is_lost) {
                // Perhaps it was all that was waited for.
                self.acknowledge(core, now);
            }
        }
        self.end_repair_if_done(core, now);
    }

    /// Acknowledgements, routes and heartbeats were those of the epoch before. Who is near, and how well each is heard, is
    /// still known.
    fn begin_epoch(&mut self, _core: &mut Core, now: Timestamp) {
        self.links.forget_epoch();
        self.route.begin_epoch();
        self.probe.forget();
        self.members = Members::default();
        self.aggregation.begin_epoch();
        self.retransmission.begin_epoch();
        self.beacon.begin_epoch(now);
    }

    fn lead(&mut self, core: &mut Core, now: Timestamp, ballot: Ballot) {
        if ballot.is_elected() {
            self.members.expect_all(core, now);
        }
        self.update_route(core, now);
        self.beacon.set(now);
    }

    fn published(&mut self, core: &mut Core, now: Timestamp) {
        self.retransmission.begin_order();
        self.links.begin_order();
        self.beacon.quicken(false);
        self.say(core, now, Reason::News);
    }

    fn carried_out(&mut self, core: &mut Core, now: Timestamp) {
        self.acknowledge(core, now);
    }

    fn discover(&mut self, core: &mut Core, now: Timestamp) {
        self.durable.discovered = true;
        self.members.expect_all(core, now);
        core.inform(Notice::DiscoveryStarted);
        core.inform(Notice::HopUpdateStarted);
        self.inform_of_routes(core);
        core.keep();
    }

    /// Until the next order, by which all will be in their places.
    fn scatter(&mut self, _core: &mut Core, _now: Timestamp) {
        self.beacon.quicken(true);
    }

    fn land(&mut self, core: &mut Core, now: Timestamp) {
        self.beacon_soon(core, now);
    }

    fn stop(&mut self, core: &mut Core, now: Timestamp) {
        self.say(core, now, Reason::News);
        self.beacon.stop();
        self.retransmission.end();
    }

    fn resync(&mut self, core: &mut Core, now: Timestamp) {
        if self.durable.discovered {
            self.inform_of_routes(core);
        }
        self.members.forget_told();
        self.report_members(core, now);
        let silent = self.members.silent();
        if !silent.is_empty() {
            core.inform(Notice::Silent(silent));
        }
    }

    fn forgive(&mut self, _core: &mut Core, now: Timestamp) {
        self.links.forgive(now);
        self.route.look_at_parent_again(&self.links);
        self.route.forgive(now);
        self.probe.forget();
        self.members.forgive(now);
    }

    fn handle_timeout(&mut self, core: &mut Core, now: Timestamp) {
        if self.aggregation.ends_hold(now) {
            self.acknowledge(core, now);
        }
        self.probe_while_due(core, now);
        self.retransmit_while_due(core, now);
        self.beacon_if_due(core, now);
        // A neighbour that was forgotten by then may have been the parent.
        self.probe_while_due(core, now);
    }

    fn read_ahead(&self) {
        black_box((self.config.repair, self.config.id, self.links.len()));
        black_box((self.route.parent(), self.route.orphaned_since()));
        black_box((
            self.beacon.deadline(),
            self.retransmission.deadline(),
            self.aggregation.deadline(),
        ));
        black_box((self.probe.left(), self.medium_tells));
    }

    fn read_further_ahead(&self, sender: Option<NodeId>) {
        self.links.read_ahead(sender);
    }

    fn deadline(&self, core: &Core) -> Option<Timestamp> {
        let hold = self.aggregation.deadline();
        let said_again = self.retransmission.deadline();
        let probe = self.next_probe(core);
        first_of([self.beacon.deadline(), said_again, hold, probe])
    }

    fn checkpoint(&self) -> PolicyCheckpoint {
        PolicyCheckpoint::Tree(self.durable.clone())
    }

    fn occupancy(&self) -> (usize, usize) {
        let nodes = self.config.drones + self.config.relays;
        (self.links.len(), nodes as usize)
    }
}

#[cfg(test)]
mod tests;
