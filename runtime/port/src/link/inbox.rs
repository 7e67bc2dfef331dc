//! What both threads of a link know.

use std::io;
use std::sync::Arc;
use std::time::Duration;

use muster_msp::check::Finding;
use muster_msp::{
    Answer, BadAnswer, Conversation, Counts, Direction, Frame, Mode, Telemetry, Write,
};

use super::RC;
use super::armed_status::ArmedStatus;
use super::events::{Event, Events};
use super::rc_counts::RcCounts;
use crate::fitness::{Found, Look};
use crate::rate::Rate;
use crate::session::Latency;
use crate::status::{State, Status};
use crate::wire::Wire;

/// A controller that said nothing for that long is silent.
const SILENT: Duration = Duration::from_millis(500);

#[derive(Debug, Default)]
pub(super) struct Inbox {
    /// The open port.
    pub(super) wire: Option<Arc<Wire>>,
    pub(super) conversation: Conversation,
    pub(super) events: Events,
    is_identified: bool,
    arming: ArmedStatus,
    answers: Answers,
    /// When the last frame was read.
    heard: Duration,
    frames: Rate,
    rc: RcCounts,
    openings: Openings,
    /// What was read since the port was opened last.
    counts: Counts,
    is_realtime: bool,
}

/// Answers since the port was opened last, and bad ones since the start.
#[derive(Debug, Default)]
struct Answers {
    latency: Latency,
    refused: u64,
    malformed: u64,
}

/// Openings of the port, and what the last look at the controller found.
#[derive(Debug, Default)]
struct Openings {
    opened: u64,
    closed_by: Option<String>,
    unfit: Vec<Finding>,
    found: Option<Arc<Found>>,
}

impl Inbox {
    /// `must_look`: the controller is to be looked at. It is, once it has disarmed, if `look` is `None` or found it armed.
    pub(super) fn open(
        &mut self,
        now: Duration,
        wire: Arc<Wire>,
        look: Option<Look>,
        must_look: bool,
    ) {
        let is_looked = look.as_ref().is_some_and(|it| !it.is_of_armed());
        self.arming.opened(must_look && !is_looked);
        self.conversation = Conversation::new(now);
        self.wire = Some(wire);
        self.is_identified = false;
        self.answers.latency = Latency::default();
        self.heard = now;
        self.openings.opened += 1;
        if let Some(Look { unfit, found }) = look {
            if !unfit.is_empty() {
                self.events.push(Event::Unfit(unfit.clone()));
            }
            self.openings.unfit = unfit;
            self.openings.found = found.map(Arc::new);
        }
    }

    pub(super) fn close(&mut self, error: &io::Error) {
        let error = error.to_string();
        let is_news = self.wire.is_some() || self.openings.closed_by.as_ref() != Some(&error);
        self.wire = None;
        self.is_identified = false;
        self.openings.closed_by = Some(error.clone());
        if is_news {
            self.events.push(Event::Closed(error));
        }
    }

    /// What to write now, and where.
    pub(super) fn tick(&mut self, now: Duration) -> Option<(Arc<Wire>, Write)> {
        if !self.conversation.is_sending(now) {
            self.rc.pause();
        }
        let wire = self.wire.clone()?;
        let write = self.conversation.tick(now)?;
        if let Some(telemetry) = self.conversation.count_acknowledged() {
            self.events.push(Event::Telemetry(telemetry));
        }
        Some((wire, write))
    }

    /// A write has ended. It says nothing of a port that was opened while it waited.
    pub(super) fn written(
        &mut self,
        now: Duration,
        wire: &Arc<Wire>,
        write: &Write,
        result: io::Result<()>,
    ) {
        let is_open = (self.wire.as_ref()).is_some_and(|open| Arc::ptr_eq(open, wire));
        match (result, write) {
            _ if !is_open => {}
            (Ok(()), Write::Rc(_)) => self.rc.written(now),
            (Ok(()), _) => {}
            (Err(error), _) => self.close(&error),
        }
    }

    /// What is read after the port was closed is of no use: it must be opened and looked at again.
    pub(super) fn take(&mut self, now: Duration, frame: &Frame<'_>) {
        if self.wire.is_none() {
            return;
        }
        self.heard = now;
        self.frames.count(now);
        if frame.direction == Direction::Request {
            return;
        }
        if frame.command == RC {
            if frame.direction == Direction::Reply {
                self.rc.acknowledged();
                self.conversation.acknowledged();
            }
            return;
        }
        let Some(Answer { delay, content }) = self.conversation.take(now, frame) else {
            return;
        };
        if let Some(delay) = delay {
            self.answers.latency.add(delay);
        }
        match content {
            Ok(Some(telemetry)) => {
                self.note_arming(&telemetry);
                self.events.push(Event::Telemetry(telemetry));
                // After the status that says so: nothing is told of a controller behind a closed port.
                if self.arming.must_look() {
                    return self.close(&io::Error::other("it landed: its settings are looked at"));
                }
            }
            Ok(None) => {}
            Err(BadAnswer::Refused) => self.answers.refused += 1,
            Err(BadAnswer::Malformed(_)) => self.answers.malformed += 1,
        }
        if !self.is_identified
            && let Some(identity) = self.conversation.identity().cloned()
        {
            self.is_identified = true;
            self.events.push(Event::Identified(identity));
        }
    }

    /// Whether the controller was armed at its last status. `None` if there was none.
    pub(super) const fn is_armed(&self) -> Option<bool> {
        self.arming.is_armed()
    }

    /// Whether several statuses in a row said that the controller is disarmed.
    pub(super) const fn is_disarmed(&self) -> bool {
        self.arming.is_disarmed()
    }

    fn note_arming(&mut self, telemetry: &Telemetry) {
        if let (Telemetry::Status(status), Some(identity)) =
            (telemetry, self.conversation.identity())
        {
            let is_armed = identity.boxes.is_active(Mode::Arm, status.modes()) == Some(true);
            self.arming.update(is_armed);
        }
    }

    /// Whether the system grants real-time priority.
    pub(super) const fn set_realtime(&mut self, is_realtime: bool) {
        self.is_realtime = is_realtime;
    }

    /// What was read since the port was opened last.
    pub(super) const fn set_counts(&mut self, counts: Counts) {
        self.counts = counts;
    }

    pub(super) fn status(&self, now: Duration) -> Status {
        let state = match (&self.wire, self.is_identified) {
            (None, _) => State::Closed,
            (Some(_), false) => State::Identifying,
            (Some(_), true) if now.saturating_sub(self.heard) > SILENT => State::Silent,
            (Some(_), true) => State::Open,
        };
        // The question that waits for its answer is not lost yet.
        let asked = self.answers.latency.answered + self.conversation.lost();
        let mut status = Status {
            state,
            identity: self
                .conversation
                .identity()
                .cloned()
                .filter(|_| self.is_identified),
            unfit: self.openings.unfit.clone(),
            found: self.openings.found.clone(),
            closed_by: self.openings.closed_by.clone(),
            opened: self.openings.opened,
            latency: Latency {
                asked,
                ..self.answers.latency
            },
            refused: self.answers.refused,
            malformed: self.answers.malformed,
            dropped: self.events.dropped(),
            counts: self.counts,
            frames_per_second: self.frames.per_second(now),
            is_realtime: self.is_realtime,
            ..Status::default()
        };
        self.rc.enter(now, &mut status);
        status
    }
}

#[cfg(test)]
mod tests {
    use std::net::TcpListener;

    use super::*;
    use crate::address::Address;

    #[test]
    fn write_that_fails_late_leaves_the_port_open_that_was_opened_since() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let host = listener.local_addr().unwrap().to_string();
        let address = Address::Tcp { host };
        let open = || Arc::new(Wire::open(&address, SILENT).unwrap());
        let (first, second) = (open(), open());
        let mut inbox = Inbox::default();
        let now = Duration::from_secs(1);
        inbox.open(now, first, None, false);
        let (first, write) = inbox.tick(now).expect("an open port is asked who it is");
        let failed = || Err(io::ErrorKind::TimedOut.into());
        inbox.close(&io::ErrorKind::UnexpectedEof.into());
        inbox.open(now, second.clone(), None, false);
        inbox.written(now, &first, &write, failed());
        assert!(inbox.wire.is_some());
        inbox.written(now, &second, &write, failed());
        assert!(inbox.wire.is_none());
    }
}
