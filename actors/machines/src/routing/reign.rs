use bytes::Bytes;

use super::Notice;
use crate::identity::{Ballot, NodeId};
use crate::reign::{Obeyed, Verdict, Way};

/// What a drone's routing knows of the reign that it is under, by any policy: whose it is, its newest order, and how
/// far the drone has got.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Default)]
pub struct Reign {
    obeyed: Obeyed,
    sequence: u32,
    order: Option<Bytes>,
    acknowledged: u32,
}

impl Reign {
    /// A reign that has just begun.
    #[must_use]
    pub fn of(ballot: Ballot) -> Self {
        Self {
            obeyed: ballot.into(),
            ..Self::default()
        }
    }

    /// Whom the drone obeys.
    #[must_use]
    pub const fn ballot(&self) -> Option<Ballot> {
        self.obeyed.ballot()
    }

    /// Whether `drone` is the master.
    #[must_use]
    pub fn is_led_by(&self, drone: NodeId) -> bool {
        self.obeyed.is_of(drone)
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
    /// reign before.
    pub fn hear(&mut self, ballot: Ballot, way: Way) -> Verdict {
        let verdict = self.obeyed.hear(ballot, way);
        if verdict == Verdict::Turned {
            *self = Self::of(ballot);
        }
        verdict
    }

    /// Takes an order of the drone's own; whether it is news. Nobody orders in the name of another: the protocol of a
    /// drone that has just turned may not know so yet.
    pub fn publish(&mut self, own: NodeId, sequence: u32, order: Bytes) -> bool {
        self.is_led_by(own) && self.take(sequence, order)
    }

    /// Takes an order that was heard under this reign; whether it is news. A master hears its own orders only.
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

    /// Takes in that the drone has carried out an order, and all before it; whether that is news.
    pub const fn acknowledge(&mut self, sequence: u32) -> bool {
        let is_news = sequence > self.acknowledged;
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
        let reign = self.ballot().map(Notice::Reign);
        reign.into_iter().chain(self.newest_order())
    }
}
