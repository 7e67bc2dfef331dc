use std::fmt::{Debug, Write};

use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;

/// What is hashed at once, in bytes: as many blocks as BLAKE3 works on side by side, and no more, for what a run touches
/// next is to stay in the processor's caches.
const BUFFER_MAX: usize = 16 * 1_024;

/// Of a frame that arrives, how many bytes are hashed: what tells whose it is, and which, lies within these as a rule, and
/// all of it was hashed when it was sent.
pub(super) const HEADING_LEN: usize = 16;

/// A running BLAKE3 of everything that can be observed of a run: equal runs have equal traces.
///
/// What was observed is hashed in the order in which it happened, each with its time, its drone and its kind.
/// Checkpoints, being a drone's own affair, and authenticators, so that it does not matter which is used, are not.
#[derive(Debug)]
pub(crate) struct Trace {
    hasher: blake3::Hasher,
    buffer: String,
    bytes: Vec<u8>,
}

/// What kind of thing was observed.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Kind {
    Sent,
    Arrived,
    Observed,
    Commanded,
    CameToRest,
    Failed,
    Started,
    Undeliverable,
    Steered,
    Killed,
    Addressed,
    Drained,
    PositionLost,
    Fell,
    Stopped,
    Hung,
    WentOn,
    Skewed,
}

impl Trace {
    pub(crate) fn new() -> Self {
        Self {
            hasher: blake3::Hasher::new(),
            buffer: String::new(),
            bytes: Vec::with_capacity(BUFFER_MAX),
        }
    }

    pub(crate) fn bytes(&mut self, now: Timestamp, drone: NodeId, kind: Kind, bytes: &[u8]) {
        let len = u32::try_from(bytes.len())
            .expect("what is observed is no longer than a datagram or a line");
        let mut head = [0; 8 + 4 + 1 + 4];
        head[..8].copy_from_slice(&now.as_nanos().to_le_bytes());
        head[8..12].copy_from_slice(&drone.0.to_le_bytes());
        head[12] = kind as u8;
        head[13..].copy_from_slice(&len.to_le_bytes());
        self.bytes.extend_from_slice(&head);
        self.bytes.extend_from_slice(bytes);
        if self.bytes.len() >= BUFFER_MAX {
            self.hasher.update(&self.bytes);
            self.bytes.clear();
        }
    }

    /// For what is rare: as it prints.
    pub(crate) fn value(&mut self, now: Timestamp, drone: NodeId, kind: Kind, value: &impl Debug) {
        let mut buffer = std::mem::take(&mut self.buffer);
        buffer.clear();
        write!(buffer, "{value:?}").expect("writing to a string can't fail");
        self.bytes(now, drone, kind, buffer.as_bytes());
        self.buffer = buffer;
    }

    /// The hash so far, in hexadecimal.
    pub(crate) fn finish(&mut self) -> String {
        self.hasher.update(&self.bytes);
        self.bytes.clear();
        self.hasher.finalize().to_hex().to_string()
    }
}
