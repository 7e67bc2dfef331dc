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
pub(super) struct TokenBucket {
    /// When the whole burst will have been earned back.
    full_at: Timestamp,
}

impl TokenBucket {
    /// From which nothing was taken yet.
    pub(super) const FULL: Self = Self {
        full_at: Timestamp::ZERO,
    };

    /// Whether there is one left.
    #[inline]
    pub(super) fn has_left(&self, now: Timestamp, budget: &Budget) -> bool {
        if self.full_at <= now {
            return budget.burst > 0;
        }
        let full_at = self.full_at + budget.interval;
        full_at.since(now) <= budget.interval * budget.burst
    }

    /// When there is one left, at the latest.
    pub(super) fn earns_at(&self, budget: &Budget) -> Timestamp {
        let rest = budget.interval * budget.burst.saturating_sub(1);
        Timestamp::ZERO + self.full_at.since(Timestamp::ZERO + rest)
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

/// How many of these may come from one host, from whichever of its ports: a tenth of all. Drones share a host only where
/// they share a machine, which then has some dozens of them that ask each other at their start.
const OF_ONE_HOST: Budget = Budget {
    interval: Duration::from_millis(10),
    burst: 128,
};

/// The port that stands for all of a host: nobody sends from it.
const ALL_PORTS: u16 = 0;

/// How many hosts and homes are remembered from which frames came that were looked at in vain.
const SOURCES_MAX: usize = 64;

/// What was looked at in vain: forgeries, whose sender nobody knows.
#[derive(Debug)]
pub(super) struct Forgeries {
    in_all: TokenBucket,
    /// Hosts and homes from which the last ones came.
    sources: Vec<(Source, TokenBucket)>,
}

const fn all_of(source: Source) -> Source {
    Source {
        port: ALL_PORTS,
        ..source
    }
}

impl Forgeries {
    pub(super) const fn new() -> Self {
        Self {
            in_all: TokenBucket::FULL,
            sources: Vec::new(),
        }
    }

    /// Whether one more may be looked at, of a sender that is not at home there.
    #[inline]
    pub(super) fn has_left(&self, now: Timestamp, source: Option<Source>) -> bool {
        self.in_all.has_left(now, &IN_ALL)
            && source.is_none_or(|source| self.has_left_at(all_of(source), now, &OF_ONE_HOST))
    }

    /// Whether one more may be looked at from a sender's home, of which so many may come.
    #[inline]
    pub(super) fn has_left_at(&self, home: Source, now: Timestamp, budget: &Budget) -> bool {
        let known = self.sources.iter().find(|it| it.0 == home);
        known.is_none_or(|(_, bucket)| bucket.has_left(now, budget))
    }

    /// One was looked at in vain, of a sender that is not at home there.
    pub(super) fn charge(&mut self, now: Timestamp, source: Option<Source>) {
        self.in_all.charge(now, &IN_ALL);
        if let Some(source) = source {
            self.charge_at(all_of(source), now, &OF_ONE_HOST);
        }
    }

    /// One from a sender's home was looked at in vain. Others may come from elsewhere as before.
    pub(super) fn charge_at(&mut self, home: Source, now: Timestamp, budget: &Budget) {
        let known = self.sources.iter().position(|it| it.0 == home);
        let at = known.unwrap_or_else(|| self.enter(home));
        self.sources[at].1.charge(now, budget);
    }

    /// Remembers a source, in the place of the one that has earned most back if there is no room.
    fn enter(&mut self, source: Source) -> usize {
        let entry = (source, TokenBucket::FULL);
        if self.sources.len() < SOURCES_MAX {
            self.sources.push(entry);
            return self.sources.len() - 1;
        }
        let buckets = self.sources.iter().enumerate();
        let least = buckets.min_by_key(|(_, (_, bucket))| bucket.full_at);
        let at = least.map_or(0, |(at, _)| at);
        self.sources[at] = entry;
        at
    }
}
