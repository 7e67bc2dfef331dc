//! Messages: payloads of the protocol from drone to drone over several hops, for any policy.
//!
//! A frame of a message goes to the leader along the parents, to one drone along the branch that it is known on or back
//! along the route of its own messages, and to all along the branches of the tree. Where no route is known, all
//! drones pass it on once. Each hop acknowledges what it has accepted, and repeats what was not (`queue`, `accepted`).
//! The origin repeats what the receiver has not acknowledged (`own`), in pieces if it is large (`transfer`, `inbox`).
//!
//! A swarm that sends no message sends the same frames as one without this module.

mod accepted;
mod delivery;
mod inbox;
pub mod limits;
mod losses;
mod neighbourhood;
mod nodes;
mod outgoing;
mod own;
mod queue;
mod route;
mod sending;
mod transfer;
mod window;

pub(super) use self::neighbourhood::{Neighbourhood, NoRoutes};
pub use self::outgoing::{DropReason, Outcome, Outgoing, Reliability};

use self::accepted::Owed;
use self::inbox::Inbox;
use self::limits::{NODES_MAX, QUEUE_MAX, SEND_BUDGET};
use self::nodes::Nodes;
use self::own::Own;
use self::queue::{Entry, FrameId, Queue, Reach, Report};
use self::sending::Sending;
use super::{Notice, SharedState};
use crate::identity::{NodeId, NodeSet};
use crate::time::{Timestamp, first_of};
use crate::wire::{Destination, MessageFrame};

/// What a step of the messages works with.
pub(super) struct Context<'a> {
    pub(super) shared: &'a mut SharedState,
    pub(super) neighbourhood: &'a dyn Neighbourhood,
    pub(super) now: Timestamp,
}

impl Context<'_> {
    /// Whether a message to this destination is for this drone.
    fn is_for_this_drone(&self, to: Destination) -> bool {
        match to {
            Destination::Leader => self.shared.is_master(),
            Destination::Drone(id) => id == self.shared.id,
            Destination::All | Destination::Neighbours => true,
        }
    }

    fn report(&mut self, id: u32, outcome: Outcome) {
        self.shared.report_sent(id, outcome);
    }
}

/// The messages of one drone.
///
/// Invariant: after each step no more can be sent now, and `deadline` is when something can.
#[derive(Debug)]
pub(super) struct Messages {
    id: NodeId,
    session: u32,
    /// Number of the last frame that this drone numbered.
    last_frame: u32,
    own: Own,
    inbox: Inbox,
    nodes: Nodes,
    queue: Queue,
    owed: Owed,
    sending: Sending,
    deadline: Option<Timestamp>,
}

impl Messages {
    pub(super) fn new(shared: &mut SharedState) -> Self {
        Self {
            id: shared.id,
            session: shared.draw(),
            last_frame: 0,
            own: Own::new(),
            inbox: Inbox::default(),
            nodes: Nodes::default(),
            queue: Queue::default(),
            owed: Owed::default(),
            sending: Sending::new(),
            deadline: None,
        }
    }

    pub(super) const fn deadline(&self) -> Option<Timestamp> {
        self.deadline
    }

    /// Number of entries in the fullest table, and that table's limit.
    pub(super) fn occupancy(&self) -> (usize, usize) {
        let tables = [
            (self.own.len(), QUEUE_MAX),
            (self.queue.len(), limits::FORWARD_MAX),
            (self.inbox.len(), limits::REASSEMBLIES_MAX),
            (self.nodes.len(), NODES_MAX),
        ];
        let fullest = tables
            .into_iter()
            .max_by_key(|(len, max)| len * NODES_MAX / max);
        fullest.unwrap_or((0, NODES_MAX))
    }

    /// Handles a message of the protocol.
    pub(super) fn submit(&mut self, cx: &mut Context<'_>, outgoing: Outgoing) {
        if let Some(reason) = outgoing.refusal(cx.shared) {
            return cx.report(outgoing.id, Outcome::Dropped(reason));
        }
        let is_for_itself = match outgoing.to {
            Destination::All | Destination::Neighbours => false,
            to => cx.is_for_this_drone(to),
        };
        if is_for_itself {
            let from = self.id;
            let payload = outgoing.payload;
            cx.shared.notify(Notice::Message { from, payload });
            if outgoing.reliability == Reliability::Acknowledged {
                cx.report(outgoing.id, Outcome::Delivered);
            }
            return;
        }
        for id in self.own.submit(cx.now, outgoing) {
            cx.report(id, Outcome::Dropped(DropReason::QueueFull));
        }
    }

    /// Drops all messages: the drone has finished.
    pub(super) fn stop(&mut self, cx: &mut Context<'_>) {
        for id in self.own.clear() {
            cx.report(id, Outcome::Dropped(DropReason::Stopped));
        }
        for entry in self.queue.clear() {
            if let Report::Losses(id) | Report::Outcome(id) = entry.report {
                cx.report(id, Outcome::Dropped(DropReason::Stopped));
            }
        }
        *self = Self {
            session: self.session,
            last_frame: self.last_frame,
            ..Self::new(cx.shared)
        };
    }

    /// Other frames of this drone were sent, which count towards its budget.
    pub(super) fn record_sent(&mut self, now: Timestamp, frames: u32) {
        for _ in 0..frames {
            self.sending.pace.charge(now, &SEND_BUDGET);
        }
    }

    /// Does what is due: expires, starts and sends frames. Call at the end of each step.
    pub(super) fn run(&mut self, cx: &mut Context<'_>) {
        self.expire(cx);
        // A frame that was sent or given up may make room for another one. Sending costs tokens, so the loop ends.
        loop {
            let before = (self.sending.available_at(), self.queue.len());
            self.start_receipts(cx);
            self.start_own(cx);
            self.send_due(cx);
            self.send_owed(cx);
            if (self.sending.available_at(), self.queue.len()) == before {
                break;
            }
        }
        self.deadline = self.next_deadline();
    }

    fn expire(&mut self, cx: &mut Context<'_>) {
        self.inbox.expire(cx.now);
        for id in self.own.expire(cx.now) {
            cx.report(id, Outcome::Expired);
        }
        for entry in self.queue.expire(cx.now) {
            self.lose(cx, &entry);
        }
    }

    /// A frame is not repeated any more. A broadcast that was sent is no loss, unless its outcome is asked for.
    fn lose(&self, cx: &mut Context<'_>, entry: &Entry) {
        let was_broadcast = entry.reach != Reach::NextHop && entry.tries > 0;
        match entry.report {
            Report::Losses(_) if was_broadcast => {}
            Report::Losses(id) | Report::Outcome(id) => cx.report(id, Outcome::Expired),
            Report::Nothing => {}
        }
    }

    fn start_receipts(&mut self, cx: &mut Context<'_>) {
        while self.queue.has_room(self.id) {
            let nodes = &self.nodes;
            let before = |origin, (session, message)| {
                let seen = nodes.get(origin).map(|node| &node.whole);
                seen.map_or(0, |seen| seen.before(session, message))
            };
            let Some((origin, body)) = self.inbox.take_due(cx.now, before) else {
                return;
            };
            let start = own::Start {
                message: 0,
                to: Destination::Drone(origin),
                body,
                lifetime: limits::TRY_LIFETIME,
                report: Report::Nothing,
            };
            self.enqueue(cx, start);
        }
    }

    fn start_own(&mut self, cx: &mut Context<'_>) {
        while self.queue.has_room(self.id) {
            let (queue, id, session) = (&self.queue, self.id, self.session);
            let is_queued = |message, piece| queue.holds(id, (session, message), piece);
            let Some(start) = self.own.start(cx.now, is_queued) else {
                return;
            };
            self.enqueue(cx, start);
        }
    }

    /// Puts an own frame into the queue.
    fn enqueue(&mut self, cx: &mut Context<'_>, start: own::Start) {
        self.last_frame = self.last_frame.wrapping_add(1);
        let id = FrameId {
            by: self.id,
            session: self.session,
            number: self.last_frame,
        };
        let reach = match start.to {
            Destination::Leader | Destination::Drone(_) => Reach::NextHop,
            Destination::All => Reach::Flood,
            Destination::Neighbours => Reach::Neighbours,
        };
        let flood = (reach == Reach::Flood).then_some((self.id, self.session));
        if flood.is_some() {
            self.remember_own(cx.now, id);
        }
        let awaited = match (reach, start.report) {
            (Reach::Flood, _) => self.branches(cx, None),
            (Reach::Neighbours, Report::Outcome(_)) => self.neighbours(cx),
            _ => NodeSet::new(),
        };
        self.queue.push(Entry {
            id,
            frame: MessageFrame {
                number: id.number,
                flood,
                hops: 0,
                left_ms: 0,
                awaited: NodeSet::new(),
                origin: self.id,
                origin_session: self.session,
                message: start.message,
                to: start.to,
                body: start.body,
            },
            reach,
            report: start.report,
            since: cx.now,
            expires_at: cx.now + start.lifetime,
            due: cx.now,
            tries: 0,
            awaited,
            avoided: NodeSet::new(),
            blocked_by: None,
        });
    }

    /// Own frames that come back are known.
    fn remember_own(&mut self, now: Timestamp, id: FrameId) {
        if let Some(own) = self.nodes.entry(self.id, now) {
            own.frames.insert(id.session, id.number);
        }
    }

    fn next_deadline(&self) -> Option<Timestamp> {
        let has_room = self.queue.has_room(self.id);
        let paced = |due: Timestamp| due.max(self.sending.available_at());
        let paced_piece = |due: Timestamp| due.max(self.sending.available_for_pieces_at());
        first_of([
            self.queue.due(false).map(paced),
            self.queue.due(true).map(paced_piece),
            self.owed.due().map(paced),
            self.queue.expires_at(),
            self.own.deadline(has_room),
            self.inbox.deadline(has_room),
        ])
    }
}

#[cfg(test)]
mod tests;
