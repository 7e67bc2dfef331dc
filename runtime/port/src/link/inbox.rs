//! What both threads of a link know.

use std::collections::VecDeque;
use std::io;
use std::sync::Arc;
use std::time::Duration;

use muster_msp::check::Finding;
use muster_msp::{
    Answer, BadAnswer, Conversation, Counts, Direction, Frame, Identity, Mode, Telemetry, Write,
};

use super::RC;
use crate::fitness::Look;
use crate::rate::Rate;
use crate::session::Latency;
use crate::status::{State, Status};
use crate::wire::Wire;

/// Telemetry that waits to be taken; then the oldest is dropped, and counted.
const EVENTS_MAX: usize = 256;
/// A controller that said nothing for that long is silent.
const SILENT: Duration = Duration::from_millis(500);

/// What happened.
#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    /// The controller is not fit to fly. Comes before [`Event::Identified`].
    Unfit(Vec<Finding>),
    /// The controller said who it is.
    Identified(Identity),
    /// The port was closed, or could not be opened.
    Closed(String),
    /// The controller told something.
    Telemetry(Telemetry),
}

#[derive(Debug, Default)]
pub(super) struct Inbox {
    /// The open port.
    pub(super) wire: Option<Arc<Wire>>,
    pub(super) conversation: Conversation,
    pub(super) events: VecDeque<Event>,
    pub(super) counts: Counts,
    pub(super) is_realtime: bool,
    is_identified: bool,
    is_armed: Option<bool>,
    /// The port was opened in flight, and its controller not looked at.
    is_unlooked: bool,
    /// Statuses in a row that said disarmed.
    disarmed: u8,
    latency: Latency,
    status: Status,
    heard: Duration,
    /// When RC was written last, while sticks are given.
    rc_written: Option<Duration>,
    frames: Rate,
    rc: Rate,
}

impl Inbox {
    /// `must_look`: the controller is to be looked at. It is, once it has disarmed, if `look` is `None`.
    pub(super) fn open(
        &mut self,
        now: Duration,
        wire: Arc<Wire>,
        look: Option<Look>,
        must_look: bool,
    ) {
        self.is_unlooked = must_look && look.is_none();
        self.disarmed = 0;
        self.conversation = Conversation::new(now);
        self.wire = Some(wire);
        self.is_identified = false;
        self.latency = Latency::default();
        self.heard = now;
        self.status.opened += 1;
        if let Some(Look { unfit, found }) = look {
            if !unfit.is_empty() {
                self.push(Event::Unfit(unfit.clone()));
            }
            self.status.unfit = unfit;
            self.status.found = found.map(Arc::new);
        }
    }

    pub(super) fn close(&mut self, error: &io::Error) {
        let error = error.to_string();
        let is_news = self.wire.is_some() || self.status.closed_by.as_ref() != Some(&error);
        self.wire = None;
        self.is_identified = false;
        self.status.closed_by = Some(error.clone());
        if is_news {
            self.push(Event::Closed(error));
        }
    }

    /// What to write now, and where.
    pub(super) fn tick(&mut self, now: Duration) -> Option<(Arc<Wire>, Write)> {
        if !self.conversation.is_sending(now) {
            self.rc_written = None;
        }
        let wire = self.wire.clone()?;
        let write = self.conversation.tick(now)?;
        if let Some(told) = self.conversation.count_acknowledged() {
            self.push(Event::Telemetry(told));
        }
        Some((wire, write))
    }

    pub(super) fn written(&mut self, now: Duration, write: &Write) {
        if let Write::Rc(_) = write {
            self.status.rc_sent += 1;
            self.rc.count(now);
            if let Some(before) = self.rc_written.replace(now) {
                self.status.rc_gap_max = self.status.rc_gap_max.max(now - before);
            }
        }
    }

    pub(super) fn take(&mut self, now: Duration, frame: &Frame<'_>) {
        self.heard = now;
        self.frames.count(now);
        if frame.direction == Direction::Request {
            return;
        }
        if frame.command == RC {
            if frame.direction == Direction::Reply {
                self.status.rc_acknowledged += 1;
                self.conversation.acknowledged();
            }
            return;
        }
        let Some(Answer { delay, told }) = self.conversation.take(now, frame) else {
            return;
        };
        if let Some(delay) = delay {
            self.latency.add(delay);
        }
        match told {
            Ok(Some(telemetry)) => {
                self.look_for_arming(&telemetry);
                self.push(Event::Telemetry(telemetry));
            }
            Ok(None) => {}
            Err(BadAnswer::Refused) => self.status.refused += 1,
            Err(BadAnswer::Malformed(_)) => self.status.malformed += 1,
        }
        if !self.is_identified
            && let Some(identity) = self.conversation.identity().cloned()
        {
            self.is_identified = true;
            self.push(Event::Identified(identity));
        }
    }

    /// Whether the controller was armed when it told so last. `None` if it never has.
    pub(super) const fn is_armed(&self) -> Option<bool> {
        self.is_armed
    }

    fn look_for_arming(&mut self, telemetry: &Telemetry) {
        if let (Telemetry::Status(status), Some(identity)) =
            (telemetry, self.conversation.identity())
        {
            let is_armed = identity.boxes.is_active(Mode::Arm, status.modes()) == Some(true);
            self.is_armed = Some(is_armed);
            self.disarmed = if is_armed {
                0
            } else {
                self.disarmed.saturating_add(1)
            };
        }
        // A single false status must not close the port of one that flies.
        if self.is_unlooked && self.disarmed > 1 {
            self.close(&io::Error::other("it landed: its settings are looked at"));
        }
    }

    fn push(&mut self, event: Event) {
        let is_telemetry = |it: &Event| matches!(it, Event::Telemetry(_));
        // What says that the port was opened or closed is never dropped: a pause between two of them bounds it.
        if self.events.len() >= EVENTS_MAX
            && is_telemetry(&event)
            && let Some(oldest) = self.events.iter().position(is_telemetry)
        {
            self.events.remove(oldest);
            self.status.dropped += 1;
        }
        self.events.push_back(event);
    }

    pub(super) fn status(&self, now: Duration) -> Status {
        let state = match (&self.wire, self.is_identified) {
            (None, _) => State::Closed,
            (Some(_), false) => State::Identifying,
            (Some(_), true) if now.saturating_sub(self.heard) > SILENT => State::Silent,
            (Some(_), true) => State::Open,
        };
        // The question that waits for its answer is not lost yet.
        let asked = self.latency.answered + self.conversation.lost();
        Status {
            state,
            identity: self
                .conversation
                .identity()
                .cloned()
                .filter(|_| self.is_identified),
            latency: Latency {
                asked,
                ..self.latency
            },
            counts: self.counts,
            frames_per_second: self.frames.per_second(now),
            rc_per_second: self.rc.per_second(now),
            is_realtime: self.is_realtime,
            ..self.status.clone()
        }
    }
}
