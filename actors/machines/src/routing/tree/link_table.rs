//! Who is near: every neighbour with its link, and what all children say together.

use std::cell::OnceCell;
use std::time::Duration;

use bytes::Bytes;

use super::link::{Link, Speaker, says_to_hear};
use crate::flaw::{self, Flaw};
use crate::identity::{NodeId, NodeSet};
use crate::roster::Roster;
use crate::routing::packet::Reception;
use crate::routing::tree::quality::WELL;
use crate::time::Timestamp;
use crate::wire::{TreeFrame, TreeFront};

/// What is known of each neighbour, from the frames of its own that were heard.
///
/// Invariant: `below`, if it is there, is what the present children say.
#[derive(Debug, Clone)]
pub(super) struct LinkTable {
    own: NodeId,
    /// How many drones there are; nothing that is said of others is kept.
    drones: u32,
    /// How often a parent speaks at least.
    beacon: Duration,
    /// How often each neighbour does.
    pace: Duration,
    links: Roster<Link>,
    /// What all children say together, until one of them says something else.
    below: OnceCell<Below>,
}

/// What all children say together.
#[derive(Debug, Clone, Default)]
pub(super) struct Below {
    /// The order that `acknowledged` is about.
    sequence: u32,
    /// Who below has carried it out: what is done stays done, even of a child that is out of reach by now.
    pub(super) acknowledged: NodeSet,
    pub(super) alive: NodeSet,
    pub(super) landing: NodeSet,
    /// Whether somebody below has neither carried it out nor is going to land.
    pub(super) is_awaited: bool,
}

/// What a frame brought.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Heard {
    /// Whether its sender knows of another order, or of others who have carried it out.
    pub(super) has_progressed: bool,
    /// Whether its sender's route, or its link, is another one.
    pub(super) has_moved: bool,
    /// Whether it was not known.
    pub(super) is_new: bool,
}

impl LinkTable {
    /// Of `own`, which has heard nobody yet.
    pub(super) fn new(own: NodeId, drones: u32, beacon: Duration, pace: Duration) -> Self {
        Self {
            own,
            drones,
            beacon,
            pace,
            links: Roster::new(),
            below: OnceCell::new(),
        }
    }

    /// Whether a neighbour says the same as before, the front of its frame apart, and is what it was to this drone. Most of
    /// what is said was, and nothing of that is read again.
    #[inline]
    pub(super) fn has_said(&self, speaker: Speaker, front: &TreeFront, words: &[u8]) -> bool {
        self.get(speaker.id).is_some_and(|link| {
            let said = &link.said;
            (said.hops, said.cost, said.parent, said.by_parent)
                == (front.hops, front.cost, front.parent, speaker.is_parent)
                && link.words == words
        })
    }

    /// Takes in what a neighbour says that has said the same before; `None` for a number that is not newer than the last.
    #[inline]
    pub(super) fn hear_again(
        &mut self,
        id: NodeId,
        front: &TreeFront,
        now: Timestamp,
    ) -> Option<Heard> {
        let link = self.links.get_mut(id)?;
        let missed = link.missed_before(front.number, link.said.unicasts)?;
        (link.said.number, link.said.heartbeat, link.said.lag) =
            (front.number, front.heartbeat, front.lag);
        let is_child = link.is_child_of(self.own);
        let link_changed = link.is_heard(now, missed, self.pace);
        if is_child && link_changed.is_back {
            self.below.take();
        }
        Some(Heard {
            has_progressed: false,
            has_moved: link_changed.is_back || link_changed.turns || link_changed.cost,
            is_new: false,
        })
    }

    /// Takes in what a neighbour says, in the words behind its front; `None` for a number that is not newer than the
    /// last. One that has left this drone out for longer than by chance does not hear it.
    pub(super) fn hear(
        &mut self,
        speaker: Speaker,
        said: &TreeFrame<'_>,
        words: Bytes,
        now: Timestamp,
    ) -> Option<Heard> {
        let link = match self.links.find(speaker.id) {
            Ok(at) => self.links.at(at),
            Err(at) => return Some(self.begin(at, speaker, said, words, now)),
        };
        let missed = link.missed_before(said.front.number, said.unicasts)?;
        let was_child = link.is_child_of(self.own);
        let changed = link.keep(said, self.own, speaker, self.drones);
        link.words = words;
        let is_child = link.is_child_of(self.own);
        let link_changed = link.is_heard(now, missed, self.pace);
        if was_child != is_child || is_child && (changed.any || link_changed.is_back) {
            self.below.take();
        }
        Some(Heard {
            has_progressed: changed.progress,
            has_moved: changed.route
                || link_changed.is_back
                || link_changed.turns
                || link_changed.cost,
            is_new: false,
        })
    }

    /// Takes in what a neighbour says that was not known.
    fn begin(
        &mut self,
        at: usize,
        speaker: Speaker,
        said: &TreeFrame<'_>,
        words: Bytes,
        now: Timestamp,
    ) -> Heard {
        let mut link = Link::new(speaker.id, now);
        link.keep(said, self.own, speaker, self.drones);
        link.symmetric = link.said.hears_own.unwrap_or(false);
        link.words = words;
        if link.is_child_of(self.own) {
            self.below.take();
        }
        self.links.insert(at, speaker.id, link);
        Heard {
            has_progressed: true,
            has_moved: true,
            is_new: true,
        }
    }

    /// Takes in that a neighbour is there that obeys another master: this drone lets it know that it is heard, and learns
    /// whether it hears this one.
    pub(super) fn hear_of_another_epoch(
        &mut self,
        id: NodeId,
        said: &TreeFrame<'_>,
        now: Timestamp,
    ) {
        let speaker = Speaker {
            id,
            is_parent: false,
            master: None,
        };
        self.hear(speaker, &said.only_of_its_link(), Bytes::new(), now);
        if let Some(link) = self.links.get_mut(id) {
            link.told_of_epoch = Some(0);
        }
    }

    /// Whether a neighbour that says this hears this drone, as far as is known.
    pub(super) fn is_symmetric(&self, id: NodeId, said: &TreeFrame<'_>) -> bool {
        says_to_hear(self.own, said)
            .unwrap_or_else(|| self.get(id).is_some_and(|link| link.symmetric))
            || flaw::has(Flaw::ObeysOneWayNeighbours)
    }

    /// Forgets what neighbours said under a master that is not obeyed any more.
    pub(super) fn forget_epoch(&mut self) {
        self.below.take();
        self.links.iter_mut().for_each(Link::forget_epoch);
    }

    /// This drone heard nobody, through no fault of theirs: everybody's silence begins anew.
    pub(super) fn forgive(&mut self, now: Timestamp) {
        for link in self.links.iter_mut() {
            link.heard_at = now;
        }
    }

    pub(super) fn forget(&mut self, id: NodeId) {
        if self.links.remove(id) {
            self.below.take();
        }
    }

    /// A neighbour has been told something, as the medium says.
    pub(super) fn told(&mut self, id: NodeId, told: &TreeFrame<'_>) {
        if let Some(link) = self.links.get_mut(id) {
            link.change_sets(|sets| {
                if told.sequence > sets.told.0 {
                    sets.told = (told.sequence, NodeSet::new());
                }
                if told.sequence == sets.told.0 {
                    sets.told.1.extend_from(&told.acknowledged());
                }
            });
            link.is_reached();
        }
        self.below.take();
    }

    /// A frame for one neighbour is on its way.
    pub(super) fn sent(&mut self, id: NodeId, now: Timestamp) {
        if let Some(link) = self.links.get_mut(id) {
            link.is_sent(now);
        }
    }

    /// Changes what is known of whether a neighbour can be reached.
    pub(super) fn change_reach(&mut self, id: NodeId, change: impl FnOnce(&mut Link)) {
        if let Some(link) = self.links.get_mut(id) {
            change(link);
        }
        self.below.take();
    }

    /// A neighbour wants to hear what this drone knows.
    pub(super) fn asks(&mut self, id: NodeId) {
        if let Some(link) = self.links.get_mut(id) {
            link.asks = true;
        }
    }

    /// A neighbour, or all, are answered.
    pub(super) fn answered(&mut self, to: Option<NodeId>) {
        for link in self.links.iter_mut() {
            link.asks &= to.is_some_and(|to| to != link.id);
            if let Some(times) = &mut link.told_of_epoch {
                *times += 1;
            }
        }
    }

    /// Forgets neighbours that have been silent for too long, which a lossy link makes longer than `time_to_live`;
    /// whether there were any.
    pub(super) fn forget_silent(&mut self, now: Timestamp, time_to_live: Duration) -> bool {
        let pace = self.pace;
        let is_there = |link: &Link| {
            let silent_for = now.since(link.heard_at);
            silent_for <= time_to_live || silent_for <= pace * link.quality.lost_beacons.into()
        };
        let has_lost_any = !self.links.iter().all(is_there);
        if has_lost_any {
            self.links.retain(is_there);
            self.below.take();
        }
        has_lost_any
    }

    /// As [`NodeMachine::read_further_ahead`](crate::node::NodeMachine::read_further_ahead) says.
    pub(super) fn read_ahead(&self, sender: Option<NodeId>) {
        match sender {
            None => self.iter().for_each(Link::read_ahead),
            Some(sender) => self.get(sender).into_iter().for_each(Link::read_ahead),
        }
    }

    #[inline]
    pub(super) fn get(&self, id: NodeId) -> Option<&Link> {
        self.links.get(id)
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &Link> {
        self.links.iter()
    }

    /// Neighbours that take this drone for their parent, those apart that are out of reach.
    pub(super) fn children(&self) -> impl Iterator<Item = &Link> {
        let is_child = |link: &&Link| link.is_child_of(self.own) && link.is_reachable();
        self.iter().filter(is_child)
    }

    pub(super) fn has_children(&self) -> bool {
        self.children().next().is_some()
    }

    /// What all children say together of order `sequence`, the newest that this drone knows of.
    pub(super) fn below(&self, sequence: u32) -> &Below {
        let below = self.below.get_or_init(|| self.sum_up(sequence));
        debug_assert_eq!(below.sequence, sequence, "a new order is told of");
        below
    }

    /// There is a newer order than before.
    pub(super) fn begin_order(&mut self) {
        self.below.take();
    }

    fn sum_up(&self, sequence: u32) -> Below {
        let mut below = Below {
            sequence,
            ..Below::default()
        };
        for link in self.iter().filter(|link| link.is_child_of(self.own)) {
            let sets = link.sets();
            if link.said.sequence == sequence {
                below.acknowledged.extend_from(&sets.acknowledged);
            }
            if link.is_reachable() {
                below.alive.extend_from(&sets.alive);
                below.landing.extend_from(&sets.landing);
            }
        }
        below.is_awaited = NodeSet::any_where(
            [
                &below.alive,
                &below.landing,
                &below.acknowledged,
                &self.own.into(),
            ],
            |[alive, landing, acknowledged, own]| alive && !landing && !acknowledged && !own,
        );
        below
    }

    /// Whom this drone hears, and whom of them not well.
    pub(super) fn heard_lately(
        &self,
        now: Timestamp,
        time_to_live: Duration,
    ) -> (NodeSet, Vec<Reception>) {
        let mut all = NodeSet::new();
        let mut weak = Vec::new();
        for link in self.iter() {
            if !self.hears(link, now, time_to_live) {
                continue;
            }
            all.insert(link.id);
            let sixteenths = link.quality.heard();
            if sixteenths < WELL {
                let id = link.id;
                weak.push(Reception { id, sixteenths });
            }
        }
        (all, weak)
    }

    /// Whether this drone hears a neighbour. One that has been silent for as long as no living neighbour is, and for half
    /// its `time_to_live`, is not heard any more; nor, until it has been heard under the present epoch, one that has been
    /// silent for so long that it would be probed: a drone that has gone deaf, and claims to lead, shall be believed by
    /// nobody. Likewise one that has been silent for longer than it was known before: that little was heard of it is no
    /// reason to believe for longer that it is.
    pub(super) fn hears(&self, link: &Link, now: Timestamp, time_to_live: Duration) -> bool {
        let silent_for = now.since(link.heard_at);
        if silent_for <= self.beacon {
            return true;
        }
        let stale = self.beacon * link.quality.stale_beacons.into();
        if silent_for <= stale || link.told_of_epoch.is_some() {
            return silent_for <= stale;
        }
        let known_for = link.heard_at.since(link.known_since);
        let lost = self.pace * link.quality.lost_beacons.into();
        silent_for <= lost.min(known_for.max(stale)).max(time_to_live / 2)
    }

    /// As if nobody had said anything before in the same words.
    #[cfg(test)]
    pub(super) fn forget_words(&mut self) {
        for link in self.links.iter_mut() {
            link.words = Bytes::new();
        }
    }

    /// The neighbours that have a route, and not through this drone.
    pub(super) fn with_routes(&self) -> impl Iterator<Item = &Link> {
        self.iter().filter(|link| link.has_route_past(self.own))
    }

    pub(super) const fn len(&self) -> usize {
        self.links.len()
    }
}
