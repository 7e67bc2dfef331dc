use std::time::Duration;

use super::Source;
use crate::time::Timestamp;

/// Rate limit of a token bucket.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Budget {
    /// Time to refill one token.
    pub interval: Duration,
    /// Capacity of the bucket.
    pub burst: u32,
}

/// Token bucket.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TokenBucket {
    /// Time when the bucket will be full.
    full_at: Timestamp,
}

impl TokenBucket {
    /// A full bucket.
    pub(crate) const FULL: Self = Self {
        full_at: Timestamp::ZERO,
    };

    /// Whether a token is left.
    #[inline]
    pub(crate) fn has_tokens(&self, now: Timestamp, budget: &Budget) -> bool {
        if self.full_at <= now {
            return budget.burst > 0;
        }
        let full_at = self.full_at + budget.interval;
        full_at.since(now) <= budget.interval * budget.burst
    }

    /// Latest time at which a token is available.
    pub(crate) fn available_at(&self, budget: &Budget) -> Timestamp {
        let rest = budget.interval * budget.burst.saturating_sub(1);
        Timestamp::ZERO + self.full_at.since(Timestamp::ZERO + rest)
    }

    #[inline]
    pub(crate) fn charge(&mut self, now: Timestamp, budget: &Budget) {
        self.full_at = self.full_at.max(now) + budget.interval;
    }
}

/// Failed verifications of frames from other than the last proven source of their sender. At 0.1 ms per signature they
/// cost at most a tenth of a processor.
const TOTAL_BUDGET: Budget = Budget {
    interval: Duration::from_millis(1),
    burst: 256,
};

/// Share of one host, from all its ports: a tenth of all. Drones share a host only if they share a machine; some dozens
/// of them challenge each other at the start.
const HOST_BUDGET: Budget = Budget {
    interval: Duration::from_millis(10),
    burst: 128,
};

/// Port that stands for all ports of a host; never a real port.
const ALL_PORTS: u16 = 0;

/// Number of hosts and proven sources with a bucket of their own.
const SOURCES_MAX: usize = 64;

/// Failed verifications: forgeries with an unknown real sender.
#[derive(Debug)]
pub(super) struct FailedVerifications {
    total: TokenBucket,
    /// Buckets of hosts and proven sources of the last failures.
    sources: Vec<(Source, TokenBucket)>,
}

const fn all_of(source: Source) -> Source {
    Source {
        port: ALL_PORTS,
        ..source
    }
}

impl FailedVerifications {
    pub(super) const fn new() -> Self {
        Self {
            total: TokenBucket::FULL,
            sources: Vec::new(),
        }
    }

    /// Whether one more frame may be verified that is not from its sender's proven source.
    #[inline]
    pub(super) fn has_tokens(&self, now: Timestamp, source: Option<Source>) -> bool {
        self.total.has_tokens(now, &TOTAL_BUDGET)
            && source.is_none_or(|source| self.has_tokens_at(all_of(source), now, &HOST_BUDGET))
    }

    /// Whether one more frame from its sender's proven source may be verified, within `budget`.
    #[inline]
    pub(super) fn has_tokens_at(&self, source: Source, now: Timestamp, budget: &Budget) -> bool {
        let known = self.sources.iter().find(|it| it.0 == source);
        known.is_none_or(|(_, bucket)| bucket.has_tokens(now, budget))
    }

    /// Records a failure of a frame that is not from its sender's proven source.
    pub(super) fn charge(&mut self, now: Timestamp, source: Option<Source>) {
        self.total.charge(now, &TOTAL_BUDGET);
        if let Some(source) = source {
            self.charge_at(all_of(source), now, &HOST_BUDGET);
        }
    }

    /// Records a failure of a frame from its sender's proven source. Frames from elsewhere are not affected.
    pub(super) fn charge_at(&mut self, source: Source, now: Timestamp, budget: &Budget) {
        let known = self.sources.iter().position(|it| it.0 == source);
        let at = known.unwrap_or_else(|| self.insert(source));
        self.sources[at].1.charge(now, budget);
    }

    /// Adds a source; replaces the fullest bucket if there is no room.
    fn insert(&mut self, source: Source) -> usize {
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
