use std::collections::BTreeMap;
use std::time::Duration;

use crate::identity::NodeId;
use crate::time::Timestamp;

/// Who is near: a neighbour is stable after some messages in a row without a gap (thesis, section 4.4, table 1).
///
/// The thesis restarts its count after 500 ms, which is the period itself, and its code never does, because it
/// stores the time before it compares; here the gap is one and a half periods and the count does restart.
#[derive(Debug, Clone)]
pub(super) struct Neighbours {
    stable_after: u32,
    gap: Duration,
    heard: BTreeMap<NodeId, Heard>,
}

#[derive(Debug, Clone, Copy)]
struct Heard {
    last: Timestamp,
    in_a_row: u32,
    stable: bool,
}

impl Neighbours {
    pub(super) const fn new(stable_after: u32, gap: Duration) -> Self {
        Self {
            stable_after,
            gap,
            heard: BTreeMap::new(),
        }
    }

    /// What a restarted routing remembers of its neighbours.
    pub(super) fn remember(&mut self, stable: impl IntoIterator<Item = NodeId>, now: Timestamp) {
        self.heard.extend(stable.into_iter().map(|id| {
            let heard = Heard {
                last: now,
                in_a_row: self.stable_after,
                stable: true,
            };
            (id, heard)
        }));
    }

    /// Counts a hello; whether it made the neighbour stable.
    pub(super) fn hear(&mut self, id: NodeId, now: Timestamp) -> bool {
        let heard = self.heard.entry(id).or_insert(Heard {
            last: now,
            in_a_row: 0,
            stable: false,
        });
        if now.since(heard.last) > self.gap {
            heard.in_a_row = 0;
        }
        heard.last = now;
        heard.in_a_row += 1;
        let becomes_stable = !heard.stable && heard.in_a_row >= self.stable_after;
        heard.stable |= becomes_stable;
        becomes_stable
    }

    pub(super) fn is_stable(&self, id: NodeId) -> bool {
        self.heard.get(&id).is_some_and(|heard| heard.stable)
    }

    /// The stable neighbours, lowest first.
    pub(super) fn stable(&self) -> impl Iterator<Item = NodeId> + '_ {
        self.heard
            .iter()
            .filter(|(_, heard)| heard.stable)
            .map(|(id, _)| *id)
    }
}
