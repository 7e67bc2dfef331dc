//! Tampering with frames: they are altered, duplicated, delayed, reordered, replayed or forged.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use bytes::Bytes;
use muster_machines::identity::{NodeId, NodeSet, SwarmId};
use muster_machines::time::Timestamp;
use muster_machines::wire::{self, AUTHENTICATOR_LEN, Header};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::message::Origin;
use crate::scenario::{Distortion, Tampered};

/// The newest frames of a sender that are recorded, to be replayed.
const RECORDED_MAX: usize = 1_024;

/// A duplicate arrives this much after the first at the latest.
const DUPLICATED_WITHIN: Duration = Duration::from_millis(10);

/// A frame that arrives.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Passage {
    /// How much later it arrives than it would.
    pub(super) late: Duration,
    pub(super) datagram: Bytes,
    pub(super) origin: Origin,
}

/// Who tampers with frames, and the frames recorded for that.
///
/// Invariant: of each sender in `recorded` the newest frames are kept, at most [`RECORDED_MAX`].
#[derive(Debug)]
pub(super) struct Tampering {
    rng: ChaCha8Rng,
    /// Distortions in effect, by the number of the fault.
    active: BTreeMap<usize, Tampered>,
    /// Frames of the senders that are listened to, oldest first.
    recorded: BTreeMap<NodeId, VecDeque<Recorded>>,
}

#[derive(Debug)]
struct Recorded {
    datagram: Bytes,
    admitted_by: NodeSet,
}

impl Tampering {
    /// Without distortions; frames of `listened_to` are recorded.
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

    /// Ends a distortion; returns it.
    pub(super) fn end(&mut self, fault: usize) -> Option<Tampered> {
        self.active.remove(&fault)
    }

    /// Whether no frame is altered or recorded.
    pub(super) fn is_idle(&self) -> bool {
        self.active.is_empty() && self.recorded.is_empty()
    }

    /// The share of a drone's frames that are altered, 0 to 1.
    pub(super) fn corrupted(&self, from: NodeId) -> f64 {
        self.share(from, |how| how == Distortion::Corrupt)
    }

    /// The share of a drone's frames that may arrive later than they would by more than this, 0 to 1.
    pub(super) fn late(&self, from: NodeId, tolerated: Duration) -> f64 {
        self.share(from, |how| how.delay_max().is_some_and(|by| by > tolerated))
    }

    /// The share of a drone's frames that distortions of these kinds affect.
    fn share(&self, from: NodeId, affects: impl Fn(Distortion) -> bool) -> f64 {
        let affects = |it: &&Tampered| affects(it.how) && it.from.is_none_or(|it| it == from);
        let intact = |it: &Tampered| 1.0 - it.share;
        1.0 - self
            .active
            .values()
            .filter(affects)
            .map(intact)
            .product::<f64>()
    }

    /// Records a frame, if its sender is listened to.
    pub(super) fn record(&mut self, from: NodeId, datagram: &Bytes) {
        if let Some(recorded) = self.recorded.get_mut(&from) {
            if recorded.len() == RECORDED_MAX {
                recorded.pop_front();
            }
            recorded.push_back(Recorded {
                datagram: datagram.clone(),
                admitted_by: NodeSet::default(),
            });
        }
    }

    /// Distorts a frame on its way to one receiver: how it arrives, and its duplicate, if any.
    pub(super) fn pass(
        &mut self,
        from: Option<NodeId>,
        datagram: Bytes,
    ) -> (Passage, Option<Passage>) {
        let intact = Passage {
            late: Duration::ZERO,
            datagram,
            origin: Origin::Genuine,
        };
        let Some(from) = from.filter(|_| !self.is_idle()) else {
            return (intact, None);
        };
        let (mut first, mut duplicate) = (intact, None);
        let is_its = |tampered: &&Tampered| tampered.from.is_none_or(|it| it == from);
        for tampered in self.active.values().filter(is_its) {
            if self.rng.random::<f64>() >= tampered.share {
                continue;
            }
            match tampered.how {
                Distortion::Corrupt => {
                    let passages = std::iter::once(&mut first).chain(&mut duplicate);
                    // Altered twice, it might be intact again.
                    for passage in passages.filter(|it| it.origin != Origin::Spurious) {
                        passage.datagram = altered(&passage.datagram, &mut self.rng);
                        passage.origin = Origin::Spurious;
                    }
                }
                Distortion::Duplicate => {
                    // A radio may admit whichever arrives first.
                    if first.origin == Origin::Genuine {
                        first.origin = Origin::Replayed;
                    }
                    duplicate.get_or_insert_with(|| Passage {
                        late: first.late
                            + self.rng.random_range(Duration::ZERO..=DUPLICATED_WITHIN),
                        ..first.clone()
                    });
                }
                Distortion::Delay(by) => {
                    for passage in std::iter::once(&mut first).chain(&mut duplicate) {
                        passage.late += by;
                    }
                }
                Distortion::Reorder(within) => {
                    for passage in std::iter::once(&mut first).chain(&mut duplicate) {
                        passage.late += self.rng.random_range(Duration::ZERO..=within);
                    }
                }
            }
        }
        (first, duplicate)
    }

    /// Whether frames of any sender are recorded.
    pub(super) fn listens(&self) -> bool {
        !self.recorded.is_empty()
    }

    /// A drone's radio has admitted a frame.
    pub(super) fn admitted(&mut self, from: NodeId, by: NodeId, datagram: &Bytes) {
        let recorded = self.recorded.get_mut(&from).into_iter().flatten();
        if let Some(known) = recorded.rev().find(|it| it.datagram == datagram) {
            known.admitted_by.insert(by);
        }
    }

    /// Whether a drone's radio has admitted a frame before.
    pub(super) fn was_admitted(&self, from: NodeId, by: NodeId, datagram: &Bytes) -> bool {
        let mut recorded = self.recorded.get(&from).into_iter().flatten().rev();
        let known = recorded.find(|it| it.datagram == datagram);
        known.is_some_and(|it| it.admitted_by.contains(by))
    }

    /// The recorded frames of a sender, oldest first.
    pub(super) fn recorded(&self, from: NodeId) -> Vec<Bytes> {
        let recorded = self.recorded.get(&from).into_iter().flatten();
        recorded.map(|it| it.datagram.clone()).collect()
    }

    /// Forged frames in the name of a drone, made from its last one.
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
        // A drone of a swarm that is not here signs a frame under a number that this swarm has too.
        let neighbour = Header {
            swarm: SwarmId(u32::MAX),
            ..usurped
        };
        let forged = |header: &Header, authenticator: &[u8; AUTHENTICATOR_LEN]| {
            let mut bytes = wire::encode_covered(header, frame.payload);
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

/// The frame with one bit flipped, and one of its authenticator, since a simulated authenticator covers nothing.
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

/// When the `index`th of several replayed or forged frames arrives.
pub(super) fn paced(now: Timestamp, index: u32) -> Timestamp {
    now + Duration::from_millis(10) * index
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn a_frame_altered_twice_is_not_intact() {
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
            let (passage, duplicate) = tampering.pass(Some(NodeId(0)), sent.clone());
            assert_eq!((passage.origin, duplicate), (Origin::Spurious, None));
            assert_ne!(passage.datagram, sent);
        }
    }
}
