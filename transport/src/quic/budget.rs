//! What each address may ask for before it has proved who it is, and all of them together, so that no stranger takes all of
//! a drone's time.

use std::collections::BTreeMap;
use std::net::IpAddr;
use std::time::Duration;

use muster_machines::time::Timestamp;

/// How many addresses are remembered. Should more ask, whoever has not asked for longest is forgotten, and with it what it
/// has used up.
const ADDRESSES_MAX: usize = 256;

/// So many at once, and then so many a second.
#[derive(Debug, Clone, Copy)]
pub(super) struct Budget {
    pub(super) burst: u32,
    /// How long it takes until there is one more.
    pub(super) refill: Duration,
}

impl Budget {
    /// When all of it will be there again if one more is taken now; nothing if none is left.
    fn take(&self, now: Timestamp, full_at: Timestamp) -> Option<Timestamp> {
        let full_at = full_at.max(now) + self.refill;
        (full_at.since(now) <= self.refill * self.burst).then_some(full_at)
    }
}

/// A budget for each address, and one for all that nobody knows.
#[derive(Debug)]
pub(super) struct Budgets {
    of_one: Budget,
    of_strangers: Budget,
    /// When each address will have all of its budget again.
    full_at: BTreeMap<IpAddr, Timestamp>,
    /// When all strangers together will.
    strangers_full_at: Timestamp,
}

impl Budgets {
    pub(super) const fn new(of_one: Budget, of_strangers: Budget) -> Self {
        Self {
            of_one,
            of_strangers,
            full_at: BTreeMap::new(),
            strangers_full_at: Timestamp::ZERO,
        }
    }

    /// Whether an address may ask for one more now; then it has. Whoever is known there uses up nothing of what is for
    /// strangers.
    pub(super) fn take(&mut self, now: Timestamp, address: IpAddr, is_known: bool) -> bool {
        let full_at = self.full_at.get(&address).copied().unwrap_or(now);
        let Some(full_at) = self.of_one.take(now, full_at) else {
            return false;
        };
        if !is_known {
            match self.of_strangers.take(now, self.strangers_full_at) {
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
        let longest = self.full_at.iter().min_by_key(|(_, full_at)| **full_at);
        if let Some(longest) = longest.map(|(address, _)| *address) {
            self.full_at.remove(&longest);
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

    fn budgets(burst: u32) -> Budgets {
        let of_strangers = Budget {
            burst: 10_000,
            refill: SECOND / 10_000,
        };
        let refill = SECOND;
        Budgets::new(Budget { burst, refill }, of_strangers)
    }

    #[test]
    fn strangers_at_many_addresses_use_up_what_is_for_strangers_and_keep_out_nobody_who_is_known() {
        let refill = SECOND;
        let mut budgets = Budgets::new(Budget { burst: 3, refill }, Budget { burst: 20, refill });
        let now = Timestamp::ZERO + SECOND * 100;
        let taken = (0..1_000).filter(|number| budgets.take(now, address(*number), false));
        assert_eq!(taken.count(), 20);
        assert!(!budgets.take(now, address(2_000), false));
        assert!(budgets.take(now, address(2_000), true));
        assert!(budgets.take(now + SECOND, address(2_001), false));
    }

    #[test]
    fn an_address_that_has_used_up_its_budget_gets_it_back_with_time_and_others_have_theirs() {
        let mut budgets = budgets(3);
        let now = Timestamp::ZERO + SECOND * 100;
        let taken = |budgets: &mut Budgets, now, number| {
            (0..10)
                .filter(|_| budgets.take(now, address(number), false))
                .count()
        };
        assert_eq!(taken(&mut budgets, now, 1), 3);
        assert_eq!(taken(&mut budgets, now, 2), 3);
        assert_eq!(taken(&mut budgets, now + SECOND / 2, 1), 0);
        assert_eq!(taken(&mut budgets, now + SECOND, 1), 1);
        assert_eq!(taken(&mut budgets, now + SECOND * 100, 1), 3);
    }

    #[test]
    fn no_more_addresses_are_remembered_than_there_is_room_for() {
        let mut budgets = budgets(2);
        for number in 0..1_000 {
            let now = Timestamp::ZERO + SECOND / 1_000 * u32::from(number);
            assert!(budgets.take(now, address(number), false));
        }
        assert_eq!(budgets.full_at.len(), ADDRESSES_MAX);
        assert!(budgets.full_at.contains_key(&address(999)));
    }
}
