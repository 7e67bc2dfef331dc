use std::collections::BTreeMap;
use std::time::Duration;

use crate::identity::NodeId;
use crate::time::Timestamp;

/// Neighbours. One is stable after a number of hellos without a gap (thesis, section 4.4, table 1).
///
/// The thesis restarts its count after 500 ms, which is the period itself. Its code never does, because it stores the
/// time before it compares. Here the gap is one and a half periods, and the count does restart.
#[derive(Debug, Clone)]
pub(super) struct Neighbours {
    stable_after: u32,
    gap: Duration,
    hellos: BTreeMap<NodeId, HelloRecord>,
}

#[derive(Debug, Clone, Copy)]
struct HelloRecord {
    last: Timestamp,
    consecutive: u32,
    stable: bool,
}

impl Neighbours {
    pub(super) const fn new(stable_after: u32, gap: Duration) -> Self {
        Self {
            stable_after,
            gap,
            hellos: BTreeMap::new(),
        }
    }

    /// After a restart: restores the stable neighbours.
    pub(super) fn restore(&mut self, stable: impl IntoIterator<Item = NodeId>, now: Timestamp) {
        self.hellos.extend(stable.into_iter().map(|id| {
            let record = HelloRecord {
                last: now,
                consecutive: self.stable_after,
                stable: true,
            };
            (id, record)
        }));
    }

    /// Counts a hello; returns whether it made the neighbour stable.
    pub(super) fn record_hello(&mut self, id: NodeId, now: Timestamp) -> bool {
        let record = self.hellos.entry(id).or_insert(HelloRecord {
            last: now,
            consecutive: 0,
            stable: false,
        });
        if now.since(record.last) > self.gap {
            record.consecutive = 0;
        }
        record.last = now;
        record.consecutive += 1;
        let becomes_stable = !record.stable && record.consecutive >= self.stable_after;
        record.stable |= becomes_stable;
        becomes_stable
    }

    pub(super) fn is_stable(&self, id: NodeId) -> bool {
        self.hellos.get(&id).is_some_and(|record| record.stable)
    }

    /// Stable neighbours, lowest id first.
    pub(super) fn stable(&self) -> impl Iterator<Item = NodeId> + '_ {
        self.hellos
            .iter()
            .filter(|(_, record)| record.stable)
            .map(|(id, _)| *id)
    }
}
