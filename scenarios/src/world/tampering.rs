//! What strangers and bad luck do to frames: they are altered, doubled, delayed, put out of order, sent again later,
//! or made up.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use bytes::Bytes;
use muster_machines::identity::{NodeId, NodeSet, SwarmId};
use muster_machines::time::Timestamp;
use muster_machines::wire::{self, AUTHENTICATOR_LEN, Header};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::Origin;
use crate::scenario::{Distortion, Tampered};

/// How many frames of one sender are recorded, to be sent again later: the newest.
const RECORDED_MAX: usize = 1_024;

/// How soon after the first a doubled frame arrives at the latest.
const DOUBLED_WITHIN: Duration = Duration::from_millis(10);

/// A frame on its way.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Passage {
    pub(super) late: Duration,
    pub(super) datagram: Bytes,
    pub(super) origin: Origin,
}

/// What is done to frames on their way.
#[derive(Debug)]
pub(super) struct Tampering {
    rng: ChaCha8Rng,
    /// By the number of the fault.
    active: BTreeMap<usize, Tampered>,
    /// Frames of those senders who are listened to.
    recorded: BTreeMap<NodeId, VecDeque<Recorded>>,
}

#[derive(Debug)]
struct Recorded {
    datagram: Bytes,
    heard_by: NodeSet,
}

impl Tampering {
    /// Nothing is done yet; frames of `listened_to` are recorded.
    pub(super) fn new(rng: ChaCha8Rng, listened_to: impl Iterator<Item = NodeId>) -> Self {
        Self {
            rng,
            active: BTreeMap::new(),
            recorded: listened_to.map(|id| (id, VecDeque::new())).collect(),
        }
    }

    pub(super) fn begin(&mut self, fault: usize, tampered: Tampered) {
        self.active.insert(fault, tampered);
    }

    pub(super) fn end(&mut self, fault: usize) {
        self.active.remove(&fault);
    }

    /// Whether nothing is done to any frame, and nobody listened to.
    pub(super) fn is_idle(&self) -> bool {
        self.active.is_empty() && self.recorded.is_empty()
    }

    /// The share of a drone's frames that are altered on their way.
    pub(super) fn corrupted(&self, from: NodeId) -> f64 {
        let corrupts =
            |it: &&Tampered| it.how == Distortion::Corrupt && it.from.is_none_or(|it| it == from);
        let intact = |it: &Tampered| 1.0 - it.share;
        1.0 - self
            .active
            .values()
            .filter(corrupts)
            .map(intact)
            .product::<f64>()
    }

    /// Takes down what a drone sends, if it is listened to.
    pub(super) fn record(&mut self, from: NodeId, datagram: &Bytes) {
        if let Some(recorded) = self.recorded.get_mut(&from) {
            if recorded.len() == RECORDED_MAX {
                recorded.pop_front();
            }
            recorded.push_back(Recorded {
                datagram: datagram.clone(),
                heard_by: NodeSet::default(),
            });
        }
    }

    /// What becomes of a frame on its way: it arrives as it is, as is the rule, or otherwise, or twice.
    pub(super) fn pass(
        &mut self,
        from: Option<NodeId>,
        datagram: Bytes,
    ) -> (Passage, Option<Passage>) {
        let as_it_is = Passage {
            late: Duration::ZERO,
            datagram,
            origin: Origin::Genuine,
        };
        let Some(from) = from.filter(|_| !self.is_idle()) else {
            return (as_it_is, None);
        };
        let (mut first, mut twin) = (as_it_is, None);
        let is_its = |tampered: &&Tampered| tampered.from.is_none_or(|it| it == from);
        for tampered in self.active.values().filter(is_its) {
            if self.rng.random::<f64>() >= tampered.share {
                continue;
            }
            match tampered.how {
                Distortion::Corrupt => {
                    let passages = std::iter::once(&mut first).chain(&mut twin);
                    // Altered twice it might be what it was.
                    for passage in passages.filter(|it| it.origin != Origin::Spurious) {
                        passage.datagram = altered(&passage.datagram, &mut self.rng);
                        passage.origin = Origin::Spurious;
                    }
                }
                Distortion::Duplicate => {
                    // Whichever of the two is let in first.
                    if first.origin == Origin::Genuine {
                        first.origin = Origin::Replayed;
                    }
                    twin.get_or_insert_with(|| Passage {
                        late: first.late + self.rng.random_range(Duration::ZERO..=DOUBLED_WITHIN),
                        ..first.clone()
                    });
                }
                Distortion::Delay(by) => {
                    for passage in std::iter::once(&mut first).chain(&mut twin) {
                        passage.late += by;
                    }
                }
                Distortion::Reorder(within) => {
                    for passage in std::iter::once(&mut first).chain(&mut twin) {
                        passage.late += self.rng.random_range(Duration::ZERO..=within);
                    }
                }
            }
        }
        (first, twin)
    }

    /// Whether anybody's frames are recorded.
    pub(super) fn listens(&self) -> bool {
        !self.recorded.is_empty()
    }

    /// A drone has let a frame in.
    pub(super) fn let_in(&mut self, from: NodeId, by: NodeId, datagram: &Bytes) {
        let recorded = self.recorded.get_mut(&from).into_iter().flatten();
        if let Some(heard) = recorded.rev().find(|it| it.datagram == datagram) {
            heard.heard_by.insert(by);
        }
    }

    /// Whether a drone has let a frame in before.
    pub(super) fn has_let_in(&self, from: NodeId, by: NodeId, datagram: &Bytes) -> bool {
        let mut recorded = self.recorded.get(&from).into_iter().flatten().rev();
        let known = recorded.find(|it| it.datagram == datagram);
        known.is_some_and(|it| it.heard_by.contains(by))
    }

    /// What was recorded of a sender, oldest first.
    pub(super) fn recorded(&self, from: NodeId) -> Vec<Bytes> {
        let recorded = self.recorded.get(&from).into_iter().flatten();
        recorded.map(|it| it.datagram.clone()).collect()
    }

    /// Frames in the name of a drone that it never sent, made from the last that it did.
    pub(super) fn forgeries(&mut self, of: NodeId) -> Vec<Bytes> {
        let last = self.recorded.get(&of).and_then(VecDeque::back);
        let Some(last) = last.map(|it| it.datagram.clone()) else {
            return Vec::new();
        };
        let Ok(frame) = wire::decode_frame(&last) else {
            return Vec::new();
        };
        let newer = Header {
            counter: frame.header.counter + 1_000,
            ..frame.header
        };
        let mut usurped = newer;
        usurped.ballot.term += 7;
        let unsigned = [0; AUTHENTICATOR_LEN];
        let stranger = Header {
            sender: NodeId(u32::MAX),
            ..usurped
        };
        let next_incarnation = Header {
            incarnation: frame.header.incarnation + 1,
            ..usurped
        };
        // A drone of another swarm, none of those here, signs what it says under a number that this swarm has too.
        let neighbour = Header {
            swarm: SwarmId(u32::MAX),
            ..usurped
        };
        let forged = |header: &Header, authenticator: &[u8; AUTHENTICATOR_LEN]| {
            let mut bytes = wire::encode_covered(header, frame.payload, Vec::new());
            bytes.extend_from_slice(authenticator);
            Bytes::from(bytes)
        };
        let noise: Vec<u8> = (0..self.rng.random_range(0..wire::DATAGRAM_MAX))
            .map(|_| self.rng.random())
            .collect();
        vec![
            forged(&newer, &unsigned),
            forged(&usurped, &unsigned),
            forged(&next_incarnation, &unsigned),
            forged(&stranger, &unsigned),
            forged(&neighbour, frame.authenticator),
            Bytes::from(noise),
        ]
    }
}

/// The same with a bit of it turned; so is one of its authenticator, since that of a simulation covers nothing.
fn altered(datagram: &Bytes, rng: &mut ChaCha8Rng) -> Bytes {
    let mut bytes = datagram.to_vec();
    let covered = bytes.len().saturating_sub(AUTHENTICATOR_LEN);
    for span in [0..covered, covered..bytes.len()] {
        if !span.is_empty() {
            let at = rng.random_range(span);
            bytes[at] ^= 1 << rng.random_range(0..8);
        }
    }
    bytes.into()
}

/// How long after the first the `index`th of many frames that are sent again, or made up, arrives.
pub(super) fn paced(now: Timestamp, index: u32) -> Timestamp {
    now + Duration::from_millis(10) * index
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn what_two_faults_alter_is_not_what_it_was() {
        let corrupts = Tampered {
            from: None,
            how: Distortion::Corrupt,
            share: 1.0,
        };
        let rng = ChaCha8Rng::seed_from_u64(1);
        let mut tampering = Tampering::new(rng, std::iter::empty());
        tampering.begin(0, corrupts);
        tampering.begin(1, corrupts);
        let sent = Bytes::from(vec![0; AUTHENTICATOR_LEN + 1]);
        for _ in 0..10_000 {
            let (passage, twin) = tampering.pass(Some(NodeId(0)), sent.clone());
            assert_eq!((passage.origin, twin), (Origin::Spurious, None));
            assert_ne!(passage.datagram, sent);
        }
    }
}
