use serde::{Deserialize, Serialize};

/// Sequences reserved at once in a checkpoint, so that a restart never reuses one.
const BLOCK: u32 = 256;

/// Additional sequences that a restart skips, so that receivers do not count the skipped ones as lost frames. A link
/// that loses this many frames in a row is practically down.
pub(super) const RESTART_GAP: u32 = 64;

/// Sequences that prove that drones live. They only rise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Heartbeats {
    /// This drone's last packet number.
    pub own: u32,
    /// Highest known heartbeat sequence of the master; the last used one on the master.
    pub master: u32,
    /// First sequence that is not reserved, so certainly unused.
    reserved: u32,
}

impl Heartbeats {
    /// Takes the next sequence; returns whether a new block was reserved. That must be stored before the sequence is
    /// used.
    pub(super) fn advance(&mut self, is_master: bool) -> bool {
        self.own += 1;
        if is_master {
            self.master += 1;
        }
        let highest = self.own.max(if is_master { self.master } else { 0 });
        let exhausted = highest >= self.reserved;
        if exhausted {
            self.reserved = highest + BLOCK;
        }
        exhausted
    }

    /// First sequence that is not reserved.
    pub(super) const fn reserved(self) -> u32 {
        self.reserved
    }

    /// Without the heartbeat sequence of the master before.
    #[must_use]
    pub(super) const fn for_new_master(self) -> Self {
        Self { master: 0, ..self }
    }

    /// After a restart: skips all sequences that may have been used.
    pub(super) fn skip_reserved(&mut self, is_master: bool) {
        self.own = self.own.max(self.reserved) + RESTART_GAP;
        if is_master {
            self.master = self.master.max(self.reserved);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn restart_skips_more_than_the_restart_gap() {
        let (mut heartbeats, mut checkpoint) = (Heartbeats::default(), Heartbeats::default());
        for _ in 0..BLOCK * 2 {
            if heartbeats.advance(false) {
                checkpoint = heartbeats;
            }
            let mut restarted = checkpoint;
            restarted.skip_reserved(false);
            assert!(restarted.own - heartbeats.own > RESTART_GAP);
        }
    }
}
