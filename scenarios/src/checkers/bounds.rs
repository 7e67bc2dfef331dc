use muster_machines::identity::NodeId;
use muster_machines::node::{Address, Occupancy};
use muster_machines::time::Timestamp;

use super::Violation;

/// Rule 8: queues and tables stay within their limits.
#[derive(Debug)]
pub(crate) struct BoundsChecker {
    waiting_max: usize,
}

impl BoundsChecker {
    /// At most `waiting_max` messages may be queued for an actor.
    pub(crate) const fn new(waiting_max: usize) -> Self {
        Self { waiting_max }
    }

    /// A step leaves the largest table of an actor with this occupancy.
    pub(crate) fn table(
        &self,
        now: Timestamp,
        drone: NodeId,
        address: Address,
        table: Occupancy,
    ) -> Option<Violation> {
        (table.len > table.max).then(|| Violation {
            rule: 8,
            at: now,
            drones: vec![drone],
            what: format!(
                "a table of the {address} actor has {} entries; the limit is {}",
                table.len, table.max
            ),
        })
    }

    /// This many messages are queued for an actor.
    pub(crate) fn queue(&self, now: Timestamp, drone: NodeId, waiting: usize) -> Option<Violation> {
        (waiting > self.waiting_max).then(|| Violation {
            rule: 8,
            at: now,
            drones: vec![drone],
            what: format!(
                "{waiting} messages are queued for an actor; the limit is {}",
                self.waiting_max
            ),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_may_be_reached_but_not_exceeded() {
        let checker = BoundsChecker::new(4);
        let check = |len| {
            let table = Occupancy { len, max: 3 };
            checker.table(Timestamp::ZERO, NodeId(0), Address::Radio, table)
        };
        assert_eq!(check(3), None);
        assert!(check(4).is_some());
        assert_eq!(checker.queue(Timestamp::ZERO, NodeId(0), 4), None);
        assert!(checker.queue(Timestamp::ZERO, NodeId(0), 5).is_some());
    }
}
