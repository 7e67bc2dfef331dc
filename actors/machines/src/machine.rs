//! The interface of all state machines.

use std::collections::VecDeque;

use crate::time::Timestamp;

/// A state machine without socket, clock or task; its only random source is seeded by its creator.
///
/// Drivers call [`step`] and nothing else.
pub trait Machine {
    /// Inputs.
    type Input;
    /// Outputs to other machines, or out of the drone.
    type Transmit;
    /// Observable outputs: telemetry, and the checkpoints from which a machine is rebuilt.
    type Event;

    /// Handles one input at `now`. A peer's fault is an event.
    fn handle_input(&mut self, now: Timestamp, input: Self::Input);

    /// Fires every deadline `<= now`. The next deadline is then after `now`. Early or repeated calls do nothing.
    fn handle_timeout(&mut self, now: Timestamp);

    /// The next output. Call until [`Output::Idle`] before handling the next input.
    fn poll_output(&mut self) -> Output<Self::Transmit, Self::Event>;
}

/// What a [`Machine`] wants done.
#[derive(Debug, Clone, PartialEq)]
#[must_use]
pub enum Output<T, E> {
    /// Send this.
    Transmit(T),
    /// Publish this.
    Event(E),
    /// Nothing is left; call [`Machine::handle_timeout`] at the deadline.
    Idle {
        /// The next deadline; `None` if there is none.
        deadline: Option<Timestamp>,
    },
}

/// Why a machine is stepped.
#[derive(Debug, Clone, PartialEq)]
pub enum Stimulus<I> {
    /// It has an input.
    Input(I),
    /// Its deadline has come, or it was just built and may have outputs.
    Timeout,
}

/// Handles one stimulus, passes all outputs to `sink` and returns the next deadline.
pub fn step<M: Machine + ?Sized>(
    machine: &mut M,
    now: Timestamp,
    stimulus: Stimulus<M::Input>,
    mut sink: impl FnMut(Emitted<M>),
) -> Option<Timestamp> {
    match stimulus {
        Stimulus::Input(input) => machine.handle_input(now, input),
        Stimulus::Timeout => machine.handle_timeout(now),
    }
    loop {
        match machine.poll_output() {
            Output::Transmit(transmit) => sink(Emitted::Transmit(transmit)),
            Output::Event(event) => sink(Emitted::Event(event)),
            Output::Idle { deadline } => return deadline,
        }
    }
}

/// One output of a [`step`].
#[derive(Debug)]
pub enum Emitted<M: Machine + ?Sized> {
    /// As [`Output::Transmit`].
    Transmit(M::Transmit),
    /// As [`Output::Event`].
    Event(M::Event),
}

/// Queue of outputs. Most steps have at most one, which is stored inline. Memory for more is freed once they are
/// polled.
#[derive(Debug, Clone)]
pub(crate) struct Outbox<T, E> {
    first: Option<Output<T, E>>,
    /// Empty while `first` is `None`.
    others: VecDeque<Output<T, E>>,
}

impl<T, E> Outbox<T, E> {
    pub(crate) const fn new() -> Self {
        Self {
            first: None,
            others: VecDeque::new(),
        }
    }

    #[inline]
    pub(crate) fn transmit(&mut self, transmit: T) {
        self.push(Output::Transmit(transmit));
    }

    #[inline]
    pub(crate) fn event(&mut self, event: E) {
        self.push(Output::Event(event));
    }

    /// Puts an event before all other outputs. Once a step: a second event would come before the first.
    pub(crate) fn event_first(&mut self, event: E) {
        if let Some(first) = self.first.replace(Output::Event(event)) {
            self.others.push_front(first);
        }
    }

    /// Whether no output waits.
    pub(crate) const fn is_empty(&self) -> bool {
        self.first.is_none()
    }

    #[inline]
    fn push(&mut self, output: Output<T, E>) {
        if self.first.is_none() {
            self.first = Some(output);
        } else {
            self.others.push_back(output);
        }
    }

    #[inline]
    pub(crate) fn poll(&mut self, deadline: Option<Timestamp>) -> Output<T, E> {
        let Some(output) = self.first.take() else {
            return Output::Idle { deadline };
        };
        if !self.others.is_empty() {
            self.first = self.others.pop_front();
            if self.others.is_empty() {
                self.others = VecDeque::new();
            }
        }
        output
    }
}
