//! Neighbours to which unicasts were lost.

use std::collections::BTreeMap;
use std::time::Duration;

use crate::identity::{NodeId, NodeSet};
use crate::time::Timestamp;

/// Weight of a new report in the mean is one of so many.
const MEAN_OF: u16 = 4;
/// Share of losses, in 256ths, above which a neighbour is unreliable: two losses in a row. The medium has sent each frame
/// up to eight times, which a good link loses once in a thousand times.
const UNRELIABLE: u16 = 100;
/// A neighbour is tried again after this time.
const AVOIDED_FOR: Duration = Duration::from_secs(3);

/// Moving mean of the losses to each neighbour, as the medium reports them.
///
/// Invariant: no entry without a loss.
#[derive(Debug, Default)]
pub(super) struct Losses(BTreeMap<NodeId, Mean>);

#[derive(Debug, Clone, Copy)]
struct Mean {
    /// In 256ths.
    lost: u16,
    lost_at: Timestamp,
}

impl Losses {
    /// Records what became of a unicast.
    pub(super) fn record(&mut self, neighbour: NodeId, now: Timestamp, is_delivered: bool) {
        if is_delivered && !self.0.contains_key(&neighbour) {
            return;
        }
        let mean = self.0.entry(neighbour).or_insert(Mean {
            lost: 0,
            lost_at: now,
        });
        mean.lost -= mean.lost.div_ceil(MEAN_OF);
        if !is_delivered {
            mean.lost += 256 / MEAN_OF;
            mean.lost_at = now;
        }
        if mean.lost == 0 {
            self.0.remove(&neighbour);
        }
    }

    /// Neighbours that are no next hop if there is another.
    pub(super) fn unreliable(&self, now: Timestamp) -> NodeSet {
        let is_unreliable =
            |mean: &Mean| mean.lost > UNRELIABLE && now.since(mean.lost_at) < AVOIDED_FOR;
        let neighbours = self.0.iter().filter(|(_, mean)| is_unreliable(mean));
        neighbours.map(|(id, _)| *id).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbour_is_unreliable_after_two_losses_and_for_a_while() {
        let (neighbour, now) = (NodeId(1), Timestamp::ZERO);
        let mut losses = Losses::default();
        losses.record(neighbour, now, false);
        assert!(losses.unreliable(now).is_empty());
        losses.record(neighbour, now, false);
        assert!(losses.unreliable(now).contains(neighbour));
        assert!(losses.unreliable(now + AVOIDED_FOR).is_empty());
        losses.record(neighbour, now, true);
        assert!(losses.unreliable(now).is_empty());
        (0..20).for_each(|_| losses.record(neighbour, now, true));
        assert!(losses.0.is_empty());
    }
}
