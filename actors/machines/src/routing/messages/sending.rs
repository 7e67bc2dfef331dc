//! Sends frames from the queue, within the drone's budget and one at a time to each neighbour where the medium reports
//! deliveries.

use std::collections::BTreeMap;
use std::time::Duration;

use super::accepted::GROUPS_MAX;
use super::limits::{
    AWAITED_MAX, BROADCAST_TRIES_MAX, DELIVERED_WAIT, DELIVERED_WAIT_MAX, DELIVERY_REPORT_MAX,
    HOP_WINDOW, LOST_DELAY, REPAIR_MAX, RESERVED_FROM_PIECES, SEND_BUDGET,
};
use super::losses::Losses;
use super::queue::{FrameId, Place, Reach};
use super::route::Hop;
use super::{Context, Messages};
use crate::identity::NodeId;
use crate::radio::{Budget, TokenBucket};
use crate::time::Timestamp;
use crate::wire::{self, Message, MessageBody};

/// Budget of pieces: what [`SEND_BUDGET`] has beyond the reserve.
const PIECES_BUDGET: Budget = Budget {
    interval: SEND_BUDGET.interval,
    burst: SEND_BUDGET.burst - RESERVED_FROM_PIECES,
};
/// Frames with a longer payload leave room for a few acknowledgements only.
const SHORT_MAX: usize = 700;
/// That few: a group takes up to 20 bytes.
const GROUPS_BESIDE_LONG: usize = 4;

/// The pace of sending.
#[derive(Debug)]
pub(super) struct Sending {
    /// All frames of this drone are charged.
    pub(super) pace: TokenBucket,
    /// When a unicast was sent to a neighbour whose delivery the medium has not reported.
    in_flight: BTreeMap<NodeId, Timestamp>,
    /// Whether the medium reports deliveries.
    has_reports: bool,
    pub(super) losses: Losses,
}

impl Sending {
    pub(super) fn new() -> Self {
        Self {
            pace: TokenBucket::FULL,
            in_flight: BTreeMap::new(),
            has_reports: false,
            losses: Losses::default(),
        }
    }

    pub(super) fn available_at(&self) -> Timestamp {
        self.pace.available_at(&SEND_BUDGET)
    }

    pub(super) fn available_for_pieces_at(&self) -> Timestamp {
        self.pace.available_at(&PIECES_BUDGET)
    }

    /// Until when a neighbour gets no further unicast; `None` if it may.
    fn busy_until(&self, neighbour: NodeId, now: Timestamp) -> Option<Timestamp> {
        let until = *self.in_flight.get(&neighbour)? + DELIVERY_REPORT_MAX;
        (self.has_reports && until > now).then_some(until)
    }
}

impl Messages {
    /// Sends frames until none is due or the budget is used up.
    pub(super) fn send_due(&mut self, cx: &mut Context<'_>) {
        while self.sending.pace.has_tokens(cx.now, &SEND_BUDGET) {
            let with_pieces = self.sending.pace.has_tokens(cx.now, &PIECES_BUDGET);
            let Some(place) = self.queue.next_due(cx.now, with_pieces) else {
                return;
            };
            match self.queue.get_mut(place).map(|entry| entry.reach) {
                Some(Reach::NextHop) => self.send_to_next_hop(cx, place),
                Some(Reach::Flood | Reach::Neighbours) => self.send_to_many(cx, place),
                None => return,
            }
        }
    }

    fn send_to_next_hop(&mut self, cx: &mut Context<'_>, place: Place) {
        let next = match self.next_hop(cx, place) {
            Hop::To(next) => next,
            Hop::Later => return,
            Hop::Flood => return self.flood(cx, place),
        };
        let busy_until = self.sending.busy_until(next, cx.now);
        let is_window_full = self.queue.queued_for(next) >= HOP_WINDOW;
        let Some(entry) = self.queue.get_mut(place) else {
            return;
        };
        if !entry.awaited.contains(next) {
            entry.awaited = next.into();
            entry.tries = 0;
        }
        let must_wait = is_window_full && entry.tries == 0;
        let window_until = must_wait.then(|| cx.now + cx.neighbourhood.repair());
        if let Some(until) = busy_until.or(window_until) {
            entry.due = until;
            entry.blocked_by = Some(next);
            return;
        }
        self.queue.end_turn(place);
        self.send_frame(cx, place, Some(next));
    }

    fn send_to_many(&mut self, cx: &mut Context<'_>, place: Place) {
        let Some(entry) = self.queue.get_mut(place) else {
            return;
        };
        // A first frame goes to all that hear it, also if none is known.
        let is_done = entry.tries > 0 && entry.awaited.is_empty();
        if is_done || entry.tries >= BROADCAST_TRIES_MAX {
            if let Some(entry) = self.queue.remove(place) {
                self.lose(cx, &entry);
            }
            return;
        }
        let only = entry.awaited.iter().next();
        let to = only.filter(|_| entry.tries > 0 && entry.awaited.len() == 1);
        self.queue.end_turn(place);
        self.send_frame(cx, place, to);
        // No one is asked to accept it.
        if (self.queue.get_mut(place)).is_some_and(|entry| entry.awaited.is_empty())
            && let Some(entry) = self.queue.remove(place)
        {
            self.lose(cx, &entry);
        }
    }

    fn send_frame(&mut self, cx: &mut Context<'_>, place: Place, to: Option<NodeId>) {
        let Some(entry) = self.queue.get_mut(place) else {
            return;
        };
        entry.tries += 1;
        let left = entry.expires_at.since(cx.now).as_millis();
        let mut frame = entry.frame.clone();
        frame.left_ms = u32::try_from(left).unwrap_or(u32::MAX);
        frame.awaited = entry.awaited.iter().take(AWAITED_MAX).collect();
        let pause = repair_pause(cx.neighbourhood.repair(), entry.tries);
        entry.due = cx.now + pause + cx.shared.jitter(pause / 2);
        if to.is_some() && self.sending.has_reports {
            // The medium reports a loss.
            entry.due = entry.due.max(cx.now + DELIVERY_REPORT_MAX);
        }
        let is_long = match &frame.body {
            MessageBody::Whole { payload, .. } | MessageBody::Piece { payload, .. } => {
                payload.len() > SHORT_MAX
            }
            MessageBody::Receipt { .. } | MessageBody::Progress { .. } => false,
        };
        let groups = match (is_long, to) {
            (false, _) => GROUPS_MAX,
            (true, Some(_)) => GROUPS_BESIDE_LONG,
            (true, None) => 0,
        };
        let message = Message {
            session: self.session,
            accepted: self.owed.take(to, groups),
            frame: Some(frame),
        };
        if let Some(to) = to {
            self.sending.in_flight.insert(to, cx.now);
        }
        self.send(cx, to, &message);
    }

    /// Acknowledges to neighbours what was accepted, if it is due and no frame carries it.
    pub(super) fn send_owed(&mut self, cx: &mut Context<'_>) {
        while self.sending.pace.has_tokens(cx.now, &SEND_BUDGET)
            && let Some(to) = self.owed.receiver(cx.now)
        {
            let message = Message {
                session: self.session,
                accepted: self.owed.take(to, GROUPS_MAX),
                frame: None,
            };
            self.send(cx, to, &message);
        }
    }

    fn send(&mut self, cx: &mut Context<'_>, to: Option<NodeId>, message: &Message) {
        self.sending.pace.charge(cx.now, &SEND_BUDGET);
        cx.shared.send_message(to, wire::encode_message(message));
    }

    /// The medium reports what became of a unicast.
    pub(in crate::routing) fn record_delivery(
        &mut self,
        cx: &mut Context<'_>,
        to: NodeId,
        payload: &[u8],
        is_delivered: bool,
    ) {
        let Ok(message) = wire::decode_message(payload) else {
            return;
        };
        self.sending.has_reports = true;
        let Some(frame) = message.frame else {
            return;
        };
        self.sending.in_flight.remove(&to);
        self.sending.losses.record(to, cx.now, is_delivered);
        self.queue.unblock(to);
        let (by, session) = frame.flood.unwrap_or((self.id, message.session));
        let id = FrameId {
            by,
            session,
            number: frame.number,
        };
        let Some(entry) = self.queue.find_mut(id) else {
            return;
        };
        if is_delivered {
            // The neighbour has it, and has no room, or its acknowledgement waits for the medium.
            let pause = (DELIVERED_WAIT * entry.tries.max(1)).min(DELIVERED_WAIT_MAX);
            entry.due = cx.now + pause + cx.shared.jitter(pause / 2);
        } else {
            entry.due = cx.now + LOST_DELAY + cx.shared.jitter(LOST_DELAY);
        }
    }
}

/// Wait before a frame is repeated that was sent so often: twice the repair interval, doubled with each try.
fn repair_pause(repair: Duration, tries: u32) -> Duration {
    let doubled = repair * (1 << tries.clamp(1, 6));
    doubled.min(REPAIR_MAX)
}
