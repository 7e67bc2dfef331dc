//! Frames that wait to be sent, or to be accepted by the next hop.

use std::collections::{BTreeMap, VecDeque};
use std::ops::Bound;

use super::limits::{FORWARD_EACH_MAX, FORWARD_MAX};
use crate::identity::{NodeId, NodeSet};
use crate::time::Timestamp;
use crate::wire::{Accepted, MessageBody, MessageFrame};

/// Identity of a frame: unique while it lives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct FrameId {
    /// The drone that numbered it.
    pub(super) by: NodeId,
    pub(super) session: u32,
    pub(super) number: u32,
}

impl Accepted {
    /// Whether a frame is among the accepted ones.
    fn covers(&self, id: FrameId) -> bool {
        let is_before = |back: u32| back < 32 && self.before & (1 << back) != 0;
        (self.by, self.session) == (id.by, id.session)
            && match self.number.checked_sub(id.number) {
                Some(0) => true,
                Some(behind) => is_before(behind - 1),
                None => false,
            }
    }
}

/// Which neighbours a frame is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Reach {
    /// The next hop on the route.
    NextHop,
    /// All, and they pass it on.
    Flood,
    /// All that hear it.
    Neighbours,
}

/// What is to be reported to the protocol of an own frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Report {
    /// Nothing: another drone reports it, or the message's end is known elsewhere.
    Nothing,
    /// That it was lost here, with the protocol's number of the message.
    Losses(u32),
    /// What became of it, with the protocol's number of the message.
    Outcome(u32),
}

/// A frame in the queue.
#[derive(Debug)]
pub(super) struct Entry {
    pub(super) id: FrameId,
    pub(super) frame: MessageFrame,
    pub(super) reach: Reach,
    pub(super) report: Report,
    pub(super) since: Timestamp,
    pub(super) expires_at: Timestamp,
    /// When it is sent, or sent again.
    pub(super) due: Timestamp,
    /// Number of times it was sent; of [`Reach::NextHop`] to the current next hop.
    pub(super) tries: u32,
    /// Neighbours that have not accepted it.
    pub(super) awaited: NodeSet,
    /// Neighbours that are no next hop: it came from there, or they do not answer.
    pub(super) avoided: NodeSet,
    /// The neighbour that must take other frames first.
    pub(super) blocked_by: Option<NodeId>,
}

impl Entry {
    /// Whether it is a piece of a large message, which gives way to others.
    pub(super) const fn is_piece(&self) -> bool {
        matches!(self.frame.body, MessageBody::Piece { .. })
    }

    const fn piece(&self) -> Option<u32> {
        match self.frame.body {
            MessageBody::Piece { index, .. } => Some(index),
            _ => None,
        }
    }

    /// Whether it was sent to a neighbour that has not accepted it.
    fn is_next_hop(&self, neighbour: NodeId) -> bool {
        self.reach == Reach::NextHop && self.tries > 0 && self.awaited.contains(neighbour)
    }
}

/// Place of an entry in the queue, valid until the queue changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Place {
    origin: NodeId,
    index: usize,
}

/// Frames by origin. The origins take turns, so one that sends much delays its own frames only.
///
/// Invariant: at most [`FORWARD_MAX`] frames, and [`FORWARD_EACH_MAX`] of one origin. No origin's list is empty.
#[derive(Debug, Default)]
pub(super) struct Queue {
    origins: BTreeMap<NodeId, VecDeque<Entry>>,
    len: usize,
    /// The origin that was last in turn.
    last: Option<NodeId>,
}

impl Queue {
    pub(super) const fn len(&self) -> usize {
        self.len
    }

    /// Whether a frame of an origin may be added.
    pub(super) fn has_room(&self, origin: NodeId) -> bool {
        let of_origin = self.origins.get(&origin).map_or(0, VecDeque::len);
        self.len < FORWARD_MAX && of_origin < FORWARD_EACH_MAX
    }

    /// Adds a frame. Call [`Self::has_room`] before.
    pub(super) fn push(&mut self, entry: Entry) {
        debug_assert!(self.has_room(entry.frame.origin));
        let origin = self.origins.entry(entry.frame.origin).or_default();
        origin.push_back(entry);
        self.len += 1;
    }

    pub(super) fn get_mut(&mut self, place: Place) -> Option<&mut Entry> {
        self.origins.get_mut(&place.origin)?.get_mut(place.index)
    }

    pub(super) fn remove(&mut self, place: Place) -> Option<Entry> {
        let origin = self.origins.get_mut(&place.origin)?;
        let removed = origin.remove(place.index);
        if origin.is_empty() {
            self.origins.remove(&place.origin);
        }
        self.len -= usize::from(removed.is_some());
        removed
    }

    /// The next frame that is due, and whose origin is in turn. Pieces follow if no other frame is due.
    pub(super) fn next_due(&self, now: Timestamp, with_pieces: bool) -> Option<Place> {
        if self.len == 0 {
            return None;
        }
        let due = |is_piece: bool| {
            let after = self.last.map_or(Bound::Unbounded, Bound::Excluded);
            let mut turns = self
                .origins
                .range((after, Bound::Unbounded))
                .chain(&self.origins);
            turns.find_map(|(origin, entries)| {
                let is_due = |entry: &Entry| entry.due <= now && entry.is_piece() == is_piece;
                let index = entries.iter().position(is_due)?;
                Some(Place {
                    origin: *origin,
                    index,
                })
            })
        };
        due(false).or_else(|| due(true).filter(|_| with_pieces))
    }

    /// Records that the origin of a frame has had its turn.
    pub(super) const fn end_turn(&mut self, place: Place) {
        self.last = Some(place.origin);
    }

    /// When the next frame is due that is a piece, or not.
    pub(super) fn due(&self, is_piece: bool) -> Option<Timestamp> {
        let entries = self.iter().filter(|entry| entry.is_piece() == is_piece);
        entries.map(|entry| entry.due).min()
    }

    /// When the next frame expires.
    pub(super) fn expires_at(&self) -> Option<Timestamp> {
        self.iter().map(|entry| entry.expires_at).min()
    }

    fn iter(&self) -> impl Iterator<Item = &Entry> {
        self.origins.values().flatten()
    }

    fn iter_mut(&mut self) -> impl Iterator<Item = &mut Entry> {
        self.origins.values_mut().flatten()
    }

    /// Removes the frames for which `is_done` is true, and returns them.
    fn take_all(&mut self, is_done: impl Fn(&Entry) -> bool) -> Vec<Entry> {
        let mut done = Vec::new();
        if self.len == 0 {
            return done;
        }
        for entries in self.origins.values_mut() {
            if !entries.iter().any(&is_done) {
                continue;
            }
            for entry in std::mem::take(entries) {
                if is_done(&entry) {
                    done.push(entry);
                } else {
                    entries.push_back(entry);
                }
            }
        }
        self.origins.retain(|_, entries| !entries.is_empty());
        self.len -= done.len();
        done
    }

    /// Removes the frames that have expired.
    pub(super) fn expire(&mut self, now: Timestamp) -> Vec<Entry> {
        self.take_all(|entry| entry.expires_at <= now)
    }

    /// Removes all frames.
    pub(super) fn clear(&mut self) -> Vec<Entry> {
        self.take_all(|_| true)
    }

    /// A neighbour has accepted frames; returns those that all awaited neighbours have accepted now.
    pub(super) fn accept(&mut self, neighbour: NodeId, accepted: &[Accepted]) -> Vec<Entry> {
        if accepted.is_empty() {
            return Vec::new();
        }
        for entry in self.iter_mut() {
            if accepted.iter().any(|it| it.covers(entry.id)) {
                entry.awaited = match entry.reach {
                    // Perhaps one that was tried before.
                    Reach::NextHop => NodeSet::new(),
                    _ => entry.awaited.difference(&neighbour.into()),
                };
            }
        }
        self.unblock(neighbour);
        self.take_all(|entry| {
            entry.tries > 0
                && entry.awaited.is_empty()
                && accepted.iter().any(|it| it.covers(entry.id))
        })
    }

    /// A neighbour passes a frame on, so it has accepted it. A frame that was not sent yet and that no one awaits any
    /// more is done, too.
    pub(super) fn overhear(&mut self, neighbour: NodeId, id: FrameId) -> Vec<Entry> {
        let mut is_done = false;
        for entry in self.iter_mut().filter(|entry| entry.id == id) {
            let is_awaited = entry.awaited.contains(neighbour);
            entry.awaited = entry.awaited.difference(&neighbour.into());
            is_done = is_awaited && entry.awaited.is_empty();
        }
        if is_done {
            self.take_all(|entry| entry.id == id)
        } else {
            Vec::new()
        }
    }

    /// Frames that wait for a neighbour may be sent.
    pub(super) fn unblock(&mut self, neighbour: NodeId) {
        for entry in self.iter_mut() {
            if entry.blocked_by == Some(neighbour) {
                entry.blocked_by = None;
                entry.due = Timestamp::ZERO;
            }
        }
    }

    /// The frame with this number.
    pub(super) fn find_mut(&mut self, id: FrameId) -> Option<&mut Entry> {
        self.iter_mut().find(|entry| entry.id == id)
    }

    /// Number of frames that a neighbour has not accepted yet.
    pub(super) fn queued_for(&self, neighbour: NodeId) -> usize {
        self.iter()
            .filter(|entry| entry.is_next_hop(neighbour))
            .count()
    }

    /// Whether this part of a message is in the queue.
    pub(super) fn holds(
        &self,
        origin: NodeId,
        (session, message): (u32, u32),
        piece: Option<u32>,
    ) -> bool {
        let entries = self.origins.get(&origin).into_iter().flatten();
        let is_it = |entry: &Entry| {
            (entry.frame.origin_session, entry.frame.message) == (session, message)
                && entry.piece() == piece
        };
        message > 0 && entries.into_iter().any(is_it)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::Destination;

    fn entry(origin: u32, number: u32, body: MessageBody) -> Entry {
        let id = FrameId {
            by: NodeId(origin),
            session: 1,
            number,
        };
        Entry {
            id,
            frame: MessageFrame {
                number,
                flood: None,
                hops: 0,
                left_ms: 0,
                awaited: NodeSet::new(),
                origin: id.by,
                origin_session: 1,
                message: number,
                to: Destination::Leader,
                body,
            },
            reach: Reach::NextHop,
            report: Report::Nothing,
            since: Timestamp::ZERO,
            expires_at: Timestamp::ZERO,
            due: Timestamp::ZERO,
            tries: 0,
            awaited: NodeSet::new(),
            avoided: NodeSet::new(),
            blocked_by: None,
        }
    }

    fn whole() -> MessageBody {
        MessageBody::Whole {
            acknowledge: false,
            payload: bytes::Bytes::new(),
        }
    }

    #[test]
    fn origins_take_turns_and_pieces_come_last() {
        let mut queue = Queue::default();
        let piece = MessageBody::Piece {
            index: 0,
            length: 1,
            payload: bytes::Bytes::from_static(b"1"),
        };
        queue.push(entry(1, 9, piece));
        (1..=3).for_each(|number| queue.push(entry(2, number, whole())));
        (1..=2).for_each(|number| queue.push(entry(3, number, whole())));
        queue.push(entry(5, 1, whole()));
        let mut turns = Vec::new();
        while let Some(place) = queue.next_due(Timestamp::ZERO, true) {
            queue.end_turn(place);
            let sent = queue.remove(place).map(|it| (it.id.by.0, it.id.number));
            turns.extend(sent);
        }
        let expected = [(2, 1), (3, 1), (5, 1), (2, 2), (3, 2), (2, 3), (1, 9)];
        assert_eq!((turns, queue.len()), (expected.to_vec(), 0));
    }

    #[test]
    fn one_origin_fills_its_own_share_only() {
        let mut queue = Queue::default();
        while queue.has_room(NodeId(1)) {
            queue.push(entry(1, 1, whole()));
        }
        assert_eq!(queue.len(), FORWARD_EACH_MAX);
        assert!(queue.has_room(NodeId(2)));
        (2..)
            .take_while(|origin| {
                let has_room = queue.has_room(NodeId(*origin));
                if has_room {
                    queue.push(entry(*origin, 1, whole()));
                }
                has_room
            })
            .for_each(drop);
        assert_eq!(queue.len(), FORWARD_MAX);
    }

    #[test]
    fn what_one_neighbour_accepted_is_done_and_a_broadcast_waits_for_all() {
        let mut queue = Queue::default();
        let mut broadcast = entry(1, 40, whole());
        broadcast.reach = Reach::Flood;
        broadcast.awaited = (2..4).map(NodeId).collect();
        let mut unicast = entry(1, 38, whole());
        unicast.awaited = NodeId(2).into();
        for mut sent in [broadcast, unicast] {
            sent.tries = 1;
            queue.push(sent);
        }
        let accepted = |session| {
            [Accepted {
                by: NodeId(1),
                session,
                number: 40,
                before: 0b10,
            }]
        };
        assert!(queue.accept(NodeId(2), &accepted(2)).is_empty());
        let done = queue.accept(NodeId(2), &accepted(1));
        assert_eq!(done.iter().map(|it| it.id.number).collect::<Vec<_>>(), [38]);
        let done = queue.accept(NodeId(3), &accepted(1));
        assert_eq!(done.iter().map(|it| it.id.number).collect::<Vec<_>>(), [40]);
    }
}
