//! A companion's side of a port: requests and answers.

use std::time::Duration;

use crate::acknowledgements::Acknowledgements;
use crate::configuration::BOXES_A_PAGE;
use crate::schedule::{
    Answered, FURTHER_BOXES, STOP_MOTORS, STOP_REVERSIBLE_MOTORS, Schedule, Write,
};
use crate::{
    Altitude, Analog, ApiVersion, Attitude, BatteryState, BoardInfo, BoxIds, Decode, DecodeError,
    Direction, FcVariant, FcVersion, FeatureConfig, Frame, Identity, Message, Modes, Motor, RawGps,
    Rc, SetRawRc, Sonar, Status,
};

/// What a controller tells.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs, reason = "each is the message of its name")]
pub enum Telemetry {
    Status(Status),
    Attitude(Attitude),
    Altitude(Altitude),
    Rc(Rc),
    Gps(RawGps),
    Sonar(Sonar),
    Analog(Analog),
    Battery(BatteryState),
    Motor(Motor),
    /// How many of the newest [`RC_COUNTED`](crate::RC_COUNTED) RC frames were acknowledged.
    Acknowledged(u32),
    /// An answer that came too late to say how it is now. The controller lives.
    Late,
}

/// An answer that says nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BadAnswer {
    /// The controller doesn't know the message. After three times in a row it is not asked again.
    Refused,
    /// The payload is too short or too long.
    Malformed(DecodeError),
}

/// An answer of a controller.
#[derive(Debug)]
pub struct Answer {
    /// How long it took, if it came in time.
    pub delay: Option<Duration>,
    /// Its content; `None` if that is not for a link.
    pub content: Result<Option<Telemetry>, BadAnswer>,
}

/// Asks a controller who it is and how it does, and sends RC on time. It is told the time, as a duration since any start.
#[derive(Debug, Default)]
pub struct Conversation {
    schedule: Schedule,
    acknowledgements: Acknowledgements,
    identity: Identity,
    /// The newest modes.
    modes: Option<Modes>,
}

impl Conversation {
    /// With a port that was just opened.
    #[must_use]
    pub fn new(now: Duration) -> Self {
        Self {
            schedule: Schedule::new(now),
            ..Self::default()
        }
    }

    /// Takes the newest sticks. They are repeated for [`RC_HOLD`](crate::RC_HOLD) at most, and only while the controller is
    /// known.
    pub fn set_channels(&mut self, now: Duration, channels: SetRawRc) {
        self.schedule.set_channels(now, channels);
    }

    /// Stops RC at once.
    pub fn release(&mut self) {
        self.schedule.release();
    }

    /// The one command of this tick. Ticks are [`TICK`](crate::TICK) apart, or later.
    pub fn tick(&mut self, now: Duration) -> Option<Write> {
        let write = self.schedule.tick(now);
        if let Some(Write::Rc(_)) = write {
            self.acknowledgements.write();
        }
        write
    }

    /// The controller has acknowledged an RC frame.
    pub fn acknowledged(&mut self) {
        self.acknowledgements.take();
    }

    /// How many RC frames the controller acknowledges, now and then; to be called after each tick.
    pub fn count_acknowledged(&mut self) -> Option<Telemetry> {
        self.acknowledgements.count().map(Telemetry::Acknowledged)
    }

    /// Whether RC is going out.
    #[must_use]
    pub fn is_sending(&self, now: Duration) -> bool {
        self.schedule.is_sending(now)
    }

    /// Questions that were never answered.
    #[must_use]
    pub fn lost(&self) -> u64 {
        self.schedule.lost()
    }

    /// Who the controller is; `None` until it has answered, or refused, all that is asked once, but for what stops its motors.
    #[must_use]
    pub fn identity(&self) -> Option<&Identity> {
        self.schedule.is_identified().then_some(&self.identity)
    }

    /// Takes a frame from the controller. `None` if it answers no question.
    pub fn take(&mut self, now: Duration, frame: &Frame<'_>) -> Option<Answer> {
        if frame.direction == Direction::Request {
            return None;
        }
        let is_refused = frame.direction == Direction::Error;
        let answer = (frame.command, frame.version);
        let (query, delay) = match self.schedule.answered(now, answer, is_refused)? {
            Answered::InTime(query, delay) => (query, delay),
            Answered::Late => {
                return Some(Answer {
                    delay: None,
                    content: Ok(Some(Telemetry::Late)),
                });
            }
        };
        let content = if is_refused {
            Err(BadAnswer::Refused)
        } else {
            let decoded = match query == FURTHER_BOXES {
                true => self.take_further_boxes(now, frame),
                false => self.decode(now, frame),
            };
            decoded.map_err(BadAnswer::Malformed)
        };
        if let Ok(Some(Telemetry::Status(status))) = &content {
            self.confirm(status);
        }
        Some(Answer {
            delay: Some(delay),
            content,
        })
    }

    /// Asks at once again if the modes have changed: a link acts on them when they are told twice.
    fn confirm(&mut self, status: &Status) {
        let modes = Some(status.modes());
        if std::mem::replace(&mut self.modes, modes) != modes {
            self.schedule.hasten::<Status>();
        }
    }

    /// Takes the modes beyond the first page. The first one's answer, if it comes once more, is not taken for them.
    fn take_further_boxes(
        &mut self,
        now: Duration,
        frame: &Frame<'_>,
    ) -> Result<Option<Telemetry>, DecodeError> {
        let further = BoxIds::decode(frame.payload)?;
        let modes = &mut self.identity.boxes.modes;
        if further.modes.starts_with(modes) {
            self.schedule.ask(now, FURTHER_BOXES);
        } else {
            modes.extend(further.modes);
        }
        Ok(None)
    }

    fn decode(
        &mut self,
        now: Duration,
        frame: &Frame<'_>,
    ) -> Result<Option<Telemetry>, DecodeError> {
        let (identity, payload) = (&mut self.identity, frame.payload);
        match frame.command {
            ApiVersion::COMMAND => identity.api = Decode::decode(payload)?,
            FcVariant::COMMAND => identity.variant = Decode::decode(payload)?,
            FcVersion::COMMAND => identity.version = Decode::decode(payload)?,
            BoardInfo::COMMAND => identity.board = Decode::decode(payload)?,
            BoxIds::COMMAND => {
                identity.boxes = Decode::decode(payload)?;
                if identity.boxes.modes.len() >= BOXES_A_PAGE {
                    self.schedule.ask(now, FURTHER_BOXES);
                }
            }
            // One that refuses to say it is told nothing.
            FeatureConfig::COMMAND => {
                let features = FeatureConfig::decode(payload)?;
                let stop = match features.has(FeatureConfig::REVERSIBLE) {
                    true => STOP_REVERSIBLE_MOTORS,
                    false => STOP_MOTORS,
                };
                self.schedule.ask(now, stop);
            }
            _ => return telemetry(frame),
        }
        Ok(None)
    }
}

fn telemetry(frame: &Frame<'_>) -> Result<Option<Telemetry>, DecodeError> {
    let payload = frame.payload;
    Ok(Some(match frame.command {
        Status::COMMAND => Telemetry::Status(Decode::decode(payload)?),
        Attitude::COMMAND => Telemetry::Attitude(Decode::decode(payload)?),
        Altitude::COMMAND => Telemetry::Altitude(Decode::decode(payload)?),
        Rc::COMMAND => Telemetry::Rc(Decode::decode(payload)?),
        RawGps::COMMAND => Telemetry::Gps(Decode::decode(payload)?),
        Sonar::COMMAND => Telemetry::Sonar(Decode::decode(payload)?),
        Analog::COMMAND => Telemetry::Analog(Decode::decode(payload)?),
        BatteryState::COMMAND => Telemetry::Battery(Decode::decode(payload)?),
        Motor::COMMAND => Telemetry::Motor(Decode::decode(payload)?),
        _ => return Ok(None),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Mode, Query, SetMotor, TICK, Version, order};

    /// The modes of a controller that has 40, on two pages, and gives its first answer about modes this late.
    fn modes(late: Duration) -> Vec<Mode> {
        let mut conversation = Conversation::default();
        let mut answers: Vec<(Duration, Query, Version)> = Vec::new();
        let mut first = Some(late);
        for tick in 0..300 {
            let now = TICK * tick;
            answers.retain(|(at, query, version)| {
                if *at > now {
                    return true;
                }
                let page: Option<Vec<u8>> =
                    (query.command == BoxIds::COMMAND).then(|| match query.payload {
                        [] => (0..32).collect(),
                        _ => (32..40).collect(),
                    });
                let frame = Frame {
                    version: *version,
                    direction: match page {
                        Some(_) => Direction::Reply,
                        None => Direction::Error,
                    },
                    command: query.command,
                    flag: 0,
                    payload: page.as_deref().unwrap_or_default(),
                };
                conversation.take(now, &frame);
                false
            });
            if let Some(Write::Request(query, version)) = conversation.tick(now) {
                let delay = match query.command {
                    BoxIds::COMMAND => first.take().unwrap_or(TICK),
                    _ => TICK,
                };
                answers.push((now + delay, query, version));
            }
        }
        conversation.identity().unwrap().boxes.modes.clone()
    }

    #[test]
    fn modes_on_two_pages_are_known_however_late_the_first_answer_comes() {
        let all = BoxIds::decode(&(0..40).collect::<Vec<_>>()).unwrap().modes;
        for late_ms in (10..300).step_by(5) {
            assert_eq!(
                modes(Duration::from_millis(late_ms)),
                all,
                "{late_ms} ms late"
            );
        }
    }

    /// Whatever is asked within two seconds of opening the port of a controller with these features; `None`: it refuses to say.
    fn written(features: Option<u32>) -> Vec<u8> {
        let mut conversation = Conversation::new(Duration::ZERO);
        let mut now = Duration::ZERO;
        let mut written = Vec::new();
        while now < Duration::from_secs(2) {
            if let Some(write) = conversation.tick(now) {
                write.encode(&mut written);
                let Write::Request(query, version) = write else {
                    continue;
                };
                let mut payload = Vec::new();
                let is_asked = query.command == FeatureConfig::COMMAND;
                if let Some(features) = features.filter(|_| is_asked) {
                    payload = features.to_le_bytes().to_vec();
                }
                let direction = match is_asked && features.is_none() {
                    true => Direction::Error,
                    false => Direction::Reply,
                };
                conversation.take(
                    now,
                    &Frame {
                        version,
                        direction,
                        command: query.command,
                        flag: 0,
                        payload: &payload,
                    },
                );
            }
            now += TICK;
        }
        assert!(conversation.identity().is_some());
        written
    }

    fn count(written: &[u8], motors: &SetMotor) -> usize {
        let mut bytes = Vec::new();
        order(Version::V1, motors, &mut bytes).expect("it fits");
        let windows = written.windows(bytes.len());
        windows.filter(|it| *it == bytes).count()
    }

    #[test]
    fn motors_are_stopped_as_they_turn() {
        let counts = |features| {
            let written = written(features);
            [SetMotor::STOP, SetMotor::STOP_REVERSIBLE].map(|it| count(&written, &it))
        };
        assert_eq!(counts(Some(FeatureConfig::GPS)), [1, 0]);
        assert_eq!(counts(Some(FeatureConfig::REVERSIBLE)), [0, 1]);
        assert_eq!(counts(None), [0, 0]);
    }
}
