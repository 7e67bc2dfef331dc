//! The shape of every decision a drone takes.

use std::collections::VecDeque;

use crate::time::Timestamp;

/// A state machine that owns no socket, no clock, no task and no random source but its own seeded one.
///
/// Whatever drives it calls [`step`] and nothing else.
pub trait Machine {
    /// What it can be told.
    type Input;
    /// What it sends: to the machines beside it, or out of the drone.
    type Transmit;
    /// What can be seen of it from outside: telemetry, and the checkpoints it is rebuilt from.
    type Event;
    /// Our own fault in an input; a peer's fault is counted as an event instead.
    type Rejection: std::error::Error;

    /// Takes one input at `now`.
    ///
    /// # Errors
    /// When the input breaks one of our own invariants; the state is then unchanged.
    fn handle_input(&mut self, now: Timestamp, input: Self::Input) -> Result<(), Self::Rejection>;

    /// Fires every deadline `<= now`, after which the next deadline lies after `now`; early or repeated calls do nothing.
    fn handle_timeout(&mut self, now: Timestamp);

    /// What is to be done next; to be called until [`Output::Idle`] before anything else is handled.
    fn poll_output(&mut self) -> Output<Self::Transmit, Self::Event>;
}

/// What a [`Machine`] wants done.
#[derive(Debug, Clone, PartialEq)]
#[must_use]
pub enum Output<T, E> {
    /// Send this.
    Transmit(T),
    /// Let this be seen.
    Event(E),
    /// Nothing now; call [`Machine::handle_timeout`] at the deadline.
    Idle {
        /// When the machine next wants to act by itself.
        deadline: Option<Timestamp>,
    },
}

/// Why a machine is stepped.
#[derive(Debug, Clone, PartialEq)]
pub enum Stimulus<I> {
    /// It was told something.
    Input(I),
    /// Its deadline has come, or it has just been built and may have something to say.
    Timeout,
}

/// Changes the machine once, drains what it has to say into `sink` and returns its next deadline.
///
/// # Errors
/// As [`Machine::handle_input`]; nothing has reached the sink then.
pub fn step<M: Machine + ?Sized>(
    machine: &mut M,
    now: Timestamp,
    stimulus: Stimulus<M::Input>,
    mut sink: impl FnMut(Emitted<M>),
) -> Result<Option<Timestamp>, M::Rejection> {
    match stimulus {
        Stimulus::Input(input) => machine.handle_input(now, input)?,
        Stimulus::Timeout => machine.handle_timeout(now),
    }
    loop {
        match machine.poll_output() {
            Output::Transmit(transmit) => sink(Emitted::Transmit(transmit)),
            Output::Event(event) => sink(Emitted::Event(event)),
            Output::Idle { deadline } => return Ok(deadline),
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

/// The outputs of a machine that wait to be polled. Most steps have one at most, which is kept within the machine; the memory
/// that more take is given back, for the next machine to use while it is at hand.
#[derive(Debug, Clone)]
pub(crate) struct Outbox<T, E> {
    first: Option<Output<T, E>>,
    /// Nothing as long as there is no first.
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

    /// Puts an event ahead of everything that waits.
    pub(crate) fn event_first(&mut self, event: E) {
        if let Some(first) = self.first.replace(Output::Event(event)) {
            self.others.push_front(first);
        }
    }

    /// Whether nothing waits.
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
