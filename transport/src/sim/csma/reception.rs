use muster_machines::time::Timestamp;

use super::FrameId;
use super::timing::DETECTION;

/// What one radio hears of the frames that are in the air around it.
///
/// It makes out a frame that begins while it hears no other and does not send itself. Another one that begins while
/// it still looks for the preamble spoils both; later ones are missed and leave the first unharmed. So a hidden
/// terminal spoils frames through one airtime and not through two, as in ns-3 at equal powers, where a delivery of
/// exp(−h·R·196 µs) was measured. **Invariant:** at most one frame is being made out, and it is in the air.
#[derive(Debug)]
pub(super) struct Reception {
    audible: u32,
    made_out: Option<(FrameId, Timestamp)>,
}

impl Reception {
    pub(super) const fn new() -> Self {
        Self {
            audible: 0,
            made_out: None,
        }
    }

    /// Whether any frame is in the air here.
    pub(super) const fn is_quiet(&self) -> bool {
        self.audible == 0
    }

    pub(super) fn begins(&mut self, now: Timestamp, frame: FrameId, is_sending: bool) {
        match self.made_out {
            Some((_, since)) if now.since(since) < DETECTION => self.made_out = None,
            None if self.audible == 0 && !is_sending => self.made_out = Some((frame, now)),
            _ => {}
        }
        self.audible += 1;
    }

    /// Whether the frame that ends was made out to its end.
    pub(super) fn ends(&mut self, frame: FrameId) -> bool {
        self.audible -= 1;
        let is_it = self.made_out.is_some_and(|(made_out, _)| made_out == frame);
        if is_it {
            self.made_out = None;
        }
        is_it
    }

    /// The radio begins to send: whatever it was hearing is lost on it.
    pub(super) const fn give_up(&mut self) {
        self.made_out = None;
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
    fn the_first_of_two_that_overlap_is_made_out() {
        let mut reception = Reception::new();
        reception.begins(at(0), FIRST, false);
        reception.begins(at(4), SECOND, false);
        assert!(reception.ends(FIRST));
        assert!(!reception.ends(SECOND));
        assert!(reception.is_quiet());
    }

    #[test]
    fn two_that_begin_together_spoil_each_other() {
        let mut reception = Reception::new();
        reception.begins(at(0), FIRST, false);
        reception.begins(at(3), SECOND, false);
        assert!(!reception.ends(FIRST));
        assert!(!reception.ends(SECOND));
    }

    #[test]
    fn a_radio_that_sends_does_not_hear() {
        let mut reception = Reception::new();
        reception.begins(at(0), FIRST, true);
        assert!(!reception.ends(FIRST));
        reception.begins(at(200), SECOND, false);
        reception.give_up();
        assert!(!reception.ends(SECOND));
    }
}
