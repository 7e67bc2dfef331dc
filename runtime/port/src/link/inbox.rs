//! What both threads of a link know.

use std::collections::VecDeque;
use std::io;
use std::sync::Arc;
use std::time::Duration;

use muster_msp::{
    Altitude, Analog, ApiVersion, Attitude, BatteryState, BoardInfo, BoxIds, Counts, Decode,
    DecodeError, Direction, FcVariant, FcVersion, Frame, Identity, Message, RawGps, Rc, Sonar,
    Status as FcStatus,
};

use super::RC;
use crate::schedule::{Schedule, Write};
use crate::session::Latency;
use crate::status::{State, Status};
use crate::wire::Wire;

/// Events that wait to be taken; then the oldest is dropped, and counted.
const EVENTS_MAX: usize = 256;
/// A controller that said nothing for that long is silent.
const SILENT: Duration = Duration::from_millis(500);

/// What happened.
#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    /// The controller said who it is.
    Identified(Identity),
    /// The port was closed, or could not be opened.
    Closed(String),
    /// The controller told something.
    Telemetry(Telemetry),
}

/// What a controller tells.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs, reason = "each is the message of its name")]
pub enum Telemetry {
    Status(FcStatus),
    Attitude(Attitude),
    Altitude(Altitude),
    Rc(Rc),
    Gps(RawGps),
    Sonar(Sonar),
    Analog(Analog),
    Battery(BatteryState),
}

#[derive(Debug, Default)]
pub(super) struct Inbox {
    /// The open port.
    pub(super) wire: Option<Arc<Wire>>,
    pub(super) schedule: Schedule,
    pub(super) events: VecDeque<Event>,
    pub(super) counts: Counts,
    pub(super) is_realtime: bool,
    identity: Identity,
    is_identified: bool,
    latency: Latency,
    status: Status,
    heard: Duration,
    /// When RC was written last, while sticks are given.
    rc_written: Option<Duration>,
    /// The current second, and the frames read in it.
    second: (u64, u64),
}

impl Inbox {
    pub(super) fn open(&mut self, now: Duration, wire: Arc<Wire>) {
        self.schedule.reopen(now);
        self.wire = Some(wire);
        self.identity = Identity::default();
        self.is_identified = false;
        self.latency = Latency::default();
        self.heard = now;
        self.status.opened += 1;
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
        if !self.schedule.is_sending(now) {
            self.rc_written = None;
        }
        let wire = self.wire.clone()?;
        Some((wire, self.schedule.tick(now)?))
    }

    pub(super) fn written(&mut self, now: Duration, write: &Write) {
        if let Write::Rc(_) = write {
            self.status.rc_sent += 1;
            if let Some(before) = self.rc_written.replace(now) {
                self.status.rc_gap_max = self.status.rc_gap_max.max(now - before);
            }
        }
    }

    pub(super) fn take(&mut self, now: Duration, frame: &Frame<'_>) {
        self.heard = now;
        self.count_second(now);
        if frame.direction == Direction::Request {
            return;
        }
        if frame.command == RC {
            self.status.rc_acknowledged += u64::from(frame.direction == Direction::Reply);
            return;
        }
        let refused = frame.direction == Direction::Error;
        let Some((query, delay)) = self.schedule.answered(now, frame.command, refused) else {
            return;
        };
        self.latency.add(delay);
        if refused {
            self.status.refused += 1;
        } else if self.decode(frame, query.page.is_some()).is_err() {
            self.status.malformed += 1;
        }
        if !self.is_identified && self.schedule.is_identified() {
            self.is_identified = true;
            self.push(Event::Identified(self.identity.clone()));
        }
    }

    fn decode(&mut self, frame: &Frame<'_>, is_further: bool) -> Result<(), DecodeError> {
        let identity = &mut self.identity;
        match frame.command {
            ApiVersion::COMMAND => identity.api = Decode::decode(frame.payload)?,
            FcVariant::COMMAND => identity.variant = Decode::decode(frame.payload)?,
            FcVersion::COMMAND => identity.version = Decode::decode(frame.payload)?,
            BoardInfo::COMMAND => identity.board = Decode::decode(frame.payload)?,
            BoxIds::COMMAND if is_further => {
                identity
                    .boxes
                    .modes
                    .extend(BoxIds::decode(frame.payload)?.modes);
            }
            BoxIds::COMMAND => identity.boxes = Decode::decode(frame.payload)?,
            _ => {
                if let Some(telemetry) = telemetry(frame)? {
                    self.push(Event::Telemetry(telemetry));
                }
            }
        }
        Ok(())
    }

    fn push(&mut self, event: Event) {
        if self.events.len() >= EVENTS_MAX {
            self.events.pop_front();
            self.status.dropped += 1;
        }
        self.events.push_back(event);
    }

    fn count_second(&mut self, now: Duration) {
        let second = now.as_secs();
        if self.second.0 == second {
            self.second.1 += 1;
            return;
        }
        let is_next = self.second.0 + 1 == second;
        self.status.frames_per_second = if is_next { self.second.1 } else { 0 };
        self.second = (second, 1);
    }

    pub(super) fn status(&self, now: Duration) -> Status {
        let state = match (&self.wire, self.is_identified) {
            (None, _) => State::Closed,
            (Some(_), false) => State::Identifying,
            (Some(_), true) if now.saturating_sub(self.heard) > SILENT => State::Silent,
            (Some(_), true) => State::Open,
        };
        // The question that waits for its answer is not lost yet.
        let asked = self.latency.answered + self.schedule.lost();
        Status {
            state,
            identity: self.is_identified.then(|| self.identity.clone()),
            latency: Latency {
                asked,
                ..self.latency
            },
            counts: self.counts,
            is_realtime: self.is_realtime,
            ..self.status.clone()
        }
    }
}

fn telemetry(frame: &Frame<'_>) -> Result<Option<Telemetry>, DecodeError> {
    let payload = frame.payload;
    Ok(Some(match frame.command {
        FcStatus::COMMAND => Telemetry::Status(Decode::decode(payload)?),
        Attitude::COMMAND => Telemetry::Attitude(Decode::decode(payload)?),
        Altitude::COMMAND => Telemetry::Altitude(Decode::decode(payload)?),
        Rc::COMMAND => Telemetry::Rc(Decode::decode(payload)?),
        RawGps::COMMAND => Telemetry::Gps(Decode::decode(payload)?),
        Sonar::COMMAND => Telemetry::Sonar(Decode::decode(payload)?),
        Analog::COMMAND => Telemetry::Analog(Decode::decode(payload)?),
        BatteryState::COMMAND => Telemetry::Battery(Decode::decode(payload)?),
        _ => return Ok(None),
    }))
}
