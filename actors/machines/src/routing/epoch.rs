use bytes::Bytes;
use serde::{Deserialize, Serialize};

use super::Notice;
use crate::identity::{Ballot, NodeId};
use crate::leader::{BallotDecision, CurrentLeader, LinkSymmetry};

/// The state of a leader epoch at one drone: the leader, its newest order, and the drone's own progress.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
pub struct LeaderEpoch {
    leader: CurrentLeader,
    sequence: u32,
    order: Option<Bytes>,
    acknowledged: u32,
}

impl LeaderEpoch {
    /// The start of a leader epoch.
    #[must_use]
    pub fn of(ballot: Ballot) -> Self {
        Self {
            leader: ballot.into(),
            ..Self::default()
        }
    }

    /// The current leader's ballot; `None` before the first.
    #[must_use]
    pub const fn ballot(&self) -> Option<Ballot> {
        self.leader.ballot()
    }

    /// Whether `drone` is the master.
    #[must_use]
    pub fn is_led_by(&self, drone: NodeId) -> bool {
        self.leader.is_of(drone)
    }

    /// Number of the newest known order; 0 before the first.
    #[must_use]
    pub const fn sequence(&self) -> u32 {
        self.sequence
    }

    /// The newest known order; `None` before the first.
    #[must_use]
    pub const fn order(&self) -> Option<&Bytes> {
        self.order.as_ref()
    }

    /// Number of the newest order that this drone has carried out.
    #[must_use]
    pub const fn acknowledged(&self) -> u32 {
        self.acknowledged
    }

    /// Observes a ballot, from a frame or from the drone's own protocol. Adopting one forgets the orders of the epoch
    /// before.
    pub fn observe(&mut self, ballot: Ballot, symmetry: LinkSymmetry) -> BallotDecision {
        let decision = self.leader.observe(ballot, symmetry);
        if decision == BallotDecision::Adopted {
            *self = Self::of(ballot);
        }
        decision
    }

    /// Accepts an order that this drone's protocol gives under `ballot`; returns whether it is new. The order is
    /// dropped if the routing has adopted another ballot, which the protocol may not know yet.
    pub fn publish(&mut self, own: NodeId, ballot: Ballot, sequence: u32, order: Bytes) -> bool {
        let is_current = self.is_led_by(own) && self.ballot() == Some(ballot);
        is_current && self.take(sequence, order)
    }

    /// Accepts an order received from others under this epoch; returns whether it is new. A master ignores it.
    pub fn receive_order(&mut self, own: NodeId, sequence: u32, order: Bytes) -> bool {
        let has_master = self.ballot().is_some() && !self.is_led_by(own);
        has_master && self.take(sequence, order)
    }

    fn take(&mut self, sequence: u32, order: Bytes) -> bool {
        let is_new = sequence > self.sequence;
        if is_new {
            self.sequence = sequence;
            self.order = Some(order);
        }
        is_new
    }

    /// Records that this drone has carried out an order and all before it; returns whether that is new.
    pub fn acknowledge(&mut self, ballot: Ballot, sequence: u32) -> bool {
        let is_new = self.ballot() == Some(ballot) && sequence > self.acknowledged;
        if is_new {
            self.acknowledged = sequence;
        }
        is_new
    }

    /// Whether this drone has carried out the newest order.
    #[must_use]
    pub const fn is_carried_out(&self) -> bool {
        self.sequence > 0 && self.acknowledged >= self.sequence
    }

    /// Whether state that must never fall back differs from `before`: the leader and the number of orders.
    pub(super) fn has_advanced_since(&self, before: &Self) -> bool {
        (self.leader, self.sequence) != (before.leader, before.sequence)
    }

    /// Notice of the newest order; `None` if there is none.
    #[must_use]
    pub fn newest_order(&self) -> Option<Notice> {
        Some(Notice::Order {
            ballot: self.ballot()?,
            sequence: self.sequence,
            order: self.order.clone()?,
        })
    }

    /// Notices for a restarted protocol: the leader and the newest order.
    pub fn notices(&self) -> impl Iterator<Item = Notice> {
        let epoch = self.ballot().map(Notice::Leader);
        epoch.into_iter().chain(self.newest_order())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn ballot(term: u32, master: u32) -> Ballot {
        let master = NodeId(master);
        let rank = master.0;
        Ballot { term, rank, master }
    }

    const ORDER: Bytes = Bytes::from_static(b"go");

    #[test]
    fn inputs_under_an_older_ballot_are_ignored() {
        let (own, claimed, better) = (NodeId(1), ballot(2, 1), ballot(3, 2));
        let mut epoch = LeaderEpoch::of(claimed);
        assert!(epoch.publish(own, claimed, 1, ORDER));
        assert!(epoch.acknowledge(claimed, 1) && epoch.is_carried_out());
        // A frame under a better ballot arrives before the protocol's next input.
        assert_eq!(
            epoch.observe(better, LinkSymmetry::Symmetric),
            BallotDecision::Adopted
        );
        assert_eq!(
            epoch.observe(claimed, LinkSymmetry::Symmetric),
            BallotDecision::Ignored
        );
        assert!(!epoch.publish(own, claimed, 2, ORDER));
        assert!(
            !epoch.publish(own, better, 2, ORDER),
            "the ballot is another drone's"
        );
        assert!(epoch.receive_order(own, 1, ORDER));
        assert!(!epoch.acknowledge(claimed, 1) && !epoch.is_carried_out());
    }

    #[test]
    fn orders_are_accepted_once_and_from_the_master_only() {
        let master = ballot(1, 2);
        let mut epoch = LeaderEpoch::of(master);
        assert!(epoch.receive_order(NodeId(1), 3, ORDER));
        assert!(
            !epoch.receive_order(NodeId(1), 3, ORDER) && !epoch.receive_order(NodeId(1), 2, ORDER)
        );
        assert!(
            !epoch.receive_order(NodeId(2), 4, ORDER),
            "a master ignores others' orders"
        );
        assert!(
            !LeaderEpoch::default().receive_order(NodeId(1), 1, ORDER),
            "there is no leader yet"
        );
        let order = Notice::Order {
            ballot: master,
            sequence: 3,
            order: ORDER,
        };
        let notices: Vec<_> = epoch.notices().collect();
        assert_eq!(notices, [Notice::Leader(master), order]);
    }
}
