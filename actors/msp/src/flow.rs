//! What an optical flow module says by itself.

use crate::frame::{Direction, Frame};
use crate::message::{Decode, Message, OpticalFlow, RangefinderSample};

/// A measurement of an optical flow module.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum FlowReading {
    /// Of the distance to the ground.
    Range(RangefinderSample),
    /// Of how the ground turns.
    Rates(OpticalFlow),
}

impl FlowReading {
    /// Reads a frame. `None` if it is no measurement.
    #[must_use]
    pub fn read(frame: &Frame<'_>) -> Option<Self> {
        if frame.direction != Direction::Request {
            return None;
        }
        match frame.command {
            RangefinderSample::COMMAND => Decode::decode(frame.payload).ok().map(Self::Range),
            OpticalFlow::COMMAND => Decode::decode(frame.payload).ok().map(Self::Rates),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Decoder, Encode, Version, order, reply};

    fn read(bytes: &[u8]) -> Vec<Option<FlowReading>> {
        let mut readings = Vec::new();
        Decoder::default().read(bytes, |frame| readings.push(FlowReading::read(&frame)));
        readings
    }

    fn bytes(message: &impl Encode) -> Vec<u8> {
        let mut bytes = Vec::new();
        order(Version::V2, message, &mut bytes).unwrap();
        bytes
    }

    #[test]
    fn what_a_module_sends_is_read() {
        let range = RangefinderSample {
            quality: 255,
            distance_mm: 1_234,
        };
        let rates = OpticalFlow {
            quality: 90,
            x_mradps: -400,
            y_mradps: 70,
        };
        let sent = [bytes(&range), bytes(&rates)].concat();
        let expected = [FlowReading::Range(range), FlowReading::Rates(rates)];
        assert_eq!(read(&sent), expected.map(Some));
    }

    #[test]
    fn replies_and_other_messages_are_no_measurements() {
        let rates = OpticalFlow::default();
        let mut answer = Vec::new();
        reply(Version::V2, &rates, &mut answer).unwrap();
        let other = bytes(&crate::Reboot::default());
        assert_eq!(read(&[answer, other].concat()), [None, None]);
    }
}
