//! A message in pieces, at its origin.

use std::collections::BTreeMap;
use std::time::Duration;

use bytes::Bytes;

use super::limits::{
    ACKNOWLEDGED_LIFETIME, PIECES_WINDOW, RETRY_MAX, RETRY_MIN, TRANSFER_LIFETIME,
};
use crate::identity::NodeId;
use crate::time::Timestamp;
use crate::wire::{MESSAGE_FRAME_MAX, MessageBody, message_pieces};

/// Sends a large message piece by piece, and repeats the pieces that do not arrive.
///
/// Invariant: a piece is in flight only if it was not acknowledged; at most [`PIECES_WINDOW`] are.
#[derive(Debug)]
pub(super) struct Transfer {
    payload: Bytes,
    length: u32,
    /// The receiver that acknowledges, and its session.
    receiver: Option<(NodeId, u32)>,
    arrived: Vec<bool>,
    missing: u32,
    /// First piece that was neither sent nor acknowledged.
    next: u32,
    in_flight: BTreeMap<u32, InFlight>,
    /// Smoothed time from a piece to its acknowledgement.
    round_trip: Duration,
    /// Number of repetitions since the last acknowledgement.
    repetitions: u32,
    started_at: Timestamp,
    progress_at: Timestamp,
}

#[derive(Debug, Clone, Copy)]
struct InFlight {
    sent_at: Timestamp,
    is_repeated: bool,
}

impl Transfer {
    /// A transfer of at most [`MESSAGE_MAX`](crate::wire::MESSAGE_MAX) bytes.
    pub(super) fn new(payload: Bytes, now: Timestamp) -> Self {
        let length = u32::try_from(payload.len()).unwrap_or(u32::MAX);
        let count = message_pieces(length);
        Self {
            payload,
            length,
            receiver: None,
            arrived: vec![false; count as usize],
            missing: count,
            next: 0,
            in_flight: BTreeMap::new(),
            round_trip: RETRY_MIN / 2,
            repetitions: 0,
            started_at: now,
            progress_at: now,
        }
    }

    fn pause(&self) -> Duration {
        let pause = (self.round_trip * 2).max(RETRY_MIN);
        (pause * (1 << (self.repetitions / PIECES_WINDOW).min(4))).min(RETRY_MAX)
    }

    /// When it is given up, unless a piece is acknowledged before.
    pub(super) fn expires_at(&self) -> Timestamp {
        let last = self.started_at + TRANSFER_LIFETIME;
        last.min(self.progress_at + ACKNOWLEDGED_LIFETIME)
    }

    /// When the next piece may be sent.
    pub(super) fn next_at(&self) -> Timestamp {
        if self.has_new_piece() {
            return Timestamp::ZERO;
        }
        let first = self.in_flight.values().map(|it| it.sent_at).min();
        first.map_or(self.expires_at(), |first| first + self.pause())
    }

    fn has_new_piece(&self) -> bool {
        self.in_flight.len() < PIECES_WINDOW as usize && self.next < self.arrived.len() as u32
    }

    /// The next piece to send; `None` if there is none yet. A piece that `is_queued` still waits at this drone.
    pub(super) fn take_piece(
        &mut self,
        now: Timestamp,
        is_queued: impl Fn(u32) -> bool,
    ) -> Option<MessageBody> {
        let pause = self.pause();
        let mut overdue: Option<(Timestamp, u32)> = None;
        for (index, piece) in &mut self.in_flight {
            if piece.sent_at + pause > now {
                continue;
            }
            if is_queued(*index) {
                // It is repeated at its hop.
                (piece.sent_at, piece.is_repeated) = (now, true);
            } else if overdue.is_none_or(|(oldest, _)| piece.sent_at < oldest) {
                overdue = Some((piece.sent_at, *index));
            }
        }
        let index = match overdue {
            Some((_, index)) => {
                self.repetitions += 1;
                index
            }
            None if self.has_new_piece() => {
                let index = self.next;
                self.next += 1;
                self.skip_arrived();
                index
            }
            None => return None,
        };
        let sent = InFlight {
            sent_at: now,
            is_repeated: overdue.is_some(),
        };
        self.in_flight.insert(index, sent);
        let begin = index as usize * MESSAGE_FRAME_MAX;
        let end = (begin + MESSAGE_FRAME_MAX).min(self.payload.len());
        Some(MessageBody::Piece {
            index,
            length: self.length,
            payload: self.payload.slice(begin..end),
        })
    }

    /// The receiver reports what has arrived; returns whether all has. Another receiver, or one that restarted, has
    /// nothing but what it reports. Another one is heeded only if it `may_take_over`.
    pub(super) fn record_progress(
        &mut self,
        now: Timestamp,
        receiver: (NodeId, u32),
        (below, beyond): (u32, u64),
        may_take_over: bool,
    ) -> bool {
        if self.receiver != Some(receiver) {
            let is_other = (self.receiver).is_some_and(|(known, _)| known != receiver.0);
            if is_other && !may_take_over {
                return false;
            }
            if self.receiver.replace(receiver).is_some() {
                self.start_over();
            }
        }
        if below as usize >= self.arrived.len() {
            return true;
        }
        self.record_arrivals(now, (below, beyond));
        if self.missing == 0 {
            // The receiver had no room to keep what it had acknowledged, and has only what it reports now.
            self.start_over();
            self.record_arrivals(now, (below, beyond));
        }
        false
    }

    fn record_arrivals(&mut self, now: Timestamp, (below, beyond): (u32, u64)) {
        let beyond = (0..64).filter(|bit| beyond & (1 << bit) != 0);
        let beyond = beyond.map(|bit| below as usize + 1 + bit);
        for index in (0..below as usize).chain(beyond) {
            self.record_arrival(now, index);
        }
        self.skip_arrived();
    }

    /// Keeps `next` at a piece that has not arrived.
    fn skip_arrived(&mut self) {
        while self.arrived.get(self.next as usize) == Some(&true) {
            self.next += 1;
        }
    }

    fn start_over(&mut self) {
        self.arrived.fill(false);
        self.missing = self.arrived.len() as u32;
        self.next = 0;
        self.in_flight.clear();
    }

    fn record_arrival(&mut self, now: Timestamp, index: usize) {
        let Some(arrived) = self.arrived.get_mut(index) else {
            return;
        };
        if std::mem::replace(arrived, true) {
            return;
        }
        self.missing -= 1;
        self.progress_at = now;
        self.repetitions = 0;
        if let Some(piece) = self.in_flight.remove(&(index as u32))
            && !piece.is_repeated
        {
            self.round_trip = (self.round_trip * 7 + now.since(piece.sent_at)) / 8;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RECEIVER: (NodeId, u32) = (NodeId(4), 1);

    fn transfer(pieces: usize) -> Transfer {
        let payload = vec![7; pieces * MESSAGE_FRAME_MAX - 1];
        Transfer::new(payload.into(), Timestamp::ZERO)
    }

    fn index(body: Option<MessageBody>) -> Option<u32> {
        match body? {
            MessageBody::Piece { index, .. } => Some(index),
            _ => None,
        }
    }

    #[test]
    fn only_missing_pieces_are_repeated() {
        let mut transfer = transfer(4);
        let sent: Vec<_> =
            std::iter::from_fn(|| index(transfer.take_piece(Timestamp::ZERO, |_| false))).collect();
        assert_eq!(sent, [0, 1, 2, 3]);
        assert!(!transfer.record_progress(Timestamp::ZERO, RECEIVER, (1, 0b10), false));
        let later = transfer.next_at();
        assert!(later > Timestamp::ZERO);
        let repeated: Vec<_> =
            std::iter::from_fn(|| index(transfer.take_piece(later, |_| false))).collect();
        assert_eq!(repeated, [1, 2]);
        assert!(transfer.record_progress(later, RECEIVER, (4, 0), false));
    }

    #[test]
    fn window_limits_pieces_in_flight() {
        let mut transfer = transfer(100);
        let sent = std::iter::from_fn(|| transfer.take_piece(Timestamp::ZERO, |_| false)).count();
        assert_eq!(sent, PIECES_WINDOW as usize);
    }

    #[test]
    fn new_leader_gets_all_pieces_and_others_are_ignored() {
        let mut transfer = transfer(2);
        while transfer.take_piece(Timestamp::ZERO, |_| false).is_some() {}
        assert!(!transfer.record_progress(Timestamp::ZERO, RECEIVER, (1, 0), false));
        let other = (NodeId(5), 1);
        assert!(!transfer.record_progress(Timestamp::ZERO, other, (2, 0), false));
        assert!(!transfer.record_progress(Timestamp::ZERO, other, (0, 0), true));
        assert_eq!(
            index(transfer.take_piece(Timestamp::ZERO, |_| false)),
            Some(0)
        );
        assert!(transfer.record_progress(Timestamp::ZERO, other, (2, 0), true));
    }

    #[test]
    fn pieces_that_the_receiver_could_not_keep_are_sent_again() {
        let mut transfer = transfer(4);
        while transfer.take_piece(Timestamp::ZERO, |_| false).is_some() {}
        assert!(!transfer.record_progress(Timestamp::ZERO, RECEIVER, (2, 0), false));
        assert!(!transfer.record_progress(Timestamp::ZERO, RECEIVER, (0, 0b110), false));
        let again: Vec<_> =
            std::iter::from_fn(|| index(transfer.take_piece(Timestamp::ZERO, |_| false))).collect();
        assert_eq!(again, [0, 1]);
        assert!(transfer.record_progress(Timestamp::ZERO, RECEIVER, (4, 0), false));
    }
}
