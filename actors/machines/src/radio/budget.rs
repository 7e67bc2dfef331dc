use std::time::Duration;

use super::Source;
use crate::time::Timestamp;

/// How much of something is allowed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Budget {
    /// How long it takes to earn one.
    pub interval: Duration,
    /// How many may come at once.
    pub burst: u32,
}

/// What is left of a budget.
#[derive(Debug, Clone, Copy)]
pub(super) struct Account {
    /// When the whole burst will have been earned back.
    full_at: Timestamp,
}

impl Account {
    /// From which nothing was taken yet.
    pub(super) const FULL: Self = Self {
        full_at: Timestamp::ZERO,
    };

    /// Whether there is one left.
    #[inline]
    pub(super) fn has_left(&self, now: Timestamp, budget: &Budget) -> bool {
        let full_at = self.full_at.max(now) + budget.interval;
        full_at.since(now) <= budget.interval * budget.burst
    }

    #[inline]
    pub(super) fn charge(&mut self, now: Timestamp, budget: &Budget) {
        self.full_at = self.full_at.max(now) + budget.interval;
    }
}

/// How many frames are looked at in vain that do not come from where their sender was last proven to be: a signature
/// that takes a tenth of a millisecond to check costs a tenth of a processor at most.
const IN_ALL: Budget = Budget {
    interval: Duration::from_millis(1),
    burst: 256,
};

/// How many of these may come from one source.
const OF_ONE_SOURCE: Budget = Budget {
    interval: Duration::from_millis(100),
    burst: 20,
};

/// How many sources are remembered from which such frames came.
const SOURCES_MAX: usize = 64;

/// What was looked at in vain: forgeries, whose sender nobody knows.
#[derive(Debug)]
pub(super) struct Forgeries {
    in_all: Account,
    /// Those from which the last ones came.
    sources: Vec<(Source, Account)>,
}

impl Forgeries {
    pub(super) const fn new() -> Self {
        Self {
            in_all: Account::FULL,
            sources: Vec::new(),
        }
    }

    /// Whether one more may be looked at.
    #[inline]
    pub(super) fn has_left(&self, now: Timestamp, source: Option<Source>) -> bool {
        let of_source = source.and_then(|source| self.sources.iter().find(|it| it.0 == source));
        self.in_all.has_left(now, &IN_ALL)
            && of_source.is_none_or(|(_, account)| account.has_left(now, &OF_ONE_SOURCE))
    }

    /// One was looked at in vain.
    pub(super) fn charge(&mut self, now: Timestamp, source: Option<Source>) {
        self.in_all.charge(now, &IN_ALL);
        let Some(source) = source else {
            return;
        };
        let known = self.sources.iter().position(|it| it.0 == source);
        let at = known.unwrap_or_else(|| self.enter(source));
        self.sources[at].1.charge(now, &OF_ONE_SOURCE);
    }

    /// Remembers a source, in the place of the one that has earned most back if there is no room.
    fn enter(&mut self, source: Source) -> usize {
        let entry = (source, Account::FULL);
        if self.sources.len() < SOURCES_MAX {
            self.sources.push(entry);
            return self.sources.len() - 1;
        }
        let accounts = self.sources.iter().enumerate();
        let least = accounts.min_by_key(|(_, (_, account))| account.full_at);
        let at = least.map_or(0, |(at, _)| at);
        self.sources[at] = entry;
        at
    }
}
