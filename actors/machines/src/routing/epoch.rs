use bytes::Bytes;
use serde::{Deserialize, Serialize};

use super::Notice;
use crate::identity::{Ballot, NodeId};
use crate::leader::{BallotDecision, CurrentLeader, LinkSymmetry};

/// What a drone's routing knows of the leader epoch that it is under, by any policy: whose it is, its newest order, and how
/// far the drone has got.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
pub struct LeaderEpoch {
    leader: CurrentLeader,
    sequence: u32,
    order: Option<Bytes>,
    acknowledged: u32,
}

impl LeaderEpoch {
    /// A leader epoch that has just begun.
    #[must_use]
    pub fn of(ballot: Ballot) -> Self {
        Self {
            leader: ballot.into(),
            ..Self::default()
        }
    }

    /// Whom the drone obeys.
    #[must_use]
    pub const fn ballot(&self) -> Option<Ballot> {
        self.leader.ballot()
    }

    /// Whether `drone` is the master.
    #[must_use]
    pub fn is_led_by(&self, drone: NodeId) -> bool {
        self.leader.is_of(drone)
    }

    /// The number of the newest order that the drone has heard of; 0 before the first.
    #[must_use]
    pub const fn sequence(&self) -> u32 {
        self.sequence
    }

    /// The newest order.
    #[must_use]
    pub const fn order(&self) -> Option<&Bytes> {
        self.order.as_ref()
    }

    /// The newest order that the drone itself has carried out.
    #[must_use]
    pub const fn acknowledged(&self) -> u32 {
        self.acknowledged
    }

    /// Hears of a ballot: in a frame, or from its own protocol, which leads. Turning to it forgets the orders of the
    /// leader epoch before.
    pub fn hear(&mut self, ballot: Ballot, symmetry: LinkSymmetry) -> BallotDecision {
        let decision = self.leader.hear(ballot, symmetry);
        if decision == BallotDecision::Turned {
            *self = Self::of(ballot);
        }
        decision
    }

    /// Takes an order that the drone gives under its ballot; whether it is news. It is not if the drone has turned to
    /// another, of which its protocol need not know yet: nobody orders in the name of another.
    pub fn publish(&mut self, own: NodeId, ballot: Ballot, sequence: u32, order: Bytes) -> bool {
        let is_current = self.is_led_by(own) && self.ballot() == Some(ballot);
        is_current && self.take(sequence, order)
    }

    /// Takes an order that was heard under this leader epoch; whether it is news. A master hears its own orders only.
    pub fn hear_order(&mut self, own: NodeId, sequence: u32, order: Bytes) -> bool {
        let has_master = self.ballot().is_some() && !self.is_led_by(own);
        has_master && self.take(sequence, order)
    }

    fn take(&mut self, sequence: u32, order: Bytes) -> bool {
        let is_news = sequence > self.sequence;
        if is_news {
            self.sequence = sequence;
            self.order = Some(order);
        }
        is_news
    }

    /// Takes in that the drone has carried out an order of this leader epoch, and all before it; whether that is news.
    pub fn acknowledge(&mut self, ballot: Ballot, sequence: u32) -> bool {
        let is_news = self.ballot() == Some(ballot) && sequence > self.acknowledged;
        if is_news {
            self.acknowledged = sequence;
        }
        is_news
    }

    /// Whether the drone has carried out the newest order.
    #[must_use]
    pub const fn is_carried_out(&self) -> bool {
        self.sequence > 0 && self.acknowledged >= self.sequence
    }

    /// Whether what must never fall back has changed since `before`: whose leader epoch it is, and how many orders it had.
    pub(super) fn is_news(&self, before: &Self) -> bool {
        (self.leader, self.sequence) != (before.leader, before.sequence)
    }

    /// For the protocol: the newest order.
    #[must_use]
    pub fn newest_order(&self) -> Option<Notice> {
        Some(Notice::Order {
            ballot: self.ballot()?,
            sequence: self.sequence,
            order: self.order.clone()?,
        })
    }

    /// For a protocol that restarted: whom it obeys, and the newest order.
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
    fn what_a_protocol_says_under_an_older_ballot_is_not_taken() {
        let (own, claimed, better) = (NodeId(1), ballot(2, 1), ballot(3, 2));
        let mut epoch = LeaderEpoch::of(claimed);
        assert!(epoch.publish(own, claimed, 1, ORDER));
        assert!(epoch.acknowledge(claimed, 1) && epoch.is_carried_out());
        // A frame under a better ballot comes before what the protocol said next.
        assert_eq!(
            epoch.hear(better, LinkSymmetry::Mutual),
            BallotDecision::Turned
        );
        assert_eq!(
            epoch.hear(claimed, LinkSymmetry::Mutual),
            BallotDecision::Ignored
        );
        assert!(!epoch.publish(own, claimed, 2, ORDER));
        assert!(!epoch.publish(own, better, 2, ORDER), "it is another's");
        assert!(epoch.hear_order(own, 1, ORDER));
        assert!(!epoch.acknowledge(claimed, 1) && !epoch.is_carried_out());
    }

    #[test]
    fn orders_are_taken_from_the_master_only_and_each_once() {
        let master = ballot(1, 2);
        let mut epoch = LeaderEpoch::of(master);
        assert!(epoch.hear_order(NodeId(1), 3, ORDER));
        assert!(!epoch.hear_order(NodeId(1), 3, ORDER) && !epoch.hear_order(NodeId(1), 2, ORDER));
        assert!(
            !epoch.hear_order(NodeId(2), 4, ORDER),
            "a master has its own"
        );
        assert!(
            !LeaderEpoch::default().hear_order(NodeId(1), 1, ORDER),
            "whose is it?"
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
