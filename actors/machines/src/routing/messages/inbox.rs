//! The receiver's side: large messages that arrive in pieces, and what is to be acknowledged to their origins.

use std::collections::BTreeMap;

use bytes::Bytes;

use super::limits::{
    PIECES_A_RECEIPT, PROGRESS_DELAY, REASSEMBLIES_MAX, REASSEMBLY_IDLE, REASSEMBLY_TIMEOUT,
    RECEIPT_DELAY,
};
use crate::identity::NodeId;
use crate::time::{Timestamp, first_of};
use crate::wire::{MESSAGE_FRAME_MAX, MessageBody, message_pieces};

/// Identity of a message of an origin: its session and number.
pub(super) type MessageId = (u32, u32);

/// A large message of which some pieces have arrived.
#[derive(Debug)]
struct Reassembly {
    message: MessageId,
    payload: Vec<u8>,
    arrived: Vec<bool>,
    missing: u32,
    /// All pieces below this index have arrived.
    below: u32,
    /// When the last new piece arrived.
    grew_at: Timestamp,
}

impl Reassembly {
    fn new(message: MessageId, length: u32, now: Timestamp) -> Self {
        let count = message_pieces(length);
        Self {
            message,
            payload: vec![0; length as usize],
            arrived: vec![false; count as usize],
            missing: count,
            below: 0,
            grew_at: now,
        }
    }

    /// Adds a piece whose length fits its index; returns whether it is new.
    fn add(&mut self, index: u32, piece: &[u8], now: Timestamp) -> bool {
        let begin = index as usize * MESSAGE_FRAME_MAX;
        let place = self.payload.get_mut(begin..begin + piece.len());
        let (Some(place), Some(arrived)) = (place, self.arrived.get_mut(index as usize)) else {
            return false;
        };
        if std::mem::replace(arrived, true) {
            return false;
        }
        place.copy_from_slice(piece);
        self.missing -= 1;
        self.grew_at = now;
        while self.arrived.get(self.below as usize) == Some(&true) {
            self.below += 1;
        }
        true
    }

    fn beyond(&self) -> u64 {
        let pieces = self.arrived.iter().skip(self.below as usize + 1).take(64);
        let arrived = pieces.enumerate().filter(|(_, arrived)| **arrived);
        arrived.map(|(bit, _)| 1 << bit).sum()
    }
}

/// What is to be acknowledged to an origin.
#[derive(Debug, Default)]
struct Receipt {
    /// The newest whole message, and when it must be acknowledged.
    whole: Option<(Timestamp, MessageId)>,
    /// The message in pieces, and when it must be acknowledged.
    pieces: Option<(Timestamp, MessageId)>,
    /// Number of pieces of it that were not reported.
    unreported: u32,
    /// The message in pieces that arrived last, and its number of pieces.
    complete: Option<(MessageId, u32)>,
}

/// Messages in pieces, one of each origin, and the acknowledgements that origins are owed.
///
/// Invariant: at most [`REASSEMBLIES_MAX`] reassemblies, so at most that many times
/// [`MESSAGE_MAX`](crate::wire::MESSAGE_MAX) bytes.
#[derive(Debug, Default)]
pub(super) struct Inbox {
    reassemblies: BTreeMap<NodeId, Reassembly>,
    receipts: BTreeMap<NodeId, Receipt>,
}

impl Inbox {
    /// Number of messages that arrive in pieces.
    pub(super) fn len(&self) -> usize {
        self.reassemblies.len()
    }

    /// A whole message arrived whose origin waits for an acknowledgement.
    pub(super) fn owe_receipt(&mut self, origin: NodeId, message: MessageId, now: Timestamp) {
        let receipt = self.receipts.entry(origin).or_default();
        let (due, known) = (receipt.whole).get_or_insert((now + RECEIPT_DELAY, message));
        if known.0 != message.0 || known.1 < message.1 {
            // Earlier numbers of another session are acknowledged at once by their repetition.
            *known = message;
        } else if known.1 - message.1 > 32 {
            *known = message;
            *due = now;
        }
    }

    /// A piece arrived of a message that is complete already.
    pub(super) fn owe_completion(
        &mut self,
        origin: NodeId,
        message: MessageId,
        length: u32,
        now: Timestamp,
    ) {
        let receipt = self.receipts.entry(origin).or_default();
        receipt.complete = Some((message, message_pieces(length)));
        receipt.pieces = Some((now, message));
    }

    /// Adds a piece; returns the message once it is complete. A newer message of the origin replaces an incomplete one.
    /// Without room for another reassembly the piece is lost, and its origin sends it again.
    pub(super) fn add_piece(
        &mut self,
        origin: NodeId,
        message: MessageId,
        (index, length): (u32, u32),
        piece: &[u8],
        now: Timestamp,
    ) -> Option<Bytes> {
        if let Some(known) = self.reassemblies.get(&origin) {
            let is_newer = known.message.0 == message.0 && known.message.1 > message.1;
            let is_same = known.message == message;
            if is_newer || is_same && known.payload.len() != length as usize {
                return None;
            }
            if !is_same {
                self.reassemblies.remove(&origin);
            }
        }
        if !self.reassemblies.contains_key(&origin) && !self.makes_room(now) {
            return None;
        }
        let reassembly = (self.reassemblies.entry(origin))
            .or_insert_with(|| Reassembly::new(message, length, now));
        let is_new = reassembly.add(index, piece, now);
        let is_complete = reassembly.missing == 0;
        let receipt = self.receipts.entry(origin).or_default();
        receipt.unreported += 1;
        let is_due = !is_new || is_complete || receipt.unreported >= PIECES_A_RECEIPT;
        let due = if is_due { now } else { now + PROGRESS_DELAY };
        let until = receipt.pieces.filter(|(_, of)| *of == message);
        receipt.pieces = Some((until.map_or(due, |(at, _)| at.min(due)), message));
        if !is_complete {
            return None;
        }
        receipt.complete = Some((message, message_pieces(length)));
        self.reassemblies
            .remove(&origin)
            .map(|complete| complete.payload.into())
    }

    fn makes_room(&mut self, now: Timestamp) -> bool {
        if self.reassemblies.len() < REASSEMBLIES_MAX {
            return true;
        }
        let idlest = self.reassemblies.iter().min_by_key(|(_, it)| it.grew_at);
        let idle = idlest.filter(|(_, it)| now.since(it.grew_at) > REASSEMBLY_IDLE);
        idle.map(|(origin, _)| *origin)
            .is_some_and(|origin| self.reassemblies.remove(&origin).is_some())
    }

    /// Takes an acknowledgement that is due, for an origin. `before` gives the numbers of whole messages that arrived
    /// before one.
    pub(super) fn take_due(
        &mut self,
        now: Timestamp,
        before: impl Fn(NodeId, MessageId) -> u32,
    ) -> Option<(NodeId, MessageBody)> {
        let is_due = |due: &Option<(Timestamp, MessageId)>| due.is_some_and(|(at, _)| at <= now);
        let owed = self.receipts.iter_mut();
        let mut owed = owed.filter(|(_, it)| is_due(&it.whole) || is_due(&it.pieces));
        let (origin, receipt) = owed.next()?;
        let origin = *origin;
        if let Some((_, message)) = receipt.whole.take_if(|(at, _)| *at <= now) {
            let body = MessageBody::Receipt {
                session: message.0,
                message: message.1,
                before: before(origin, message),
            };
            self.forget_if_settled(origin);
            return Some((origin, body));
        }
        let (_, message) = receipt.pieces.take()?;
        receipt.unreported = 0;
        let complete = receipt.complete.take_if(|(of, _)| *of == message);
        let (below, beyond) = match (complete, self.reassemblies.get(&origin)) {
            (Some((_, count)), _) => (count, 0),
            (None, Some(it)) if it.message == message => (it.below, it.beyond()),
            _ => (0, 0),
        };
        self.forget_if_settled(origin);
        let body = MessageBody::Progress {
            session: message.0,
            message: message.1,
            below,
            beyond,
        };
        Some((origin, body))
    }

    /// Forgets an origin that is owed nothing more.
    fn forget_if_settled(&mut self, origin: NodeId) {
        let is_settled = |it: &Receipt| it.whole.is_none() && it.pieces.is_none();
        if self.receipts.get(&origin).is_some_and(is_settled) {
            self.receipts.remove(&origin);
        }
    }

    /// Forgets reassemblies without new pieces for long.
    pub(super) fn expire(&mut self, now: Timestamp) {
        self.reassemblies
            .retain(|_, it| now.since(it.grew_at) < REASSEMBLY_TIMEOUT);
    }

    /// When an acknowledgement is due, if `has_room` for it, or a reassembly expires.
    pub(super) fn deadline(&self, has_room: bool) -> Option<Timestamp> {
        let receipts = self.receipts.values().filter(|_| has_room);
        let due = receipts.flat_map(|it| [it.whole, it.pieces]).flatten();
        let expires_at = self.reassemblies.values().map(|it| it.grew_at);
        first_of([
            due.map(|(at, _)| at).min(),
            expires_at.min().map(|at| at + REASSEMBLY_TIMEOUT),
        ])
    }
}
