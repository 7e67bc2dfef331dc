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

use crate::scenario::{Distortion, Tampered};

/// How many frames of one sender are recorded, to be sent again later: the newest.
const RECORDED_MAX: usize = 1_024;

/// How soon after the first a doubled frame arrives at the latest.
const DOUBLED_WITHIN: Duration = Duration::from_millis(10);

/// A frame on its way, and whether it is what its sender said, for the first time.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Passage {
    pub(super) late: Duration,
    pub(super) datagram: Bytes,
    pub(super) is_genuine: bool,
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

    /// What becomes of a frame on its way to `to`: it arrives as it is, as is the rule, or otherwise, or twice.
    pub(super) fn pass(
        &mut self,
        from: Option<NodeId>,
        to: NodeId,
        datagram: Bytes,
    ) -> (Passage, Option<Passage>) {
        let as_it_is = Passage {
            late: Duration::ZERO,
            datagram,
            is_genuine: true,
        };
        let Some(from) = from.filter(|_| !self.is_idle()) else {
            return (as_it_is, None);
        };
        self.hear(from, to, &as_it_is.datagram);
        let (mut first, mut twin) = (as_it_is, None);
        let is_its = |tampered: &&Tampered| tampered.from.is_none_or(|it| it == from);
        for tampered in self.active.values().filter(is_its) {
            if self.rng.random::<f64>() >= tampered.share {
                continue;
            }
            match tampered.how {
                Distortion::Corrupt => {
                    for passage in std::iter::once(&mut first).chain(&mut twin) {
                        passage.datagram = altered(&passage.datagram, &mut self.rng);
                        passage.is_genuine = false;
                    }
                }
                Distortion::Duplicate => {
                    twin.get_or_insert_with(|| Passage {
                        late: first.late + self.rng.random_range(Duration::ZERO..=DOUBLED_WITHIN),
                        datagram: Bytes::copy_from_slice(&first.datagram),
                        is_genuine: false,
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
        // Whichever arrives first is let in.
        if let Some(twin) = &mut twin
            && twin.late < first.late
        {
            std::mem::swap(&mut first.is_genuine, &mut twin.is_genuine);
        }
        (first, twin)
    }

    fn hear(&mut self, from: NodeId, to: NodeId, datagram: &Bytes) {
        let recorded = self.recorded.get_mut(&from);
        let heard = recorded.and_then(|frames| {
            let mut newest_first = frames.iter_mut().rev();
            newest_first.find(|it| it.datagram.as_ptr() == datagram.as_ptr())
        });
        if let Some(heard) = heard {
            heard.heard_by.insert(to);
        }
    }

    /// What was recorded of a sender, oldest first, and who has heard each frame already.
    pub(super) fn recorded(&self, from: NodeId) -> impl Iterator<Item = (Bytes, &NodeSet)> {
        let recorded = self.recorded.get(&from).into_iter().flatten();
        recorded.map(|it| (Bytes::copy_from_slice(&it.datagram), &it.heard_by))
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
        let next_life = Header {
            boot: frame.header.boot + 1,
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
            forged(&next_life, &unsigned),
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
