use serde::{Deserialize, Serialize};

/// How many numbers are reserved at once, so that a restart never falls back to one already used.
const BLOCK: u32 = 256;

/// By how many numbers more than it skips anyway a restart is ahead, so that nobody takes those that were skipped for so many
/// frames that were missed: over a link on which as many in a row are missed next to nothing is heard.
pub(super) const RESTART_GAP: u32 = 64;

/// The numbers by which drones prove that they live; they only rise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Heartbeats {
    /// This drone's own last number.
    pub own: u32,
    /// The highest number of the master's own that was heard of, or used as master.
    pub master: u32,
    /// The first number that may not have been used yet.
    reserved: u32,
}

impl Heartbeats {
    /// Goes on to the next number; whether a new block of them was reserved, which is to be remembered before it is
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

    /// The first number that may not have been used yet.
    pub(super) const fn reserved(self) -> u32 {
        self.reserved
    }

    /// The same under another master, whose number has not been heard yet.
    #[must_use]
    pub(super) const fn under_another_master(self) -> Self {
        Self { master: 0, ..self }
    }

    /// Skips whatever may have been used since this was remembered.
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
    fn a_restart_skips_more_numbers_than_may_be_missed() {
        let (mut beats, mut kept) = (Heartbeats::default(), Heartbeats::default());
        for _ in 0..BLOCK * 2 {
            if beats.advance(false) {
                kept = beats;
            }
            let mut restarted = kept;
            restarted.skip_reserved(false);
            assert!(restarted.own - beats.own > RESTART_GAP);
        }
    }
}
