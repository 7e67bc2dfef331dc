use std::collections::BTreeMap;
use std::time::Duration;

use crate::flaw::{self, Flaw};
use crate::identity::{NodeId, NodeSet};
use crate::routing::packet::Tree;
use crate::time::Timestamp;

/// How many frames an estimate of a link's loss remembers; it is their mean as long as there were fewer.
const LOSS_MEMORY: u32 = 50;
/// How unlikely it must be that a living neighbour is silent for as long as it takes to be given up.
const LOST: f64 = 1e-6;
/// How unlikely it must be that it is silent for as long as it takes to prefer another, and to ask whether it is there.
const STALE: f64 = 1e-2;
/// How unlikely it must be that a living neighbour answers none of the questions whether it is there.
const UNANSWERED: f64 = 1e-9;
/// However lossy a link is, no more questions are asked.
pub(super) const QUESTIONS_MAX: f64 = 40.0;
/// However lossy a link is, it is given up after this many beacons.
const LOST_BEACONS_MAX: f64 = 30.0;
/// And asked after this many: to ask costs a frame.
pub(super) const STALE_BEACONS_MAX: f64 = 5.0;

/// After how many times that the medium gave up to reach a neighbour, which was not heard in between, it is taken to be
/// out of reach.
const GIVEN_UP_MAX: u32 = 2;

/// How often a neighbour is told of a new reign beyond what is said anyway.
const TOLD_OF_REIGN_MAX: u32 = 8;

/// What is known of each neighbour, from the frames of its own that were heard.
#[derive(Debug, Clone, Default)]
pub(super) struct Links(BTreeMap<NodeId, Link>);

/// What is known of one neighbour.
#[derive(Debug, Clone)]
pub(super) struct Link {
    pub(super) heard_at: Timestamp,
    /// Whether the neighbour has heard this drone too: only then the link counts.
    pub(super) symmetric: bool,
    /// Since when it has left this drone out whenever it said whom it hears.
    left_out: Option<Timestamp>,
    /// The share of the neighbour's frames that was missed lately, told from the gaps between their numbers.
    pub(super) loss: f64,
    /// How many frames that was told from, up to [`LOSS_MEMORY`].
    frames: u32,
    /// What the medium says has arrived there: of which order, and who has carried it out.
    told: (u32, NodeSet),
    /// How often the medium has given up to reach it since it was heard.
    given_up: u32,
    /// Whether it repeated itself to this drone and has not been answered.
    pub(super) asks: bool,
    /// How often it has been told of the reign that it was not heard under yet; nothing once it was.
    told_of_reign: Option<u32>,
    /// What it said last; of the neighbours that it hears, only [`Self::symmetric`] is kept.
    pub(super) said: Tree,
}

impl Link {
    /// Whether it can be reached, as far as is known.
    pub(super) const fn is_reachable(&self) -> bool {
        self.given_up < GIVEN_UP_MAX
    }

    /// Whether it is perhaps not aware of the reign, though it hears this drone.
    pub(super) fn obeys_another(&self) -> bool {
        let told = self.told_of_reign;
        self.symmetric && told.is_some_and(|times| times < TOLD_OF_REIGN_MAX)
    }

    /// Whether it has just said that it does not hear this drone, which it did before.
    pub(super) const fn needs_to_hear(&self) -> bool {
        self.symmetric && self.left_out.is_some()
    }

    /// Whether it knows of an order, as it said or the medium did.
    pub(super) fn knows(&self, sequence: u32) -> bool {
        self.said.sequence.max(self.told.0) >= sequence
    }

    /// Who has carried an order out, as far as it is known to know.
    pub(super) fn knows_acknowledged(&self, sequence: u32) -> NodeSet {
        let mut all = NodeSet::default();
        if self.said.sequence == sequence {
            all.extend_from(&self.said.acknowledged);
        }
        if self.told.0 == sequence {
            all.extend_from(&self.told.1);
        }
        all
    }

    /// Takes into the estimate of the loss that a frame was missed (1) or heard (0).
    fn learn(&mut self, missed: f64) {
        self.frames = (self.frames + 1).min(LOSS_MEMORY);
        self.loss += (missed - self.loss) / f64::from(self.frames);
    }

    /// Whether it has been silent for so long that another way would be better.
    pub(super) fn is_stale(&self, now: Timestamp, beacon: Duration) -> bool {
        now > self.stale_at(beacon)
    }

    /// From when on that is so, unless it is heard.
    pub(super) fn stale_at(&self, beacon: Duration) -> Timestamp {
        self.heard_at + self.patience(beacon, STALE, STALE_BEACONS_MAX)
    }

    /// How long a neighbour that speaks once a beacon may be silent by a chance of `odds`.
    fn patience(&self, beacon: Duration, odds: f64, beacons_max: f64) -> Duration {
        let beacons = libm::log(odds) / libm::log(self.cautious_loss());
        beacon.mul_f64(beacons.ceil().min(beacons_max))
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
    /// Takes in what a neighbour says; false for a number that is not newer than the last. One that has left this drone
    /// out for a beacon does not hear it.
    pub(super) fn hear(
        &mut self,
        own: NodeId,
        id: NodeId,
        said: Tree,
        now: Timestamp,
        beacon: Duration,
    ) -> bool {
        let symmetric = self.is_symmetric(own, id, &said);
        match self.0.get_mut(&id) {
            None => {
                let link = Link {
                    heard_at: now,
                    symmetric,
                    left_out: None,
                    loss: 0.0,
                    frames: 0,
                    told: (0, NodeSet::default()),
                    given_up: 0,
                    asks: false,
                    told_of_reign: None,
                    said,
                };
                self.0.insert(id, link);
                true
            }
            Some(link) if said.beat <= link.said.beat => false,
            Some(link) => {
                let missed = said.beat - link.said.beat - 1;
                for _ in 0..missed.min(LOSS_MEMORY) {
                    link.learn(1.0);
                }
                link.learn(0.0);
                link.heard_at = now;
                link.given_up = 0;
                link.told_of_reign = None;
                if !said.tells(&link.told) {
                    // It restarted, or spoke before it knew.
                    link.told = (0, NodeSet::default());
                }
                let leaves_out = !symmetric && said.hears.is_some();
                link.left_out = leaves_out.then(|| link.left_out.unwrap_or(now));
                // At first it may have restarted: it hears this drone again when that speaks.
                let is_new = link.left_out.is_none_or(|since| now.since(since) < beacon);
                link.symmetric = symmetric || (link.symmetric && is_new);
                link.said = said;
                true
            }
        }
    }

    /// Takes in that a neighbour is there that obeys another master: this drone lets it know that it is heard, and learns
    /// whether it hears this one.
    pub(super) fn hear_of_another_reign(
        &mut self,
        own: NodeId,
        id: NodeId,
        said: &Tree,
        now: Timestamp,
        beacon: Duration,
    ) {
        let said = Tree {
            beat: said.beat,
            hears: said.hears.clone(),
            ..Tree::default()
        };
        self.hear(own, id, said, now, beacon);
        if let Some(link) = self.0.get_mut(&id) {
            link.told_of_reign = Some(0);
        }
    }

    /// Whether a neighbour that says this hears `own`, as far as is known.
    pub(super) fn is_symmetric(&self, own: NodeId, id: NodeId, said: &Tree) -> bool {
        let was = self.0.get(&id).is_some_and(|link| link.symmetric);
        let hears_us = said.hears.as_ref().map(|hears| hears.contains(own));
        said.parent == Some(own)
            || said.to == Some(own)
            || hears_us.unwrap_or(was)
            || flaw::has(Flaw::ObeysOneWayNeighbours)
    }

    /// Forgets what neighbours said under a master that is not obeyed any more.
    pub(super) fn forget_reign(&mut self) {
        for link in self.0.values_mut() {
            link.said = Tree {
                beat: link.said.beat,
                ..Tree::default()
            };
            link.told = (0, NodeSet::default());
            link.given_up = 0;
            link.asks = false;
            link.told_of_reign = Some(0);
        }
    }

    /// This drone heard nobody, through no fault of theirs: everybody's silence begins anew.
    pub(super) fn forgive(&mut self, now: Timestamp) {
        for link in self.0.values_mut() {
            link.heard_at = now;
        }
    }

    pub(super) fn forget(&mut self, id: NodeId) {
        self.0.remove(&id);
    }

    /// A neighbour has been told something, as the medium says.
    pub(super) fn told(&mut self, id: NodeId, told: &Tree) {
        if let Some(link) = self.0.get_mut(&id) {
            if told.sequence > link.told.0 {
                link.told = (told.sequence, NodeSet::default());
            }
            if told.sequence == link.told.0 {
                link.told.1.extend_from(&told.acknowledged);
            }
            link.given_up = 0;
        }
    }

    /// The medium gave up to reach a neighbour.
    pub(super) fn gave_up(&mut self, id: NodeId) {
        if let Some(link) = self.0.get_mut(&id) {
            link.given_up += 1;
        }
    }

    /// A neighbour did not answer to anything: it is out of reach until it is heard again.
    pub(super) fn suspect(&mut self, id: NodeId) {
        if let Some(link) = self.0.get_mut(&id) {
            link.given_up = GIVEN_UP_MAX;
        }
    }

    /// A neighbour waits for an answer.
    pub(super) fn asks(&mut self, id: NodeId) {
        if let Some(link) = self.0.get_mut(&id) {
            link.asks = true;
        }
    }

    /// A neighbour, or all, are answered.
    pub(super) fn answered(&mut self, to: Option<NodeId>) {
        for (id, link) in &mut self.0 {
            link.asks &= to.is_some_and(|to| to != *id);
            if let Some(times) = &mut link.told_of_reign {
                *times += 1;
            }
        }
    }

    /// Forgets neighbours that have been silent for too long, which a lossy link makes longer than `time_to_live`;
    /// who they were.
    pub(super) fn forget_silent(
        &mut self,
        now: Timestamp,
        time_to_live: Duration,
        beacon: Duration,
    ) -> Vec<NodeId> {
        let silent: Vec<NodeId> = self
            .0
            .iter()
            .filter(|(_, link)| {
                now.since(link.heard_at)
                    > time_to_live.max(link.patience(beacon, LOST, LOST_BEACONS_MAX))
            })
            .map(|(id, _)| *id)
            .collect();
        for id in &silent {
            self.0.remove(id);
        }
        silent
    }

    pub(super) fn get(&self, id: NodeId) -> Option<&Link> {
        self.0.get(&id)
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = (NodeId, &Link)> {
        self.0.iter().map(|(id, link)| (*id, link))
    }

    /// Neighbours that take `own` for their parent, those apart that are out of reach.
    pub(super) fn children(&self, own: NodeId) -> impl Iterator<Item = (NodeId, &Link)> {
        self.iter()
            .filter(move |(_, link)| link.said.parent == Some(own) && link.is_reachable())
    }

    /// Whom this drone hears. One that has been silent for as long as no living neighbour is, is not heard any more; nor,
    /// until it has been heard under the present reign, one that has been silent for so long that it would be asked: a
    /// drone that has gone deaf, and claims to lead, shall be believed by nobody.
    pub(super) fn heard_lately(&self, now: Timestamp, beacon: Duration) -> NodeSet {
        let is_heard = |link: &Link| {
            let patience = match link.told_of_reign {
                Some(_) => link.patience(beacon, STALE, STALE_BEACONS_MAX),
                None => link.patience(beacon, LOST, LOST_BEACONS_MAX),
            };
            now.since(link.heard_at) <= patience
        };
        let heard = self.iter().filter(|(_, link)| is_heard(link));
        heard.map(|(id, _)| id).collect()
    }

    pub(super) fn len(&self) -> usize {
        self.0.len()
    }
}
