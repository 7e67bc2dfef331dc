use serde::{Deserialize, Serialize};

/// Counters reserved at once: a restart never reuses one, and the journal is written rarely.
pub(super) const COUNTER_BLOCK: u64 = 1_024;

/// Persistent state of a radio: the counters that may have been used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Checkpoint {
    /// First counter that no frame has used.
    pub counter: u64,
}

/// Counters of own frames. A checkpoint reserves each counter before a frame uses it.
#[derive(Debug)]
pub(super) struct Counters {
    next: u64,
    /// First counter that is not reserved; never below `next`.
    reserved: u64,
}

impl Counters {
    /// Starts after the counters reserved by `checkpoint`.
    pub(super) const fn new(checkpoint: Checkpoint) -> Self {
        Self {
            next: checkpoint.counter,
            reserved: checkpoint.counter,
        }
    }

    /// The next counter.
    pub(super) const fn next(&self) -> u64 {
        self.next
    }

    /// Reserves counters if none is left; returns the checkpoint to write first.
    #[inline]
    pub(super) fn reserve(&mut self) -> Option<Checkpoint> {
        (self.next == self.reserved).then(|| {
            self.reserved += COUNTER_BLOCK;
            let counter = self.reserved;
            Checkpoint { counter }
        })
    }

    /// Uses the next counter, which must be reserved.
    #[inline]
    pub(super) fn take(&mut self) -> u64 {
        debug_assert!(
            self.next < self.reserved,
            "counters are reserved before use"
        );
        self.next += 1;
        self.next - 1
    }
}
