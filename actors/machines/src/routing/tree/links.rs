use std::cell::OnceCell;
use std::hint::black_box;
use std::time::Duration;

use bytes::Bytes;

use crate::flaw::{self, Flaw};
use crate::identity::{NodeId, NodeSet};
use crate::roster::Roster;
use crate::routing::beats::RESTART_GAP;
use crate::time::Timestamp;
use crate::wire::{TreeFrame, TreeFront};

/// How many frames an estimate of a link's loss remembers; it is their mean as long as there were fewer.
const LOSS_MEMORY: u16 = 50;
/// How unlikely it must be that a living neighbour is silent for as long as it takes to be given up.
const LOST: f64 = 1e-6;
/// How unlikely it must be that it is silent for as long as it takes to prefer another, and to ask whether it is there.
const STALE: f64 = 1e-2;
/// How unlikely it must be that a living neighbour answers none of the questions whether it is there.
const UNANSWERED: f64 = 1e-9;
/// However lossy a link is, no more questions are asked.
pub(super) const QUESTIONS_MAX: f64 = 40.0;
/// However lossy a link is, it is given up after this many beacons.
const LOST_BEACONS_MAX: u16 = 30;
/// And asked after this many: to ask costs a frame.
pub(super) const STALE_BEACONS_MAX: u16 = 5;

/// After how many times that the medium gave up to reach a neighbour, which was not heard in between, it is taken to be
/// out of reach.
const GIVEN_UP_MAX: u32 = 2;

/// How often a neighbour is told of a new reign beyond what is said anyway.
const TOLD_OF_REIGN_MAX: u32 = 8;

/// What is known of each neighbour, from the frames of its own that were heard.
#[derive(Debug, Clone)]
pub(super) struct Links {
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

/// What is known of one neighbour.
#[derive(Debug, Clone)]
pub(super) struct Link {
    pub(super) id: NodeId,
    /// When it was heard first, and last.
    known_since: Timestamp,
    pub(super) heard_at: Timestamp,
    /// Whether the neighbour has heard this drone too: only then the link counts.
    pub(super) symmetric: bool,
    /// Since when it has left this drone out whenever it said whom it hears.
    left_out: Option<Timestamp>,
    pub(super) quality: Quality,
    /// How often the medium has given up to reach it since it was heard.
    given_up: u32,
    /// Whether it repeated itself to this drone and has not been answered.
    pub(super) asks: bool,
    /// How often it has been told of the reign that it was not heard under yet; nothing once it was.
    told_of_reign: Option<u32>,
    /// What it said last.
    pub(super) said: Said,
    /// The sets that are kept of it, as long as there are any.
    sets: Option<Box<Sets>>,
    /// What it said as it was written, behind the front; nothing of what it said under another reign.
    words: Bytes,
}

/// How well a neighbour is heard.
#[derive(Debug, Clone, Copy)]
pub(super) struct Quality {
    /// The share of its frames for all that was missed lately, told from the gaps between their numbers.
    pub(super) loss: f64,
    /// How many frames that was told from, up to [`LOSS_MEMORY`].
    frames: u16,
    /// After how many beacons of silence it is stale, and after how many it is lost.
    stale_beacons: u16,
    lost_beacons: u16,
}

/// Who says something, and what it is to this drone.
#[derive(Debug, Clone, Copy)]
pub(super) struct Speaker {
    pub(super) id: NodeId,
    /// Whether it is the parent.
    pub(super) is_parent: bool,
    /// Whom this drone obeys.
    pub(super) master: Option<NodeId>,
}

/// What is kept of a neighbour's words.
#[derive(Debug, Clone, Default)]
pub(super) struct Said {
    beat: u32,
    aside: u32,
    pub(super) hops: Option<u16>,
    pub(super) parent: Option<NodeId>,
    pub(super) pulse: u32,
    pub(super) sequence: u32,
    pub(super) to: Option<NodeId>,
    /// Whether it was said only because its time had come.
    pub(super) is_beacon: bool,
    /// Whether its sender hears this drone, as far as that tells.
    hears_own: Option<bool>,
    /// Whether the master is on its way to the ground.
    pub(super) master_lands: bool,
    /// Whether it was said by the parent, or by who was that then.
    by_parent: bool,
}

/// The sets of drones that are kept of a neighbour; of most there are none.
#[derive(Debug, Clone, Default, PartialEq)]
struct Sets {
    /// What the medium says has arrived there: of which order, and who has carried it out.
    told: (u32, NodeSet),
    /// As it said last, if it is a child or the parent.
    acknowledged: NodeSet,
    /// Likewise, of children only.
    alive: NodeSet,
    /// Likewise.
    landing: NodeSet,
}

/// Of a neighbour of whom no sets are kept.
static NO_SETS: Sets = Sets {
    told: (0, NodeSet::new()),
    acknowledged: NodeSet::new(),
    alive: NodeSet::new(),
    landing: NodeSet::new(),
};

/// Who is known to have carried an order out, of whoever has said nothing of that one.
static NOBODY: NodeSet = NodeSet::new();

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

/// How a neighbour's words differ from those before.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Heard {
    /// Whether it knows of another order, or of others who have carried it out.
    pub(super) has_progressed: bool,
    /// Whether its own way to the master, or to this drone, is another one.
    pub(super) has_moved: bool,
    /// Whether it was not known.
    pub(super) is_new: bool,
}

/// How a link has changed by a frame that was heard over it.
struct LinkChanged {
    /// It could not be reached before.
    is_back: bool,
    /// It carries both ways, which it did not, or one way only.
    turns: bool,
}

impl Link {
    /// To a neighbour that is heard for the first time, before that is taken in.
    fn new(id: NodeId, now: Timestamp) -> Self {
        Self {
            id,
            known_since: now,
            heard_at: now,
            symmetric: false,
            left_out: None,
            quality: Quality::new(),
            given_up: 0,
            asks: false,
            told_of_reign: None,
            said: Said::default(),
            sets: None,
            words: Bytes::new(),
        }
    }

    /// Reads some of each part of it, as [`Links::read_further_ahead`] says.
    fn read_ahead(&self) {
        black_box((self.left_out, self.said.beat, self.said.by_parent));
        black_box((self.words.len(), self.heard_at, self.quality.frames));
        black_box((self.sets.is_some(), self.symmetric));
    }

    /// How many frames for all were missed before one of these numbers; nothing for one that is not newer than the last.
    #[inline]
    fn missed_before(&self, beat: u32, aside: u32) -> Option<u32> {
        let said = &self.said;
        let is_newer = (beat, aside) > (said.beat, said.aside);
        let is_for_all = aside == 0;
        is_newer.then(|| beat - said.beat - u32::from(is_for_all))
    }

    /// Takes in that the neighbour was heard say what is kept by now, after so many frames for all that were missed.
    #[inline]
    fn is_heard(&mut self, now: Timestamp, missed: u32, pace: Duration) -> LinkChanged {
        self.quality.learn_missed(missed);
        if self.said.aside == 0 {
            self.quality.learn(0.0);
        }
        self.heard_at = now;
        let was_reachable = self.is_reachable();
        self.given_up = 0;
        self.told_of_reign = None;
        let symmetric = self.said.hears_own.unwrap_or(self.symmetric);
        let leaves_out = self.said.hears_own == Some(false);
        self.left_out = leaves_out.then(|| self.left_out.unwrap_or(now));
        // At first it may have restarted, or have missed what this drone said: it hears it again when that gets through.
        let patience = pace * self.quality.stale_beacons.into();
        let is_new = self
            .left_out
            .is_none_or(|since| now.since(since) < patience);
        let was_symmetric = self.symmetric;
        self.symmetric = symmetric || (self.symmetric && is_new);
        if !self.shows_what_it_was_told() {
            // It restarted, or spoke before it knew.
            self.change_sets(|sets| sets.told = (0, NodeSet::new()));
        }
        LinkChanged {
            is_back: !was_reachable,
            turns: self.symmetric != was_symmetric,
        }
    }

    /// Whether it can be reached, as far as is known.
    pub(super) const fn is_reachable(&self) -> bool {
        self.given_up < GIVEN_UP_MAX
    }

    /// Whether it is perhaps not aware of the reign, though it hears this drone.
    pub(super) fn obeys_another(&self) -> bool {
        let told = self.told_of_reign;
        self.symmetric && told.is_some_and(|times| times < TOLD_OF_REIGN_MAX)
    }

    /// Whether it leaves this drone out whenever it says whom it hears.
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
    fn sets(&self) -> &Sets {
        self.sets.as_deref().unwrap_or(&NO_SETS)
    }

    /// Changes the sets that are kept; none are if they are as before anything was said.
    fn change_sets<T>(&mut self, change: impl FnOnce(&mut Sets) -> T) -> T {
        let mut sets = self.sets.take().unwrap_or_default();
        let changed = change(&mut sets);
        self.sets = Some(sets).filter(|sets| **sets != NO_SETS);
        changed
    }

    /// Who is there of itself and those below it, if it is a child.
    pub(super) fn alive(&self) -> &NodeSet {
        &self.sets().alive
    }

    const fn is_child_of(&self, id: NodeId) -> bool {
        matches!(self.said.parent, Some(parent) if parent.0 == id.0)
    }

    /// Whether it has been silent for so long that another way would be better.
    pub(super) fn is_stale(&self, now: Timestamp, beacon: Duration) -> bool {
        now > self.stale_at(beacon)
    }

    /// From when on that is so, unless it is heard.
    pub(super) fn stale_at(&self, beacon: Duration) -> Timestamp {
        self.heard_at + beacon * self.quality.stale_beacons.into()
    }
}

impl Quality {
    /// Of a neighbour that was heard once.
    fn new() -> Self {
        let mut quality = Self {
            loss: 0.0,
            frames: 0,
            stale_beacons: 0,
            lost_beacons: 0,
        };
        quality.judge();
        quality
    }

    /// Takes into the estimate of the loss that so many frames were missed, unless their sender skipped them when it was
    /// restarted.
    #[inline]
    fn learn_missed(&mut self, missed: u32) {
        if missed < RESTART_GAP {
            for _ in 0..missed.min(LOSS_MEMORY.into()) {
                self.learn(1.0);
            }
        }
    }

    /// Takes into the estimate of the loss that a frame was missed (1) or heard (0).
    #[inline]
    fn learn(&mut self, missed: f64) {
        let before = (self.loss, self.frames);
        self.frames = (self.frames + 1).min(LOSS_MEMORY);
        self.loss += (missed - self.loss) / f64::from(self.frames);
        if before != (self.loss, self.frames) {
            self.judge();
        }
    }

    /// How long it may be silent by chance, as things are by now.
    fn judge(&mut self) {
        self.stale_beacons = self.patience(STALE, STALE_BEACONS_MAX);
        self.lost_beacons = self.patience(LOST, LOST_BEACONS_MAX);
    }

    /// For how many beacons a neighbour that speaks once in each may be silent by a chance of `odds`.
    fn patience(&self, odds: f64, beacons_max: u16) -> u16 {
        let loss = self.cautious_loss();
        let (mut beacons, mut chance) = (1, loss);
        while chance > odds && beacons < beacons_max {
            chance *= loss;
            beacons += 1;
        }
        beacons
    }

    /// How often it is asked before it is taken to be gone: a question or its answer may be lost, each like any frame.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between 1 and `QUESTIONS_MAX`"
    )]
    pub(super) fn questions(&self) -> u32 {
        let heard = 1.0 - self.cautious_loss();
        let questions = libm::log(UNANSWERED) / libm::log(1.0 - heard * heard);
        questions.ceil().clamp(1.0, QUESTIONS_MAX) as u32
    }

    /// Its loss, by the rule of succession: so that few frames prove little.
    fn cautious_loss(&self) -> f64 {
        let frames = f64::from(self.frames);
        (self.loss * frames + 1.0) / (frames + 2.0)
    }
}

impl Links {
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

    /// As [`Cell::read_further_ahead`](crate::cell::Cell::read_further_ahead) says.
    pub(super) fn read_further_ahead(&self, sender: Option<NodeId>) {
        match sender {
            None => self.iter().for_each(Link::read_ahead),
            Some(sender) => self.get(sender).into_iter().for_each(Link::read_ahead),
        }
    }

    /// Whether these very words were the last that a neighbour said under this reign, as what it is to this drone now.
    #[inline]
    pub(super) fn has_said(&self, speaker: Speaker, front: &TreeFront, words: &[u8]) -> bool {
        self.get(speaker.id).is_some_and(|link| {
            let said = &link.said;
            (said.hops, said.parent, said.by_parent)
                == (front.hops, front.parent, speaker.is_parent)
                && link.words == words
        })
    }

    /// Takes in what a neighbour says that has said the same before; nothing for a number that is not newer than the last.
    #[inline]
    pub(super) fn hear_again(
        &mut self,
        id: NodeId,
        front: &TreeFront,
        now: Timestamp,
    ) -> Option<Heard> {
        let link = self.links.get_mut(id)?;
        let missed = link.missed_before(front.beat, link.said.aside)?;
        (link.said.beat, link.said.pulse) = (front.beat, front.pulse);
        let is_child = link.is_child_of(self.own);
        let link_changed = link.is_heard(now, missed, self.pace);
        if is_child && link_changed.is_back {
            self.below.take();
        }
        Some(Heard {
            has_progressed: false,
            has_moved: link_changed.is_back || link_changed.turns,
            is_new: false,
        })
    }

    /// Takes in what a neighbour says, in the words behind its front; nothing for a number that is not newer than the
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
        let missed = link.missed_before(said.front.beat, said.aside)?;
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
            has_moved: changed.way || link_changed.is_back || link_changed.turns,
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
    pub(super) fn hear_of_another_reign(
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
            link.told_of_reign = Some(0);
        }
    }

    /// Whether a neighbour that says this hears this drone, as far as is known.
    pub(super) fn is_symmetric(&self, id: NodeId, said: &TreeFrame<'_>) -> bool {
        says_to_hear(self.own, said)
            .unwrap_or_else(|| self.get(id).is_some_and(|link| link.symmetric))
            || flaw::has(Flaw::ObeysOneWayNeighbours)
    }

    /// Forgets what neighbours said under a master that is not obeyed any more.
    pub(super) fn forget_reign(&mut self) {
        self.below.take();
        for link in self.links.iter_mut() {
            link.said = Said {
                beat: link.said.beat,
                aside: link.said.aside,
                ..Said::default()
            };
            link.words = Bytes::new();
            link.sets = None;
            link.given_up = 0;
            link.asks = false;
            link.told_of_reign = Some(0);
        }
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
            link.given_up = 0;
        }
        self.below.take();
    }

    /// The medium gave up to reach a neighbour.
    pub(super) fn gave_up(&mut self, id: NodeId) {
        if let Some(link) = self.links.get_mut(id) {
            link.given_up += 1;
        }
        self.below.take();
    }

    /// A neighbour did not answer to anything: it is out of reach until it is heard again.
    pub(super) fn suspect(&mut self, id: NodeId) {
        if let Some(link) = self.links.get_mut(id) {
            link.given_up = GIVEN_UP_MAX;
        }
        self.below.take();
    }

    /// A neighbour waits for an answer.
    pub(super) fn asks(&mut self, id: NodeId) {
        if let Some(link) = self.links.get_mut(id) {
            link.asks = true;
        }
    }

    /// A neighbour, or all, are answered.
    pub(super) fn answered(&mut self, to: Option<NodeId>) {
        for link in self.links.iter_mut() {
            link.asks &= to.is_some_and(|to| to != link.id);
            if let Some(times) = &mut link.told_of_reign {
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

    /// Whom this drone hears.
    pub(super) fn heard_lately(&self, now: Timestamp, time_to_live: Duration) -> NodeSet {
        let heard = self
            .iter()
            .filter(|link| self.hears(link, now, time_to_live));
        heard.map(|link| link.id).collect()
    }

    /// Whether this drone hears a neighbour. One that has been silent for as long as no living neighbour is, and for half
    /// its `time_to_live`, is not heard any more; nor, until it has been heard under the present reign, one that has been
    /// silent for so long that it would be asked: a drone that has gone deaf, and claims to lead, shall be believed by
    /// nobody. Likewise one that has been silent for longer than it was known before: that little was heard of it is no
    /// reason to believe for longer that it is.
    pub(super) fn hears(&self, link: &Link, now: Timestamp, time_to_live: Duration) -> bool {
        let silent_for = now.since(link.heard_at);
        let stale = self.beacon * link.quality.stale_beacons.into();
        if silent_for <= stale || link.told_of_reign.is_some() {
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

    pub(super) const fn len(&self) -> usize {
        self.links.len()
    }
}

/// Whether a neighbour says that it hears `own`, or shows it, if it says anything of that.
fn says_to_hear(own: NodeId, said: &TreeFrame<'_>) -> Option<bool> {
    if said.front.parent == Some(own) || said.to == Some(own) {
        Some(true)
    } else {
        said.hears(own)
    }
}

/// How a child's words differ from those before, or a parent's.
struct Changed {
    /// It knows of another order, or of others who have carried it out.
    progress: bool,
    /// That, or others are below it or going to land.
    any: bool,
    /// It is farther from the master or nearer, or has another parent.
    way: bool,
}

impl Link {
    /// Keeps what matters to `own` of its words; how they differ from those before.
    fn keep(
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
                }
                if is_kin {
                    progress |= keep(&mut sets.acknowledged, said.acknowledged());
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
        Changed {
            progress,
            any: any || progress,
            way: (before.hops, before.parent) != (said.front.hops, said.front.parent),
        }
    }
}

impl Said {
    /// What is kept of a speaker's words by `own`.
    fn of(said: &TreeFrame<'_>, own: NodeId, speaker: Speaker) -> Self {
        let TreeFront {
            beat,
            hops,
            parent,
            pulse,
        } = said.front;
        Self {
            beat,
            aside: said.aside,
            hops,
            parent,
            pulse,
            sequence: said.sequence,
            to: said.to,
            is_beacon: said.hears.is_some(),
            hears_own: says_to_hear(own, said),
            master_lands: (speaker.master).is_some_and(|master| said.is_landing(master)),
            by_parent: speaker.is_parent,
        }
    }
}
