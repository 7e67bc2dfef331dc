use muster_machines::time::Timestamp;

use super::FrameId;
use super::timing::DETECTION;

/// Reception of one radio.
///
/// It decodes a frame that starts while it senses no other and does not send. A second frame that starts during the
/// detection of the preamble destroys both. A later one is missed and does not harm the first. A hidden terminal therefore
/// destroys frames during one airtime, not two. That matches ns-3 at equal powers, with a measured delivery of
/// exp(−h·R·196 µs). **Invariant:** at most one frame is being decoded, and it is on the air.
#[derive(Debug)]
pub(super) struct Reception {
    /// Number of frames that are sensed.
    sensed: u32,
    /// The frame being decoded, and its start.
    decoding: Option<(FrameId, Timestamp)>,
}

impl Reception {
    pub(super) const fn new() -> Self {
        Self {
            sensed: 0,
            decoding: None,
        }
    }

    /// Whether no frame is sensed.
    pub(super) const fn is_quiet(&self) -> bool {
        self.sensed == 0
    }

    /// A frame starts.
    pub(super) fn frame_starts(&mut self, now: Timestamp, frame: FrameId, is_sending: bool) {
        match self.decoding {
            Some((_, since)) if now.since(since) < DETECTION => self.decoding = None,
            None if self.sensed == 0 && !is_sending => self.decoding = Some((frame, now)),
            _ => {}
        }
        self.sensed += 1;
    }

    /// A frame ends. Returns whether it was decoded.
    pub(super) fn frame_ends(&mut self, frame: FrameId) -> bool {
        self.sensed -= 1;
        let is_decoded = self.decoding.is_some_and(|(decoding, _)| decoding == frame);
        if is_decoded {
            self.decoding = None;
        }
        is_decoded
    }

    /// The radio starts to send, which ends decoding.
    pub(super) const fn abort(&mut self) {
        self.decoding = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FIRST: FrameId = FrameId(0);
    const SECOND: FrameId = FrameId(1);

    fn at(micros: u64) -> Timestamp {
        Timestamp::from_nanos(micros * 1_000)
    }

    #[test]
    fn first_of_two_overlapping_frames_is_decoded() {
        let mut reception = Reception::new();
        reception.frame_starts(at(0), FIRST, false);
        reception.frame_starts(at(4), SECOND, false);
        assert!(reception.frame_ends(FIRST));
        assert!(!reception.frame_ends(SECOND));
        assert!(reception.is_quiet());
    }

    #[test]
    fn simultaneous_frames_collide() {
        let mut reception = Reception::new();
        reception.frame_starts(at(0), FIRST, false);
        reception.frame_starts(at(3), SECOND, false);
        assert!(!reception.frame_ends(FIRST));
        assert!(!reception.frame_ends(SECOND));
    }

    #[test]
    fn sending_radio_does_not_receive() {
        let mut reception = Reception::new();
        reception.frame_starts(at(0), FIRST, true);
        assert!(!reception.frame_ends(FIRST));
        reception.frame_starts(at(200), SECOND, false);
        reception.abort();
        assert!(!reception.frame_ends(SECOND));
    }
}
