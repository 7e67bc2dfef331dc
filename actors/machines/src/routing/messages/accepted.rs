//! Frames that this drone has accepted, and that are to be acknowledged to their senders.

use std::collections::BTreeMap;

use super::limits::ACCEPT_DELAY;
use super::queue::FrameId;
use crate::identity::NodeId;
use crate::time::Timestamp;
use crate::wire::Accepted;

/// Most frames of a neighbour that are collected. Of more the first are forgotten, and repeated by the neighbour.
const FRAMES_MAX: usize = 64;
/// Most groups of numbers in one packet.
pub(super) const GROUPS_MAX: usize = 16;

/// What is to be acknowledged to each neighbour.
///
/// Invariant: no neighbour's list is empty or longer than [`FRAMES_MAX`].
#[derive(Debug, Default)]
pub(super) struct Owed(BTreeMap<NodeId, (Timestamp, Vec<FrameId>)>);

impl Owed {
    /// A frame of a neighbour was accepted.
    pub(super) fn add(&mut self, neighbour: NodeId, id: FrameId, now: Timestamp) {
        let (_, frames) = self
            .0
            .entry(neighbour)
            .or_insert_with(|| (now + ACCEPT_DELAY, Vec::new()));
        if frames.len() == FRAMES_MAX {
            frames.remove(0);
        }
        if !frames.contains(&id) {
            frames.push(id);
        }
    }

    /// When a neighbour must get an acknowledgement.
    pub(super) fn due(&self) -> Option<Timestamp> {
        self.0.values().map(|(due, _)| *due).min()
    }

    /// Receiver of a packet that is due now: a neighbour, or `None` for several. Outer `None` if none is due.
    pub(super) fn receiver(&self, now: Timestamp) -> Option<Option<NodeId>> {
        if self.due().is_none_or(|due| due > now) {
            return None;
        }
        let only = self.0.keys().next().filter(|_| self.0.len() == 1);
        Some(only.copied())
    }

    /// Takes what a packet to a neighbour, or to all, can carry: up to `groups` groups.
    pub(super) fn take(&mut self, to: Option<NodeId>, groups: usize) -> Vec<Accepted> {
        let mut taken = Vec::new();
        let neighbours: Vec<NodeId> = match to {
            Some(to) => vec![to],
            None => self.0.keys().copied().collect(),
        };
        for neighbour in neighbours {
            if taken.len() == groups {
                break;
            }
            let Some((due, mut frames)) = self.0.remove(&neighbour) else {
                continue;
            };
            frames.sort_unstable();
            while taken.len() < groups
                && let Some(highest) = frames.pop()
            {
                taken.push(group(highest, &mut frames));
            }
            if !frames.is_empty() {
                self.0.insert(neighbour, (due, frames));
            }
        }
        taken
    }
}

/// Takes the numbers that one group with the highest number holds from the end of sorted frames.
fn group(highest: FrameId, frames: &mut Vec<FrameId>) -> Accepted {
    let mut before = 0;
    while let Some(next) = frames.last() {
        if (next.by, next.session) != (highest.by, highest.session) {
            break;
        }
        let behind = highest.number - next.number;
        if !(1..=32).contains(&behind) {
            break;
        }
        before |= 1 << (behind - 1);
        frames.pop();
    }
    Accepted {
        by: highest.by,
        session: highest.session,
        number: highest.number,
        before,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn frame(by: u32, number: u32) -> FrameId {
        FrameId {
            by: NodeId(by),
            session: 9,
            number,
        }
    }

    #[test]
    fn numbers_of_one_drone_are_merged() {
        let mut owed = Owed::default();
        for number in [100, 101, 99, 67, 68] {
            owed.add(NodeId(1), frame(1, number), Timestamp::ZERO);
        }
        owed.add(NodeId(2), frame(1, 3), Timestamp::ZERO);
        assert_eq!(owed.receiver(Timestamp::ZERO), None);
        let later = Timestamp::ZERO + ACCEPT_DELAY;
        assert_eq!(owed.receiver(later), Some(None));
        let taken = owed.take(Some(NodeId(1)), 8);
        let numbers: Vec<_> = taken.iter().map(|it| (it.number, it.before)).collect();
        assert_eq!(numbers, [(101, 0b11), (68, 1)]);
        assert_eq!(owed.receiver(later), Some(Some(NodeId(2))));
        assert_eq!(owed.take(None, 8).len(), 1);
        assert_eq!(owed.due(), None);
    }

    #[test]
    fn acknowledgements_without_room_are_sent_with_the_next_frame() {
        let mut owed = Owed::default();
        (0..4).for_each(|nth| owed.add(NodeId(1), frame(nth, 1), Timestamp::ZERO));
        assert_eq!(owed.take(Some(NodeId(1)), 3).len(), 3);
        assert_eq!(owed.take(None, 3).len(), 1);
    }
}
