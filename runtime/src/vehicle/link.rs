use std::collections::VecDeque;

use muster_machines::machine::{Machine, Output};
use muster_machines::msp::{Checkpoint, Event, FlightCommand, Input, Transmit};
use muster_machines::time::Timestamp;

/// Replaces the link to a flight controller for simulated vehicles.
#[derive(Debug)]
pub struct SimulatedLink {
    durable: Checkpoint,
    outbox: VecDeque<Output<Transmit, Event>>,
}

impl SimulatedLink {
    /// A link restored from `checkpoint`; a new one for `None`.
    #[must_use]
    pub fn new(checkpoint: Option<Checkpoint>) -> Self {
        let mut link = Self {
            durable: checkpoint.unwrap_or_default(),
            outbox: VecDeque::new(),
        };
        if checkpoint.is_some() {
            link.transmit(Transmit::Resync);
        }
        // So that the next link finds a checkpoint from the start.
        link.checkpoint();
        link
    }

    fn transmit(&mut self, transmit: Transmit) {
        self.outbox.push_back(Output::Transmit(transmit));
    }

    fn checkpoint(&mut self) {
        let event = Event::Checkpoint(self.durable);
        self.outbox.push_back(Output::Event(event));
    }
}

impl Machine for SimulatedLink {
    type Input = Input;
    type Transmit = Transmit;
    type Event = Event;

    fn handle_input(&mut self, _now: Timestamp, input: Input) {
        match input {
            Input::FlightCommand(FlightCommand::Report) => {
                self.transmit(Transmit::Command(FlightCommand::Report));
            }
            Input::FlightCommand(_) if self.durable.gave_up => {}
            Input::FlightCommand(command) => self.transmit(Transmit::Command(command)),
            Input::Telemetry(telemetry) => self.transmit(Transmit::Telemetry(telemetry)),
            // It has no port.
            Input::Port(_) => {}
            Input::GiveUp => {
                self.durable.gave_up = true;
                self.checkpoint();
                self.transmit(Transmit::Command(FlightCommand::Land));
            }
        }
    }

    fn handle_timeout(&mut self, _now: Timestamp) {}

    fn poll_output(&mut self) -> Output<Transmit, Event> {
        self.outbox
            .pop_front()
            .unwrap_or(Output::Idle { deadline: None })
    }
}
