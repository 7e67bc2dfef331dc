//! When a drone speaks, and what it says.

use std::time::Duration;

use super::links::Link;
use super::{
    CONFIRM_ABOVE_LOSS, Config, Heard, Hold, NodeId, NodeSet, Packet, Repair, Transmit, Tree,
    TreeRouting,
};
use crate::time::Timestamp;
use crate::wire;

/// Within which drones that heard the same number pass it on, so that they do not all speak at one instant.
pub(super) const SPREAD: Duration = Duration::from_millis(5);

/// A drone that is nobody's parent passes the master's number on no more often than this, however quick beacons are: nobody
/// needs it for its way, and each frame costs all who hear it a signature.
const LEAF_PAUSE: Duration = Duration::from_millis(100);

/// How many beacons a drone that has been going to land for its time to live leaves out, less one.
const LANDING_BEACONS: u32 = 4;

/// How long acknowledgements wait for those still missing below, in repairs: a drone that has gone to another parent
/// out of hearing is missed here until its link is given up.
const HOLD_REPAIRS: u32 = 20;

/// How long, in repairs, acknowledgements that come in after one was said wait to be said in one frame: a drone with many
/// below it would otherwise speak more often than others listen to it.
const MERGED_REPAIRS: u32 = 2;

/// After how many repairs that nothing was heard of a parent it is suspected to be out of reach.
const TRIES_MAX: u32 = 4;

/// Why a drone speaks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Occasion {
    /// Its time has come.
    KeepAlive,
    /// Something has changed that others must know.
    News,
    /// Something was not seen to arrive.
    Repair,
    /// The parent has not been heard for a while.
    Seek,
}

impl Config {
    /// The longest that a drone keeps silent that is not landing; a master speaks sooner.
    #[must_use]
    pub fn turn(&self) -> Duration {
        let pace = self.pace();
        pace * 5 / 4 + pace / 8
    }

    /// How many of the master's numbers it takes until a drone that is nobody's parent passes one on.
    pub(super) fn numbers_a_turn(&self) -> u32 {
        let numbers = LEAF_PAUSE
            .as_nanos()
            .div_ceil(self.beacon.as_nanos().max(1));
        u32::try_from(numbers).unwrap_or(u32::MAX).max(1)
    }

    /// How often a drone speaks at least that is nobody's parent.
    pub(super) fn pace(&self) -> Duration {
        self.beacon * self.numbers_a_turn()
    }

    /// How long news takes to a neighbour whether or not it gets there at the first try, the way through the air
    /// apart: each repair makes up for a loss, and of two in five lost frames the mean is less than one repair.
    #[must_use]
    pub fn hop(&self) -> Duration {
        self.repair * 2
    }
}

impl TreeRouting {
    /// What the drone knows, as a packet for all or for one.
    fn state(&self, to: Option<NodeId>) -> Tree {
        let sequence = self.durable.reign.sequence();
        let below = self.links.below(sequence);
        let (acknowledged, mut landing) = (self.acknowledged(), below.landing.clone());
        if self.durable.landing.is_some() {
            landing.insert(self.config.id);
        }
        let mut alive = below.alive.clone();
        if !self.is_relay() {
            alive.insert(self.config.id);
        }
        let pending = if self.is_master() {
            // All that there are, heard of or not, from the first order on the ground on.
            let all = NodeSet::from(0..self.config.drones);
            all.difference(&acknowledged).difference(&landing)
        } else if self.pending.0 == sequence {
            self.pending.1.clone()
        } else {
            NodeSet::default()
        };
        Tree {
            beat: self.durable.beats.own,
            hops: self.routes.hops,
            parent: self.routes.parent,
            pulse: self.durable.beats.pulse,
            sequence,
            span: None,
            acknowledged,
            alive,
            landing,
            hears: None,
            to,
            aside: self.aside,
            pending,
            order: self
                .durable
                .reign
                .order()
                .cloned()
                .filter(|_| self.is_master() || self.routes.relay || self.routes.parent.is_none()),
        }
    }

    /// A packet's bytes; where they outgrow a datagram, of as many drones as fit, from those on whom the packet before
    /// left out.
    fn encode(&mut self, state: Tree) -> Vec<u8> {
        let packet = Packet::Tree(state);
        let payload = wire::encode_packet(&packet);
        let (false, Packet::Tree(state)) = (payload.len() <= wire::PAYLOAD_MAX, packet) else {
            return payload;
        };
        let end = self.config.drones + self.config.relays;
        let begin = self.next_span % end;
        let cut = |end| wire::encode_packet(&Packet::Tree(state.cut_to(begin..end)));
        let (mut fits, mut too_far) = (begin + 1, end + 1);
        while fits + 1 < too_far {
            let middle = u32::midpoint(fits, too_far);
            if cut(middle).len() <= wire::PAYLOAD_MAX {
                fits = middle;
            } else {
                too_far = middle;
            }
        }
        self.next_span = fits;
        cut(fits)
    }

    /// Who of this drone and those below it has carried the newest order out.
    fn acknowledged(&self) -> NodeSet {
        let below = self.links.below(self.durable.reign.sequence());
        let mut all = below.acknowledged.clone();
        if self.durable.reign.is_carried_out() {
            all.insert(self.config.id);
        }
        all
    }

    /// Speaks now, and sets the time by which it must have been seen to arrive.
    pub(super) fn say(&mut self, now: Timestamp, occasion: Occasion) {
        let Some(ballot) = self
            .durable
            .reign
            .ballot()
            .filter(|_| !self.durable.stopped)
        else {
            return;
        };
        let to = match occasion {
            Occasion::KeepAlive => None,
            Occasion::News | Occasion::Repair => self.addressee(now),
            Occasion::Seek => self.routes.parent,
        };
        if to.is_some() {
            self.aside += 1;
        } else {
            self.aside = 0;
            // The master's number rises with its beacons only: each rise makes every drone speak once.
            let raises_pulse = self.is_master() && occasion == Occasion::KeepAlive;
            if self.durable.beats.advance(raises_pulse) {
                self.checkpoint();
            }
        }
        let mut state = self.state(to);
        self.said_sequence = state.sequence;
        if occasion == Occasion::KeepAlive {
            self.passed_on = state.pulse;
            let time_to_live = self.config.link_time_to_live;
            state.hears = Some(self.links.heard_lately(now, time_to_live));
            if self.master_lands {
                // Whoever does not hear it itself is to know, too.
                let master = self.durable.reign.ballot().map(|ballot| ballot.master);
                state.landing.extend(master);
            }
        }
        self.links.answered(to);
        let payload = self.encode(state);
        self.outbox.transmit(Transmit::Send {
            to,
            ballot,
            payload,
            keep_alive: occasion == Occasion::KeepAlive,
        });
        self.set_repair(now, occasion);
    }

    fn set_repair(&mut self, now: Timestamp, occasion: Occasion) {
        if !self.is_anyone_behind() {
            self.repair = None;
            return;
        }
        let (since, pause, tries) = match (occasion, self.repair) {
            (Occasion::Repair, Some(repair)) => {
                let pause = (repair.pause * 3 / 2).min(self.config.repair_max);
                (repair.since, pause, repair.tries + 1)
            }
            (Occasion::KeepAlive | Occasion::Seek, Some(_)) => return,
            _ => (now, self.config.repair, 0),
        };
        let due = now + pause / 2 + self.jitter(pause);
        self.repair = Some(Repair {
            since,
            due,
            pause,
            tries,
        });
    }

    /// The neighbours that are not known to know what this drone has for them, or ask for it.
    fn unaware(&self) -> impl Iterator<Item = NodeId> {
        let (own, sequence) = (self.config.id, self.durable.reign.sequence());
        let parent = self.routes.parent.filter(|_| self.is_parent_behind());
        let is_child_behind =
            move |link: &Link| link.said.parent == Some(own) && !link.knows(sequence);
        self.links
            .iter()
            .filter(move |link| {
                let lacks = link.asks
                    || parent == Some(link.id)
                    || is_child_behind(link)
                    || link.obeys_another();
                link.is_reachable() && lacks
            })
            .map(|link| link.id)
    }

    /// The only one to whom what this drone says is news: it is said to that one, and the medium sees to it that it
    /// arrives. What several are to hear is said to all, and what one is to hear that is not heard itself: to be spoken
    /// to shows that one is.
    fn addressee(&self, now: Timestamp) -> Option<NodeId> {
        let mut unaware = self.unaware();
        let only = unaware.next().filter(|_| unaware.next().is_none())?;
        let link = self.links.get(only)?;
        let is_heard = self.links.hears(link, now, self.config.link_time_to_live);
        is_heard.then_some(only)
    }

    /// Whether something is to be said again, as far as this drone knows.
    fn is_anyone_behind(&self) -> bool {
        self.unaware().any(|id| !self.is_trusted(id))
    }

    fn is_parent_behind(&self) -> bool {
        let Some(parent) = self.routes.parent.and_then(|parent| self.links.get(parent)) else {
            return false;
        };
        let sequence = self.durable.reign.sequence();
        if parent.said.sequence > sequence || !self.may_acknowledge() {
            return false;
        }
        if !parent.knows(sequence) {
            return true;
        }
        // Once the master has named who is pending, only they answer.
        let are_named = self.pending.0 == sequence;
        let (pending, [said, told]) = (&self.pending.1, parent.known(sequence));
        let own = self.config.id;
        let is_own_missed = self.durable.reign.is_carried_out()
            && ![said, told].iter().any(|known| known.contains(own))
            && (!are_named || pending.contains(own));
        let below = &self.links.below(sequence).acknowledged;
        let is_known = said.is_superset(below) || told.is_superset(below);
        is_own_missed
            || !is_known
                && NodeSet::any_where(
                    [below, said, told, pending],
                    |[below, said, told, pending]| {
                        below && !said && !told && (!are_named || pending)
                    },
                )
    }

    /// A leaf over a link that loses next to nothing is trusted to have heard what was said to all, unless it asks.
    fn is_trusted(&self, id: NodeId) -> bool {
        self.routes.parent != Some(id)
            && self.links.get(id).is_some_and(|child| {
                NodeSet::from(id).is_superset(child.alive())
                    && !child.asks
                    && child.quality.loss < CONFIRM_ABOVE_LOSS
            })
    }

    /// Whether this drone and all below it have carried the newest order out, those apart that are landing.
    fn is_complete(&self) -> bool {
        let sequence = self.durable.reign.sequence();
        let is_awaited = !self.is_relay()
            && self.durable.landing.is_none()
            && !self.durable.reign.is_carried_out();
        sequence > 0 && !is_awaited && !self.links.below(sequence).is_awaited
    }

    /// Whether what has come in so far may be passed on: all of it has, or what is missing was waited for long enough.
    fn may_acknowledge(&self) -> bool {
        let waited = self
            .hold
            .is_some_and(|hold| hold.is_over && hold.sequence == self.durable.reign.sequence());
        waited || self.is_complete()
    }

    /// Acknowledges, or begins to wait for what is still missing below.
    pub(super) fn acknowledge(&mut self, now: Timestamp) {
        let sequence = self.durable.reign.sequence();
        let has_any = self.durable.reign.is_carried_out()
            || !self.links.below(sequence).acknowledged.is_empty();
        if self.is_master() || !has_any {
            return;
        }
        if self.may_acknowledge() {
            if self.is_parent_behind() {
                self.acknowledge_or_merge(now);
            }
        } else if self.hold.is_none_or(|hold| hold.sequence != sequence) {
            self.hold = Some(Hold {
                sequence,
                until: now + self.config.repair * HOLD_REPAIRS,
                is_over: false,
            });
        }
    }

    /// Says who has carried the order out, unless it has just done so: then what comes in meanwhile is said with it.
    fn acknowledge_or_merge(&mut self, now: Timestamp) {
        let pause = self.config.repair * MERGED_REPAIRS;
        let next = self
            .acknowledged_at
            .map(|at| at + pause)
            .filter(|next| now < *next);
        match (next, &mut self.repair) {
            (None, _) => {
                self.acknowledged_at = Some(now);
                self.say(now, Occasion::News);
            }
            (Some(next), Some(repair)) => repair.due = repair.due.min(next),
            (Some(next), none) => {
                *none = Some(Repair {
                    since: now,
                    due: next,
                    pause: self.config.repair,
                    tries: 0,
                });
            }
        }
    }

    pub(super) fn let_go_if_due(&mut self, now: Timestamp) {
        if let Some(hold) = &mut self.hold
            && !hold.is_over
            && hold.until <= now
        {
            hold.is_over = true;
            self.acknowledge(now);
        }
    }

    /// What a neighbour's words call for.
    pub(super) fn answer(&mut self, now: Timestamp, sender: NodeId, heard: Heard, news: bool) {
        if news {
            // A leaf is silent: whoever told it knows from the medium, trusts it, or asks.
            if self.links.children().next().is_some() {
                self.say(now, Occasion::News);
            }
            return;
        }
        let Some(link) = self.links.get(sender) else {
            return;
        };
        let is_child = link.said.parent == Some(self.config.id);
        let is_parent = self.routes.parent == Some(sender);
        let is_behind = link.said.sequence < self.durable.reign.sequence();
        let has_progressed = heard.has_progressed;
        let is_asked = !link.said.is_beacon && link.said.to.is_none_or(|to| to == self.config.id);
        // A child that repeats itself has not heard that it was understood.
        let repeats_itself = is_child && is_asked && !has_progressed;
        // A parent that speaks again, while this drone has not yet said that it knows the order, waits for that.
        let awaits_word =
            is_parent && is_asked && self.said_sequence < self.durable.reign.sequence();
        if repeats_itself || awaits_word {
            self.links.asks(sender);
            self.hurry_repair(now);
            return;
        }
        if is_child && is_behind || is_parent && self.is_missed() {
            self.hurry_repair(now);
            return;
        }
        if is_child && has_progressed {
            self.acknowledge(now);
        }
        if self.repair.is_some() && !self.is_anyone_behind() {
            self.repair = None;
        }
    }

    /// Whether the master misses, and the parent does not have, what this drone could tell.
    fn is_missed(&self) -> bool {
        self.pending.0 == self.durable.reign.sequence() && self.is_parent_behind()
    }

    /// What became of something that was said to one neighbour.
    pub(super) fn outcome(&mut self, now: Timestamp, to: NodeId, payload: &[u8], delivered: bool) {
        let Ok(told) = wire::decode_tree(payload) else {
            return;
        };
        if delivered {
            self.links.told(to, &told);
        } else {
            self.links.gave_up(to);
            self.update_routes(now);
            if let Some(repair) = &mut self.repair {
                // Sooner than if nothing were known, and still rarer each time.
                repair.due = now + repair.due.since(now) / 2;
            }
            let lost = |link: &Link| !link.is_reachable();
            if Some(to) != self.routes.parent && self.links.get(to).is_some_and(lost) {
                // Perhaps it was all that was waited for.
                self.acknowledge(now);
            }
        }
        if self.repair.is_some() && !self.is_anyone_behind() {
            self.repair = None;
        }
    }

    /// Answers soon, once for all that ask.
    fn hurry_repair(&mut self, now: Timestamp) {
        let due = now + self.jitter(self.config.repair / 4);
        let pause = self.config.repair;
        match &mut self.repair {
            Some(repair) => repair.due = repair.due.min(due),
            None => {
                self.repair = Some(Repair {
                    since: now,
                    due,
                    pause,
                    tries: 0,
                });
            }
        }
    }

    pub(super) fn repair_if_due(&mut self, now: Timestamp) {
        let Some(repair) = self.repair.filter(|repair| repair.due <= now) else {
            return;
        };
        let parent = self.routes.parent.and_then(|parent| self.links.get(parent));
        if repair.tries >= TRIES_MAX && parent.is_some_and(|link| link.heard_at < repair.since) {
            if let Some(parent) = self.routes.parent {
                self.links.suspect(parent);
            }
            self.update_routes(now);
        }
        self.say(now, Occasion::Repair);
    }

    pub(super) fn beacon_if_due(&mut self, now: Timestamp) {
        if self.next_beacon.is_none_or(|due| due > now) {
            return;
        }
        self.watch(now);
        self.say(now, Occasion::KeepAlive);
        // A drone that hears the master's number passes it on before its own time comes.
        let pause = if self.is_settled_to_land(now) {
            self.config.beacon * LANDING_BEACONS
        } else if self.is_master() {
            self.config.beacon
        } else {
            let numbers = if self.speaks_seldom() {
                self.numbers_a_turn
            } else {
                1
            };
            let pace = self.config.beacon * numbers;
            pace * 5 / 4 + self.jitter(pace / 8)
        };
        self.next_beacon = Some(now + pause);
    }

    /// Whether beacons are so quick that a drone that is nobody's parent does not pass on each number.
    pub(super) const fn are_beacons_quick(&self) -> bool {
        self.numbers_a_turn > 1
    }

    /// Whether this drone need not pass on each number of the master's, as nobody takes it for its parent.
    fn speaks_seldom(&self) -> bool {
        self.are_beacons_quick() && self.links.children().next().is_none()
    }

    /// Whether it is this drone's turn to pass the master's number on.
    pub(super) fn is_its_turn(&self) -> bool {
        let numbers = self.durable.beats.pulse.saturating_sub(self.passed_on);
        numbers >= self.numbers_a_turn || !self.speaks_seldom()
    }

    /// A neighbour under the same master that has heard less of it, and not only because the newest number is still on its way,
    /// is told: where drones do not speak at each number, its way to the master may be gone.
    pub(super) fn tell_if_behind(&mut self, now: Timestamp, pulse: u32) {
        let behind = self.durable.beats.pulse.saturating_sub(pulse);
        if self.are_beacons_quick() && behind > 1 && !self.is_settled_to_land(now) {
            self.beacon_soon(now);
        }
    }

    /// Whether the drone has been going to land for so long that nobody needs it any more.
    pub(super) fn is_settled_to_land(&self, now: Timestamp) -> bool {
        self.durable
            .landing
            .is_some_and(|since| now.since(since) > self.config.time_to_live)
    }

    /// Says for the last time how far this drone has got.
    pub(super) fn stop(&mut self, now: Timestamp) {
        if !self.durable.stopped {
            self.durable.landing.get_or_insert(now);
            self.say(now, Occasion::News);
            self.durable.stopped = true;
            self.next_beacon = None;
            self.repair = None;
            self.checkpoint();
        }
    }
}
