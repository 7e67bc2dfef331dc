//! Lists of the expelled, passed on from drone to drone: whoever has a newer one than the others says it.

use std::time::Duration;

use crate::time::Timestamp;

/// How often a radio says which list it has, and how soon it says so to whoever has a newer one.
const NUMBER_INTERVAL: Duration = Duration::from_secs(10);
const ANSWER_INTERVAL: Duration = Duration::from_secs(1);

/// How soon after one list the next may follow: for whoever has an older one, and for whoever is on it and speaks all the
/// same.
const LIST_INTERVAL: Duration = Duration::from_secs(1);
const TELLING_INTERVAL: Duration = Duration::from_secs(10);

/// What is to be said of the list that a radio has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Saying {
    /// Its number.
    Number,
    /// All of it.
    List,
}

/// When a radio says which list it has, and when it says the list.
#[derive(Debug)]
pub(super) struct Gossip {
    /// The number of the newest list that it has passed on, or had from the start.
    passed_on: u64,
    /// When it last said which list it has.
    numbered_at: Option<Timestamp>,
    /// When the list was last said to all, by itself or by another.
    listed_at: Option<Timestamp>,
    /// Whether somebody has a newer list.
    wants: bool,
    /// Whether somebody has an older one, or is on it.
    is_wanted: bool,
}

impl Gossip {
    /// Of a radio that starts with this list: it says so at once.
    pub(super) const fn new(known: u64) -> Self {
        Self {
            passed_on: known,
            numbered_at: None,
            listed_at: None,
            wants: false,
            is_wanted: false,
        }
    }

    /// A peer says which list it has.
    pub(super) const fn hears_number(&mut self, theirs: u64, own: u64) {
        self.wants |= theirs > own;
        self.is_wanted |= theirs < own;
    }

    /// A peer has said the list that this radio has, to all.
    pub(super) const fn hears_list(&mut self, now: Timestamp) {
        self.is_wanted = false;
        self.listed_at = Some(now);
    }

    /// Somebody speaks who was expelled, or a frame says so.
    pub(super) fn hears_revoked(&mut self, now: Timestamp) {
        let told_at = self.listed_at.map(|at| at + TELLING_INTERVAL);
        self.is_wanted |= told_at.is_none_or(|at| at <= now);
    }

    /// When its number is to be said, and when the list.
    fn times(&self) -> (Timestamp, Option<Timestamp>) {
        let interval = if self.wants {
            ANSWER_INTERVAL
        } else {
            NUMBER_INTERVAL
        };
        let after =
            |at: Option<Timestamp>, interval| at.map_or(Timestamp::ZERO, |at| at + interval);
        let list_at = self.is_wanted.then(|| after(self.listed_at, LIST_INTERVAL));
        (after(self.numbered_at, interval), list_at)
    }

    pub(super) fn deadline(&self) -> Timestamp {
        let (number_at, list_at) = self.times();
        list_at.map_or(number_at, |at| at.min(number_at))
    }

    /// What is to be said now, if anything, of the list with this number.
    pub(super) fn due(&mut self, now: Timestamp, own: u64) -> Option<Saying> {
        let (number_at, list_at) = self.times();
        if own > self.passed_on || list_at.is_some_and(|at| at <= now) {
            self.passed_on = own;
            self.listed_at = Some(now);
            self.is_wanted = false;
            return Some(Saying::List);
        }
        (number_at <= now).then(|| {
            self.numbered_at = Some(now);
            self.wants = false;
            Saying::Number
        })
    }
}
