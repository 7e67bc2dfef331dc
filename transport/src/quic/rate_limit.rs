//! Rate limits for unauthenticated requests, per address and for all unknown addresses together. They keep strangers from
//! using up a drone's processor.

use std::collections::BTreeMap;
use std::net::IpAddr;
use std::time::Duration;

use muster_machines::time::Timestamp;

/// Number of addresses that are remembered. A further address replaces the one whose bucket is full the soonest.
const ADDRESSES_MAX: usize = 256;

/// Parameters of a token bucket.
#[derive(Debug, Clone, Copy)]
pub(super) struct RateLimit {
    /// Capacity in tokens.
    pub(super) burst: u32,
    /// Time until one token is refilled.
    pub(super) refill: Duration,
}

impl RateLimit {
    /// Takes a token from a bucket that is full at `full_at`. Returns the new time at which it is full; `None` if it is empty.
    fn take(&self, now: Timestamp, full_at: Timestamp) -> Option<Timestamp> {
        let full_at = full_at.max(now) + self.refill;
        (full_at.since(now) <= self.refill * self.burst).then_some(full_at)
    }
}

/// A token bucket for each address, and one for all unknown addresses together.
#[derive(Debug)]
pub(super) struct RateLimiter {
    per_address: RateLimit,
    strangers: RateLimit,
    /// When the bucket of each address is full again.
    full_at: BTreeMap<IpAddr, Timestamp>,
    /// When the bucket of all strangers is full again.
    strangers_full_at: Timestamp,
}

impl RateLimiter {
    pub(super) const fn new(per_address: RateLimit, strangers: RateLimit) -> Self {
        Self {
            per_address,
            strangers,
            full_at: BTreeMap::new(),
            strangers_full_at: Timestamp::ZERO,
        }
    }

    /// Takes a token for a request; `false` if none is left. A known address takes none from the bucket of strangers.
    pub(super) fn take(&mut self, now: Timestamp, address: IpAddr, is_known: bool) -> bool {
        let full_at = self.full_at.get(&address).copied().unwrap_or(now);
        let Some(full_at) = self.per_address.take(now, full_at) else {
            return false;
        };
        if !is_known {
            match self.strangers.take(now, self.strangers_full_at) {
                Some(full_at) => self.strangers_full_at = full_at,
                None => return false,
            }
        }
        if self.full_at.len() >= ADDRESSES_MAX && !self.full_at.contains_key(&address) {
            self.forget_one();
        }
        self.full_at.insert(address, full_at);
        true
    }

    fn forget_one(&mut self) {
        let first = self.full_at.iter().min_by_key(|(_, full_at)| **full_at);
        if let Some(first) = first.map(|(address, _)| *address) {
            self.full_at.remove(&first);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    fn address(number: u16) -> IpAddr {
        let [high, low] = number.to_be_bytes();
        IpAddr::from([10, 0, high, low])
    }

    fn limiter(burst: u32) -> RateLimiter {
        let strangers = RateLimit {
            burst: 10_000,
            refill: SECOND / 10_000,
        };
        let refill = SECOND;
        RateLimiter::new(RateLimit { burst, refill }, strangers)
    }

    #[test]
    fn strangers_at_many_addresses_keep_out_no_known_address() {
        let refill = SECOND;
        let per_address = RateLimit { burst: 3, refill };
        let mut limiter = RateLimiter::new(per_address, RateLimit { burst: 20, refill });
        let now = Timestamp::ZERO + SECOND * 100;
        let taken = (0..1_000).filter(|number| limiter.take(now, address(*number), false));
        assert_eq!(taken.count(), 20);
        assert!(!limiter.take(now, address(2_000), false));
        assert!(limiter.take(now, address(2_000), true));
        assert!(limiter.take(now + SECOND, address(2_001), false));
    }

    #[test]
    fn buckets_refill_with_time_and_are_independent() {
        let mut limiter = limiter(3);
        let now = Timestamp::ZERO + SECOND * 100;
        let taken = |limiter: &mut RateLimiter, now, number| {
            (0..10)
                .filter(|_| limiter.take(now, address(number), false))
                .count()
        };
        assert_eq!(taken(&mut limiter, now, 1), 3);
        assert_eq!(taken(&mut limiter, now, 2), 3);
        assert_eq!(taken(&mut limiter, now + SECOND / 2, 1), 0);
        assert_eq!(taken(&mut limiter, now + SECOND, 1), 1);
        assert_eq!(taken(&mut limiter, now + SECOND * 100, 1), 3);
    }

    #[test]
    fn number_of_remembered_addresses_is_limited() {
        let mut limiter = limiter(2);
        for number in 0..1_000 {
            let now = Timestamp::ZERO + SECOND / 1_000 * u32::from(number);
            assert!(limiter.take(now, address(number), false));
        }
        assert_eq!(limiter.full_at.len(), ADDRESSES_MAX);
        assert!(limiter.full_at.contains_key(&address(999)));
    }
}
