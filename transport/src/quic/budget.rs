//! What each address may ask for before it has proved who it is, so that no stranger takes all of a drone's time.

use std::collections::BTreeMap;
use std::net::IpAddr;
use std::time::Duration;

use muster_machines::time::Timestamp;

/// How many addresses are remembered. Should more ask, whoever has not asked for longest is forgotten, and with it what it
/// has used up.
const ADDRESSES_MAX: usize = 256;

/// So many at once, and then so many a second, for each address.
#[derive(Debug)]
pub(super) struct Budgets {
    burst: u32,
    /// How long it takes until there is one more.
    refill: Duration,
    /// When each address will have all of its budget again.
    full_at: BTreeMap<IpAddr, Timestamp>,
}

impl Budgets {
    pub(super) const fn new(burst: u32, refill: Duration) -> Self {
        Self {
            burst,
            refill,
            full_at: BTreeMap::new(),
        }
    }

    /// Whether an address may ask for one more now; then it has.
    pub(super) fn take(&mut self, now: Timestamp, address: IpAddr) -> bool {
        let full_at = self.full_at.get(&address).copied();
        let full_at = full_at.unwrap_or(now).max(now) + self.refill;
        if full_at.since(now) > self.refill * self.burst {
            return false;
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

    #[test]
    fn an_address_that_has_used_up_its_budget_gets_it_back_with_time_and_others_have_theirs() {
        let mut budgets = Budgets::new(3, SECOND);
        let now = Timestamp::ZERO + SECOND * 100;
        let taken = |budgets: &mut Budgets, now, number| {
            (0..10)
                .filter(|_| budgets.take(now, address(number)))
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
        let mut budgets = Budgets::new(2, SECOND);
        for number in 0..1_000 {
            let now = Timestamp::ZERO + SECOND / 1_000 * u32::from(number);
            assert!(budgets.take(now, address(number)));
        }
        assert_eq!(budgets.full_at.len(), ADDRESSES_MAX);
        assert!(budgets.full_at.contains_key(&address(999)));
    }
}
