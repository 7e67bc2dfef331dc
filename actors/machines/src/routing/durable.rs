use bytes::Bytes;

use super::Routes;
use crate::identity::{Ballot, NodeId};
use crate::time::Timestamp;

/// How many beats are reserved at once, so that a restart never falls back to one already used.
const BEAT_BLOCK: u32 = 256;

/// What outlives a routing.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Checkpoint {
    /// Whom this drone obeys.
    pub ballot: Option<Ballot>,
    /// What its routing is doing.
    pub phase: Phase,
    /// The number of the newest order; 0 before the first.
    pub sequence: u32,
    /// The newest order.
    pub order: Option<Bytes>,
    /// The newest order that the drone has carried out.
    pub acknowledged: u32,
    /// Since when the drone is going to land.
    pub landing: Option<Timestamp>,
    /// The way to the master.
    pub routes: Routes,
    /// The stable neighbours, lowest first.
    pub stable: Vec<NodeId>,
    /// The highest number of the master's own that was heard of, or sent as master.
    pub pulse: u32,
    /// This drone's own beat.
    pub beat: u32,
    /// The first beat and pulse that may not have been used yet.
    pub reserved: u32,
}

/// What a routing is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Phase {
    /// There are no routes yet: everyone repeats all it knows.
    #[default]
    Gossip,
    /// Everyone says hello.
    Discovery {
        /// When it ends.
        until: Timestamp,
    },
    /// Hops and routing lists spread from the master.
    HopUpdate {
        /// When it began.
        since: Timestamp,
    },
    /// Routes are up.
    Following,
    /// On the ground, done.
    Stopped,
}

impl Checkpoint {
    /// The next beat; whether a new block of them was reserved, which is to be remembered before it is used.
    pub(super) fn next_beat(&mut self, is_master: bool) -> bool {
        self.beat += 1;
        if is_master {
            self.pulse += 1;
        }
        let highest = self.beat.max(if is_master { self.pulse } else { 0 });
        let exhausted = highest >= self.reserved;
        if exhausted {
            self.reserved = highest + BEAT_BLOCK;
        }
        exhausted
    }

    /// Skips whatever may have been used since this was stored.
    pub(super) fn skip_reserved(&mut self, is_master: bool) {
        self.beat = self.beat.max(self.reserved);
        if is_master {
            self.pulse = self.pulse.max(self.reserved);
        }
    }
}
