use std::time::Duration;

use super::*;
use crate::machine::{Machine, Output, Stimulus};
use crate::time::Timestamp;

/// A link whose deadline never changes.
struct Stuck(Timestamp);

impl Machine for Stuck {
    type Input = msp::Input;
    type Transmit = msp::Transmit;
    type Event = msp::Event;

    fn handle_input(&mut self, _: Timestamp, _: msp::Input) {}

    fn handle_timeout(&mut self, _: Timestamp) {}

    fn poll_output(&mut self) -> Output<msp::Transmit, msp::Event> {
        let deadline = Some(self.0);
        Output::Idle { deadline }
    }
}

#[test]
fn machine_is_overdue_if_its_deadline_is_due_after_a_timeout() {
    let deadline = Timestamp::from_secs_f64(2.0);
    let is_overdue = |now, stimulus| {
        let (mut machine, mut output) = (
            NodeMachine::Msp(Box::new(Stuck(deadline))),
            StepOutput::default(),
        );
        machine.step(now, stimulus, &mut output);
        output.is_overdue
    };
    let input = || Stimulus::Input(Envelope::Msp(Box::new(msp::Input::GiveUp)));
    let later = deadline + Duration::from_secs(1);
    assert!(is_overdue(deadline, Stimulus::Timeout) && is_overdue(later, Stimulus::Timeout));
    assert!(!is_overdue(Timestamp::ZERO, Stimulus::Timeout));
    assert!(
        !is_overdue(later, input()),
        "an input may cause a timeout at once"
    );
}
