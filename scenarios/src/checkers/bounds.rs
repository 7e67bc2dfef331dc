use muster_machines::identity::NodeId;
use muster_machines::node::{Address, Occupancy};
use muster_machines::time::Timestamp;

use super::Violation;

/// Rule 8: queues and tables stay within their limits.
#[derive(Debug)]
pub(crate) struct BoundsChecker {
    pub(crate) waiting_max: usize,
}

impl BoundsChecker {
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
                "a table of the {address} actor holds {} entries of at most {}",
                table.len, table.max
            ),
        })
    }

    pub(crate) fn queue(&self, now: Timestamp, drone: NodeId, waiting: usize) -> Option<Violation> {
        (waiting > self.waiting_max).then(|| Violation {
            rule: 8,
            at: now,
            drones: vec![drone],
            what: format!(
                "{waiting} messages wait where at most {} may",
                self.waiting_max
            ),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_table_is_fine_and_one_entry_more_is_not() {
        let checker = BoundsChecker { waiting_max: 4 };
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
