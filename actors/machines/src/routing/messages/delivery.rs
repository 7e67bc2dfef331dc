//! What a received frame leads to: it is accepted, delivered to the protocol, and passed on.

use std::time::Duration;

use bytes::Bytes;

use super::limits::{FLOOD_JITTER, FRAME_LIFETIME_MAX};
use super::nodes::Node;
use super::queue::{Entry, FrameId, Reach, Report};
use super::{Context, Messages, Outcome};
use crate::identity::{NodeId, NodeSet};
use crate::routing::{Event, Notice};
use crate::wire::{Destination, MESSAGE_HOPS_MAX, Message, MessageBody, MessageFrame};

impl Messages {
    /// Handles a packet of a neighbour.
    pub(in crate::routing) fn receive(
        &mut self,
        cx: &mut Context<'_>,
        sender: NodeId,
        message: Message,
    ) {
        let nodes = cx.neighbourhood.nodes();
        let is_member = sender.0 < nodes && sender != self.id;
        if !is_member {
            return cx.shared.emit(Event::Ignored(sender));
        }
        let Some(node) = self.nodes.entry(sender, cx.now) else {
            return cx.shared.emit(Event::Ignored(sender));
        };
        node.record_heard(cx.now);
        for entry in self.queue.accept(sender, &message.accepted) {
            self.finish(cx, &entry);
        }
        if let Some(frame) = message.frame {
            if !is_plausible(cx, &frame, nodes) {
                return cx.shared.emit(Event::Ignored(sender));
            }
            self.receive_frame(cx, (sender, message.session), frame);
        }
    }

    /// All awaited neighbours have accepted a frame.
    fn finish(&mut self, cx: &mut Context<'_>, entry: &Entry) {
        if let Report::Outcome(id) = entry.report {
            cx.report(id, Outcome::Delivered);
        }
    }

    fn receive_frame(
        &mut self,
        cx: &mut Context<'_>,
        (sender, session): (NodeId, u32),
        frame: MessageFrame,
    ) {
        let reach = match (frame.flood, frame.to) {
            (Some(_), _) => Reach::Flood,
            (None, Destination::Neighbours) => Reach::Neighbours,
            (None, _) => Reach::NextHop,
        };
        let is_asked = frame.awaited.contains(self.id);
        if reach == Reach::NextHop && !is_asked {
            return;
        }
        let (by, session) = frame.flood.unwrap_or((sender, session));
        let id = FrameId {
            by,
            session,
            number: frame.number,
        };
        if reach == Reach::Flood {
            for entry in self.queue.overhear(sender, id) {
                self.finish(cx, &entry);
            }
        }
        let is_known =
            (self.nodes.get(by)).is_some_and(|it| it.frames.contains(session, id.number));
        if is_known {
            if is_asked {
                self.owed.add(sender, id, cx.now);
            }
            return;
        }
        let is_for_this_drone = cx.is_for_this_drone(frame.to);
        let is_forwarded = match frame.to {
            Destination::All => frame.hops < MESSAGE_HOPS_MAX,
            Destination::Neighbours => false,
            _ => !is_for_this_drone && frame.hops < MESSAGE_HOPS_MAX,
        };
        if is_forwarded && !self.queue.has_room(frame.origin) {
            return;
        }
        if !self.admits(cx, sender, id, &frame) {
            return cx.shared.emit(Event::Ignored(sender));
        }
        // One of this drone's own comes back if it restarted meanwhile.
        if is_for_this_drone && frame.origin != self.id {
            self.deliver(cx, &frame);
        }
        let acknowledges_by_relaying = is_forwarded && self.pass_on(cx, sender, (id, reach), frame);
        if is_asked && !acknowledges_by_relaying {
            self.owed.add(sender, id, cx.now);
        }
    }

    /// Whether a new frame's origin is within its budget, and there is room to remember it. Then the frame is known
    /// from now on. Otherwise the neighbour repeats it later.
    fn admits(
        &mut self,
        cx: &Context<'_>,
        sender: NodeId,
        id: FrameId,
        frame: &MessageFrame,
    ) -> bool {
        if frame.origin != self.id {
            let Some(origin) = self.nodes.entry(frame.origin, cx.now) else {
                return false;
            };
            if !origin.take_token(cx.now) {
                return false;
            }
            origin.learn_route(sender, cx.now);
        }
        let by = self.nodes.entry(id.by, cx.now);
        if let Some(by) = by {
            by.frames.insert(id.session, id.number);
            return true;
        }
        false
    }

    /// Passes a frame on. Returns whether the neighbour that it came from learns by that that it was accepted.
    fn pass_on(
        &mut self,
        cx: &mut Context<'_>,
        sender: NodeId,
        (mut id, reach): (FrameId, Reach),
        mut frame: MessageFrame,
    ) -> bool {
        let piece = match frame.body {
            MessageBody::Piece { index, .. } => Some(index),
            _ => None,
        };
        let message = (frame.origin_session, frame.message);
        if reach == Reach::NextHop && self.queue.holds(frame.origin, message, piece) {
            // The origin has repeated what still waits here.
            return false;
        }
        let left = Duration::from_millis(frame.left_ms.into()).min(FRAME_LIFETIME_MAX);
        let mut due = cx.now;
        let (mut awaited, mut avoided) = (NodeSet::new(), NodeSet::new());
        if reach == Reach::Flood {
            awaited = self.branches(cx, Some(sender));
            let has_routes = cx.neighbourhood.branches().is_some();
            if awaited.is_empty() && has_routes {
                return false;
            }
            due += cx.shared.jitter(FLOOD_JITTER);
            let from_branch = cx.neighbourhood.branches();
            if from_branch.is_some_and(|branches| !branches.contains(sender)) {
                // The branches may get it from elsewhere, too.
                due += cx.neighbourhood.repair();
            }
        } else {
            avoided.insert(sender);
            self.last_frame = self.last_frame.wrapping_add(1);
            id = FrameId {
                by: self.id,
                session: self.session,
                number: self.last_frame,
            };
            frame.number = id.number;
        }
        frame.hops += 1;
        let acknowledges = reach == Reach::Flood && !awaited.is_empty();
        self.queue.push(Entry {
            id,
            frame,
            reach,
            report: Report::Nothing,
            since: cx.now,
            expires_at: cx.now + left,
            due,
            tries: 0,
            awaited,
            avoided,
            blocked_by: None,
        });
        acknowledges
    }

    /// Delivers a frame to the protocol, or an acknowledgement to the own messages.
    fn deliver(&mut self, cx: &mut Context<'_>, frame: &MessageFrame) {
        let message = (frame.origin_session, frame.message);
        match &frame.body {
            MessageBody::Whole {
                acknowledge,
                payload,
            } => {
                if *acknowledge {
                    self.inbox.owe_receipt(frame.origin, message, cx.now);
                }
                self.deliver_once(cx, frame.origin, payload.clone(), |origin| {
                    origin.whole.insert(message.0, message.1)
                });
            }
            MessageBody::Piece {
                index,
                length,
                payload,
            } => {
                let origin = self.nodes.get(frame.origin);
                if origin.is_some_and(|it| it.large.contains(message.0, message.1)) {
                    (self.inbox).owe_completion(frame.origin, message, *length, cx.now);
                    return;
                }
                let piece = (*index, *length);
                let complete =
                    (self.inbox).add_piece(frame.origin, message, piece, payload, cx.now);
                if let Some(payload) = complete {
                    self.deliver_once(cx, frame.origin, payload, |origin| {
                        origin.large.insert(message.0, message.1)
                    });
                }
            }
            MessageBody::Receipt {
                session,
                message,
                before,
            } if *session == self.session => {
                for id in self.own.record_receipt(*message, *before) {
                    cx.report(id, Outcome::Delivered);
                }
            }
            MessageBody::Progress {
                session,
                message,
                below,
                beyond,
            } if *session == self.session => {
                let receiver = (frame.origin, frame.origin_session);
                let (pieces, leader) = ((*below, *beyond), cx.shared.master());
                let done = (self.own).record_progress(cx.now, receiver, *message, pieces, leader);
                if let Some((id, true)) = done {
                    cx.report(id, Outcome::Delivered);
                }
            }
            // Of an earlier session.
            MessageBody::Receipt { .. } | MessageBody::Progress { .. } => {}
        }
    }

    /// Delivers a message of `from` to the protocol, unless `record` says that it was delivered before.
    fn deliver_once(
        &mut self,
        cx: &mut Context<'_>,
        from: NodeId,
        payload: Bytes,
        record: impl FnOnce(&mut Node) -> bool,
    ) {
        if self.nodes.entry(from, cx.now).is_some_and(record) {
            cx.shared.notify(Notice::Message { from, payload });
        }
    }
}

/// Whether the fields of a frame name drones of the swarm, and fit each other.
fn is_plausible(cx: &Context<'_>, frame: &MessageFrame, nodes: u32) -> bool {
    let is_for_many = matches!(frame.to, Destination::All | Destination::Neighbours);
    let fits = match &frame.body {
        MessageBody::Whole { acknowledge, .. } => {
            frame.message > 0 && !(*acknowledge && is_for_many)
        }
        MessageBody::Piece { .. } => frame.message > 0 && !is_for_many,
        MessageBody::Receipt { .. } | MessageBody::Progress { .. } => {
            matches!(frame.to, Destination::Drone(_))
        }
    };
    let is_drone = |id: NodeId| id.0 < cx.shared.drones;
    fits && frame.number > 0
        && is_drone(frame.origin)
        && frame.flood.is_none_or(|(by, _)| by.0 < nodes)
        && !matches!(frame.to, Destination::Drone(id) if !is_drone(id))
}
