//! The port by which a drone's process reaches its simulated flight controller.

use std::time::Duration;

use muster_controller::Truth;
use muster_machines::identity::NodeId;
use muster_machines::msp::controller::{
    ACKNOWLEDGED_MIN, FRESH_ANSWER_TIMEOUT, HEIGHT_LOST_AFTER, LOST_AFTER, Stage,
};
use muster_machines::msp::{Introduction, PortEvent};
use muster_machines::time::Timestamp;
use muster_msp::{
    Conversation, Decoder, Direction, Frame, Identity, Message, SetRawRc,
    Telemetry as MspTelemetry, Write,
};

use crate::checkers::{ArmSwitch, RC_GAP_MAX, RcGaps, Violation};

/// What a port has counted since the start of the run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct PortFigures {
    /// How often it was opened.
    pub(crate) opened: u64,
    /// Frames read.
    pub(crate) frames: u64,
    /// Bad frames read.
    pub(crate) bad_frames: u64,
    /// Bytes read that belong to no frame.
    pub(crate) noise_bytes: u64,
    /// Questions without an answer.
    pub(crate) questions_lost: u64,
    /// RC frames written.
    pub(crate) rc_sent: u64,
    /// RC frames that the controller acknowledged.
    pub(crate) rc_acknowledged: u64,
    /// Longest time between two RC frames that were due.
    pub(crate) rc_gap_max: Duration,
}

/// What the port of a drone's process does in a tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PortState {
    /// The process runs.
    Runs,
    /// The process runs, but its link to the controller hangs or has failed for good: no new RC frames come.
    WithoutLink,
    /// The process has ended or hangs.
    Still,
}

/// The process's end of a line to a controller, and the checks of what leaves there.
#[derive(Debug)]
pub(super) struct Port {
    conversation: Conversation,
    decoder: Decoder,
    introduction: Introduction,
    is_open: bool,
    is_identified: bool,
    pub(super) loss: Loss,
    gaps: RcGaps,
    arm_switch: ArmSwitch,
    figures: PortFigures,
}

impl Port {
    /// An open port at the start of a run.
    pub(super) fn new() -> Self {
        Self {
            conversation: Conversation::default(),
            decoder: Decoder::default(),
            introduction: Introduction::default(),
            is_open: true,
            is_identified: false,
            loss: Loss::default(),
            gaps: RcGaps::default(),
            arm_switch: ArmSwitch::default(),
            figures: PortFigures {
                opened: 1,
                ..PortFigures::default()
            },
        }
    }

    /// The link's newest RC frame; `None` stops RC.
    pub(super) fn set_rc(&mut self, now: Timestamp, rc: Option<SetRawRc>) {
        match rc {
            Some(rc) => self.conversation.set_channels(elapsed(now), rc),
            None => self.conversation.release(),
        }
    }

    /// The process has ended.
    pub(super) fn end(&mut self, now: Timestamp) {
        self.converse_anew(now);
        self.introduction = Introduction::default();
        self.loss.heard_at = now;
    }

    /// Events for a link that starts now.
    pub(super) fn introduction(&self, now: Timestamp) -> impl Iterator<Item = PortEvent> + use<> {
        self.introduction.events(now)
    }

    /// Reads what has come, and writes one command. `is_open`: whether the line is. `tell` takes events for the link.
    pub(super) fn tick(
        &mut self,
        now: Timestamp,
        is_open: bool,
        received: &[u8],
        tell: &mut impl FnMut(PortEvent),
    ) -> Vec<u8> {
        let (mut events, mut written) = (Vec::new(), Vec::new());
        self.open_or_close(now, is_open, &mut events);
        if self.is_open {
            self.read(now, received, &mut events);
            self.write(now, &mut written);
        }
        for event in events {
            self.introduction.take(now, &event);
            tell(event);
        }
        written
    }

    /// Looks whether RC was due at the controller, and in time.
    pub(super) fn look(&mut self, now: Timestamp, truth: &Truth, state: PortState) {
        self.loss.look(now, truth);
        let is_open = self.is_identified && state == PortState::Runs;
        let is_due = truth.is_armed && is_open && !self.loss.is_lost;
        self.gaps.look(now, is_due);
    }

    /// Whether the controller has waited for RC for too long, or was armed too early.
    pub(super) fn check(&self, now: Timestamp, drone: NodeId) -> Option<Violation> {
        let early = self.arm_switch.check(now, drone);
        early.or_else(|| self.gaps.check(now, drone))
    }

    pub(super) fn figures(&self) -> PortFigures {
        let counts = self.decoder.counts();
        PortFigures {
            frames: counts.frames,
            bad_frames: counts.bad(),
            noise_bytes: counts.noise_bytes,
            questions_lost: self.figures.questions_lost + self.conversation.lost(),
            rc_gap_max: self.gaps.longest(),
            ..self.figures
        }
    }

    fn converse_anew(&mut self, now: Timestamp) {
        self.is_identified = false;
        self.figures.questions_lost += self.conversation.lost();
        self.conversation = Conversation::new(elapsed(now));
    }

    /// Notices that the line is closed, or opens it again.
    fn open_or_close(&mut self, now: Timestamp, is_open: bool, events: &mut Vec<PortEvent>) {
        if is_open == self.is_open {
            return;
        }
        self.is_open = is_open;
        self.figures.opened += u64::from(is_open);
        self.converse_anew(now);
        if !is_open {
            events.push(PortEvent::Closed);
        }
    }

    fn read(&mut self, now: Timestamp, received: &[u8], events: &mut Vec<PortEvent>) {
        let (conversation, figures) = (&mut self.conversation, &mut self.figures);
        let loss = &mut self.loss;
        let mut take = |frame: Frame<'_>| {
            let is_rc = frame.command == SetRawRc::COMMAND && frame.direction == Direction::Reply;
            if is_rc {
                figures.rc_acknowledged += 1;
                conversation.acknowledged();
            } else if let Some(Ok(Some(telemetry))) =
                conversation.take(elapsed(now), &frame).map(|it| it.content)
            {
                loss.hear(now, &telemetry);
                events.push(PortEvent::Telemetry(telemetry));
            }
        };
        self.decoder.read(received, &mut take);
        self.decoder.expire(elapsed(now), &mut take);
        if let Some(telemetry) = conversation.count_acknowledged() {
            if let MspTelemetry::Acknowledged(count) = telemetry {
                self.loss.count_acknowledged(count);
            }
            events.push(PortEvent::Telemetry(telemetry));
        }
        if !self.is_identified
            && let Some(identity) = self.conversation.identity()
        {
            self.is_identified = true;
            events.push(PortEvent::Identified {
                identity: Box::new(identity.clone()),
                granted: Stage::Bench,
            });
        }
    }

    fn write(&mut self, now: Timestamp, bytes: &mut Vec<u8>) {
        let Some(write) = self.conversation.tick(elapsed(now)) else {
            return;
        };
        if let Write::Rc(rc) = &write {
            let identity = self.conversation.identity();
            self.arm_switch
                .sent(rc, identity.is_some_and(Identity::is_simulation));
            self.gaps.sent(now);
            self.figures.rc_sent += 1;
        }
        write.encode(bytes);
    }
}

/// When a link must stop RC until the controller disarms: its failsafe flies, no answer or no height came for too long, or too
/// few RC frames were acknowledged.
#[derive(Debug, Default)]
pub(super) struct Loss {
    is_lost: bool,
    /// Whether the controller was armed at the last tick.
    pub(super) was_armed: bool,
    /// The newest answer of an armed controller.
    heard_at: Timestamp,
    /// The newest that was not too late to be used.
    fresh_at: Timestamp,
    /// The newest height, by the controller or a pose.
    pub(super) height_at: Timestamp,
}

impl Loss {
    /// A tick begins. The link's timer ends before it gets what arrives now.
    pub(super) fn begin(&mut self, now: Timestamp) {
        self.is_lost |= self.was_armed && self.is_silent(now);
    }

    fn hear(&mut self, now: Timestamp, telemetry: &MspTelemetry) {
        self.heard_at = now;
        if *telemetry != MspTelemetry::Late {
            self.fresh_at = now;
        }
        if let MspTelemetry::Altitude(_) = telemetry {
            self.height_at = now;
        }
    }

    const fn count_acknowledged(&mut self, count: u32) {
        self.is_lost |= self.was_armed && count < ACKNOWLEDGED_MIN;
    }

    fn look(&mut self, now: Timestamp, truth: &Truth) {
        if !truth.is_armed {
            (self.heard_at, self.fresh_at, self.height_at) = (now, now, now);
            self.is_lost = false;
        }
        self.is_lost |= truth.is_failsafe || self.is_silent(now);
        self.was_armed = truth.is_armed;
    }

    fn is_silent(&self, now: Timestamp) -> bool {
        // Of the heights that came, the link may have doubted the newest.
        now.since(self.heard_at) >= LOST_AFTER
            || now.since(self.fresh_at) >= FRESH_ANSWER_TIMEOUT
            || now.since(self.height_at) >= HEIGHT_LOST_AFTER - RC_GAP_MAX
    }
}

fn elapsed(now: Timestamp) -> Duration {
    now.since(Timestamp::ZERO)
}
