//! When something is said again that was not seen to arrive, and how often a drone may speak at all.

use std::time::Duration;

use super::link_table::LinkTable;
use crate::identity::{NodeId, NodeSet};
use crate::routing::core::Core;
use crate::time::{Timestamp, first_of};

/// The share of a repair that passes until what the medium gave up is tried again.
const RETRY_SHARE: u32 = 4;
/// After so many tries each pause is longer than the one before by half: until then losses are by chance.
const STEADY_TRIES: u32 = 4;
/// After how many tries in which nothing was heard of a parent it is suspected to be out of reach.
const TRIES_MAX: u32 = 6;
/// Each neighbour that is asked by the same frame answers within this, by chance: an answer of 150 bytes takes a third of
/// a millisecond over 802.11a at 6 Mb/s, back-off included.
const ANSWER_SLOT: Duration = Duration::from_micros(500);
/// How long a second copy waits: beyond the answers to the first.
const COPY_REPAIRS: u32 = 2;
/// Each neighbour that passes an order on at the same time makes a drone wait so long for its turn, at most: two of them
/// may not hear each other, and collide at those that hear both.
const RELAY_SLOT: Duration = Duration::from_micros(300);
/// However many these are.
const RELAY_SLOTS_MAX: u32 = 10;

/// How often a drone may speak: less than a radio lets in of one sender (`radio::Config::budget`), so that nothing that
/// it says is dropped for being too much.
const PACE: Duration = Duration::from_millis(6);
/// How much of that it may save up.
const BURST: u32 = 20;

/// What waits to be said again.
///
/// Invariant: every time in it lies behind the step in which it was set; an attempt goes on until nobody is owed
/// anything.
#[derive(Debug, Default)]
pub(super) struct Retransmission {
    attempt: Option<Attempt>,
    /// When a new order is passed on.
    relay_at: Option<Timestamp>,
    /// When those that ask are answered, and when others were last.
    answer_at: Option<Timestamp>,
    answered_at: Option<Timestamp>,
    /// When the newest order is said to all once more, and which one that was.
    copy: Option<(Timestamp, u32)>,
    /// When a neighbour is asked for an order that this drone has missed.
    ask: Option<(Timestamp, NodeId)>,
    /// When all that this drone may save up of its pace will be saved up again.
    full_at: Timestamp,
}

/// Something that was said and has not been seen to arrive.
#[derive(Debug, Clone, Copy)]
struct Attempt {
    since: Timestamp,
    due: Timestamp,
    pause: Duration,
    tries: u32,
}

/// What is due.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Due {
    /// A new order.
    Relay,
    /// What was not seen to arrive.
    Repair,
    /// An answer to those that ask.
    Answer,
    /// The newest order once more, if it is still this one.
    Copy(u32),
    /// A question for an order that this drone has missed.
    Ask(NodeId),
}

impl Retransmission {
    pub(super) fn begin_epoch(&mut self) {
        *self = Self {
            full_at: self.full_at,
            ..Self::default()
        };
    }

    /// A newer order than before makes attempts to pass on another one pointless.
    pub(super) const fn begin_order(&mut self) {
        self.attempt = None;
        self.relay_at = None;
        self.copy = None;
        self.ask = None;
    }

    /// When the next of it is due.
    pub(super) fn deadline(&self) -> Option<Timestamp> {
        let attempt = self.attempt.map(|it| it.due);
        let copy = self.copy.map(|it| it.0);
        let ask = self.ask.map(|it| it.0);
        let first = first_of([self.relay_at, attempt, self.answer_at, copy, ask]);
        first.map(|due| due.max(self.speaks_at()))
    }

    /// The first time at which the pace allows for another frame.
    fn speaks_at(&self) -> Timestamp {
        Timestamp::ZERO + self.full_at.since(Timestamp::ZERO + PACE * (BURST - 1))
    }

    /// Takes what is due by `now`.
    pub(super) fn take_due(&mut self, now: Timestamp) -> Option<Due> {
        if self.speaks_at() > now {
            return None;
        }
        if self.relay_at.is_some_and(|at| at <= now) {
            self.relay_at = None;
            return Some(Due::Relay);
        }
        if self.answer_at.is_some_and(|at| at <= now) {
            self.answer_at = None;
            self.answered_at = Some(now);
            return Some(Due::Answer);
        }
        if let Some((_, sequence)) = self.copy.filter(|(at, _)| *at <= now) {
            self.copy = None;
            return Some(Due::Copy(sequence));
        }
        if let Some((_, neighbour)) = self.ask.filter(|(at, _)| *at <= now) {
            self.ask = None;
            return Some(Due::Ask(neighbour));
        }
        self.attempt
            .is_some_and(|it| it.due <= now)
            .then_some(Due::Repair)
    }

    /// Whether the pace allows for a frame now; where it does not, the frame is said as a repair as soon as it does.
    pub(super) fn may_speak(&mut self, now: Timestamp, repair: Duration) -> bool {
        let may = self.speaks_at() <= now;
        if !may {
            let due = self.speaks_at();
            self.bring_forward(now, due, repair);
        }
        may
    }

    /// A frame leaves.
    pub(super) fn spoken(&mut self, now: Timestamp) {
        self.full_at = self.full_at.max(now) + PACE;
    }

    /// Whether anything waits to be repaired.
    pub(super) const fn is_under_way(&self) -> bool {
        self.attempt.is_some()
    }

    /// Nobody is owed anything any more.
    pub(super) const fn end(&mut self) {
        self.attempt = None;
    }

    /// Something new was said that somebody is not known to know.
    pub(super) fn begin(&mut self, core: &mut Core, now: Timestamp, repair: Duration) {
        self.attempt = Some(Attempt {
            since: now,
            due: now + repair / 2 + core.jitter(repair),
            pause: repair,
            tries: 0,
        });
    }

    /// What is not known to have arrived was said once more.
    pub(super) fn go_on(
        &mut self,
        core: &mut Core,
        now: Timestamp,
        (repair, repair_max): (Duration, Duration),
    ) {
        let Some(attempt) = &mut self.attempt else {
            return self.begin(core, now, repair);
        };
        attempt.tries += 1;
        if attempt.tries > STEADY_TRIES {
            attempt.pause = (attempt.pause * 3 / 2).min(repair_max);
        }
        attempt.due = now + attempt.pause / 2 + core.jitter(attempt.pause);
    }

    /// What is not known to have arrived is said at `due` at the latest.
    pub(super) fn bring_forward(&mut self, now: Timestamp, due: Timestamp, repair: Duration) {
        match &mut self.attempt {
            Some(attempt) => attempt.due = attempt.due.min(due),
            None => {
                self.attempt = Some(Attempt {
                    since: now,
                    due,
                    pause: repair,
                    tries: 0,
                });
            }
        }
    }

    /// Somebody lacks what this drone knows and has not been told it: it is said soon, once for all that do.
    pub(super) fn hurry(&mut self, core: &mut Core, now: Timestamp, repair: Duration) {
        let due = now + repair / 16 + core.jitter(repair / 4);
        self.bring_forward(now, due, repair);
    }

    /// The medium gave a frame up: it is tried again sooner than if nothing were known of it.
    pub(super) fn retry(&mut self, core: &mut Core, now: Timestamp, repair: Duration) {
        let pause = self.attempt.map_or(repair, |it| it.pause) / RETRY_SHARE;
        let due = now + pause / 4 + core.jitter(pause);
        self.bring_forward(now, due, repair);
    }

    /// A new order is to be passed on, as `others` near do at the same time.
    pub(super) fn relay(&mut self, core: &mut Core, now: Timestamp, others: usize) {
        let others = u32::try_from(others).unwrap_or(u32::MAX);
        let within = RELAY_SLOT
            .saturating_mul(others)
            .min(RELAY_SLOT * RELAY_SLOTS_MAX);
        self.relay_at = Some(now + core.jitter(within));
    }

    /// Somebody asks, beside `asked - 1` others that hear the same frame. Those that ask again and again are answered once
    /// in a repair.
    pub(super) fn answer(
        &mut self,
        core: &mut Core,
        now: Timestamp,
        (asked, repair): (usize, Duration),
    ) {
        let asked = u32::try_from(asked).unwrap_or(u32::MAX).max(1);
        let at = now + ANSWER_SLOT / 4 + core.jitter(ANSWER_SLOT.saturating_mul(asked));
        let at = self
            .answered_at
            .map_or(at, |before| at.max(before + repair));
        self.answer_at = Some(self.answer_at.map_or(at, |known| known.min(at)));
    }

    /// A neighbour has said more than this drone knows: it is asked if nobody says more before.
    pub(super) fn ask(
        &mut self,
        core: &mut Core,
        now: Timestamp,
        neighbour: NodeId,
        repair: Duration,
    ) {
        let at = now + repair / 16 + core.jitter(repair / 2);
        self.ask.get_or_insert((at, neighbour));
    }

    /// An order was said to all; `leaves` of those that it is for are trusted to have heard it.
    pub(super) fn copy_for(
        &mut self,
        core: &mut Core,
        now: Timestamp,
        leaves: usize,
        repair: Duration,
    ) {
        if leaves > 0 {
            let at = now + repair * COPY_REPAIRS + core.jitter(repair);
            self.copy = Some((at, core.sequence()));
        }
    }

    /// Whether a parent that was last heard at `heard_at` has been silent for as long as this drone has tried to reach it.
    pub(super) fn has_tried_in_vain(&self, heard_at: Timestamp) -> bool {
        self.attempt
            .is_some_and(|it| it.tries >= TRIES_MAX && heard_at < it.since)
    }
}

/// The neighbours for whom this drone has something.
#[derive(Debug, Clone, Default)]
pub(super) struct Owed {
    /// Not known to know what this drone has for them, those that are trusted to have heard it left out.
    pub(super) unaware: NodeSet,
    /// Trusted: leaves over links that lose next to nothing, which have not shown yet that they know the newest order.
    pub(super) trusted: NodeSet,
    /// Asking.
    pub(super) asking: NodeSet,
}

impl Owed {
    /// Looks at all neighbours; `parent` is given if it lacks something. A child that has been silent for longer than by
    /// chance is owed nothing until it is heard again: it may have taken another parent out of hearing.
    pub(super) fn of(
        core: &Core,
        links: &LinkTable,
        parent: Option<NodeId>,
        (now, beacon): (Timestamp, Duration),
    ) -> Self {
        let sequence = core.sequence();
        let mut owed = Self::default();
        for link in links.iter() {
            if link.asks {
                owed.asking.insert(link.id);
            }
            let is_child_behind = link.is_child_of(core.id) && !link.knows(sequence);
            if parent == Some(link.id) || link.obeys_another() {
                owed.unaware.insert(link.id);
            } else if is_child_behind && !link.is_stale(now, beacon) {
                if link.is_leaf_of(core.id) && link.is_trusted() {
                    owed.trusted.insert(link.id);
                } else {
                    owed.unaware.insert(link.id);
                }
            }
        }
        owed
    }

    /// Whether something is to be said again, as far as this drone knows.
    pub(super) fn is_anyone_behind(&self) -> bool {
        !self.unaware.is_empty() || !self.asking.is_empty()
    }

    /// All of them.
    pub(super) fn all(&self) -> NodeSet {
        let mut all = self.unaware.clone();
        all.extend_from(&self.trusted);
        all.extend_from(&self.asking);
        all
    }
}

#[cfg(test)]
mod tests;
