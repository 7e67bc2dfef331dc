//! The trace of a run.

use std::fmt::{Debug, Write};

use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;

/// Bytes that are hashed at once: as many blocks as BLAKE3 processes in parallel, and no more, to leave the processor's
/// caches to the run.
const BUFFER_MAX: usize = 16 * 1_024;

/// Bytes of an arriving frame that are hashed. They usually hold its sender and number; the whole frame was hashed when it
/// was sent.
pub(super) const HEADING_LEN: usize = 16;

/// A running BLAKE3 hash of all observations of a run: equal runs have equal traces.
///
/// Observations are hashed in their order, each with its time, drone and kind. Checkpoints are left out, being internal to a
/// drone; so are authenticators, so that the trace does not depend on the one in use.
///
/// Invariant: the hash covers what `hasher` has taken, followed by `bytes`.
#[derive(Debug)]
pub(crate) struct Trace {
    hasher: blake3::Hasher,
    /// Memory to print values, used again.
    buffer: String,
    /// What has yet to be hashed.
    bytes: Vec<u8>,
}

/// The kind of an observation. Its number is hashed: new kinds are added at the end.
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
    Resumed,
    Skewed,
    Flew,
}

impl Trace {
    pub(crate) fn new() -> Self {
        Self {
            hasher: blake3::Hasher::new(),
            buffer: String::new(),
            bytes: Vec::with_capacity(BUFFER_MAX),
        }
    }

    /// Adds an observation.
    pub(crate) fn bytes(&mut self, now: Timestamp, drone: NodeId, kind: Kind, bytes: &[u8]) {
        let len =
            u32::try_from(bytes.len()).expect("an observation is at most a datagram or a line");
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

    /// Adds a rare observation, as it prints.
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
