//! What is known of one neighbour: how well the link carries, what it said last, and what it is known to know.

use std::hint::black_box;
use std::time::Duration;

use bytes::Bytes;

use super::quality::Quality;
use crate::identity::{NodeId, NodeSet};
use crate::time::Timestamp;
use crate::wire::{TreeFrame, TreeFront};

/// How often a neighbour is told of a new leader epoch beyond what is said anyway.
const TOLD_OF_EPOCH_MAX: u32 = 8;

/// How unlikely it must be that a neighbour within reach misses as many frames in a row as make it count as out of reach.
const OUT_OF_REACH: f64 = 1e-3;
/// And how many these are at least, and at most.
const GIVEN_UP: std::ops::RangeInclusive<u32> = 2..=12;

/// How long a medium takes at most to tell what became of a frame: eight tries over 802.11a with the longest back-off take
/// some 30 ms.
const ON_ITS_WAY_MAX: Duration = Duration::from_millis(60);

/// One neighbour.
#[derive(Debug, Clone)]
pub(super) struct Link {
    pub(super) id: NodeId,
    /// When it was heard first, and last.
    pub(super) known_since: Timestamp,
    pub(super) heard_at: Timestamp,
    /// Whether the neighbour has heard this drone too: only then the link counts.
    pub(super) symmetric: bool,
    /// Since when it has left this drone out of those that it says to hear.
    left_out: Option<Timestamp>,
    pub(super) quality: Quality,
    /// How often in a row the medium has given up to reach it, or it has left a probe unanswered, since it was heard.
    given_up: u32,
    /// Since when a frame for it has been on its way, of which the medium has not told yet what became.
    sent_at: Option<Timestamp>,
    /// Whether it asks what this drone knows and has not been answered.
    pub(super) asks: bool,
    /// How often it has been told of the epoch that it was not heard under yet; `None` once it was.
    pub(super) told_of_epoch: Option<u32>,
    /// What it said last.
    pub(super) said: Said,
    /// The sets that are kept of it, as long as there are any.
    sets: Option<Box<Sets>>,
    /// The frame that `said` and `sets` come from, behind its front; empty if it was sent under another epoch.
    pub(super) words: Bytes,
}

/// What a neighbour is to this drone.
#[derive(Debug, Clone, Copy)]
pub(super) struct Speaker {
    pub(super) id: NodeId,
    /// Whether it is the parent.
    pub(super) is_parent: bool,
    /// The current leader.
    pub(super) master: Option<NodeId>,
}

/// What is kept of a neighbour's last frame.
#[derive(Debug, Clone, Default)]
pub(super) struct Said {
    pub(super) number: u32,
    pub(super) unicasts: u32,
    pub(super) hops: Option<u16>,
    pub(super) cost: u16,
    pub(super) parent: Option<NodeId>,
    pub(super) heartbeat: u32,
    pub(super) lag: u32,
    pub(super) sequence: u32,
    /// Whether its sender wants to hear what this drone knows.
    pub(super) asks_own: bool,
    /// How many others it asks with it.
    pub(super) asked: u16,
    /// Whether its sender hears this drone, as far as that tells.
    pub(super) hears_own: Option<bool>,
    /// Whether the master is on its way to the ground.
    pub(super) master_lands: bool,
    /// Whether it was said by the parent, or by what was that then.
    pub(super) by_parent: bool,
}

/// The sets of drones that are kept of a neighbour; of most there are none.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Sets {
    /// What the medium says has arrived there: of which order, and who has carried it out.
    pub(super) told: (u32, NodeSet),
    /// As it said last, if it is a child or the parent.
    pub(super) acknowledged: NodeSet,
    /// Likewise, of children only.
    pub(super) alive: NodeSet,
    /// Likewise.
    pub(super) landing: NodeSet,
    /// Who the master misses, of the parent only.
    pub(super) pending: NodeSet,
}

/// Of a neighbour without sets.
static NO_SETS: Sets = Sets {
    told: (0, NodeSet::new()),
    acknowledged: NodeSet::new(),
    alive: NodeSet::new(),
    landing: NodeSet::new(),
    pending: NodeSet::new(),
};

/// Who is known to have carried an order out, of a neighbour that has said nothing of that one.
static NOBODY: NodeSet = NodeSet::new();

/// How a link has changed by a frame that was heard over it.
#[derive(Debug, Clone, Copy)]
pub(super) struct LinkChanged {
    /// It could not be reached before.
    pub(super) is_back: bool,
    /// It carries both ways, which it did not, or one way only.
    pub(super) turns: bool,
    /// It costs more or less than before.
    pub(super) cost: bool,
}

/// How a neighbour's words differ from those before.
#[derive(Debug, Clone, Copy)]
pub(super) struct Changed {
    /// It knows of another order, or of others who have carried it out.
    pub(super) progress: bool,
    /// That, or others are below it or going to land.
    pub(super) any: bool,
    /// It is farther from the master or nearer, or has another parent.
    pub(super) route: bool,
}

impl Link {
    /// To a neighbour that is heard for the first time, before that is taken in.
    pub(super) fn new(id: NodeId, now: Timestamp) -> Self {
        Self {
            id,
            known_since: now,
            heard_at: now,
            symmetric: false,
            left_out: None,
            quality: Quality::new(),
            given_up: 0,
            sent_at: None,
            asks: false,
            told_of_epoch: None,
            said: Said::default(),
            sets: None,
            words: Bytes::new(),
        }
    }

    /// How many broadcasts were missed before one of these numbers; `None` for one that is not newer than the last.
    #[inline]
    pub(super) fn missed_before(&self, number: u32, unicasts: u32) -> Option<u32> {
        let said = &self.said;
        let is_newer = (number, unicasts) > (said.number, said.unicasts);
        let is_for_all = unicasts == 0;
        is_newer.then(|| number - said.number - u32::from(is_for_all))
    }

    /// Takes in that the neighbour was heard say what is kept by now, after so many broadcasts that were missed.
    #[inline]
    pub(super) fn is_heard(&mut self, now: Timestamp, missed: u32, pace: Duration) -> LinkChanged {
        let before = self.quality;
        self.quality.learn_missed(missed);
        if self.said.unicasts == 0 {
            self.quality.learn_heard();
        }
        self.heard_at = now;
        let was_reachable = self.is_reachable();
        self.given_up = 0;
        self.told_of_epoch = None;
        let symmetric = self.said.hears_own.unwrap_or(self.symmetric);
        match self.said.hears_own {
            Some(true) => self.left_out = None,
            Some(false) => self.left_out = self.left_out.or(Some(now)),
            // It has not said which drones it hears.
            None => {}
        }
        // At first it may have restarted, or have missed what this drone said: it hears it again when that gets through.
        let patience = || pace * self.quality.stale_beacons.into();
        let is_new = self
            .left_out
            .is_none_or(|since| now.since(since) < patience());
        let was_symmetric = self.symmetric;
        self.symmetric = symmetric || (self.symmetric && is_new);
        if !self.shows_what_it_was_told() {
            // It restarted, or spoke before it knew.
            self.change_sets(|sets| sets.told = (0, NodeSet::new()));
        }
        LinkChanged {
            is_back: !was_reachable,
            turns: self.symmetric != was_symmetric,
            cost: self.quality.costs_otherwise_than(&before),
        }
    }

    /// Whether it can be reached, as far as is known.
    pub(super) fn is_reachable(&self) -> bool {
        self.given_up < *GIVEN_UP.start() || self.given_up < self.given_up_max()
    }

    /// How many frames in a row a neighbour within reach hardly ever misses.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "within `GIVEN_UP`"
    )]
    fn given_up_max(&self) -> u32 {
        let lost = (1.0 - self.quality.round_trip()).max(f64::EPSILON);
        let frames = (libm::log(OUT_OF_REACH) / libm::log(lost)).ceil() as u32;
        frames.clamp(*GIVEN_UP.start(), *GIVEN_UP.end())
    }

    /// Whether it is taken to have heard what it was told: it loses next to nothing, has missed nothing that it was told
    /// since it was heard, and does not ask.
    pub(super) fn is_trusted(&self) -> bool {
        self.quality.is_good() && self.given_up == 0 && !self.asks
    }

    /// Takes in that a frame for it is on its way.
    pub(super) const fn is_sent(&mut self, now: Timestamp) {
        self.sent_at = Some(now);
    }

    /// Whether the medium is still at a frame for it: another one would wait behind, and so would all else.
    pub(super) fn is_on_its_way(&self, now: Timestamp) -> bool {
        self.sent_at
            .is_some_and(|at| now.since(at) < ON_ITS_WAY_MAX)
    }

    /// Takes in that a frame for it did not arrive.
    pub(super) const fn give_up_once(&mut self) {
        self.sent_at = None;
        self.given_up = self.given_up.saturating_add(1);
    }

    /// Takes in that a frame for it arrived.
    pub(super) const fn is_reached(&mut self) {
        self.sent_at = None;
        self.given_up = 0;
    }

    /// Takes in that it does not answer at all: it is out of reach until it is heard again.
    pub(super) const fn suspect(&mut self) {
        self.given_up = *GIVEN_UP.end();
    }

    /// Whether it is perhaps not aware of the leader epoch, though it hears this drone.
    pub(super) fn obeys_another(&self) -> bool {
        let told = self.told_of_epoch;
        self.symmetric && told.is_some_and(|times| times < TOLD_OF_EPOCH_MAX)
    }

    /// Whether it leaves this drone out of those that it says to hear.
    pub(super) const fn leaves_out(&self) -> bool {
        self.left_out.is_some()
    }

    /// Whether it has just said that it does not hear this drone, which it did before.
    pub(super) const fn needs_to_hear(&self) -> bool {
        self.symmetric && self.leaves_out()
    }

    /// Whether it knows of an order, as it said or the medium did.
    pub(super) fn knows(&self, sequence: u32) -> bool {
        self.said.sequence.max(self.sets().told.0) >= sequence
    }

    /// Who is known there to have carried an order out, as it said and as the medium did.
    pub(super) fn known(&self, sequence: u32) -> [&NodeSet; 2] {
        let sets = self.sets();
        let said = (self.said.sequence, &sets.acknowledged);
        let told = (sets.told.0, &sets.told.1);
        [said, told].map(|(of, known)| if of == sequence { known } else { &NOBODY })
    }

    /// Whether what it said shows that it knows what it was told.
    #[inline]
    fn shows_what_it_was_told(&self) -> bool {
        let sets = self.sets();
        let (sequence, acknowledged) = &sets.told;
        self.said.sequence > *sequence
            || self.said.sequence == *sequence && sets.acknowledged.is_superset(acknowledged)
    }

    #[inline]
    pub(super) fn sets(&self) -> &Sets {
        self.sets.as_deref().unwrap_or(&NO_SETS)
    }

    /// Changes the sets that are kept; none are if they are as before anything was said.
    pub(super) fn change_sets<T>(&mut self, change: impl FnOnce(&mut Sets) -> T) -> T {
        let mut sets = self.sets.take().unwrap_or_default();
        let changed = change(&mut sets);
        self.sets = Some(sets).filter(|sets| **sets != NO_SETS);
        changed
    }

    /// Forgets what it said under another leader epoch. Who is near, and how well each is heard, is still known.
    pub(super) fn forget_epoch(&mut self) {
        self.said = Said {
            number: self.said.number,
            unicasts: self.said.unicasts,
            ..Said::default()
        };
        self.words = Bytes::new();
        self.sets = None;
        self.given_up = 0;
        self.asks = false;
        self.told_of_epoch = Some(0);
    }

    pub(super) const fn is_child_of(&self, id: NodeId) -> bool {
        matches!(self.said.parent, Some(parent) if parent.0 == id.0)
    }

    /// Whether it has a route to the master, and not through `id` as its parent.
    pub(super) const fn has_route_past(&self, id: NodeId) -> bool {
        self.said.hops.is_some() && !self.is_child_of(id)
    }

    /// Whether it is a child of `id` with nobody below it, so that it passes nothing on.
    pub(super) fn is_leaf_of(&self, id: NodeId) -> bool {
        self.is_child_of(id) && NodeSet::from(self.id).is_superset(&self.sets().alive)
    }

    /// The heartbeat sequence that its route rests on.
    pub(super) const fn route_heartbeat(&self) -> u32 {
        self.said.heartbeat.saturating_sub(self.said.lag)
    }

    /// What the route to the master costs through it; `None` if it has none.
    pub(super) fn cost_through(&self) -> Option<u16> {
        self.said.hops?;
        Some(self.said.cost.saturating_add(self.quality.cost()))
    }

    /// Reads some of each part of it.
    pub(super) fn read_ahead(&self) {
        black_box((self.left_out, self.said.number, self.said.by_parent));
        black_box((self.words.len(), self.heard_at, self.quality.is_proven()));
        black_box((self.sets().told.0, self.symmetric));
    }

    /// Whether it has been silent for so long that another route would be better.
    pub(super) fn is_stale(&self, now: Timestamp, beacon: Duration) -> bool {
        now > self.stale_at(beacon)
    }

    /// From when on that is so, unless it is heard.
    pub(super) fn stale_at(&self, beacon: Duration) -> Timestamp {
        self.heard_at + beacon * self.quality.stale_beacons.into()
    }

    /// Keeps what matters to `own` of its words; how they differ from those before.
    pub(super) fn keep(
        &mut self,
        said: &TreeFrame<'_>,
        own: NodeId,
        speaker: Speaker,
        drones: u32,
    ) -> Changed {
        let is_another_order = said.sequence != self.said.sequence;
        let is_child = said.front.parent == Some(own);
        let is_kin = is_child || speaker.is_parent;
        let (mut progress, mut any) = (is_another_order, false);
        if is_kin || self.sets.is_some() {
            self.change_sets(|sets| {
                let keep = |kept: &mut NodeSet, set: NodeSet| {
                    let mut set = said.and_before(set, kept);
                    set.truncate(drones);
                    let differs = set != *kept;
                    *kept = set;
                    differs
                };
                if is_another_order || !is_kin {
                    sets.acknowledged = NodeSet::new();
                    sets.pending = NodeSet::new();
                    if said.span.is_some() && speaker.is_parent {
                        sets.pending = NodeSet::from(0..drones);
                    }
                }
                if is_kin {
                    progress |= keep(&mut sets.acknowledged, said.acknowledged());
                }
                if speaker.is_parent {
                    keep(&mut sets.pending, said.pending.to_set());
                } else {
                    sets.pending = NodeSet::new();
                }
                if is_child {
                    any |= keep(&mut sets.alive, said.alive.to_set());
                    any |= keep(&mut sets.landing, said.landing());
                } else {
                    (sets.alive, sets.landing) = (NodeSet::new(), NodeSet::new());
                }
            });
        }
        let before = std::mem::replace(&mut self.said, Said::of(said, own, speaker));
        let reception = said.reception_of(own);
        let hears_otherwise = reception.is_some_and(|it| self.quality.learn_reception(it));
        let route = |said: &Said| (said.hops, said.cost, said.parent);
        Changed {
            progress,
            any: any || progress,
            route: hears_otherwise || route(&before) != route(&self.said),
        }
    }
}

impl Said {
    /// What is kept of a speaker's words by `own`.
    fn of(said: &TreeFrame<'_>, own: NodeId, speaker: Speaker) -> Self {
        let TreeFront {
            number,
            hops,
            cost,
            parent,
            heartbeat,
            lag,
        } = said.front;
        Self {
            number,
            unicasts: said.unicasts,
            hops,
            cost,
            parent,
            heartbeat,
            lag,
            sequence: said.sequence,
            asks_own: said.asks.contains(own),
            asked: said.asks.members(),
            hears_own: says_to_hear(own, said),
            master_lands: (speaker.master).is_some_and(|master| said.is_landing(master)),
            by_parent: speaker.is_parent,
        }
    }
}

/// Whether a neighbour says that it hears `own`, or shows it, if it says anything of that.
pub(super) fn says_to_hear(own: NodeId, said: &TreeFrame<'_>) -> Option<bool> {
    if said.front.parent == Some(own) || said.to == Some(own) || said.asks.contains(own) {
        Some(true)
    } else {
        said.hears(own)
    }
}

#[cfg(test)]
mod tests;
