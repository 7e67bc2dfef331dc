//! The indoor machine of a drone that has a map.

use super::{Event, Transmit};
use crate::indoor::{self, Indoor};
use crate::machine::{Emitted, Outbox, Stimulus, step};
use crate::time::Timestamp;

#[derive(Debug)]
pub(super) struct Host {
    machine: Box<dyn Indoor>,
    deadline: Option<Timestamp>,
}

impl Host {
    /// A host of `machine`, which must be stepped before its deadline is known.
    pub(super) fn new(machine: Box<dyn Indoor>) -> Self {
        Self {
            machine,
            deadline: None,
        }
    }

    /// Steps the machine and passes on what it yields.
    pub(super) fn step(
        &mut self,
        now: Timestamp,
        stimulus: Stimulus<indoor::Input>,
        outbox: &mut Outbox<Transmit, Event>,
    ) {
        self.deadline = step(self.machine.as_mut(), now, stimulus, |emitted| {
            outbox.event(match emitted {
                Emitted::Transmit(indoor::Transmit::Velocity(velocity)) => {
                    Event::Velocity(velocity)
                }
                Emitted::Event(event) => Event::Indoor(event),
            });
        });
    }

    pub(super) const fn deadline(&self) -> Option<Timestamp> {
        self.deadline
    }
}
